//! A campaign's summary for the terminal.

use std::fmt::Write as _;

use comfy_table::{Attribute, Cell, Color};

use crate::text::repeated::repeated_text;
use crate::text::weighted::weighted_text;
use crate::text::{by_action, fit, regressions_text, ruled, terminal_width};
use crate::{CampaignSummary, PropertyLine, Proportion, RunSummary};
use actcheck_base::{Outcome, names};
use actcheck_history::SkillRecord;

/// Maximum number of rows in the table of runs. The text names the command that lists the rest.
const RUNS_SHOWN: usize = 40;
/// Maximum number of failed runs that are described in words.
const FAILURES_SHOWN: usize = 20;

/// Formats the table of runs × properties, the scores, and the witness of each failed property.
pub fn campaign_text(summary: &CampaignSummary, colour: bool) -> String {
    let mut out = regressions_text(&summary.regressions);
    if !out.is_empty() {
        out.push('\n');
    }
    runs_table(&mut out, summary, colour);
    out.push('\n');
    properties_table(&mut out, summary);
    out.push('\n');
    repeated_text(&mut out, summary);
    weighted_text(&mut out, summary);
    scores(&mut out, summary);
    failure_modes(&mut out, summary);
    remarks(&mut out, summary);
    failures(&mut out, summary);
    out
}

fn runs_table(out: &mut String, summary: &CampaignSummary, colour: bool) {
    if summary.runs.is_empty() {
        return;
    }
    // All runs if they fit; otherwise the runs that did not pass, which are of most interest.
    let fit = summary.runs.len() <= RUNS_SHOWN;
    let shown: Vec<&RunSummary> = summary.runs.iter().filter(|run| fit || !run.passed()).take(RUNS_SHOWN).collect();
    let several = by_action::has_several_actions(summary);
    let table = if several { by_action::scores_table } else { outcomes_table }(summary, &shown, colour);
    let _ = writeln!(out, "{table}");
    let left_out = summary.runs.len() - shown.len();
    if left_out > 0 {
        let passed = summary.runs.iter().filter(|run| run.passed()).count();
        let _ = writeln!(
            out,
            "{left_out} more runs ({passed} of all passed): {} list --history {}",
            summary.program, summary.history
        );
    }
}

/// Outcomes of the shown runs, for tests with a single action.
fn outcomes_table(summary: &CampaignSummary, shown: &[&RunSummary], colour: bool) -> comfy_table::Table {
    let mut table = ruled();
    if colour {
        table.enforce_styling();
    } else {
        table.force_no_tty();
    }
    let labels = summary.properties.iter().map(|(_, label, _)| label.clone());
    table.set_header(["run".to_owned(), "test".to_owned()].into_iter().chain(labels).chain(["S".to_owned()]));
    for run in shown {
        let mut row = vec![Cell::new(&run.id), Cell::new(&run.test)];
        row.extend(summary.properties.iter().map(|(iri, ..)| outcomes_cell(run, iri)));
        row.push(Cell::new(format!("{:.2}", run.score)));
        table.add_row(row);
    }
    table
}

/// Outcomes of a property in a run, one for each action that has the property.
fn outcomes_cell(run: &RunSummary, property: &str) -> Cell {
    let outcomes: Vec<Outcome> = run
        .actions
        .iter()
        .flat_map(|action| &action.judgements)
        .filter(|judgement| judgement.property == property)
        .map(|judgement| judgement.outcome)
        .collect();
    let words: Vec<&str> = outcomes.iter().map(|outcome| outcome.word()).collect();
    let worst = outcomes.iter().copied().max_by_key(|outcome| match outcome {
        Outcome::Failed => 2,
        Outcome::Passed | Outcome::Inapplicable => 0,
        _ => 1,
    });
    let cell = Cell::new(words.join(" "));
    match worst {
        Some(Outcome::Failed) => cell.fg(Color::Red).add_attribute(Attribute::Bold),
        Some(Outcome::Passed) => cell.fg(Color::Green),
        Some(Outcome::Inapplicable) | None => cell.fg(Color::DarkGrey),
        Some(_) => cell.fg(Color::Yellow),
    }
}

fn properties_table(out: &mut String, summary: &CampaignSummary) {
    if by_action::has_several_actions(summary) {
        let _ = writeln!(out, "{}", by_action::properties_table(summary, pass_rate));
        return;
    }
    let mut table = ruled();
    table.force_no_tty();
    let counted = Outcome::ALL.map(|outcome| outcome.word().to_owned());
    table.set_header(["property".to_owned(), "pass rate [95 % interval]".to_owned()].into_iter().chain(counted));
    for line in summary.property_lines() {
        let rate = pass_rate(&line);
        let counts = Outcome::ALL.map(|outcome| line.counts.get(outcome).to_string());
        table.add_row([line.label, rate].into_iter().chain(counts));
    }
    let lines = summary.property_lines();
    // In a narrow terminal, counts that are all zero are left out.
    let zero = Outcome::ALL.into_iter().rev().filter(|outcome| lines.iter().all(|line| line.counts.get(*outcome) == 0));
    let zero: Vec<&str> = zero.map(Outcome::word).collect();
    let hidden = terminal_width().and_then(|width| fit(&mut table, width, &zero)).unwrap_or_default();
    let _ = writeln!(out, "{table}");
    if !hidden.is_empty() {
        let _ = writeln!(out, " (all zero: {})", hidden.join(", "));
    }
}

