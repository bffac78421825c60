//! Formats verdicts, findings and tables for people and for programs.
//!
//! Never: decides an outcome, computes a statistic of its own, or writes to a stream.

mod answer;
mod by_action;
mod campaign_json;
mod campaign_table;
mod campaign_text;
mod case_text;
mod compare_summary;
mod compare_table;
mod compare_text;
mod contacts;
mod findings_json;
mod findings_summary;
mod findings_text;
mod formats;
mod health;
mod html;
mod moment;
mod oracles;
mod picture;
mod recheck_summary;
mod recheck_text;
#[cfg(feature = "rerun")]
mod recording;
mod remarks;
mod repeated;
mod repeated_text;
mod run_text;
mod scene_rule;
mod shrunk_text;
mod summary;
mod table;
mod weighted;
mod xml;

pub use answer::answer_table;
pub use campaign_json::campaign_json;
pub use campaign_table::campaign_table;
pub use campaign_text::campaign_text;
pub use case_text::{CaseSummary, case_json, case_text, regressions_text};
pub use compare_summary::{CompareSummary, ComparedSide, SideChange};
pub use compare_table::{compare_json, compare_table};
pub use compare_text::compare_text;
pub use findings_json::findings_json;
pub use findings_summary::{FindingsSummary, PropertyReport, findings_table, maps_table};
pub use findings_text::findings_text;
pub use formats::{
    Attachment, EarlReport, JunitReport, MarkdownReport, RESULTS_COMMON_FILES, Repetitions, allure_common,
    allure_results, markdown, observation,
};
pub use health::{HealthSummary, health_json, health_lines, health_table, health_text};
pub use html::{Explained, HTML_COLUMNS, HtmlReport, PropertyWords, Replays, html, replay_order};
pub use oracles::{OracleSummary, oracles_json, oracles_table, oracles_text};
pub use picture::{Caption, Drawing, patterns_picture, run_picture};
pub use recheck_summary::{Change, RecheckLine, RecheckSummary, Why};
pub use recheck_text::{recheck_json, recheck_table, recheck_text};
#[cfg(feature = "rerun")]
pub use recording::{RecordingFault, Recordings};
pub use remarks::{Oddity, Remark};
pub use repeated::RepeatedProperty;
pub use run_text::{run_json, run_text};
pub use scene_rule::scene_rule;
pub use shrunk_text::{ShrunkChoice, ShrunkSummary, shrunk_json, shrunk_text, with_shrunk};
pub use summary::{ActionSummary, CampaignSummary, EndedBy, PropertyLine, RunSummary, Share};
pub use table::{Table, TableFormat};
pub use weighted::{GuidedSearch, WeightedLine};
