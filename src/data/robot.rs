//! Robots: the URDF and the roles of its joints and links.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::{Mesh, ModelTree, Part, Pose, Shape};
use actcheck_base::Source;

/// Mass of links without a mass in the URDF, such as the stages of a base, and of lighter ones.
/// Unit: kilograms. Small compared to any real link, large enough for 32-bit arithmetic.
pub const LEAST_LINK_KG: f64 = 0.01;

/// A robot without the roles of its arm, hand and camera: its links and joints, and its place.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotCore {
    /// Display name.
    pub name: String,
    /// The robot in URDF, as skills receive it: the text of its file, or its tree in this form.
    pub urdf: Source,
    /// Its links and joints, as its file states them. The simulation reads nothing else of it.
    pub tree: Arc<ModelTree>,
    /// Joints of an omnidirectional base in the order x, y, heading; `None` if the base is fixed.
    pub base_joints: Option<[String; 3]>,
    /// Whether those joints are added below the URDF's root instead of being part of it:
    /// `base = "planar"`.
    pub planar_base: bool,
    /// Height of the root above the floor or the surface that the robot is mounted on: of a mount,
    /// which is not simulated, or wheels. Unit: metres.
    pub mount_height_m: f64,
    /// Rotation of the root of a fixed robot about the vertical, if its arm does not work along the
    /// root's x axis. Unit: radians.
    pub mount_turned_rad: f64,
    /// Whether it is mounted on the surface that holds the objects, beside its edge, instead of on
    /// the floor.
    pub on_surface: bool,
    /// Distances from the root, nearest and farthest, at which a fixed arm takes objects: targets
    /// are placed between them. `None`: anywhere on the half of the surface towards the robot.
    /// Unit: metres.
    pub reach_m: Option<[f64; 2]>,
    /// Head joints, pan then tilt; empty if the head does not move.
    pub head_joints: Vec<String>,
    /// Joints without another role that programs may move. All joints without a role are rigid.
    pub other_joints: Vec<String>,
    /// Positions of rigid joints, such as those of a second arm; all others are at 0 or at the
    /// limit nearest to it. Units: metres or radians.
    pub parked: Vec<(String, f64)>,
    /// Links whose collision shapes are left out, such as markers between the fingers.
    pub no_collision_links: Vec<String>,
    /// Collision meshes by the file name in the URDF, in the file's own scale.
    pub meshes: BTreeMap<String, Vec<Shape>>,
    /// The same meshes before they were divided into convex pieces, which fill hollows; empty if
    /// they were not divided.
    pub surfaces: BTreeMap<String, Vec<Arc<Mesh>>>,
    /// Digest of profile, URDF and meshes.
    pub digest: String,
}

impl RobotCore {
    /// Joints of a planar base that is added below the URDF's root: x, y, heading.
    pub const PLANAR_JOINTS: [&'static str; 3] =
        ["planar_x_joint", "planar_y_joint", "planar_heading_joint"];
}

/// A robot with all of its roles: those of its profile, and those that were found on its model
/// because the profile leaves them out (see [`StatedRobot`](crate::StatedRobot)).
#[derive(Debug, Clone, PartialEq)]
pub struct RobotProfile {
    /// Its links and joints, and its place.
    pub core: RobotCore,
    /// Joints that position the hand (lift and arm), from the base outwards.
    pub arm_joints: Vec<String>,
    /// Its gripper.
    pub hand: Hand,
    /// The depth camera, whose x axis points forwards and whose z axis up in the image. Its link is
    /// [`RobotProfile::MAP`] if the camera is fixed beside the robot: its frame is in the world's
    /// then.
    pub camera: LinkFrame,
    /// Arm posture for driving, in the order of `arm_joints`. Units: metres or radians.
    pub home: Vec<f64>,
    /// Seeds of inverse kinematics: arm postures in the order of `arm_joints`.
    pub postures: Vec<Vec<f64>>,
}

impl RobotProfile {
    /// The link of a camera that is fixed beside the robot: its pose is in the frame of the map,
    /// whose z axis points up from the floor.
    pub const MAP: &'static str = "map";

