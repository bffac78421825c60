//! A campaign's health report as text, table and JSON.

use std::fmt::Write as _;

use serde_json::{Value, json};

use crate::Table;
use crate::table::ruled;
use actcheck_analysis::{Ailment, Health, ParameterCoverage};
use actcheck_base::{Diagnostic, Diagnostics, names};

/// A campaign's health, with the names that messages refer to.
#[derive(Debug, Clone, PartialEq)]
pub struct HealthSummary {
    /// The campaign's id.
    pub campaign: String,
    /// Path of the history, as the user named it.
    pub history: String,
    /// How the user invoked this program.
    pub program: String,
    /// The measured health.
    pub health: Health,
}

impl HealthSummary {
    /// 0: the campaign is healthy. 1: there are warnings.
    pub fn exit_code(&self) -> u8 {
        u8::from(!self.health.ailments.is_empty())
    }

    /// The problems found, as warnings with help.
    pub fn warnings(&self) -> Diagnostics {
        let mut found = Diagnostics::new();
        for ailment in &self.health.ailments {
            found.push(self.warning(ailment));
        }
        found
    }

    fn warning(&self, ailment: &Ailment) -> Diagnostic {
        match ailment {
            Ailment::Discards(discards, drawn, run, reason) => Diagnostic::warning(
                "S032",
                format!("{discards} of {drawn} scenes were discarded; the first, for run {run}: {reason}"),
            )
            .help(
                "use fewer or smaller objects, a larger surface, or ranges closer to `[scene] require`: fewer discards waste \
                 less time and bias the sample less",
            ),
            Ailment::Inapplicable(property, not, of) => Diagnostic::warning(
                "Q001",
                format!("{} was inapplicable in {not} of {of} judgements", names::local(property)),
            )
            .help("generate scenes to which it applies, or widen the `applicable` condition of its rule"),
            Ailment::Neglected(parameter) => neglected(parameter),
            Ailment::PairNeglected(pair) => Diagnostic::warning(
                "Q003",
                format!(
                    "of {} pairs of values of `{}` and `{}` {} were tried; {} random draws would try about {:.0}",
                    pair.cells, pair.names[0], pair.names[1], pair.hits, pair.draws, pair.expected_hits
                ),
            )
            .help("the two parameters vary together, so failures can't be attributed to one of them: check whether discards or a case tie them"),
            Ailment::Duplicates(times, run, of) => {
                Diagnostic::warning("Q004", format!("{times} runs make the same decisions as another run: {run} repeats {of}"))
                    .help("widen the ranges of `[physics]`, `[sensing]` or the models, or ask for fewer runs")
            }
            Ailment::Slow(run, secs, median) => Diagnostic::warning(
                "Q005",
                format!("run {run} took {secs:.1} s, {:.0} times the median of {median:.1} s", secs / median.max(1e-9)),
            )
            .help(format!("`{}` shows the run; `[budget]` limits the time of a run", self.show(run))),
            Ailment::Penetration(run, depth) => Diagnostic::warning(
                "Q006",
                format!("in run {run}, bodies penetrated each other by {:.1} mm: contacts were simulated inaccurately", depth * 1e3),
            )
            .help("raise `[physics] steps_per_second` or `iterations`, or make heavy objects lighter"),
            Ailment::Energy(run, energy) => Diagnostic::warning(
                "Q007",
                format!("in run {run}, objects gained {energy:.2} J without a cause: the simulation was unstable"),
            )
            .help("raise `[physics] steps_per_second` or `iterations`, or lower `restitution`"),
        }
    }

    fn show(&self, run: &str) -> String {
        format!("{} show {run} --history {}", self.program, self.history)
    }

    /// Pairs of bins over all pairs of parameters: number tried, number expected, total.
    fn pairs(&self) -> (usize, f64, usize) {
        let pairs = &self.health.pairs;
        (
            pairs.iter().map(|pair| pair.hits).sum(),
            pairs.iter().map(|pair| pair.expected_hits).sum(),
            pairs.iter().map(|pair| pair.cells).sum(),
        )
    }
}

fn neglected(parameter: &ParameterCoverage) -> Diagnostic {
    let bins = parameter.counts.len();
    let bin = parameter.neglected.unwrap_or_default();
    let (times, even) = (parameter.counts.get(bin).copied().unwrap_or_default(), parameter.draws as f64 / bins as f64);
    let message = format!(
        "`{}` fell into the {} of its {bins} equally probable bins {times} times in {} draws, not about {even:.0}",
        parameter.name,
        ordinal(bin + 1),
        parameter.draws
    );
    Diagnostic::warning("Q002", message)
        .help("rarely drawn values are rarely tested: check whether discards exclude such scenes (`act:discards` of each run)")
}

