//! A robot as its profile and its file describe it, compiled once for many simulations.

use std::collections::BTreeSet;
use std::sync::Arc;

use crate::counterweight::BalancedJoint;
use crate::description::RobotModel;
use crate::layout::Named;
use crate::{RobotError, gripper};
use actcheck_data::RobotProfile;

/// The links and joints of a robot, with their roles. A campaign compiles its robot once and hands
/// it to each simulation.
#[derive(Debug, Clone)]
pub struct Robot {
    /// Its profile.
    pub profile: Arc<RobotProfile>,
    /// Its links and joints.
    pub model: Arc<RobotModel>,
    /// Those with a role.
    pub named: Named,
    /// The pairs of links that pass through each other.
    pub(crate) passing: BTreeSet<(usize, usize)>,
    /// The links of its hand.
    pub(crate) hand: BTreeSet<usize>,
}

impl Robot {
    /// Compiles the robot of a profile.
    ///
    /// # Errors
    /// [`RobotError`] if profile and file don't match.
    pub fn compile(profile: &Arc<RobotProfile>) -> Result<Self, RobotError> {
        let model = RobotModel::read(profile.roles())?;
        let named = Named::find(profile.roles(), &model)?;
        let (passing, hand) = (named.passing(&model), named.links_of_hand(&model));
        Ok(Self {
            profile: Arc::clone(profile),
            model: Arc::new(model),
            named,
            passing,
            hand,
        })
    }

    /// Returns the largest force of each finger that the motors of the gripper can give. Unit:
    /// newtons.
    pub fn grip_limit_n(&self) -> f64 {
        let of =
            |(joint, effort_per_n): (usize, f64)| self.model.joints[joint].effort / effort_per_n;
        let motors = self.named.layout.gripper.motors();
        motors.map(of).fold(f64::INFINITY, f64::min)
    }

    /// Returns the force along the fingers of the gripper, relative to that across them, with which
    /// they push a round object of this diameter out of the hand: fingers that turn are a wedge
    /// around it. Negative if they push it towards the palm. Friction with a greater coefficient
    /// holds the object. Returns `None` if they can't be closed on it. Unit: metres.
    pub fn outward_push(&self, diameter_m: f64) -> Option<f64> {
        let named = &self.named;
        gripper::outward_push(
            &self.model,
            &named.layout.gripper,
            named.finger_links,
            named.grasp,
            diameter_m,
        )
    }

    /// Returns the links whose collision shapes are between the fingers: nothing can be grasped
    /// there.
    pub fn shapes_between_fingers(&self) -> Vec<String> {
        gripper::between_fingers(&self.model, self.named.finger_links, self.named.grasp)
    }

    /// The joints of the arm that can't hold its weight by their motors alone. They are simulated
    /// as balanced.
    pub fn balanced_joints(&self) -> &[BalancedJoint] {
        &self.model.balanced
    }

    /// The joints with a role whose largest effort is 0 in the file, and so unknown: they are
    /// simulated with [`UNKNOWN_EFFORT`](crate::UNKNOWN_EFFORT).
    pub fn assumed_efforts(&self) -> &[String] {
        &self.model.assumed
    }

    /// As [`Robot::assumed_efforts`], for joints whose largest speed is 0 and
    /// [`UNKNOWN_SPEEDS`](crate::UNKNOWN_SPEEDS).
    pub fn assumed_speeds(&self) -> &[String] {
        &self.model.assumed_speeds
    }
}
