//! Findings of the analysis as flat tables.

use crate::{FindingsSummary, Table};

/// Returns one row for each pattern, of conditions or of effects.
pub fn findings_table(summary: &FindingsSummary) -> Table {
    let mut table = Table::new([
        "action",
        "property",
        "conditions",
        "sentence",
        "runs",
        "failed",
        "rate",
        "low",
        "high",
        "elsewhere",
        "lift",
        "wracc",
        "p",
        "q",
        "held_out_runs",
        "held_out_failed",
        "p_held_out",
        "confirmed",
        "run_ids",
        "of",
    ]);
    for report in &summary.properties {
        let conditions = report
            .when()
            .patterns
            .patterns
            .iter()
            .map(|pattern| (report.when(), "conditions", pattern));
        let effects = report
            .how()
            .patterns
            .patterns
            .iter()
            .map(|pattern| (report.how(), "effects", pattern));
        for (causes, of, pattern) in conditions.chain(effects) {
            let held_out = pattern.held_out;
            table.rows.push(vec![
                report.findings.action.clone().into(),
                report.findings.property.clone().into(),
                causes.conditions(&pattern.conditions).into(),
                causes.sentence(pattern).into(),
                (pattern.all.failed_in + pattern.all.passed_in).into(),
                pattern.all.failed_in.into(),
                pattern.rate.rate.into(),
                pattern.rate.low.into(),
                pattern.rate.high.into(),
                pattern.elsewhere.map(|elsewhere| elsewhere.rate).into(),
                pattern.lift.into(),
                pattern.wracc.into(),
                pattern.p.into(),
                pattern.q.into(),
                (held_out.failed_in + held_out.passed_in).into(),
                held_out.failed_in.into(),
                pattern.p_held_out.into(),
                pattern.confirmed.into(),
                causes.runs(pattern).join(" ").into(),
                of.into(),
            ]);
        }
    }
    table
}

/// Returns one row for each cell of the heat maps.
pub fn maps_table(summary: &FindingsSummary) -> Table {
    let mut table = Table::new([
        "action", "property", "by", "down", "across", "runs", "failed", "rate", "low", "high",
    ]);
    for report in &summary.properties {
        for map in &report.maps {
            for (down, cells) in map.down.iter().zip(&map.cells) {
                for (across, cell) in map.across.iter().zip(cells) {
                    table.rows.push(vec![
                        report.findings.action.clone().into(),
                        report.findings.property.clone().into(),
                        map.by.join(" ").into(),
                        down.clone().into(),
                        across.clone().into(),
                        cell.runs.into(),
                        cell.failed.into(),
                        cell.failing.map(|failing| failing.rate).into(),
                        cell.failing.map(|failing| failing.low).into(),
                        cell.failing.map(|failing| failing.high).into(),
                    ]);
                }
            }
        }
    }
    table
}
