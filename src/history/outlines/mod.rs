//! Outlines: runs that are not kept whole.
//!
//! An outline has the choices, the states before and after each action, the statements about the
//! run, and its outcomes: everything except the motion over time, in a twentieth of the space. The
//! motion comes back bit for bit when the run is simulated again from its choices.
//!
//! A new outline is a file of its own, so that it survives a kill of the process. As soon as there
//! are enough, they go into one file together, which takes half the space, because runs of a
//! campaign are alike.
//!
//! Never: has a run that the store has too.

mod copy;
mod file;
mod loaded;
mod read;
mod restore;
mod row;
mod sheets;
mod shelf;
mod stream;
mod view;

pub(super) use file::Outline;
pub(super) use loaded::LoadedFiles;
pub use restore::Restore;
pub(crate) use restore::withheld;
pub(super) use row::Outlined;
pub(super) use sheets::SheetFile;
pub(super) use shelf::Shelf;
pub(super) use view::{MOST_STATEMENTS, View, too_many};
