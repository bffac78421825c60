//! Resolves the joints and links with a role in the URDF.

use std::collections::BTreeSet;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::description::RobotModel;
use crate::gripper::{Probe, links_of_fingers};
use crate::kinematics::Mount;
use crate::wrist;
use crate::{Gripper, GripperFault, Robot, RobotError};
use actcheck_data::{LinkFrame, RobotProfile, RobotRoles};

/// Indices of the robot's joints by their role.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    /// Base: x, y, heading; `None` if it is fixed.
    pub base: Option<[usize; 3]>,
    /// Arm, in the profile's order.
    pub arm: Vec<usize>,
    /// Head: pan, tilt.
    pub head: Vec<usize>,
    /// Joints of the fingers.
    pub gripper: Gripper,
}

/// Tolerance of `max_opening_m`, which is often rounded. Unit: metres.
const OPENING_SLACK_M: f64 = 2e-3;

/// The joints and links with a role, resolved in the URDF.
#[derive(Debug, Clone)]
pub struct Named {
    /// The joints by role.
    pub layout: Layout,
    /// The fingertips, left and right.
    pub finger_links: [usize; 2],
    /// All links of each finger, left and right, with the fingertips.
    pub fingers: [Vec<usize>; 2],
    /// The grasp frame: its merged link, and the pose in that link's frame.
    pub grasp: (usize, Isometry3<f64>),
    /// The place of the camera.
    pub camera: Mount,
}

impl Named {
    /// Finds the joints and links that have these roles.
    ///
    /// # Errors
    /// [`RobotError`] for the first missing or unsupported one.
    pub fn find(roles: RobotRoles<'_>, model: &RobotModel) -> Result<Self, RobotError> {
        let RobotRoles {
            core,
            arm_joints,
            hand,
            camera,
        } = roles;
        let joints = |names: &[String]| {
            names
                .iter()
                .map(|name| model.joint(name))
                .collect::<Result<Vec<_>, _>>()
        };
        let base = match &core.base_joints {
            Some([x, y, heading]) => {
                Some([model.joint(x)?, model.joint(y)?, model.joint(heading)?])
            }
            None => None,
        };
        let [left_link, right_link] = &hand.finger_links;
        let grasp = frame(model, &hand.grasp)?;
        let camera = mounted(model, camera)?;
        let finger_links = [model.frame(left_link)?.0, model.frame(right_link)?.0];
        let layout = Layout {
            base,
            arm: joints(arm_joints)?,
            head: joints(&core.head_joints)?,
            gripper: Gripper::of(hand, model, finger_links, grasp)?,
        };
        let probe = Probe::new(model, finger_links, grasp);
        let fingers = links_of_fingers(model, &layout.gripper, &probe);
        Ok(Self {
            layout,
            finger_links,
            fingers,
            grasp,
            camera,
        })
    }

    /// Returns the pairs of links that pass through each other, with the smaller index first: those
    /// of the hand, but not the two fingertips, and those of a wrist, because their convex shapes
    /// overlap where the real ones do not; and those that the file names.
    pub fn passing(&self, model: &RobotModel) -> BTreeSet<(usize, usize)> {
        let all = self.links_of_hand(model);
        let [left, right] = self.finger_links;
        let pairs = all
            .iter()
            .flat_map(|first| all.range(first + 1..).map(|second| (*first, *second)));
        let of_gripper = pairs.filter(|pair| *pair != (left.min(right), left.max(right)));
        of_gripper
            .chain(wrist::passing(model))
            .chain(model.passing.iter().copied())
            .collect()
    }

    /// Returns the links of the gripper's mechanism, those that carry them, and the hand's other
    /// fingers.
    pub(crate) fn links_of_hand(&self, model: &RobotModel) -> BTreeSet<usize> {
        let gripper = &self.layout.gripper;
        let palms: BTreeSet<usize> = gripper
            .joints()
            .map(|joint| model.joints[joint].parent)
            .collect();
        let moved_by = |begins: &dyn Fn(usize) -> bool| {
            let mut moved = vec![false; model.links.len()];
            for (idx, joint) in model.joints.iter().enumerate() {
                moved[idx + 1] = begins(idx) || moved[joint.parent];
            }
            moved
        };
        // A link that carries an arm or the head too, such as a torso with the fingers of two arms,
        // is not a hand.
        let is_elsewhere =
            |idx: &usize| self.layout.arm.contains(idx) || self.layout.head.contains(idx);
        let is_hand = |palm: usize| {
            let below = moved_by(&|idx| model.joints[idx].parent == palm);
            palm > 0 && !(0..model.joints.len()).any(|idx| below[idx + 1] && is_elsewhere(&idx))
        };
        let hands: BTreeSet<usize> = palms
            .iter()
            .copied()
            .filter(|palm| is_hand(*palm))
            .collect();
        let moved =
            moved_by(&|idx| gripper.contains(idx) || hands.contains(&model.joints[idx].parent));
        let moved = (0..model.links.len()).filter(|link| moved[*link]);
        moved.chain(palms).collect()
    }
}

/// A frame on a link: the merged link, and the pose in its frame.
pub(crate) fn frame(
    model: &RobotModel,
    frame: &LinkFrame,
) -> Result<(usize, Isometry3<f64>), RobotError> {
    let (link, at) = model.frame(&frame.link)?;
    Ok((link, at * moved(frame)))
}

/// The place of a camera: on a link, or fixed in the world.
fn mounted(model: &RobotModel, camera: &LinkFrame) -> Result<Mount, RobotError> {
    match frame(model, camera) {
        Ok((link, pose)) => Ok(Mount::Link(link, pose)),
        // A link of this name takes precedence: it is where the URDF says.
        Err(_) if camera.link == RobotProfile::MAP => Ok(Mount::World(moved(camera))),
        Err(error) => Err(error),
    }
}

pub(crate) fn moved(frame: &LinkFrame) -> Isometry3<f64> {
    let [roll, pitch, yaw] = frame.turned_rad;
    Translation3::from(Vector3::from(frame.offset_m))
        * UnitQuaternion::from_euler_angles(roll, pitch, yaw)
}

impl Robot {
    /// Checks that the fingers open as wide as the profile states.
    ///
    /// # Errors
    /// [`GripperFault::TooNarrow`] if they don't.
    pub fn check(&self) -> Result<(), RobotError> {
        let (profile, widest_m) = (&self.profile, self.named.layout.gripper.widest_m());
        if profile.hand.max_opening_m > widest_m + OPENING_SLACK_M {
            let name = profile.core.urdf.name.to_string();
            let fault = GripperFault::TooNarrow {
                stated_m: profile.hand.max_opening_m,
                widest_m,
            };
            return Err(RobotError::Gripper { name, fault });
        }
        Ok(())
    }
}
