//! Episodes that another simulator or a robot recorded, as traces that the rules can judge.
//!
//! ```text
//! file → Episode ─┐
//!                 ├→ Cast → Trace
//! text → Mapping ─┘
//! ```
//!
//! Never: steps a simulation, runs a program, invents a quantity that was not recorded, or decides a
//! verdict. The facts that an episode lacks are listed in its trace.

mod cast;
mod cuts;
mod episode;
mod file;
mod forms;
mod lacks;
mod mapping;
mod messages;
mod meters;
mod patterns;
mod propose;
mod snapshot;
mod solids;
mod trace;

pub use cast::{Cast, Hand, Owner, Part, Thing};
pub use cuts::Span;
pub use episode::{
    Body, Contact, Episode, Joint, JointKind, Mark, Model, Outcome, Shape, Site, State,
};
pub use lacks::{Lacks, Quantity};
pub use mapping::{Action, Mapping, Moment};
pub use propose::propose;
pub use trace::{repeat, trace};
