//! Exports a history to third-party formats, one module for each: Allure, JUnit, EARL, Markdown and
//! JSON Lines.
//!
//! Never: decides an outcome, reads a history, writes a file, or merges two of the six outcomes if
//! the format can distinguish them.

mod allure;
mod earl;
mod identity;
mod junit;
mod markdown;
mod observation;
mod review;

pub use allure::{Attachment, allure_common, allure_results};
pub use earl::EarlReport;
pub use identity::Repetitions;
pub use junit::JunitReport;
#[cfg(feature = "rerun")]
pub(super) use markdown::plain;
pub use markdown::{MarkdownReport, markdown};
pub use observation::observation;
pub(super) use review::flip_words;
pub use review::review_markdown;
