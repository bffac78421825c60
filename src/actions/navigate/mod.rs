//! Driving to a goal: an occupancy grid from the robot's map and depth camera, a path over it, and
//! the controller that follows it.
//!
//! Never: knows obstacles other than from the map and its own pictures, or the base's pose other
//! than from its own belief.

mod follow;
mod grid;
mod search;
mod sense;
mod shorten;
mod skill;
mod terrain;

pub(super) use sense::Size;
pub(super) use skill::{drive_to, move_to};
