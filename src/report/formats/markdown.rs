//! Formats a summary in Markdown, for comments on pull requests.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use quick_xml::escape::partial_escape;

use crate::{Proportion, RateBounds};
use actcheck_analysis::Sampling;
use actcheck_base::{Judgement, Outcome, names};
use actcheck_history::{CampaignRow, RunDetail, RunStatus, SkillRecord};
use actcheck_verdict::Counts;

/// Maximum number of failed runs that are listed; the rest are counted.
const MOST_FAILURES: usize = 10;

/// Collects the data of the summary, run by run.
#[derive(Debug, Clone, Default)]
pub struct MarkdownReport {
    counts: Counts,
    /// Outcome counts by action and property, in the order of the actions.
    properties: Vec<((String, String), Counts)>,
    campaigns: Vec<String>,
    statuses: BTreeMap<RunStatus, u64>,
    scores: Vec<f64>,
    passed_runs: u64,
    failures: Vec<String>,
    failed_runs: u64,
    twins: u64,
    privileged: Vec<String>,
    sampling: Sampling,
}

impl MarkdownReport {
    /// Creates an empty summary.
    pub fn new() -> Self {
        Self::default()
    }

    /// Records which campaigns had a skill program that received ground truth, and whether outcomes
    /// ended one.
    pub fn know(&mut self, campaigns: &[CampaignRow]) {
        let privileged = campaigns
            .iter()
            .filter(|row| row.skill.as_ref().is_some_and(|skill| skill.privileged));
        self.privileged = privileged.map(|row| row.id.clone()).collect();
        let of = campaigns
            .iter()
            .map(|row| Sampling::of(row.ended_by.as_deref(), row.interrupted));
        self.sampling = of.fold(Sampling::Fixed, Sampling::and);
    }

    /// Counts a run that a later run repeats bit for bit: it does not count otherwise.
    pub fn add_twin(&mut self, run: &RunDetail) {
        self.add_campaign(run);
        self.twins += 1;
    }

    fn add_campaign(&mut self, run: &RunDetail) {
        if !self.campaigns.contains(&run.row.campaign) {
            self.campaigns.push(run.row.campaign.clone());
        }
    }

    /// Adds a run.
    pub fn add(&mut self, run: &RunDetail) {
        self.add_campaign(run);
        *self.statuses.entry(run.row.status).or_default() += 1;
        self.scores.push(run.row.score);
        let mut of_run = Counts::default();
        for action in &run.actions {
            for judgement in &action.judgements {
                of_run.add(judgement.outcome);
                self.property(
                    names::local(&action.action),
                    names::local(&judgement.property),
                )
                .add(judgement.outcome);
            }
        }
        self.counts.add_all(of_run);
        self.passed_runs +=
            u64::from(of_run.passed > 0 && of_run.passed + of_run.inapplicable == of_run.total());
        if of_run.failed > 0 {
            self.failed_runs += 1;
            if self.failures.len() < MOST_FAILURES {
                self.failures.push(failure(run));
            }
        }
    }

    fn property(&mut self, action: &str, property: &str) -> &mut Counts {
        let known = self
            .properties
            .iter()
            .position(|((a, p), _)| a == action && p == property);
        let at = known.unwrap_or_else(|| {
            self.properties
                .push(((action.to_owned(), property.to_owned()), Counts::default()));
            self.properties.len() - 1
        });
        &mut self.properties[at].1
    }
}

/// Formats the summary: counts, then properties with intervals, then the first failures.
pub fn markdown(report: &MarkdownReport) -> String {
    let runs = report.scores.len() as u64;
    let mut out = format!("## {}\n\n", headline(report));
    let _ = writeln!(
        out,
        "{runs} {} of {} {}: {}. Outcomes: {}.",
        plural(runs, "run", "runs"),
        plural(report.campaigns.len() as u64, "campaign", "campaigns"),
        report
            .campaigns
            .iter()
            .map(|id| code(id))
            .collect::<Vec<String>>()
            .join(", "),
        listed(
            report
                .statuses
                .iter()
                .map(|(status, count)| (status.word(), *count))
        ),
        listed(Outcome::ALL.map(|outcome| (outcome.word(), report.counts.get(outcome)))),
    );
    if report.twins > 0 {
        let (more, are) = (
            plural(report.twins, "more run is a", "more runs are"),
            plural(report.twins, "", "s"),
        );
        let _ = writeln!(
            out,
            "\n{} {more} bit-for-bit duplicate{are} of a later one: each trace counts once.",
            report.twins
        );
    }
    if runs > 0 {
        let mean = report.scores.iter().sum::<f64>() / runs as f64;
        let _ = writeln!(
            out,
            "\nT = {mean:.4}; runs in which everything passed: {}.",
            rate(report.passed_runs, runs, report.sampling)
        );
        let lost: u64 = report
            .statuses
            .iter()
            .filter(|(status, _)| **status != RunStatus::Completed)
            .map(|(_, n)| *n)
            .sum();
        let lost = lost.min(runs.saturating_sub(report.passed_runs + report.failed_runs));
        if let Some(bounds) =
            RateBounds::new(report.passed_runs, runs - lost, lost, report.sampling)
        {
            let _ = writeln!(
                out,
                "\n{lost} of {runs} runs were lost (broken or timed out): counted as failures, the rate is {}; counted as passes, {}.",
                bounds.as_failures, bounds.as_passes
            );
        }
    }
    if report.sampling == Sampling::Stopped {
        out.push_str(
            "\nOutcomes ended a campaign: its shares are biased and left out; intervals are valid for that.\n",
        );
    }
    for campaign in &report.privileged {
        let _ = writeln!(out, "\nIn {}, {}.", code(campaign), SkillRecord::PRIVILEGED);
    }
    if !report.properties.is_empty() {
        out.push_str("\n| action | property | pass rate [95 % interval] |");
        Outcome::ALL
            .iter()
            .for_each(|outcome| out.push_str(&format!(" {} |", outcome.word())));
        out.push_str("\n| --- | --- | --- |");
        out.push_str(&" ---: |".repeat(Outcome::ALL.len()));
        out.push('\n');
    }
    for ((action, property), counts) in &report.properties {
        let decided = counts.decided();
        let _ = write!(
            out,
            "| {} | {} | {} |",
            plain(action),
            plain(property),
            rate(counts.passed, decided, report.sampling)
        );
        Outcome::ALL
            .iter()
            .for_each(|outcome| out.push_str(&format!(" {} |", counts.get(*outcome))));
        out.push('\n');
    }
    failures(report, &mut out);
    out
}

