//! A picture of a run without screen or graphics hardware: its scene before and after, from above and from the side.
//!
//! From a run to pixels: [`run`] lays panels out, [`window`] says what each shows, [`outline`] and [`paths`] make lines of
//! bodies and motions, [`labels`] finds room for names; [`drawing`] is all of it as plain shapes, which [`svg`] writes and
//! [`png`] fills, with letters from [`font`]. [`patterns`] draws the runs of patterns with the same means.
//!
//! Never: reads or writes a file, or knows of a shape that the trace does not hold.

mod drawing;
mod font;
mod header;
mod labels;
mod legend;
mod outline;
mod paint;
mod panel;
mod paths;
mod patterns;
mod png;
mod run;
mod svg;
mod window;

pub use drawing::Drawing;
pub use header::Caption;
#[cfg(feature = "rerun")]
pub(super) use outline::hull as flat_hull;
pub use patterns::patterns_picture;
pub use run::run_picture;
