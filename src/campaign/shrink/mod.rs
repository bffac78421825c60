//! Shrinks a failing run and explains which of its choices matter.
//!
//! Three layers: `list` edits lists of named choices; `search`, `reduce` and `explain` work on
//! choices and a test function, independent of robots; `counterexample` supplies the test function,
//! which makes a run, and the meaning of the choices: placement, physics, noise.
//!
//! Never: accepts a run that fails in another way, or depends on the number of workers.

mod counterexample;
mod explain;
mod list;
mod reduce;
mod search;

pub(super) use counterexample::SHRUNK;
pub use counterexample::{Repeat, ShrinkOptions, Shrunk, shrink, store};
pub use explain::{Explained, Influence, Neighbour, Passing, explain};
pub(crate) use list::drop_rejected_tries;
pub use list::{Id, ids};
pub use reduce::{ShrinkPlan, reduce};
pub use search::{TrialLimits, TrialSearch, Tried, TryResult};