fn ordinal(number: usize) -> String {
    let ending = match (number % 10, number % 100) {
        (1, rest) if rest != 11 => "st",
        (2, rest) if rest != 12 => "nd",
        (3, rest) if rest != 13 => "rd",
        _ => "th",
    };
    format!("{number}{ending}")
}

/// One line for each warning, for the end of a campaign's summary. Empty if the campaign is healthy.
pub fn health_lines(summary: &HealthSummary) -> String {
    let mut out = String::new();
    for warning in summary.warnings().iter() {
        let help = warning.help.as_deref().unwrap_or_default();
        let _ = writeln!(out, "warning {}: {} ({help})", warning.code, warning.message);
    }
    if !out.is_empty() {
        out.insert(0, '\n');
        let _ = writeln!(out, "  more: {} health {} --history {}", summary.program, summary.campaign, summary.history);
    }
    out
}

/// Returns one row for each parameter: how often its bins were tried.
pub fn health_table(summary: &HealthSummary) -> Table {
    let mut table = Table::new(["parameter", "draws", "bins", "hit", "expected_hit", "least", "most"]);
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

/// Formats coverage, then the other measurements.
pub fn health_text(summary: &HealthSummary) -> String {
    let health = &summary.health;
    let mut out = String::new();
    if !health.parameters.is_empty() {
        let mut table = ruled();
        table.force_no_tty();
        table.set_header(["parameter", "draws", "bins hit (expected)", "draws in each bin"]);
        for parameter in &health.parameters {
            let counts: Vec<String> = parameter.counts.iter().map(u64::to_string).collect();
            table.add_row([
                parameter.name.clone(),
                parameter.draws.to_string(),
                format!("{} of {} ({:.1})", parameter.hits(), parameter.counts.len(), parameter.expected_hits),
                counts.join(" "),
            ]);
        }
        let _ = writeln!(out, "{table}\n");
    }
    let (hits, expected, cells) = summary.pairs();
    if cells > 0 {
        let _ = writeln!(out, "pairs of bins of two parameters: {hits} of {cells} tried (expected {expected:.0})");
    }
    let drawn = health.runs + health.discards;
    let _ = writeln!(out, "scenes discarded: {} of {drawn}", health.discards);
    if let (Some(median), Some((secs, run))) = (health.median_secs, &health.slowest) {
        let _ = writeln!(out, "wall time of a run: median {median:.2} s, longest {secs:.2} s ({run})");
    }
    if let Some((depth, run)) = &health.deepest {
        let _ = writeln!(out, "deepest penetration: {:.2} mm ({run})", depth * 1e3);
    }
    if let Some((energy, run)) = &health.energy {
        let _ = writeln!(out, "unexplained energy gain: at most {:.4} J in a run ({run})", energy);
    }
    let _ = match health.ailments.len() {
        0 => writeln!(out, "campaign {} in {} is healthy", summary.campaign, summary.history),
        1 => writeln!(out, "campaign {} in {}: 1 warning", summary.campaign, summary.history),
        many => writeln!(out, "campaign {} in {}: {many} warnings", summary.campaign, summary.history),
    };
    out
}

/// Returns the health report as JSON.
pub fn health_json(summary: &HealthSummary) -> Value {
    let health = &summary.health;
    let parameters = health.parameters.iter().map(|parameter| {
        json!({
            "parameter": parameter.name, "draws": parameter.draws, "counts": parameter.counts,
            "hit": parameter.hits(), "expected_hit": parameter.expected_hits,
        })
    });
    let pairs = health.pairs.iter().map(|pair| {
        json!({
            "parameters": pair.names, "draws": pair.draws, "cells": pair.cells, "hit": pair.hits,
            "expected_hit": pair.expected_hits,
        })
    });
    let worst =
        |worst: &Option<(f64, String)>| worst.as_ref().map(|(value, run)| json!({ "value": value, "run": run }));
    let warnings = health.ailments.iter().map(|ailment| {
        let warning = summary.warning(ailment);
        json!({ "code": warning.code, "text": warning.message, "help": warning.help })
    });
    json!({
        "campaign": summary.campaign, "runs": health.runs, "discarded_scenes": health.discards,
        "wall_median_secs": health.median_secs, "wall_longest_secs": worst(&health.slowest),
        "deepest_penetration_m": worst(&health.deepest), "energy_gain_j": worst(&health.energy),
        "parameters": parameters.collect::<Vec<_>>(),
        "pairs": pairs.collect::<Vec<_>>(),
        "warnings": warnings.collect::<Vec<_>>(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ordinals_have_english_suffixes() {
        let told: Vec<String> = [1, 2, 3, 4, 11, 12, 13, 21, 102].into_iter().map(ordinal).collect();
        assert_eq!(told, ["1st", "2nd", "3rd", "4th", "11th", "12th", "13th", "21st", "102nd"]);
    }
}
