//! Additions of a run's trace to its record: realised noise, and the effects of each action.
//!
//! Noise is drawn by chance, whatever the robot does, so it belongs to the conditions of a run. An
//! effect is a consequence of the robot's behaviour: it can explain how an action failed, but not
//! when.
//!
//! Never: judges, reads a file, or uses the motion of bodies between snapshots.

mod action;
mod base;
mod contacts;
mod noise;
mod perceived;
mod surroundings;
mod table_run;

pub use action::ActionEffects;
pub(crate) use action::target_of;
pub use contacts::{FirstContact, LargestForce};
pub use noise::RealisedNoise;
pub use perceived::{PerceptionError, concerns_target, perceived_sentences};
pub use surroundings::Surrounding;
pub use table_run::TableRun;
