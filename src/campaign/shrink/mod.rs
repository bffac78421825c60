//! Makes a failing run small, and says what of it matters.
//!
//! Three layers: `list` edits lists of named choices; `search`, `reduce` and `explain` know choices and a test function,
//! and nothing of robots; `counterexample` runs the line as that test and knows which choices place objects, set physics
//! and make noise.
//!
//! Never: lets a run fail otherwise than it did, or does other things at another number of workers.

mod counterexample;
mod explain;
mod list;
mod reduce;
mod search;

pub(super) use counterexample::SHRUNK;
pub use counterexample::{Repeat, ShrinkOptions, Shrunk, keep, shrink};
pub use explain::{Explained, Influence, Neighbour, explain};
pub(super) use list::accepted_places;
pub use list::{Id, ids, unit_of};
pub use reduce::{Plan, reduce};
pub use search::{Limits, Search, Tried};
