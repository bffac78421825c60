//! Exports a run as a ROS 2 bag in the MCAP format: poses of all bodies, joints, shapes, contacts,
//! percepts and outcomes over simulated time.
//!
//! Types of messages are carried in the file, so that a reader needs no ROS. The same run gives the
//! same bytes.
//!
//! Never: reads a history, writes a file, reads a clock, or simulates.

mod cdr;
mod events;
mod markers;
mod motion;
mod recorder;
mod types;
mod written;

pub use recorder::BagFault;
pub use written::{BagInput, bag};
