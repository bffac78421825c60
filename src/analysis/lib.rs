//! Analyses a history: tables, rates with confidence intervals, failure modes, patterns, and
//! comparisons of campaigns.
//!
//! Never: judges, changes a history (its tables are stored beside it), or exposes a type of the
//! table library.

mod agreement;
mod answer;
mod bisect;
mod calibrate;
mod compare;
mod consistency;
mod coverage;
mod dataset;
mod effects;
mod engines;
mod failure_modes;
mod false_discovery;
mod findings;
mod fisher;
mod health;
mod holm;
mod mined;
mod oracles;
mod paired;
mod patterns;
mod runs_needed;
#[cfg(test)]
mod sample_rows;
mod score_interval;
mod stopped;
mod tables;

pub use agreement::Agreement;
pub use answer::Answer;
pub use bisect::{Likeness, OutcomeFlip, like_by_outcomes, like_by_rates, outcome_flips};
pub use calibrate::{Calibration, FittedLimit, LabelledRun, calibrate};
pub use compare::{
    Compared, ComparedLine, ComparedRun, ComparedRuns, Comparison, compare, compared_runs,
};
pub use consistency::{
    Consistency, PassPower, Repeated, SceneCounts, SceneRuns, Variance, consistency,
};
pub use coverage::{Coverage, PairCoverage, ParameterCoverage};
pub use dataset::{
    Dataset, DatasetImage, DatasetRuns, DrawImages, LerobotDataset, export_dataset, export_facts,
    export_lerobot,
};
pub use effects::{
    ActionEffects, FirstContact, LargestForce, PerceptionError, RealisedNoise, Surrounding,
    TableRun, concerns_target, perceived_sentences,
};
pub use engines::{
    Disagreement, EngineComparison, OwnContact, Parting, PropertyAgreement, RunInEngines,
};
pub use failure_modes::{FailureMode, failure_modes};
pub use false_discovery::benjamini_hochberg;
pub use findings::{
    Cascade, ChangePoint, Collisions, Example, FINDING_COLUMNS, FlakyScene, HitKind, Judged,
    JudgedProperty, Mined, PlacedThing, PropertyFindings, Quantiles, RATE_COLUMNS, Sector, Trend,
    TrendPoint, TwoWay, TwoWayCell, cascades, collisions, finding_columns, flaky_scenes, judged,
    property_findings, quantiles, table_failure_modes, trend, two_way,
};
pub use fisher::{FisherTest, TwoByTwo};
pub use health::{Health, HealthMeter, HealthProblem};
pub use holm::holm;
pub use mined::{Beyond, MinedLimit};
pub use oracles::{
    LEVEL, Notice, OracleCell, OracleGap, OracleMatrix, OracleRow, OracleTrial, oracle_matrix,
};
pub use paired::{Difference, PairedTable, PairedTest};
pub use patterns::{
    Condition, Parameter, Pattern, PatternInput, PatternOptions, Patterns, Strongest, Values, mine,
};
pub use runs_needed::{POWER, TwoRates};
pub use score_interval::score_interval;
pub use stopped::{PassesUntilFailures, Sampling, anytime, passes_until_failures};
pub use tables::{
    Column, ColumnKind, ColumnRole, Hierarchy, Mirror, MirrorChange, OutcomeTable, TableFilter,
    TextColumn, columns, export_csv, export_parquet,
};

// Re-exported for readers of tables.
pub use actcheck_verdict::{Interval, wilson, wilson_share};
