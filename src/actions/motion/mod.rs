//! Arm paths through the perceived surroundings: straight if that is free, otherwise by sampling
//! postures.
//!
//! Never: moves the robot, drives its base, or measures its own run time: effort is bounded by the
//! number of samples, so that the same choices give the same path.

mod connect;
mod samples;
mod space;
#[cfg(test)]
mod tests;

pub use connect::way;
pub use samples::Samples;
pub use space::{ArmClearance, ArmSpace, moved_links};
