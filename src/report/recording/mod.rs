//! Runs as recordings for the viewer of rerun (`.rrd`): every body in 3D over simulated time, what happened when, and what came of it.
//!
//! One file has one recording for each run, named by it. Ids within a recording are counted and its only time is simulated time: the
//! same runs make the same bytes.
//!
//! Never: reads a history, writes a file, chooses a run, looks at a clock, or draws an id by chance.

mod course;
mod events;
mod footer;
mod hull;
mod look;
mod mesh;
mod outcomes;
mod recordings;
mod solids;
mod stream;

pub use recordings::Recordings;
pub use stream::RecordingFault;
