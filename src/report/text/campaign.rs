//! A campaign's summary for the terminal.

use std::fmt::Write as _;

use comfy_table::{Attribute, Cell, Color, Table};

use crate::text::repeated::repeated_text;
use crate::text::weighted::weighted_text;
use crate::text::{Page, by_action, command, fit, fitted, regressions_text, ruled};
use crate::{CampaignSummary, PropertyLine, Proportion, RateBounds, RunSummary};
use actcheck_analysis::Sampling;
use actcheck_base::{Judgement, Outcome, ShellLine, names};
use actcheck_history::{RunStatus, SkillRecord};

/// Maximum number of rows in the table of runs. The text names the command that lists the rest.
const RUNS_SHOWN: usize = 40;
/// Maximum number of kinds of failures that are described.
const KINDS_SHOWN: usize = 6;
/// Maximum number of runs of the most frequent kind of failure that are described; of the others,
/// one.
const RUNS_OF_A_KIND: usize = 3;

/// Formats the pass rates of the properties, the scores, and the kinds of failures with examples.
pub fn campaign_text(summary: &CampaignSummary, page: Page) -> String {
    let mut out = regressions(summary);
    if by_action::has_several_actions(summary) {
        out.push_str(&by_action::scores_table(summary, &[], page));
        out.push('\n');
    }
    tables(&mut out, summary, page);
    scores(&mut out, summary);
    out.push_str(&failures_text(summary));
    remarks(&mut out, summary);
    page.set(&out)
}

/// As [`campaign_text`], with a table of the runs. Failures are only counted: they were printed when
/// they happened.
pub fn campaign_runs_text(summary: &CampaignSummary, page: Page) -> String {
    let mut out = regressions(summary);
    runs_table(&mut out, summary, page);
    out.push('\n');
    tables(&mut out, summary, page);
    scores(&mut out, summary);
    for kind in kinds(summary) {
        let _ = writeln!(out, "{}", kind.title(summary));
    }
    remarks(&mut out, summary);
    page.set(&out)
}

/// Formats only the result: scores, and the kinds of failures with examples.
pub fn campaign_result_text(summary: &CampaignSummary, page: Page) -> String {
    let mut out = regressions_text(&summary.regressions);
    scores(&mut out, summary);
    out.push_str(&failures_text(summary));
    page.set(&out)
}

fn regressions(summary: &CampaignSummary) -> String {
    let mut out = regressions_text(&summary.regressions);
    if !out.is_empty() {
        out.push('\n');
    }
    out
}

/// The tables of properties and of repeated or weighted scenes.
fn tables(out: &mut String, summary: &CampaignSummary, page: Page) {
    out.push_str(&properties_text(summary, page));
    out.push('\n');
    repeated_text(out, summary, page);
    weighted_text(out, summary, page);
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
    let of = |count: usize| match count {
        1 => "1 run".to_owned(),
        count => format!("{count} runs"),
    };
    if let Some(rate) = summary.pass_rate() {
        let _ = writeln!(out, "runs in which everything passed: {rate}");
    }
    let score = |value: f64| format!("{value:.2}");
    let total = summary.total_score();
    let _ = write!(
        out,
        "score T = {} over {}",
        total.map_or_else(|| "none".to_owned(), score),
        of(summary.runs.len())
    );
    let spoilt = summary
        .runs
        .iter()
        .filter(|run| run.reason.is_some())
        .count();
    let whole = summary.total_score_without_broken();
    if let Some(whole) = whole.filter(|whole| Some(*whole) != total) {
        let _ = write!(out, ", {} without broken runs", score(whole));
    }
    if spoilt > 0 {
        let _ = write!(out, "; {} did not complete", of(spoilt));
    }
    match summary.discards {
        0 => {}
        1 => out.push_str("; 1 scene discarded"),
        several => {
            let _ = write!(out, "; {several} scenes discarded");
        }
    }
    let _ = writeln!(
        out,
        "; campaign {} in {}",
        summary.campaign, summary.history
    );
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
            "stopped early: {} of {} planned runs, which are in the history; the others: {}",
            summary.runs.len(),
            summary.planned,
            command(&summary.resume())
        );
    }
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

/// Runs that failed in the same properties, or did not complete for the same reason.
struct Kind<'a> {
    /// IRIs of the failed properties, sorted; empty if none failed.
    failed: Vec<&'a str>,
    runs: Vec<&'a RunSummary>,
}

/// The kinds of failures: most frequent first, then in the order of their first runs.
fn kinds(summary: &CampaignSummary) -> Vec<Kind<'_>> {
    let mut kinds: Vec<(String, Kind<'_>)> = Vec::new();
    for run in &summary.runs {
        if !run.failed() && run.reason.is_none() {
            continue;
        }
        let mut failed: Vec<&str> = failed_of(run)
            .map(|(_, judgement)| judgement.property.as_str())
            .collect();
        failed.sort_unstable();
        failed.dedup();
        // Reasons that differ only in numbers, such as times, are the same kind.
        let reason = run.reason.as_deref().unwrap_or_default();
        let reason = reason.chars().filter(|letter| !letter.is_ascii_digit());
        let key = format!("{}\n{}", failed.join(" "), reason.collect::<String>());
        match kinds.iter_mut().find(|(known, _)| *known == key) {
            Some((_, kind)) => kind.runs.push(run),
            None => kinds.push((
                key,
                Kind {
                    failed,
                    runs: vec![run],
                },
            )),
        }
    }
    kinds.sort_by_key(|(_, kind)| std::cmp::Reverse(kind.runs.len()));
    kinds.into_iter().map(|(_, kind)| kind).collect()
}

