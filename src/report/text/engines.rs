//! The same runs in two physics engines, for the terminal.

use std::fmt::Write as _;

use crate::table::{engines_table, percent_interval, settings_table};
use crate::text::Page;
use crate::{EngineSummary, TableFormat};
use actcheck_analysis::RunInEngines;

/// Maximum number of disagreements that are explained; `--format json` has all.
const MOST_EXPLAINED: usize = 10;

/// Formats the agreement of each property and setting, the likely cause of disagreements, and where
/// each of the first ten begins.
pub fn engines_text(summary: &EngineSummary, page: Page) -> String {
    let comparison = &summary.comparison;
    let (all, n_runs) = (comparison.agreement(), comparison.runs.len());
    let mut out = String::new();
    let _ = writeln!(
        out,
        "{n_runs} runs of {} in MuJoCo {}, {}: all properties agree in {} ({})\n",
        summary.campaign,
        summary.version,
        summary.way(),
        all.agree,
        percent_interval(all)
    );
    out += &engines_table(summary).render(TableFormat::Table, page);
    if !summary.closed_loop {
        out.push('\n');
        out += &settings_table(summary).render(TableFormat::Table, page);
    }
    if let Some((setting, gain)) = comparison.likely_cause() {
        let _ = writeln!(
            out,
            "\nwith {} MuJoCo agrees in {gain} more runs: this is the likely cause of the disagreements",
            summary.setting(setting)
        );
    }
    let contested = comparison.runs.iter();
    let contested = contested.filter(|run| !run.contested().is_empty()).count();
    let _ = writeln!(
        out,
        "\n{contested} of {n_runs} runs are contested: an engine or a setting decides a property otherwise"
    );
    let differing = comparison.runs.iter();
    let differing = differing.filter(|run| !run.disagreements.is_empty());
    for run in differing.take(MOST_EXPLAINED) {
        explain(&mut out, run);
    }
    if let Some(imported) = &summary.imported {
        let _ = writeln!(
            out,
            "\nMuJoCo's courses are the runs of campaign {imported}; CPU {:.1} s of MuJoCo",
            summary.plain_secs
        );
    }
    page.set(&out)
}

/// Explains the disagreements of a run.
fn explain(out: &mut String, run: &RunInEngines) {
    let _ = writeln!(out, "\nrun {}", run.run);
    for one in &run.disagreements {
        let _ = writeln!(
            out,
            "  {}: here {}; in MuJoCo {}",
            one.property, one.here, one.there
        );
    }
    if let Some(parting) = &run.parting {
        let _ = writeln!(
            out,
            "  the courses part by more than 5 mm at {:.1} s: {}",
            parting.secs, parting.body
        );
    }
    if let Some(contact) = &run.contact {
        let [first, second] = &contact.pair;
        let place = if contact.is_here {
            "only here"
        } else {
            "only in MuJoCo"
        };
        let _ = writeln!(
            out,
            "  first contact that differs: {first} and {second} at {:.2} s, {place}",
            contact.secs
        );
    }
}
