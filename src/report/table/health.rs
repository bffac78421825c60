//! The coverage of a campaign's parameters as a flat table.

use crate::{HealthSummary, Table};

/// Returns one row for each parameter: how often its bins were tried.
pub fn health_table(summary: &HealthSummary) -> Table {
    let mut table = Table::new([
        "parameter",
        "draws",
        "bins",
        "hit",
        "expected_hit",
        "least",
        "most",
    ]);
    for parameter in &summary.health.parameters {
        table.rows.push(vec![
            parameter.name.clone().into(),
            parameter.draws.into(),
            parameter.counts.len().into(),
            parameter.hits().into(),
            ((parameter.expected_hits * 100.0).round() / 100.0).into(),
            parameter.counts.iter().min().copied().into(),
            parameter.counts.iter().max().copied().into(),
        ]);
    }
    table
}
