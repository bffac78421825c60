//! Simulates a `Scene`: the only crate that uses the physics engine.
//!
//! A [`World`] has four parts: the [`Engine`] steps the bodies, the [`Drive`] is the robot's side,
//! [`Proximity`] decides which things the robot can touch in a tick, and the [`Recorder`] measures.
//!
//! Never: decides the robot's actions, judges success, or attaches an object to the hand by a
//! constraint, other than the seal of a suction cup, which breaks beyond its limits.

mod assemble;
mod attach;
mod bodies;
mod camera;
mod clearance;
mod contacts;
mod departure;
mod distances;
mod drive;
mod effective_mass;
mod engine;
mod error;
mod fault;
mod forms;
mod free_motion;
mod fresh;
mod furniture;
#[cfg(test)]
mod gripper_tests;
mod hollows;
mod idle_links;
mod link_pairs;
mod motion;
mod motor;
mod motor_law;
mod object;
mod observe;
mod odometry;
mod other_engine;
mod overlaps;
mod ownership;
mod patches;
mod perturbation;
mod physics;
mod picture;
mod playback;
mod proximity;
mod quality;
mod reach;
mod recorder;
mod robot;
mod robot_course;
mod samples;
mod sense;
mod settle;
mod shell;
mod simulation;
mod spans;
mod suction;
mod watch;

pub use camera::DepthImage;
pub use drive::{Command, Drive, Observation};
pub use engine::Engine;
pub use error::WorldError;
pub use fault::{Fault, Perturbation, Poison};
pub use fresh::narrow_phase;
pub use other_engine::{EngineContact, EngineState, MovedObject, OtherEngine};
pub use overlaps::Overlap;
pub use picture::{LazySkins, Skins, Stage, StagedObject};
pub use playback::{MotorGains, Playback, PlayedObject, PrincipalInertia, Setpoint, Surfaces};
pub use proximity::Proximity;
pub use reach::Shortcuts;
pub use recorder::{Contact, Course, Record, Recorder, Tracks};
pub use sense::Sighting;
pub use settle::Settling;
pub use simulation::{World, build, build_with, keep_playback, move_by};
pub use suction::would_seal;

pub use actcheck_geometry::{
    Cluster, DecompositionFault, RgbImage, Sphere, decompose, decomposition_key, has_volume, sheet,
    simplified, sphere_tree,
};
pub use actcheck_robot::{
    BalancedJoint, Completed, Dynamics, FingerJoint, GRAVITY, Gripper, GripperFault, Joint,
    JointKind, Kinematics, Layout, Mount, Proposal, Robot, RobotBody, RobotError, RobotMeasures,
    RobotModel, SelfContact, UNKNOWN_EFFORT, UNKNOWN_SPEEDS, UnknownHand, complete, geometry, ik,
    propose,
};

/// Version of the physics: the same scene and commands give the same bits only with the same
/// version. It rises with each change of these bits.
pub const PHYSICS_VERSION: u32 = 19;
