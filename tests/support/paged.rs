//! Report pages of made-up runs: from tables to HTML without a history.

use std::collections::BTreeMap;
use std::path::Path;

use actcheck::analysis::{
    Hierarchy, Mirror, OutcomeTable, PatternOptions, TableFilter, TableRun, cascades, collisions,
    finding_columns, flaky_scenes, judged, property_findings, table_failure_modes, trend, two_way,
};
use actcheck::report::{
    FindingsSummary, HTML_COLUMNS, HtmlReport, PackedRuns, PropertyReport, PropertyWords, Replays,
    html,
};
use actcheck::verdict::Counts;

/// The accepted false discovery rate.
const LEVEL: f64 = 0.05;

/// The findings of a table.
pub fn findings(table: &OutcomeTable, history: &str) -> FindingsSummary {
    let all = judged(table);
    let property = |of| {
        let findings = property_findings(table, of, &Hierarchy::new(), &PatternOptions::default());
        let (flaky, repeated_scenes) = flaky_scenes(table, of);
        PropertyReport {
            maps: [
                ["surface_y_m", "surface_x_m"],
                ["target_category", "target_turned_rad"],
            ]
            .iter()
            .filter_map(|by| two_way(&findings.input, by))
            .collect(),
            unit: Some("m".to_owned()),
            trend: trend(table, of, LEVEL),
            flaky,
            repeated_scenes,
            findings,
        }
    };
    FindingsSummary {
        sampling: table.sampling,
        history: history.to_owned(),
        program: "actcheck".to_owned(),
        options: String::new(),
        campaigns: table.text("campaign").texts.clone(),
        runs: table.text("run").texts.len() as u64,
        sampled_runs: None,
        twins: 0,
        counts: all.iter().fold(Counts::default(), |mut sum, of| {
            sum.add_all(of.counts);
            sum
        }),
        modes: table_failure_modes(table),
        cascades: cascades(table, LEVEL),
        collisions: collisions(table),
        properties: all.iter().map(property).collect(),
        level: LEVEL,
    }
}

/// Writes runs as a mirror into a folder.
pub fn mirror(
    folder: &Path,
    campaign: &str,
    runs: impl IntoIterator<Item = impl Into<TableRun>>,
) -> Mirror {
    Mirror::of_runs(folder, campaign, runs).unwrap()
}

/// The page of a mirror.
pub fn page(
    mirror: &Mirror,
    history: &str,
    words: &BTreeMap<String, PropertyWords>,
    replays: &Replays,
) -> String {
    let names: Vec<&str> = finding_columns().into_iter().chain(HTML_COLUMNS).collect();
    let table = OutcomeTable::read(mirror, &TableFilter::default(), &names).unwrap();
    let findings = findings(&table, history);
    html(&HtmlReport {
        version: "0.1.0",
        made: "2026-01-01T00:00:00Z",
        findings: &findings,
        table: &table,
        runs: &PackedRuns::of(&findings, &table, None),
        campaigns: &[],
        words,
        replays,
        contested: &BTreeMap::new(),
        relations: &[],
        served: false,
    })
}