    /// Returns the roles of its joints and links.
    pub fn roles(&self) -> RobotRoles<'_> {
        RobotRoles {
            core: &self.core,
            arm_joints: &self.arm_joints,
            hand: &self.hand,
            camera: &self.camera,
        }
    }
}

/// A robot with the roles of its joints and links, which decide about its model; its postures may
/// still be unknown.
#[derive(Debug, Clone, Copy)]
pub struct RobotRoles<'a> {
    /// Its links and joints, and its place.
    pub core: &'a RobotCore,
    /// See [`RobotProfile::arm_joints`].
    pub arm_joints: &'a [String],
    /// Its gripper.
    pub hand: &'a Hand,
    /// See [`RobotProfile::camera`].
    pub camera: &'a LinkFrame,
}

/// A frame on a link of the URDF.
#[derive(Debug, Clone, PartialEq)]
pub struct LinkFrame {
    /// The link.
    pub link: String,
    /// Origin of the frame in the link's frame, if it differs from the link's. Unit: metres.
    pub offset_m: [f64; 3],
    /// Rotation of the frame relative to the link, if the link's axes differ: about its fixed x, y
    /// and z axes, in this order. Unit: radians.
    pub turned_rad: [f64; 3],
}

/// A gripper: its fingers, or its suction cup.
#[derive(Debug, Clone, PartialEq)]
pub struct Hand {
    /// The frame between the fingertips: its x axis points along the fingers, its y axis across
    /// them.
    pub grasp: LinkFrame,
    /// Joints with motors that move the fingers: left then right, or one for both or for the only
    /// finger that moves. Further ones close further fingers with these. Joints that mimic them
    /// follow.
    pub finger_joints: Vec<String>,
    /// Links of the fingertips, left then right; one of them may be fixed.
    pub finger_links: [String; 2],
    /// Widest gap between the fingers. Unit: metres.
    pub max_opening_m: f64,
    /// Friction coefficient of the fingertips.
    pub finger_friction: f64,
    /// Closing force of one finger; of a suction cup, its greatest pull. Unit: newtons.
    pub grip_force_n: f64,
    /// The suction cup of a gripper without fingers: both `finger_links` are then the link of the
    /// grasp frame, which is at the cup's lip with its x axis along the axis of the cup;
    /// `max_opening_m` is the cup's diameter.
    pub suction: Option<Suction>,
}

impl Hand {
    /// Returns a suction cup with its lip at this frame.
    pub fn of_cup(grasp: LinkFrame, cup: Suction) -> Self {
        Self {
            finger_joints: Vec::new(),
            finger_links: [grasp.link.clone(), grasp.link.clone()],
            max_opening_m: 2.0 * cup.radius_m,
            finger_friction: cup.friction,
            grip_force_n: cup.force_n,
            suction: Some(cup),
            grasp,
        }
    }
}

/// A suction cup, which holds a surface by a seal.
///
/// The seal breaks if the pull along the cup's axis exceeds `force_n`, the shear force across it
/// `friction · force_n`, or the peel moment about the middle of the lip `force_n · radius_m`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Suction {
    /// Greatest pull along the cup's axis. Unit: newtons.
    pub force_n: f64,
    /// Radius of the lip. Unit: metres.
    pub radius_m: f64,
    /// Friction coefficient between the lip and a surface.
    pub friction: f64,
}

impl Suction {
    /// Returns the greatest shear force across the axis at a pull limit of `force_n`. Unit:
    /// newtons.
    pub fn most_shear_n(&self, force_n: f64) -> f64 {
        self.friction * force_n
    }

    /// Returns the greatest peel moment at a pull limit of `force_n`. Unit: newton metres.
    pub fn most_peel_nm(&self, force_n: f64) -> f64 {
        force_n * self.radius_m
    }
}

/// A robot in one posture, for a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotView {
    /// Name of the posture.
    pub title: String,
    /// The robot's collision shapes. Frame: world, with the robot's base at the origin.
    pub solids: Vec<Part>,
    /// Named frames of the profile. Frame: as the shapes.
    pub frames: Vec<(String, Pose)>,
}
