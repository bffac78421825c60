//! A robot as its profile and its file describe it: tree, kinematics, gripper, dynamics, and the
//! proposal of a profile.
//!
//! Never: knows the physics engine, or the state of a simulation.

#![forbid(unsafe_code)]
#![warn(missing_docs, clippy::unwrap_used)]

mod appearance;
mod assumed;
mod body;
mod counterweight;
mod description;
mod error;
mod factor;
mod folding;
mod gripper;
pub mod ik;
mod inertia;
mod kinematics;
mod layout;
mod link_depth;
mod measures;
mod mechanism;
mod needed;
mod pieces;
mod propose;
mod robot;
mod self_contact;
mod start;
mod views;
mod wrist;

pub use assumed::{UNKNOWN_EFFORT, UNKNOWN_SPEEDS};
pub use body::RobotBody;
pub use counterweight::BalancedJoint;
pub use description::{Joint, JointKind, Link, RobotModel};
pub use error::{GripperFault, RobotError};
pub use factor::Factor;
pub use gripper::Gripper;
pub use inertia::{Dynamics, Inertias, Twist, inertias};
pub use kinematics::{GRAVITY, Kinematics, Mount, axis_in_world};
pub use layout::{Layout, Named};
pub use measures::RobotMeasures;
pub use propose::{Completed, FingerJoint, Notes, Proposal, UnknownHand, complete, propose};
pub use robot::Robot;
pub use self_contact::SelfContact;
pub use start::geometry;
