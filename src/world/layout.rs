//! Resolves the joints and links of a profile in the URDF.

use nalgebra::{Isometry3, UnitQuaternion};

use crate::WorldError;
use crate::description::RobotModel;
use actcheck_data::RobotProfile;

/// Indices of the robot's joints by their role.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Layout {
    /// Base: x, y, heading; `None` if it is fixed.
    pub base: Option<[usize; 3]>,
    /// Arm, in the profile's order.
    pub arm: Vec<usize>,
    /// Head: pan, tilt.
    pub head: Vec<usize>,
    /// Fingers: left, right.
    pub fingers: [usize; 2],
}

/// The profile's joints and links, resolved in the URDF.
pub(super) struct Named {
    pub(super) layout: Layout,
    pub(super) finger_links: [usize; 2],
    pub(super) grasp: (usize, Isometry3<f64>),
    pub(super) camera: (usize, Isometry3<f64>),
}

impl Named {
    pub(super) fn find(profile: &RobotProfile, model: &RobotModel) -> Result<Self, WorldError> {
        let joints = |names: &[String]| names.iter().map(|name| model.joint(name)).collect::<Result<Vec<_>, _>>();
        let base = match &profile.base_joints {
            Some([x, y, heading]) => Some([model.joint(x)?, model.joint(y)?, model.joint(heading)?]),
            None => None,
        };
        let [left, right] = &profile.finger_joints;
        let [left_link, right_link] = &profile.finger_links;
        let layout = Layout {
            base,
            arm: joints(&profile.arm_joints)?,
            head: joints(&profile.head_joints)?,
            fingers: [model.joint(left)?, model.joint(right)?],
        };
        let [roll, pitch, yaw] = profile.grasp_turned_rad;
        let (grasp_link, grasp_at) = model.frame(&profile.grasp_link)?;
        Ok(Self {
            layout,
            finger_links: [model.frame(left_link)?.0, model.frame(right_link)?.0],
            grasp: (grasp_link, grasp_at * UnitQuaternion::from_euler_angles(roll, pitch, yaw)),
            camera: model.frame(&profile.camera_link)?,
        })
    }
}

/// Checks that a profile matches its URDF, without simulating.
///
/// # Errors
/// [`WorldError`] for the first missing or unsupported element.
pub fn check_robot(profile: &RobotProfile) -> Result<(), WorldError> {
    let model = RobotModel::read(profile)?;
    Named::find(profile, &model).map(|_| ())
}
