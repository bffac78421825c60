//! Simulates a `Scene`: the only crate that uses the physics engine.
//!
//! Never: decides the robot's actions, judges success, or attaches an object to the hand by a
//! constraint, other than the seal of a suction cup, which breaks beyond its limits.

mod assemble;
mod assumed;
mod attach;
mod body;
mod camera;
mod clearance;
mod contacts;
mod convert;
mod counterweight;
mod decompose;
mod departure;
mod description;
mod drive;
mod effective_mass;
mod engine;
mod error;
mod factor;
mod fault;
mod forms;
mod free_motion;
mod fresh;
mod furniture;
mod gripper;
mod hull;
mod idle_links;
pub mod ik;
mod inertia;
mod kinematics;
mod layout;
mod link_depth;
mod link_pairs;
mod measures;
mod mechanism;
mod motion;
mod motor;
mod needed;
mod neighbours;
mod object;
mod observe;
mod odometry;
mod overlaps;
mod ownership;
mod patches;
mod perturbation;
mod pieces;
mod propose;
mod proximity;
mod quality;
mod rays;
mod reach;
mod recorder;
mod resolved;
mod robot;
mod robot_course;
mod samples;
mod self_contact;
mod sense;
mod separation;
mod settle;
mod shell;
mod silhouette;
mod simulation;
mod solid_depth;
mod spans;
mod sphere_tree;
mod suction;
mod surface;
mod views;
mod wrist;

pub use body::RobotBody;
pub use camera::DepthImage;
pub use counterweight::BalancedJoint;
pub use decompose::{DecompositionFault, decompose, decomposition_key, sheet, simplified};
pub use description::{Joint, JointKind};
pub use error::{GripperFault, WorldError};
pub use fault::{Fault, Perturbation, Poison};
pub use fresh::narrow_phase;
pub use gripper::Gripper;
pub use inertia::Dynamics;
pub use kinematics::{GRAVITY, Kinematics};
pub use layout::{
    Layout, assumed_efforts, assumed_speeds, balanced_joints, check_robot, grip_limit_n,
    outward_push, shapes_between_fingers,
};
pub use measures::{RobotMeasures, robot_measures};
pub use overlaps::Overlap;
pub use propose::{FingerJoint, Proposal, UnknownHand, complete, is_incomplete, propose};
pub use reach::Shortcuts;
pub use recorder::{Contact, Course, Record, Tracks};
pub use robot::geometry;
pub use self_contact::SelfContact;
pub use sense::Sighting;
pub use settle::Settling;
pub use simulation::{Command, Observation, World, build};
pub use sphere_tree::{Cluster, Sphere, sphere_tree};
pub use suction::would_seal;
pub use views::robot_views;

/// Version of the physics: the same scene and commands give the same bits only with the same
/// version. It rises with each change of these bits.
pub const PHYSICS_VERSION: u32 = 19;