fn failed_of(run: &RunSummary) -> impl Iterator<Item = (&str, &Judgement)> {
    run.actions.iter().flat_map(|action| {
        let failed = action.judgements.iter();
        failed
            .filter(|judgement| judgement.outcome == Outcome::Failed)
            .map(move |judgement| (action.name.as_str(), judgement))
    })
}

/// How a run ended that did not complete.
fn ended(status: RunStatus) -> &'static str {
    match status {
        RunStatus::Timeout => "timed out",
        other => other.word(),
    }
}

impl Kind<'_> {
    /// `3 runs (20 % [7–45]) fail CloseObject + MovedObject`
    fn title(&self, summary: &CampaignSummary) -> String {
        let count = self.runs.len();
        let runs = if count == 1 { "run" } else { "runs" };
        let spoilt = self.runs.iter().find(|run| run.reason.is_some());
        let words = match (spoilt, self.failed.is_empty()) {
            (Some(run), true) => return format!("{count} {runs} {}", ended(run.status)),
            (Some(run), false) => format!("{} and ", ended(run.status)),
            (None, _) => String::new(),
        };
        let mode = summary.failure_modes.iter().find(|mode| {
            mode.failed.len() == self.failed.len()
                && self
                    .failed
                    .iter()
                    .all(|iri| mode.failed.iter().any(|of| of == iri))
        });
        let share = mode
            .filter(|_| spoilt.is_none())
            .map_or_else(String::new, |mode| {
                let (low, high) = (mode.share.low * 100.0, mode.share.high * 100.0);
                match summary.mode_share(mode).rate {
                    Some(rate) => format!(" ({:.0} % [{low:.0}–{high:.0}])", rate * 100.0),
                    None => format!(" ([{low:.0}–{high:.0} %])"),
                }
            });
        let fail = if count == 1 { "fails" } else { "fail" };
        let names: Vec<&str> = self.failed.iter().map(|iri| names::local(iri)).collect();
        format!("{count} {runs}{share} {words}{fail} {}", names.join(" + "))
    }
}

/// Longest reason of a failure in a list; of a longer one, only the first part is printed. Unit:
/// characters.
const LONGEST_REASON: usize = 90;

/// The first part of a reason that is too long for a list.
pub fn shortened(reason: &str) -> String {
    let too_long = reason.chars().count() > LONGEST_REASON;
    match reason.split_once("; ").filter(|_| too_long) {
        Some((first, _)) => format!("{first}; …"),
        None => reason.to_owned(),
    }
}

/// The kinds of failures, each with the first reasons of its first runs, and the command for more.
fn failures_text(summary: &CampaignSummary) -> String {
    let mut out = String::new();
    let kinds = kinds(summary);
    let several = by_action::has_several_actions(summary);
    let shown_of = |number: usize| if number == 0 { RUNS_OF_A_KIND } else { 1 };
    for (number, kind) in kinds.iter().take(KINDS_SHOWN).enumerate() {
        if number == 0 {
            out.push('\n');
        }
        let _ = writeln!(out, "{}:", kind.title(summary));
        for run in kind.runs.iter().take(shown_of(number)) {
            let reason = match (&run.reason, failed_of(run).next()) {
                (Some(reason), _) => reason.clone(),
                (None, Some((action, judgement))) => {
                    let action = if several {
                        format!("{action}: ")
                    } else {
                        String::new()
                    };
                    format!("{action}{}", shortened(&judgement.witness))
                }
                (None, None) => String::new(),
            };
            let _ = writeln!(out, "  {}  {reason}", run.id);
        }
    }
    if kinds.len() > KINDS_SHOWN {
        let more: usize = kinds[KINDS_SHOWN..]
            .iter()
            .map(|kind| kind.runs.len())
            .sum();
        let _ = writeln!(out, "{more} runs failed in other ways");
    }
    let Some(first) = kinds.first().and_then(|kind| kind.runs.first()) else {
        return out;
    };
    let show = ShellLine::new(&summary.program)
        .fixed("show")
        .word(&first.id)
        .option("--history", &summary.history);
    let _ = writeln!(out, "more: {}", command(&show));
    let shown: usize = kinds
        .iter()
        .take(KINDS_SHOWN)
        .enumerate()
        .map(|(number, kind)| kind.runs.len().min(shown_of(number)))
        .sum();
    if shown < kinds.iter().map(|kind| kind.runs.len()).sum() {
        let _ = writeln!(out, "all of them: {}", command(&summary.failed_runs()));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::summary::campaign_samples::{campaign, run};

    #[test]
    fn a_failed_property_is_described_with_a_command_for_details() {
        let summary = campaign(vec![
            run(0, RunStatus::Completed, &[Outcome::Passed, Outcome::Failed]),
            run(1, RunStatus::Broken, &[Outcome::Broken, Outcome::Broken]),
        ]);
        let text = campaign_text(&summary, Page::default());
        assert!(
            text.contains("fails P1:\n  k7f3-1  glass_1 moved 0.4 cm, needs more than 2 cm"),
            "{text}"
        );
        assert!(
            text.contains("actcheck show k7f3-1 --history configs/.actcheck"),
            "{text}"
        );
        assert!(
            text.contains(
                "score T = 0.25 over 2 runs, 0.50 without broken runs; 1 run did not complete"
            ),
            "{text}"
        );
        assert!(
            text.contains("1 run broken:\n  k7f3-2  body left the world"),
            "{text}"
        );
        assert!(!text.contains('\u{1b}'), "no colours unless requested");
    }
}
