//! A campaign's health report for the terminal.

use std::fmt::Write as _;

use crate::HealthSummary;
use crate::text::{Page, command, fitted, ruled};
use actcheck_base::ShellLine;

/// One line for each warning, for the end of a campaign's summary. Empty if the campaign is
/// healthy.
pub fn health_lines(summary: &HealthSummary, page: Page) -> String {
    let mut out = String::new();
    for warning in summary.warnings().iter() {
        let help = warning.help.as_deref().unwrap_or_default();
        let _ = writeln!(
            out,
            "warning {}: {} ({help})",
            warning.code, warning.message
        );
    }
    if !out.is_empty() {
        out.insert(0, '\n');
        let more = ShellLine::new(&summary.program)
            .fixed("health")
            .word(&summary.campaign);
        let more = more.option("--history", &summary.history);
        let _ = writeln!(out, "  more: {}", command(&more));
    }
    page.set(&out)
}

/// Formats coverage, then the other measurements.
pub fn health_text(summary: &HealthSummary, page: Page) -> String {
    let health = &summary.health;
    let mut out = String::new();
    if !health.parameters.is_empty() {
        let mut table = ruled();
        table.set_header([
            "parameter",
            "draws",
            "bins hit (expected)",
            "draws in each bin",
        ]);
        for parameter in &health.parameters {
            let counts: Vec<String> = parameter.counts.iter().map(u64::to_string).collect();
            table.add_row([
                parameter.name.clone(),
                parameter.draws.to_string(),
                format!(
                    "{} of {} ({:.1})",
                    parameter.hits(),
                    parameter.counts.len(),
                    parameter.expected_hits
                ),
                counts.join(" "),
            ]);
        }
        let _ = writeln!(
            out,
            "{}",
            fitted(table, page, &["draws in each bin", "draws"])
        );
    }
    let (hits, expected, cells) = summary.pairs();
    if cells > 0 {
        let _ = writeln!(
            out,
            "pairs of bins of two parameters: {hits} of {cells} tried (expected {expected:.0})"
        );
    }
    let drawn = health.runs + health.discards;
    let _ = writeln!(out, "scenes discarded: {} of {drawn}", health.discards);
    if let (Some(median), Some((secs, run))) = (health.median_secs, &health.slowest) {
        let _ = writeln!(
            out,
            "wall time of a run: median {median:.2} s, longest {secs:.2} s ({run})"
        );
    }
    if let Some((depth, run)) = &health.deepest {
        let _ = writeln!(out, "deepest penetration: {:.2} mm ({run})", depth * 1e3);
    }
    if let Some((energy, run)) = &health.energy {
        let _ = writeln!(
            out,
            "unexplained energy gain: at most {:.4} J in a run ({run})",
            energy
        );
    }
    let _ = match health.problems.len() {
        0 => writeln!(
            out,
            "campaign {} in {} is healthy",
            summary.campaign, summary.history
        ),
        1 => writeln!(
            out,
            "campaign {} in {}: 1 warning",
            summary.campaign, summary.history
        ),
        many => writeln!(
            out,
            "campaign {} in {}: {many} warnings",
            summary.campaign, summary.history
        ),
    };
    page.set(&out)
}
