//! Types shared by all stages: sources and diagnostics, terms, poses, recorded choices, random streams, shipped files.
//!
//! Never: reads a configuration, depends on actions, rules or robots, or prints.

mod choices;
mod diagnostic;
mod digest;
mod files;
mod geometry;
pub mod names;
mod shard;
mod source;
mod stream;
mod suggest;
mod term;
mod whole;

pub use choices::{Choice, ChoiceKind, Choices};
pub use diagnostic::{Diagnostic, Diagnostics, Severity};
pub use digest::{Digest, PROGRAM_DIGEST, digest_of};
pub use files::Files;
pub use geometry::Pose;
pub use shard::{NoShard, Shard};
pub use source::{Source, Span};
pub use stream::Stream;
pub use suggest::{did_you_mean, nearest};
pub use term::{Term, TermId, Terms};
pub use whole::write_whole;
