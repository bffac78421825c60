//! Ways of the arm through what is seen: straight where that is free, otherwise by sampling postures.
//!
//! Never: moves the robot, drives its base, or asks how long it took: effort is bounded by the number of samples, so that the
//! same choices give the same way.

mod connect;
mod samples;
mod space;
#[cfg(test)]
mod tests;

pub use connect::way;
pub use samples::Samples;
pub use space::{ArmSpace, Room};
