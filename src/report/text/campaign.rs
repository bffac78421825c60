//! A campaign's summary for the terminal.

use std::fmt::Write as _;

use comfy_table::{Attribute, Cell, Color, Table};

use crate::text::repeated::repeated_text;
use crate::text::weighted::weighted_text;
use crate::text::{Page, by_action, command, fit, fitted, regressions_text, ruled};
use crate::{CampaignSummary, PropertyLine, Proportion, RateBounds, RunSummary};
use actcheck_analysis::Sampling;
use actcheck_base::{Outcome, ShellLine, names};
use actcheck_history::SkillRecord;

/// Maximum number of rows in the table of runs. The text names the command that lists the rest.
const RUNS_SHOWN: usize = 40;
/// Maximum number of failed runs that are described in words.
const FAILURES_SHOWN: usize = 20;

/// Formats the table of runs × properties, the scores, and the witness of each failed property.
pub fn campaign_text(summary: &CampaignSummary, page: Page) -> String {
    let mut out = regressions_text(&summary.regressions);
    if !out.is_empty() {
        out.push('\n');
    }
    runs_table(&mut out, summary, page);
    out.push('\n');
    out.push_str(&properties_text(summary, page));
    out.push('\n');
    repeated_text(&mut out, summary, page);
    weighted_text(&mut out, summary, page);
    scores(&mut out, summary);
    failure_modes(&mut out, summary);
    remarks(&mut out, summary);
    failures(&mut out, summary);
    page.set(&out)
}

/// Formats only the result: scores, which properties fail together, and the witness of each failed
/// property.
pub fn campaign_result_text(summary: &CampaignSummary, page: Page) -> String {
    let mut out = regressions_text(&summary.regressions);
    scores(&mut out, summary);
    failure_modes(&mut out, summary);
    failures(&mut out, summary);
    page.set(&out)
}

fn runs_table(out: &mut String, summary: &CampaignSummary, page: Page) {
    if summary.runs.is_empty() {
        return;
    }
    // All runs if they fit; otherwise the runs that did not pass, which are of most interest.
    let fit = summary.runs.len() <= RUNS_SHOWN;
    let shown: Vec<&RunSummary> = summary
        .runs
        .iter()
        .filter(|run| fit || !run.passed())
        .take(RUNS_SHOWN)
        .collect();
    let several = by_action::has_several_actions(summary);
    out.push_str(&if several {
        by_action::scores_table
    } else {
        outcomes_table
    }(summary, &shown, page));
    let left_out = summary.runs.len() - shown.len();
    if left_out > 0 {
        let passed = summary.runs.iter().filter(|run| run.passed()).count();
        let more = command(&summary.all_runs());
        let _ = writeln!(out, "{left_out} more runs ({passed} of all passed): {more}");
    }
}

/// Outcomes of the shown runs, for tests with a single action.
fn outcomes_table(summary: &CampaignSummary, shown: &[&RunSummary], page: Page) -> String {
    let mut table = ruled();
    let labels = summary.properties.iter().map(|(_, label, _)| label.clone());
    table.set_header(
        ["run".to_owned(), "test".to_owned()]
            .into_iter()
            .chain(labels)
            .chain(["S".to_owned()]),
    );
    for run in shown {
        let mut row = vec![Cell::new(&run.id), Cell::new(&run.test)];
        row.extend(
            summary
                .properties
                .iter()
                .map(|(iri, ..)| outcomes_cell(run, iri)),
        );
        row.push(Cell::new(format!("{:.2}", run.score)));
        table.add_row(row);
    }
    match fit(&mut table, page, &["test"]) {
        Some(_) => format!("{table}\n"),
        None => fitted(narrow_outcomes(summary, shown), page, &["test", "S"]),
    }
}

