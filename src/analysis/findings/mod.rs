//! Findings from the table of outcomes: when and why actions fail.
//!
//! Only passed and failed outcomes are evidence about the robot. All others are counted and reported, but never as
//! failures.
//!
//! Never: reads a file, or depends on the meaning of a property.

mod cascade;
mod flaky;
mod judged;
mod margins;
mod modes;
mod parameters;
mod property;
mod scenes;
mod trend;
mod two_way;

pub use cascade::{Cascade, Judged, cascades};
pub use flaky::{FlakyScene, flaky_scenes};
pub use judged::{JudgedProperty, judged};
pub use margins::{Quantiles, quantiles};
pub use modes::table_failure_modes;
pub use property::{Example, PropertyFindings, property_findings};
pub use trend::{ChangePoint, Trend, TrendPoint, trend};
pub use two_way::{TwoWay, TwoWayCell, two_way};

/// Columns of the table that findings need, in addition to the parameters of the scene.
pub const FINDING_COLUMNS: [&str; 13] = [
    "run",
    "campaign",
    "scene",
    "weight",
    "status",
    "started",
    "trace_hash",
    "step",
    "action",
    "property",
    "outcome",
    "margin",
    "designators",
];
