//! What a history says, as one page that opens anywhere without a network.
//!
//! Data travel as columns and quantised courses, packed ([`pack`]) so that 10,000 runs fit; scripts and style stand readable in `web/`,
//! the library that draws in 3D with its licence in `vendor/`. Every word of a model, rule or message is in the packed data, and the
//! scripts only ever make text of it: the page's policy forbids everything else to run.
//!
//! Never: reads a history or a file, chooses what is judged, or writes a word of a user's into markup.

mod columns;
mod events;
mod input;
mod order;
mod pack;
mod page;
mod replay;
mod scripts;
mod shapes;
mod summary;

pub use columns::HTML_COLUMNS;
pub use input::{Explained, HtmlReport, PropertyWords};
pub use order::replay_order;
pub use page::html;
pub use replay::Replays;
