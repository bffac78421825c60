//! Formats verdicts, findings and tables for people and for programs.
//!
//! Never: decides an outcome, computes a statistic of its own, or writes to a stream.

mod bag;
mod contacts;
mod divergence;
mod faces;
mod formats;
mod html;
mod json;
mod look;
#[cfg(test)]
mod made_up;
mod moment;
mod picture;
mod pressed;
#[cfg(feature = "rerun")]
mod recording;
mod summary;
mod table;
mod text;
mod xml;

pub use bag::{BagFault, BagInput, bag};
pub use divergence::{Divergence, SharedEvent, divergence};
pub use formats::{
    Attachment, EarlReport, JunitReport, MarkdownReport, Repetitions, allure_common,
    allure_results, markdown, observation, review_markdown,
};
pub use html::{
    Explained, FilmImage, HTML_COLUMNS, HtmlReport, MarginBound, PackedRuns, PropertyWords,
    ReplayedRun, Replays, ReviewPage, film_times, html, html_data, replay_order, review_html,
};
pub use json::{
    campaign_json, case_json, compare_json, engines_json, findings_json, health_json, labels_json,
    oracles_json, recheck_json, relations_json, run_json, shrunk_json, skill_json,
};
pub use picture::{
    Caption, Chart, Drawing, collisions_picture, patterns_picture, robot_picture, run_picture,
};
#[cfg(feature = "rerun")]
pub use recording::{RecordingFault, Recordings};
pub use summary::{
    ActionSummary, CampaignSummary, CaseSummary, Causes, ChangeReason, CompareSummary,
    ComparedSide, EndedBy, EngineSummary, FindingsSummary, FlipGroup, GuidedSearch, HealthSummary,
    KnownIssueRuns, LabelSummary, LabelledProperty, Oddity, OracleSummary, PassingValue,
    PropertyLine, PropertyReport, Proportion, RateBounds, RecheckChange, RecheckLine,
    RecheckSummary, RelationsSummary, Remark, RepeatedProperty, Review, ReviewPair, ReviewRun,
    RunSummary, ShrunkChoice, ShrunkSummary, SideChange, WeightedLine,
};
pub use table::{
    Table, TableFormat, TableParts, answer_cells, answer_table, campaign_table, compare_table,
    engines_table, findings_table, health_table, labels_table, maps_table, oracles_table,
    recheck_table, relations_table, with_shrunk,
};
pub use text::{
    FailureLines, Page, campaign_result_text, campaign_runs_text, campaign_text, case_text,
    compare_text, engines_text, findings_text, health_lines, health_text, labels_text,
    oracles_text, recheck_text, relations_text, run_text, scene_rule, shortened, shrunk_text,
    skill_text,
};
