//! What a history holds in the formats of other people's tools: one file each of Allure, JUnit, EARL, Markdown and JSON lines.
//!
//! Never: decides an outcome, reads a history, writes a file, or counts two of the six outcomes as one where the format has words
//! for both.

mod allure;
mod earl;
mod identity;
mod junit;
mod markdown;
mod observation;

pub use allure::{Attachment, RESULTS_COMMON_FILES, allure_common, allure_results};
pub use earl::EarlReport;
pub use identity::Repetitions;
pub use junit::JunitReport;
#[cfg(feature = "rerun")]
pub(super) use markdown::plain;
pub use markdown::{MarkdownReport, markdown};
pub use observation::observation;
