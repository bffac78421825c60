//! The changes that a recheck made for the terminal.

use std::fmt::Write as _;

use crate::summary::reason_text;
use crate::text::{Page, fitted, ruled};
use crate::{RecheckChange, RecheckSummary};
use actcheck_base::{Outcome, names};
use actcheck_verdict::Counts;

/// Maximum number of changes printed at a terminal; `--format csv` has all.
const MAX_LISTED: usize = 20;

/// Formats the counts of each property before and now, and the outcomes that changed.
pub fn recheck_text(summary: &RecheckSummary, page: Page) -> String {
    let mut out = String::new();
    let mut table = ruled();
    table.set_header(["property", "before", "now", "changed", "new"]);
    for (iri, line) in &summary.properties {
        table.add_row([
            names::local(iri).to_owned(),
            counted(line.before),
            with_vacuous(counted(line.now), line.vacuous),
            line.changed.to_string(),
            line.new.to_string(),
        ]);
    }
    let restated: u64 = summary.properties.values().map(|line| line.restated).sum();
    let _ = writeln!(
        out,
        "{}\n{}",
        fitted(table, page, &["new"]),
        totals(summary, restated)
    );
    held_before(&mut out, summary);
    changes(&mut out, summary);
    page.set(&out)
}

/// Adds how many passes say nothing.
fn with_vacuous(counts: String, vacuous: u64) -> String {
    if vacuous > 0 {
        format!("{counts}; {vacuous} vacuously")
    } else {
        counts
    }
}

fn totals(summary: &RecheckSummary, restated: u64) -> String {
    let changed: u64 = summary.properties.values().map(|line| line.changed).sum();
    let new: u64 = summary.properties.values().map(|line| line.new).sum();
    let mut text = format!(
        "{} judged again: {changed} outcomes changed, {new} new",
        runs(summary.runs)
    );
    if restated > 0 {
        let _ = write!(
            text,
            ", {restated} unchanged with a different rule, margin or witness"
        );
    }
    text
}

/// Names the properties that already held before actions that passed them: such passes say nothing
/// about the action.
fn held_before(out: &mut String, summary: &RecheckSummary) {
    for (iri, line) in summary
        .properties
        .iter()
        .filter(|(_, line)| line.held_before > 0)
    {
        let _ = writeln!(
            out,
            "{} already held before the action in {} of {} passes, which say nothing about the action",
            names::local(iri),
            line.held_before,
            line.now.passed
        );
    }
}

fn runs(count: u64) -> String {
    if count == 1 {
        "1 run".to_owned()
    } else {
        format!("{count} runs")
    }
}

/// Writes changed outcomes, then new outcomes that failed; other new outcomes are omitted.
fn changes(out: &mut String, summary: &RecheckSummary) {
    let (changed, new): (Vec<&RecheckChange>, Vec<&RecheckChange>) = summary
        .changes
        .iter()
        .partition(|change| change.before.is_some());
    let failed: Vec<&RecheckChange> = new
        .into_iter()
        .filter(|change| change.now.outcome == Outcome::Failed)
        .collect();
    for change in changed.iter().chain(&failed).take(MAX_LISTED) {
        let before = change.before.map_or("new", |(outcome, _)| outcome.word());
        let _ = writeln!(
            out,
            "  {} {}, {}: {before} → {} ({}{}); {}",
            change.run,
            names::local(&change.action),
            names::local(&change.now.property),
            change.now.outcome,
            reason_text(&change.why, 8),
            margins(change),
            change.now.witness
        );
    }
    let left_out = (changed.len() + failed.len()).saturating_sub(MAX_LISTED);
    if left_out > 0 {
        let _ = writeln!(out, "  {left_out} more: --format csv lists every one");
    }
}

fn margins(change: &RecheckChange) -> String {
    let number =
        |margin: Option<f64>| margin.map_or("none".to_owned(), |margin| format!("{margin:.4}"));
    match (change.before, change.now.margin) {
        (Some((_, None)) | None, None) => String::new(),
        (Some((_, before)), now) => format!(", margin {} → {}", number(before), number(now)),
        (None, now) => format!(", margin {}", number(now)),
    }
}

/// Lists the outcomes that occurred, with their counts.
fn counted(counts: Counts) -> String {
    let words: Vec<String> = Outcome::ALL
        .into_iter()
        .filter(|outcome| counts.get(*outcome) > 0)
        .map(|outcome| format!("{} {outcome}", counts.get(outcome)))
        .collect();
    if words.is_empty() {
        "none".to_owned()
    } else {
        words.join(", ")
    }
}
