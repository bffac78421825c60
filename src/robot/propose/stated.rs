//! The parts of the gripper that a profile names, which the search for the others keeps.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Isometry3;

use super::body::chain;
use super::fingers::leader;
use crate::description::RobotModel;
use crate::layout::frame;
use crate::{GripperFault, RobotError};
use actcheck_data::StatedFingers;

/// Why no gripper was found.
pub(super) enum NoHand {
    /// No part of the model is one.
    Gripper(GripperFault),
    /// The profile names a part that the model does not have.
    Model(RobotError),
}

impl NoHand {
    /// The error about a robot's file.
    pub(super) fn named(self, name: &str) -> RobotError {
        match self {
            Self::Gripper(fault) => RobotError::Gripper {
                name: name.to_owned(),
                fault,
            },
            Self::Model(error) => error,
        }
    }
}

impl From<RobotError> for NoHand {
    fn from(error: RobotError) -> Self {
        Self::Model(error)
    }
}

/// The fingers that a profile names, resolved on the model.
pub(super) struct Stated {
    pub(super) links: Option<[usize; 2]>,
    pub(super) joints: Vec<usize>,
    /// The grasp frame, with its link.
    pub(super) grasp: Option<(usize, Isometry3<f64>)>,
}

impl Stated {
    pub(super) fn of(fingers: &StatedFingers, model: &RobotModel) -> Result<Self, RobotError> {
        let links = match &fingers.finger_links {
            Some([left, right]) => Some([model.frame(left)?.0, model.frame(right)?.0]),
            None => None,
        };
        let led_here = |joint: usize| {
            model
                .own_leaders
                .iter()
                .find(|(_, own)| **own == joint)
                .map_or(joint, |(new, _)| *new)
        };
        let named = fingers.finger_joints.iter().flatten();
        let joints = named
            .map(|name| model.joint(name).map(led_here))
            .collect::<Result<Vec<_>, _>>()?;
        let grasp = fingers.grasp.as_ref().map(|grasp| frame(model, grasp));
        let grasp = grasp.transpose()?;
        Ok(Self {
            links,
            joints,
            grasp,
        })
    }

    /// The gripper's joints by its palm, if the named parts decide about them.
    pub(super) fn groups(&self, model: &RobotModel) -> Option<BTreeMap<usize, BTreeSet<usize>>> {
        let links = match (self.links, self.joints.as_slice()) {
            (Some(links), _) => links.to_vec(),
            (None, []) => return None,
            (None, joints) => joints.iter().map(|joint| joint + 1).collect(),
        };
        let chains: Vec<Vec<usize>> = links.iter().map(|link| chain(model, *link)).collect();
        let common = (0..).take_while(|place| match &chains[..] {
            [one] => place + 1 < one.len(),
            chains => chains.iter().all(|chain| {
                chain
                    .get(*place)
                    .is_some_and(|joint| Some(joint) == chains[0].get(*place))
            }),
        });
        let mut n_common = common.count();
        let of_drives = self
            .joints
            .iter()
            .filter_map(|joint| chains[0].iter().position(|known| known == joint));
        n_common = of_drives.fold(n_common, usize::min);
        let palm = match self.grasp {
            Some((link, _)) => link,
            None => n_common
                .checked_sub(1)
                .map_or(0, |last| chains[0][last] + 1),
        };
        let inner = chain(model, palm);
        let followers =
            (0..model.joints.len()).filter(|joint| self.joints.contains(&leader(model, *joint)));
        let all = chains
            .iter()
            .flatten()
            .copied()
            .chain(followers)
            .filter(|joint| !inner.contains(joint));
        Some(BTreeMap::from([(palm, all.collect())]))
    }
}