fn pass_rate(line: &PropertyLine) -> String {
    line.rate.as_ref().map_or_else(|| "none decided".to_owned(), Proportion::to_string)
}

fn scores(out: &mut String, summary: &CampaignSummary) {
    let score = |value: Option<f64>| value.map_or_else(|| "none".to_owned(), |value| format!("{value:.4}"));
    let broken = summary.runs.len() - summary.runs.iter().filter(|run| run.reason.is_none()).count();
    let _ = writeln!(
        out,
        "T = {} over {} runs (without broken runs {}); {} did not complete; {} scenes discarded",
        score(summary.total_score()),
        summary.runs.len(),
        score(summary.total_score_without_broken()),
        broken,
        summary.discards,
    );
    if let Some(rate) = summary.pass_rate() {
        let _ = writeln!(out, "runs in which everything passed: {}", rate);
    }
    if let Some(ended) = &summary.ended_by {
        let _ = writeln!(
            out,
            "ended after {} of at most {} runs: {}",
            summary.runs.len(),
            summary.planned,
            ended.description
        );
    }
    if summary.interrupted {
        let _ = writeln!(
            out,
            "stopped early: {} of {} planned runs; all of these are in the history",
            summary.runs.len(),
            summary.planned
        );
    }
    let _ = writeln!(out, "campaign {} in {}", summary.campaign, summary.history);
}

/// Writes which properties fail together, and how often.
fn failure_modes(out: &mut String, summary: &CampaignSummary) {
    let modes = summary.failure_modes.iter().filter(|mode| !mode.failed.is_empty());
    for mode in modes {
        let failed: Vec<&str> = mode.failed.iter().map(|iri| names::local(iri)).collect();
        let example = mode.runs.first().map_or("", String::as_str);
        let (rate, low, high) = (mode.share.rate * 100.0, mode.share.low * 100.0, mode.share.high * 100.0);
        let _ = writeln!(
            out,
            "  {rate:.0} % [{low:.0}–{high:.0}] of the runs ({}, such as {example}) fail {}",
            mode.runs.len(),
            failed.join(" + ")
        );
    }
}

/// Writes warnings about properties whose outcomes may be misleading.
fn remarks(out: &mut String, summary: &CampaignSummary) {
    if summary.privileged {
        let _ = writeln!(out, "note: {}", SkillRecord::PRIVILEGED);
    }
    for remark in summary.remarks() {
        let severity = if remark.warning { "warning" } else { "note" };
        let _ = writeln!(out, "{severity}: {}", summary.remark_text(&remark));
    }
}

fn failures(out: &mut String, summary: &CampaignSummary) {
    let shown: Vec<&RunSummary> = summary.runs.iter().filter(|run| run.failed() || run.reason.is_some()).collect();
    for run in shown.iter().take(FAILURES_SHOWN) {
        let _ = writeln!(out, "\n{} ({})", run.id, run.test);
        if let Some(reason) = &run.reason {
            let _ = writeln!(out, "  {}: {reason}", run.status.word());
        }
        for action in &run.actions {
            for judgement in action.judgements.iter().filter(|j| j.outcome == Outcome::Failed) {
                let property = summary.properties.iter().find(|(iri, ..)| *iri == judgement.property);
                let label = property.map_or(judgement.property.as_str(), |(_, label, _)| label.as_str());
                let _ = writeln!(out, "  {} failed: {label}: {}", action.name, judgement.witness);
            }
        }
        let _ = writeln!(out, "  more: {} show {} --history {}", summary.program, run.id, summary.history);
    }
    if shown.len() > FAILURES_SHOWN {
        let _ = writeln!(
            out,
            "\n{} more runs did not pass: {} list --history {}",
            shown.len() - FAILURES_SHOWN,
            summary.program,
            summary.history
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::summary::campaign_samples::{campaign, run};
    use actcheck_history::RunStatus;

    #[test]
    fn a_failed_property_is_described_with_a_command_for_details() {
        let summary = campaign(vec![
            run(0, RunStatus::Completed, &[Outcome::Passed, Outcome::Failed]),
            run(1, RunStatus::Broken, &[Outcome::Broken, Outcome::Broken]),
        ]);
        let text = campaign_text(&summary, false);
        assert!(text.contains("Pick failed: property 1: glass_1 moved 0.4 cm, needs more than 2 cm"), "{text}");
        assert!(text.contains("actcheck show k7f3-1 --history configs/.actcheck"), "{text}");
        assert!(text.contains("T = 0.2500 over 2 runs (without broken runs 0.5000); 1 did not complete"), "{text}");
        assert!(text.contains("broken: body left the world"), "{text}");
        assert!(!text.contains('\u{1b}'), "no colours unless requested");
    }
}