/// As [`outcomes_table`], but names the properties of each outcome instead of a column for each
/// property.
fn narrow_outcomes(summary: &CampaignSummary, shown: &[&RunSummary]) -> Table {
    let mut table = ruled();
    table.set_header(["run", "test", "outcomes", "S"]);
    for run in shown {
        let judged = || run.actions.iter().flat_map(|action| &action.judgements);
        let label = |iri: &str| {
            summary
                .properties
                .iter()
                .find(|(known, ..)| known == iri)
                .map(|(_, label, _)| label)
        };
        let of = |outcome: Outcome| {
            let of = judged().filter(|judgement| judgement.outcome == outcome);
            let names: Vec<&str> = of
                .filter_map(|judgement| label(&judgement.property))
                .map(String::as_str)
                .collect();
            (!names.is_empty()).then(|| format!("{outcome}: {}", names.join(", ")))
        };
        let others: Vec<String> = Outcome::ALL
            .into_iter()
            .filter(|one| *one != Outcome::Passed)
            .filter_map(of)
            .collect();
        let outcomes = if others.is_empty() {
            "all passed".to_owned()
        } else {
            others.join("; ")
        };
        let colour = if run.passed() {
            Color::Green
        } else if run.failed() {
            Color::Red
        } else {
            Color::Yellow
        };
        let score = Cell::new(format!("{:.2}", run.score));
        table.add_row([
            Cell::new(&run.id),
            Cell::new(&run.test),
            Cell::new(outcomes).fg(colour),
            score,
        ]);
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
    let worst = outcomes
        .iter()
        .copied()
        .max_by_key(|outcome| match outcome {
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

/// Formats the pass rate of each property. A narrow page leaves out counts: first those that are
/// all zero, then those that the rate has too.
fn properties_text(summary: &CampaignSummary, page: Page) -> String {
    let lines = summary.property_lines();
    let is_zero = |outcome: &Outcome| lines.iter().all(|line| line.counts.get(*outcome) == 0);
    let (zero, other): (Vec<Outcome>, Vec<Outcome>) =
        Outcome::ALL.into_iter().rev().partition(is_zero);
    let (zero, other) = (
        zero.into_iter().map(Outcome::word),
        other.into_iter().rev().map(Outcome::word),
    );
    let expendable: Vec<&str> = zero.clone().chain(other).collect();
    let by_action = by_action::has_several_actions(summary);
    let mut table = if by_action {
        by_action::properties_table(summary, pass_rate)
    } else {
        properties_table(summary)
    };
    let Some(hidden) = fit(&mut table, page, &expendable) else {
        return fitted(table, page, &[]);
    };
    let mut out = format!("{table}\n");
    let (empty, left_out): (Vec<&str>, Vec<&str>) = hidden
        .iter()
        .map(String::as_str)
        .partition(|name| zero.clone().any(|word| word == *name));
    for (title, names) in [("all zero", empty), ("not shown at this width", left_out)] {
        if !names.is_empty() {
            let _ = writeln!(out, " ({title}: {})", names.join(", "));
        }
    }
    out
}

fn properties_table(summary: &CampaignSummary) -> Table {
    let mut table = ruled();
    let counted = Outcome::ALL.map(|outcome| outcome.word().to_owned());
    table.set_header(
        [
            "property".to_owned(),
            "pass rate [95 % interval]".to_owned(),
        ]
        .into_iter()
        .chain(counted),
    );
    for line in summary.property_lines() {
        let rate = pass_rate(&line);
        let counts = Outcome::ALL.map(|outcome| line.counts.get(outcome).to_string());
        table.add_row([line.label, rate].into_iter().chain(counts));
    }
    table
}

fn pass_rate(line: &PropertyLine) -> String {
    let rate = line
        .rate
        .as_ref()
        .map_or_else(|| "none decided".to_owned(), Proportion::to_string);
    let bounds = line.bounds.map_or_else(String::new, |bounds| {
        let [low, high] = bounds.ends().map(|end| end * 100.0);
        format!("; {low:.0} to {high:.0} % with {} lost", bounds.lost)
    });
    let vacuous = if line.vacuous > 0 {
        format!("; {} vacuously", line.vacuous)
    } else {
        String::new()
    };
    rate + &bounds + &vacuous
}

fn scores(out: &mut String, summary: &CampaignSummary) {
    let score =
        |value: Option<f64>| value.map_or_else(|| "none".to_owned(), |value| format!("{value:.4}"));
    let broken = summary.runs.len()
        - summary
            .runs
            .iter()
            .filter(|run| run.reason.is_none())
            .count();
    let _ = writeln!(
        out,
        "T = {} over {} (without broken runs {}); {} did not complete; {} scenes discarded",
        score(summary.total_score()),
        match summary.runs.len() {
            1 => "1 run".to_owned(),
            count => format!("{count} runs"),
        },
        score(summary.total_score_without_broken()),
        broken,
        summary.discards,
    );
    if let Some(rate) = summary.pass_rate() {
        let _ = writeln!(out, "runs in which everything passed: {}", rate);
    }
    if let Some(RateBounds {
        lost,
        as_failures,
        as_passes,
    }) = summary.pass_rate_bounds()
    {
        let _ = writeln!(
            out,
            "warning: {lost} of {} runs were lost (broken or timed out), perhaps because they would have failed: counted as \
             failures, the rate is {as_failures}; counted as passes, {as_passes}",
            summary.runs.len()
        );
    }
    out.push_str(sampling_note(summary));
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

/// Says which rates and intervals are printed if outcomes ended the campaign.
fn sampling_note(summary: &CampaignSummary) -> &'static str {
    match (summary.sampling(), summary.ended_at_failures()) {
        (Sampling::Fixed, _) => "",
        (Sampling::Stopped, Some(1)) => {
            "note: the first failure ended the campaign, so no rate can be estimated; the intervals are valid for that\n"
        }
        (Sampling::Stopped, Some(_)) => {
            "note: failures ended the campaign: rates leave out the last one, which would bias them, and intervals are valid \
             for that\n"
        }
        (Sampling::Stopped, None) => {
            "note: the campaign was stopped: intervals are wider, so that they are valid whenever one stops\n"
        }
    }
}

/// Writes which properties fail together, and how often.
fn failure_modes(out: &mut String, summary: &CampaignSummary) {
    let modes = summary
        .failure_modes
        .iter()
        .filter(|mode| !mode.failed.is_empty());
    for mode in modes {
        let failed: Vec<&str> = mode.failed.iter().map(|iri| names::local(iri)).collect();
        let example = mode.runs.first().map_or("", String::as_str);
        let (low, high) = (mode.share.low * 100.0, mode.share.high * 100.0);
        let share = match summary.mode_share(mode).rate {
            Some(rate) => format!("{:.0} % [{low:.0}–{high:.0}]", rate * 100.0),
            None => format!("[{low:.0}–{high:.0} %]"),
        };
        let _ = writeln!(
            out,
            "  {share} of the runs ({}, such as {example}) fail {}",
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
    let shown: Vec<&RunSummary> = summary
        .runs
        .iter()
        .filter(|run| run.failed() || run.reason.is_some())
        .collect();
    for run in shown.iter().take(FAILURES_SHOWN) {
        let _ = writeln!(out, "\n{} ({})", run.id, run.test);
        if let Some(reason) = &run.reason {
            let _ = writeln!(out, "  {}: {reason}", run.status.word());
        }
        for action in &run.actions {
            for judgement in action
                .judgements
                .iter()
                .filter(|j| j.outcome == Outcome::Failed)
            {
                let property = summary
                    .properties
                    .iter()
                    .find(|(iri, ..)| *iri == judgement.property);
                let label =
                    property.map_or(judgement.property.as_str(), |(_, label, _)| label.as_str());
                let _ = writeln!(
                    out,
                    "  {} failed: {label}: {}",
                    action.name, judgement.witness
                );
            }
        }
        let show = ShellLine::new(&summary.program)
            .fixed("show")
            .word(&run.id)
            .option("--history", &summary.history);
        let more = command(&show);
        let _ = writeln!(out, "  more: {more}");
    }
    if shown.len() > FAILURES_SHOWN {
        let more = command(&summary.all_runs());
        let _ = writeln!(
            out,
            "\n{} more runs did not pass: {more}",
            shown.len() - FAILURES_SHOWN
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
        let text = campaign_text(&summary, Page::default());
        assert!(
            text.contains("Pick failed: property 1: glass_1 moved 0.4 cm, needs more than 2 cm"),
            "{text}"
        );
        assert!(
            text.contains("actcheck show k7f3-1 --history configs/.actcheck"),
            "{text}"
        );
        assert!(
            text.contains(
                "T = 0.2500 over 2 runs (without broken runs 0.5000); 1 did not complete"
            ),
            "{text}"
        );
        assert!(text.contains("broken: body left the world"), "{text}");
        assert!(!text.contains('\u{1b}'), "no colours unless requested");
    }
}