fn headline(report: &MarkdownReport) -> String {
    let counts = report.counts;
    match (counts.failed, counts.broken + counts.timeout, counts.passed) {
        (0, 0, 0) => "actcheck: nothing was judged".to_owned(),
        (0, 0, _) => "actcheck: no property failed".to_owned(),
        (0, unknown, _) => format!("actcheck: no property failed, {unknown} could not be judged"),
        (failed, _, _) => {
            let runs = report.scores.len() as u64;
            let failures = plural(failed, "failure", "failures");
            format!(
                "actcheck: {failed} {failures} in {} of {runs} {}",
                report.failed_runs,
                plural(runs, "run", "runs")
            )
        }
    }
}

fn failures(report: &MarkdownReport, out: &mut String) {
    if report.failures.is_empty() {
        return;
    }
    out.push_str("\n<details><summary>What failed</summary>\n\n");
    report
        .failures
        .iter()
        .for_each(|failure| out.push_str(failure));
    let left_out = report.failed_runs - report.failures.len() as u64;
    if left_out > 0 {
        let _ = writeln!(out, "- {left_out} more {}", plural(left_out, "run", "runs"));
    }
    out.push_str("\n</details>\n");
}

fn failure(run: &RunDetail) -> String {
    let mut out = format!("- {} ({})\n", code(&run.row.run), plain(&run.row.test));
    for action in &run.actions {
        for judgement in action
            .judgements
            .iter()
            .filter(|judgement| judgement.outcome == Outcome::Failed)
        {
            let Judgement {
                property, witness, ..
            } = judgement;
            let (action, property) = (names::local(&action.action), names::local(property));
            let _ = writeln!(
                out,
                "  - {} **{}**: {}",
                plain(action),
                plain(property),
                plain(witness)
            );
        }
    }
    out
}

fn rate(passed: u64, of: u64, sampling: Sampling) -> String {
    Proportion::sampled(passed, of, sampling).map_or_else(
        || "nothing was decided".to_owned(),
        |share| share.to_string(),
    )
}

fn listed<'a>(counts: impl IntoIterator<Item = (&'a str, u64)>) -> String {
    counts
        .into_iter()
        .map(|(word, count)| format!("{count} {word}"))
        .collect::<Vec<String>>()
        .join(", ")
}

fn plural<'a>(count: u64, one: &'a str, several: &'a str) -> &'a str {
    if count == 1 { one } else { several }
}

/// Escapes text as a single line without markup, also inside tables.
pub fn plain(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for letter in partial_escape(text).chars() {
        match letter {
            // Otherwise, the forge would notify the user named after it.
            '@' => out.push_str("&#64;"),
            '\\' | '`' | '*' | '_' | '[' | ']' | '|' | '#' | '~' | '!' => {
                out.push('\\');
                out.push(letter);
            }
            letter if letter.is_control() => out.push(' '),
            letter => out.push(letter),
        }
    }
    out
}

/// Formats an id as inline code.
pub(super) fn code(id: &str) -> String {
    format!("`{}`", id.replace('`', "'"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn witnesses_are_escaped() {
        assert_eq!(
            plain("a|b\n<img> @all [x](y) *z*"),
            "a\\|b &lt;img&gt; &#64;all \\[x\\](y) \\*z\\*"
        );
    }

    #[test]
    fn an_empty_report_is_not_a_success() {
        assert!(markdown(&MarkdownReport::new()).starts_with("## actcheck: nothing was judged"));
    }
}
