//! Draws a run without a screen or graphics hardware: its scene before and after, from above and
//! from the side.
//!
//! From a run to pixels: [`run`] lays out the panels, [`window`] selects the region that each
//! shows, [`outline`] and [`paths`] compute the outlines of bodies and the paths of motions,
//! [`facets`] shades the bodies whose files state their appearance, and [`labels`] places names. The result is a [`drawing`] of plain shapes, which [`svg`] writes and
//! [`png`] rasterises, with glyphs from [`font`]. [`patterns`] draws the runs of patterns in the
//! same way, [`collisions`] the things that were hit, and [`charts`] the signals that decided
//! properties about time. [`robot`] draws a robot in its postures.
//!
//! Never: reads or writes a file, or simulates anything.

mod charts;
mod collisions;
mod drawing;
mod facets;
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
mod robot;
mod run;
mod svg;
mod window;

pub use charts::Chart;
pub use collisions::collisions_picture;
pub use drawing::Drawing;
pub use header::Caption;
pub use patterns::patterns_picture;
pub use robot::robot_picture;
pub use run::run_picture;
