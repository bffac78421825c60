//! Findings from the table of outcomes: when and why actions fail.
//!
//! Only passed and failed outcomes are evidence about the robot. All others are counted and
//! reported, but never as failures.
//!
//! Never: reads a file, or depends on the meaning of a property.

mod cascade;
mod collisions;
mod flaky;
mod judged;
mod margins;
mod modes;
mod parameters;
mod property;
mod scenes;
mod trend;
mod two_way;

use crate::columns;

pub use cascade::{Cascade, Judged, cascades};
pub use collisions::{Collisions, HitKind, PlacedThing, Sector, collisions};
pub use flaky::{FlakyScene, flaky_scenes};
pub use judged::{JudgedProperty, judged};
pub use margins::{Quantiles, quantiles};
pub use modes::table_failure_modes;
pub use property::{Example, Mined, PropertyFindings, property_findings};
pub use trend::{ChangePoint, Trend, TrendPoint, trend};
pub use two_way::{TwoWay, TwoWayCell, two_way};

/// Columns of the table that findings need, in addition to conditions and effects.
pub const FINDING_COLUMNS: [&str; 14] = [
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
    "surroundings",
];

/// Returns all columns that findings need: [`FINDING_COLUMNS`], conditions and effects.
pub fn finding_columns() -> Vec<&'static str> {
    let mined = columns()
        .iter()
        .filter(|column| column.is_condition() || column.is_effect());
    FINDING_COLUMNS
        .into_iter()
        .chain(mined.map(|column| column.name))
        .collect()
}

/// Columns from which rates, failure modes and trends are computed: a tenth of the size of
/// [`finding_columns`].
pub const RATE_COLUMNS: [&str; 12] = [
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
];
