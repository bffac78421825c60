//! What the table of outcomes says of when and why actions fail.
//!
//! Only passed and failed outcomes say something of the robot; all others are counted and told, and are never failures.
//!
//! Never: reads a file, or knows what a property means.

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

/// Columns of the table that findings are made of, beside the parameters of the scene.
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
