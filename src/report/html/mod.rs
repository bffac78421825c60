//! Generates an HTML report of a history: one self-contained page that works offline.
//!
//! Data are packed as columns and quantised trajectories ([`pack`]), so that 10,000 runs fit.
//! Scripts and styles are in `web/`, the 3D library and its licence in `vendor/`. All text from
//! models, rules and messages is in the packed data, and the scripts only insert it as text nodes;
//! the page's content security policy forbids all other scripts.
//!
//! Never: reads a history or a file, chooses the judged properties, or writes user text into
//! markup.

mod columns;
mod events;
mod film;
mod input;
mod joints;
mod order;
mod pack;
mod page;
mod replay;
mod review;
mod scripts;
mod shapes;
mod signals;
mod summary;

pub use columns::{HTML_COLUMNS, PackedRuns};
pub use film::{FilmImage, film_times};
pub use input::{Explained, HtmlReport, MarginBound, PropertyWords};
pub use order::replay_order;
pub use page::{html, html_data};
pub use replay::{ReplayedRun, Replays};
pub use review::{ReviewPage, review_html};
