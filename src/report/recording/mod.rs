//! Exports runs as recordings for the rerun viewer (`.rrd`): all bodies in 3D over simulated time,
//! events and outcomes.
//!
//! A file has one recording for each run, named after the run. Ids within a recording are
//! sequential and its only timeline is simulated time, so the same runs give the same bytes.
//!
//! Never: reads a history, writes a file, chooses a run, reads a clock, or generates random ids.

mod events;
mod footer;
mod mesh;
mod motion;
mod outcomes;
mod recordings;
mod solids;
mod stream;

pub use recordings::Recordings;
pub use stream::RecordingFault;
