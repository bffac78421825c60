//! Driving to a place: an occupancy grid from the robot's map and its depth camera, a way over it, and the way driven.
//!
//! Never: knows where obstacles are other than by its own pictures, or where the base is other than by its own belief.

mod follow;
mod grid;
mod search;
mod sense;
mod shorten;
mod skill;
mod terrain;

pub(super) use skill::{drive_to, move_to};
