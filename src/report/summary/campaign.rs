//! The summary of a finished campaign, as plain data.

use crate::{CaseSummary, GuidedSearch};
use actcheck_analysis::{FailureMode, Interval, Sampling, passes_until_failures};
use actcheck_base::{Judgement, Outcome, ShellLine, names};
use actcheck_history::{Repetition, RunDetail, RunRecord, RunStatus};
use actcheck_verdict::{Counts, mean};

/// Summary of a campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct CampaignSummary {
    /// Its id in the history.
    pub campaign: String,
    /// Its configuration, as the user named it.
    pub config: String,
    /// Path of the history, as the user named it.
    pub history: String,
    /// How the user invoked this program; used in suggested commands.
    pub program: String,
    /// All judged properties in order: IRI, label, unit of the margin.
    pub properties: Vec<(String, String, Option<String>)>,
    /// The runs, by index.
    pub runs: Vec<RunSummary>,
    /// The guided search that chose the scenes, if any; counts of its runs are not failure rates.
    pub search: Option<GuidedSearch>,
    /// Runs that share the same set of failed properties, most frequent first.
    pub failure_modes: Vec<FailureMode>,
    /// The project's cases, which ran first. They only affect the exit code.
    pub regressions: Vec<CaseSummary>,
    /// Whether a skill program received ground truth, which a real robot does not have.
    pub privileged: bool,
    /// Number of planned runs.
    pub planned: u64,
    /// Number of scenes that could not be built and were sampled again.
    pub discards: u64,
    /// The budget that ended it. `None` if it completed its planned runs or was interrupted.
    pub ended_by: Option<EndedBy>,
    /// Whether it was interrupted.
    pub interrupted: bool,
}

/// The budget that ended a campaign.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EndedBy {
    /// `time`, `width` or `failures`.
    pub budget: &'static str,
    /// The reason in words.
    pub description: String,
}

/// Summary of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct RunSummary {
    /// Its id in the history.
    pub id: String,
    /// Position in the campaign, from 0.
    pub index: u64,
    /// Scene and repetition number, if scenes are run more than once.
    pub repetition: Option<Repetition>,
    /// Importance weight of its scene, if a search chose it.
    pub weight: Option<f64>,
    /// Names of its actions.
    pub test: String,
    /// How it ended.
    pub status: RunStatus,
    /// Why it did not complete, if it did not.
    pub reason: Option<String>,
    /// The paper's S.
    pub score: f64,
    /// Digest over all states; empty if it broke before its first state.
    pub trace_hash: String,
    /// Its actions, in order.
    pub actions: Vec<ActionSummary>,
}

/// Summary of an action.
#[derive(Debug, Clone, PartialEq)]
pub struct ActionSummary {
    /// Local name.
    pub name: String,
    /// The paper's A.
    pub score: f64,
    /// One for each property.
    pub judgements: Vec<Judgement>,
}

/// A proportion with its 95 % confidence interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Proportion {
    /// Numerator.
    pub count: u64,
    /// Denominator.
    pub of: u64,
    /// An estimate of the proportion in further runs; `None` if outcomes ended the runs and it is
    /// biased.
    pub rate: Option<f64>,
    /// The count divided by the total, and the interval.
    pub interval: Interval,
}

impl Proportion {
    /// The proportion `count` / `of` with its Wilson interval. Returns `None` if `of` is 0.
    pub fn new(count: u64, of: u64) -> Option<Self> {
        Self::sampled(count, of, Sampling::Fixed)
    }

    /// As [`Proportion::new`], with an interval that is valid for the way in which the number of
    /// runs was decided.
    pub fn sampled(count: u64, of: u64, sampling: Sampling) -> Option<Self> {
        let interval = sampling.interval(count, of)?;
        Some(Self {
            count,
            of,
            rate: (sampling == Sampling::Fixed).then_some(interval.rate),
            interval,
        })
    }
}

/// One property over all runs.
#[derive(Debug, Clone, PartialEq)]
pub struct PropertyLine {
    /// IRI.
    pub property: String,
    /// Label.
    pub label: String,
    /// Counts of all six outcomes.
    pub counts: Counts,
    /// Proportion of passed among decided outcomes, with its 95 % interval. `None` if none was
    /// decided.
    pub rate: Option<Proportion>,
    /// Number of passed outcomes whose property already held before the action.
    pub held_before: u64,
    /// Number of passed outcomes that say nothing because no left side of an `implies` held.
    pub vacuous: u64,
    /// The rate with lost outcomes counted either way, if there are many. They are broken or timed
    /// out, or untested because the run ended so.
    pub bounds: Option<RateBounds>,
}

/// From this share of lost outcomes on, a rate without them says little: the robot may crash or
/// hang where it would fail.
const MANY_LOST: f64 = 0.1;

/// The bounds of a pass rate if lost outcomes, which are neither passed nor failed, are counted
/// either way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RateBounds {
    /// Number of lost outcomes.
    pub lost: u64,
    /// The rate if all of them count as failures.
    pub as_failures: Proportion,
    /// The rate if all of them count as passes.
    pub as_passes: Proportion,
}

impl RateBounds {
    /// Returns the bounds if more than a tenth of the outcomes is lost.
    pub fn new(passed: u64, decided: u64, lost: u64, sampling: Sampling) -> Option<Self> {
        let of = decided + lost;
        if lost as f64 <= MANY_LOST * of as f64 {
            return None;
        }
        let as_failures = Proportion::sampled(passed, of, sampling)?;
        Some(Self {
            lost,
            as_failures,
            as_passes: Proportion::sampled(passed + lost, of, sampling)?,
        })
    }

    /// The lowest and the highest rate.
    pub fn ends(&self) -> [f64; 2] {
        [self.as_failures, self.as_passes].map(|end| end.interval.rate)
    }
}

impl std::fmt::Display for Proportion {
    /// Writes, for example, `80 % [55–93] (12 of 15)`, and `[55–93 %] (12 of 15)` without an
    /// estimate of the rate.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let interval = &self.interval;
        let (low, high) = (interval.low * 100.0, interval.high * 100.0);
        match self.rate {
            Some(rate) => write!(
                f,
                "{:.0} % [{low:.0}–{high:.0}] ({} of {})",
                rate * 100.0,
                self.count,
                self.of
            ),
            None => write!(f, "[{low:.0}–{high:.0} %] ({} of {})", self.count, self.of),
        }
    }
}

impl RunSummary {
    /// Summarises a record.
    pub fn of(record: &RunRecord) -> Self {
        let actions = record
            .trace
            .actions
            .iter()
            .zip(&record.judgements)
            .zip(&record.action_scores)
            .map(|((action, judgements), score)| ActionSummary {
                name: action.action.clone(),
                score: *score,
                judgements: judgements.clone(),
            })
            .collect();
        Self {
            id: record.id.clone(),
            index: record.index,
            repetition: record.repetition,
            weight: record.weight,
            test: record.test.clone(),
            status: record.status,
            reason: record.reason.clone(),
            score: record.score,
            trace_hash: record.trace.hash.clone(),
            actions,
        }
    }

    /// Summarises a run read from the history; equals the summary of its record.
    pub fn from_history(run: &RunDetail) -> Self {
        let actions = run.actions.iter().map(|action| ActionSummary {
            name: names::local(&action.action).to_owned(),
            score: action.score,
            judgements: action.judgements.clone(),
        });
        Self {
            id: run.row.run.clone(),
            index: run.row.index,
            repetition: run.row.repetition,
            weight: run.row.weight,
            test: run.row.test.clone(),
            status: run.row.status,
            reason: run.reason.clone(),
            score: run.row.score,
            trace_hash: run.row.trace_hash.clone(),
            actions: actions.collect(),
        }
    }

    /// Outcomes of all properties of all actions.
    pub fn outcomes(&self) -> impl Iterator<Item = Outcome> + '_ {
        self.actions
            .iter()
            .flat_map(|action| action.judgements.iter().map(|j| j.outcome))
    }

    /// Whether at least one property passed and all others passed or were inapplicable.
    pub fn passed(&self) -> bool {
        let counts = Counts::of(self.outcomes());
        counts.passed > 0 && counts.passed + counts.inapplicable == counts.total()
    }

    /// Whether the given property failed in any action.
    pub fn failed_property(&self, property: &str) -> bool {
        let judgements = self.actions.iter().flat_map(|action| &action.judgements);
        judgements
            .into_iter()
            .any(|judgement| judgement.property == property && judgement.outcome == Outcome::Failed)
    }

    /// Whether any property failed.
    pub fn failed(&self) -> bool {
        self.outcomes().any(|outcome| outcome == Outcome::Failed)
    }
}

impl CampaignSummary {
    /// The command that lists the runs of its history.
    pub(crate) fn all_runs(&self) -> ShellLine {
        ShellLine::new(&self.program)
            .fixed("list")
            .option("--history", &self.history)
    }

    /// The command that lists the runs that failed; all runs of the campaign if some did not
    /// complete, which `--failed` leaves out.
    pub(crate) fn failed_runs(&self) -> ShellLine {
        let spoilt = self
            .runs
            .iter()
            .any(|run| run.reason.is_some() && !run.failed());
        ShellLine::new(&self.program)
            .fixed(if spoilt { "list" } else { "list --failed" })
            .option("--campaign", &self.campaign)
            .option("--history", &self.history)
    }

    /// The command that makes the runs that an interrupted campaign lacks.
    pub(crate) fn resume(&self) -> ShellLine {
        ShellLine::new(&self.program)
            .fixed("run")
            .word(&format!("--resume={}", self.campaign))
            .option("--history", &self.history)
    }

    /// The paper's T over all runs. Returns `None` if there are no runs.
    pub fn total_score(&self) -> Option<f64> {
        mean(self.runs.iter().map(|run| run.score))
    }

    /// T over the runs that are not broken. Returns `None` if there are none.
    pub fn total_score_without_broken(&self) -> Option<f64> {
        mean(
            self.runs
                .iter()
                .filter(|run| run.status != RunStatus::Broken)
                .map(|run| run.score),
        )
    }

    /// How the number of runs was decided.
    pub fn sampling(&self) -> Sampling {
        Sampling::of(
            self.ended_by.as_ref().map(|ended| ended.budget),
            self.interrupted,
        )
    }

    /// Number of failed runs, if a number of them ended the campaign.
    pub fn ended_at_failures(&self) -> Option<u64> {
        let ended = self
            .ended_by
            .as_ref()
            .is_some_and(|ended| ended.budget == "failures");
        ended.then(|| self.runs.iter().filter(|run| run.failed()).count() as u64)
    }

    /// Proportion of runs in which everything passed, among the runs that are not broken. Returns
    /// `None` if all runs are broken.
    pub fn pass_rate(&self) -> Option<Proportion> {
        let judged = || {
            self.runs
                .iter()
                .filter(|run| run.status != RunStatus::Broken)
        };
        let (passed, of) = (
            judged().filter(|run| run.passed()).count() as u64,
            judged().count() as u64,
        );
        let failed = judged().filter(|run| run.failed()).count() as u64;
        let alike = self.interval_of_alike(None);
        let exact = alike.is_none() && passed + failed == of;
        self.proportion([passed, of], [0, failed], alike, exact)
    }

    /// Bounds of the pass rate, if more than a tenth of the runs is broken or timed out.
    pub fn pass_rate_bounds(&self) -> Option<RateBounds> {
        let lost = self
            .runs
            .iter()
            .filter(|run| run.status != RunStatus::Completed && !run.failed())
            .count() as u64;
        let passed = self.runs.iter().filter(|run| run.passed()).count() as u64;
        RateBounds::new(passed, self.runs.len() as u64 - lost, lost, self.sampling())
    }

    /// The share of the tested runs in which exactly these properties failed.
    pub fn mode_share(&self, mode: &FailureMode) -> Proportion {
        let runs = |fails: bool| {
            let modes = self
                .failure_modes
                .iter()
                .filter(|mode| !fails || !mode.failed.is_empty());
            modes.map(|mode| mode.runs.len() as u64).sum::<u64>()
        };
        let (count, of) = (mode.runs.len() as u64, runs(false));
        let in_failed = [if mode.failed.is_empty() { 0 } else { count }, runs(true)];
        Proportion {
            count,
            of,
            rate: self.estimate([count, of], in_failed),
            interval: mode.share,
        }
    }

    /// A proportion with an interval that is valid for the way in which the campaign ended.
    /// `in_failed`: count and total within failed runs. `alike`: the interval for scenes that were
    /// run several times. `exact`: whether the others of the total are the failures that may have
    /// ended the campaign.
    fn proportion(
        &self,
        [count, of]: [u64; 2],
        in_failed: [u64; 2],
        alike: Option<Interval>,
        exact: bool,
    ) -> Option<Proportion> {
        let found = Proportion::sampled(count, of, self.sampling())?;
        let mut interval = alike.unwrap_or(found.interval);
        if let Some(known) = self
            .ended_at_failures()
            .filter(|_| exact)
            .and_then(|_| passes_until_failures(of - count, of))
        {
            (interval.low, interval.high) = (known.low, known.high);
        }
        Some(Proportion {
            rate: self.estimate([count, of], in_failed),
            interval,
            ..found
        })
    }

    /// The estimate of a rate in further runs. Returns `None` if the first failure ended the
    /// campaign, or if one did and scenes were run several times.
    ///
    /// If the failure number k ended it, the runs before that one are unbiased: they are those of
    /// the other k - 1 failures, and of their number. Which of the failed runs was the last does
    /// not depend on anything else, so the estimate leaves out the mean of them: a k-th of the
    /// counts within failed runs. For whole runs, this is Haldane's estimate (1945).
    fn estimate(&self, [count, of]: [u64; 2], [count_failed, of_failed]: [u64; 2]) -> Option<f64> {
        let Some(failures) = self.ended_at_failures() else {
            return Some(count as f64 / of as f64);
        };
        if failures < 2 || self.is_repeated() {
            return None;
        }
        let without_last =
            |all: u64, in_failed: u64| all as f64 - in_failed as f64 / failures as f64;
        let of = without_last(of, of_failed);
        (of > 0.0).then(|| without_last(count, count_failed) / of)
    }

    /// Outcome counts over all properties.
    pub fn counts(&self) -> Counts {
        Counts::of(self.runs.iter().flat_map(RunSummary::outcomes))
    }

    /// One line for each property.
    pub fn property_lines(&self) -> Vec<PropertyLine> {
        self.lines_of(|_| true)
    }

    /// All actions in the order in which the tests list them, each with one line per property.
    pub fn lines_by_action(&self) -> Vec<(String, Vec<PropertyLine>)> {
        let mut names: Vec<&String> = Vec::new();
        for action in self.runs.iter().flat_map(|run| &run.actions) {
            if !names.contains(&&action.name) {
                names.push(&action.name);
            }
        }
        let lines = |name: &String| {
            let all = self.lines_of(|action| action.name == *name);
            all.into_iter()
                .filter(|line| line.counts.total() > 0)
                .collect()
        };
        names
            .into_iter()
            .map(|name| (name.clone(), lines(name)))
            .collect()
    }

    /// One line for each property, over the actions that the filter accepts.
    fn lines_of(&self, accepts: impl Fn(&ActionSummary) -> bool) -> Vec<PropertyLine> {
        let line = |iri: &String, label: &String| {
            let judged = |which: &dyn Fn(&RunSummary) -> bool| -> Vec<&Judgement> {
                let runs = self.runs.iter().filter(|run| which(run));
                let actions = runs
                    .flat_map(|run| &run.actions)
                    .filter(|action| accepts(action));
                let judgements = actions.flat_map(|action| &action.judgements);
                judgements
                    .filter(|judgement| judgement.property == *iri)
                    .collect()
            };
            let count =
                |own: &[&Judgement]| Counts::of(own.iter().map(|judgement| judgement.outcome));
            let own = judged(&|_| true);
            let (counts, failed) = (count(&own), count(&judged(&RunSummary::failed)));
            let ended_early = count(&judged(&|run| run.status != RunStatus::Completed));
            let lost = counts.broken + counts.timeout + ended_early.untested;
            let alike = self.interval_of_alike(Some(iri));
            // With one property of one action, its failures are those of the runs.
            let sole =
                self.properties.len() == 1 && self.runs.iter().all(|run| run.actions.len() <= 1);
            let exact = sole && alike.is_none();
            PropertyLine {
                property: iri.clone(),
                label: label.clone(),
                counts,
                rate: self.proportion(
                    [counts.passed, counts.decided()],
                    [failed.passed, failed.decided()],
                    alike,
                    exact,
                ),
                held_before: own
                    .iter()
                    .filter(|judgement| judgement.held_before == Some(true))
                    .count() as u64,
                vacuous: own
                    .iter()
                    .filter(|judgement| judgement.vacuous == Some(true))
                    .count() as u64,
                bounds: RateBounds::new(counts.passed, counts.decided(), lost, self.sampling()),
            }
        };
        self.properties
            .iter()
            .map(|(iri, label, _)| line(iri, label))
            .collect()
    }

    /// 0: everything passed. 1: a property failed, in a run or in a case. 2: nothing failed, but
    /// something could not be tested.
    pub fn exit_code(&self) -> u8 {
        let counts = self.counts();
        if counts.failed > 0 || self.regressions.iter().any(CaseSummary::fails) {
            1
        } else if counts.passed > 0
            && counts.passed + counts.inapplicable == counts.total()
            && self.regressions.iter().all(|case| case.exit_code() == 0)
        {
            0
        } else {
            2
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use actcheck_analysis::wilson;

    pub fn run(index: u64, status: RunStatus, outcomes: &[Outcome]) -> RunSummary {
        let judgements: Vec<Judgement> = outcomes
            .iter()
            .enumerate()
            .map(|(idx, outcome)| Judgement {
                property: format!("http://actions#P{idx}"),
                outcome: *outcome,
                margin: Some(if *outcome == Outcome::Passed {
                    0.05
                } else {
                    -0.016
                }),
                witness: "glass_1 moved 0.4 cm, needs more than 2 cm".into(),
                rule_digest: "d".into(),
                held_before: None,
                vacuous: None,
            })
            .collect();
        let score = actcheck_verdict::action_score(outcomes.iter().copied());
        RunSummary {
            id: format!("k7f3-{}", index + 1),
            index,
            repetition: None,
            weight: None,
            test: "Pick".into(),
            status,
            reason: (status != RunStatus::Completed).then(|| "body left the world".into()),
            score,
            trace_hash: index.to_string(),
            actions: vec![ActionSummary {
                name: "Pick".into(),
                score,
                judgements,
            }],
        }
    }

    pub fn campaign(runs: Vec<RunSummary>) -> CampaignSummary {
        CampaignSummary {
            campaign: "k7f3".into(),
            config: "configs/pick.toml".into(),
            history: "configs/.actcheck".into(),
            program: "actcheck".into(),
            properties: (0..2)
                .map(|i| {
                    (
                        format!("http://actions#P{i}"),
                        format!("property {i}"),
                        Some("m".to_owned()),
                    )
                })
                .collect(),
            search: None,
            failure_modes: vec![],
            regressions: vec![],
            privileged: false,
            planned: runs.len() as u64,
            runs,
            discards: 1,
            ended_by: None,
            interrupted: false,
        }
    }

    /// Regression: after `--max-failures`, rates were biased and intervals assumed a fixed number
    /// of runs.
    #[test]
    fn rates_after_a_stop_at_failures_are_those_of_inverse_sampling() {
        use Outcome::{Failed, Passed};
        let stopped = |outcomes: &[[Outcome; 2]], sole: bool| {
            let runs = (0u64..)
                .zip(outcomes)
                .map(|(index, both)| run(index, RunStatus::Completed, &both[usize::from(sole)..]));
            let mut summary = campaign(runs.collect());
            summary.properties.truncate(if sole { 1 } else { 2 });
            summary.ended_by = Some(EndedBy {
                budget: "failures",
                description: String::new(),
            });
            summary
        };
        let outcomes = [
            [Passed, Passed],
            [Passed, Failed],
            [Passed, Passed],
            [Passed, Passed],
            [Failed, Failed],
        ];
        let known = passes_until_failures(2, 5).expect("it has runs");
        let summary = stopped(&outcomes, false);
        let rate = summary.pass_rate().expect("decided");
        assert_eq!((rate.count, rate.of, rate.rate), (3, 5, known.rate));
        assert_eq!(
            (rate.interval.low, rate.interval.high),
            (known.low, known.high)
        );
        // The first property failed in one of the two failed runs: half a failure in four runs.
        let lines = summary.property_lines();
        assert_eq!(lines[0].rate.and_then(|rate| rate.rate), Some(3.5 / 4.0));
        assert_eq!(
            lines[0].rate.map(|rate| rate.interval),
            Sampling::Stopped.interval(4, 5)
        );
        let alone = stopped(&outcomes, true).property_lines()[0]
            .rate
            .expect("decided");
        assert_eq!((alone.rate, alone.interval.low), (known.rate, known.low));
        // There is no unbiased estimate at the first failure, but an interval.
        let first = stopped(&outcomes[..2], false).pass_rate().expect("decided");
        assert!(
            first.rate.is_none() && first.to_string().ends_with("–99 %] (1 of 2)"),
            "{first}"
        );
        let mut interrupted = campaign(stopped(&outcomes, false).runs);
        interrupted.interrupted = true;
        let rate = interrupted.pass_rate().expect("decided");
        assert_eq!(
            (rate.rate, Some(rate.interval)),
            (Some(0.6), Sampling::Stopped.interval(3, 5))
        );
    }

    /// Regression: a program that crashed or hung whenever it would have failed had a rate of 100
    /// %.
    #[test]
    fn many_lost_runs_give_bounds() {
        use Outcome::{Broken, Passed, Timeout, Untested};
        let lost = |lost: u64| {
            let of = |index| match index {
                index if index >= lost => run(index, RunStatus::Completed, &[Passed, Passed]),
                0 => run(index, RunStatus::Timeout, &[Timeout, Untested]),
                _ => run(index, RunStatus::Broken, &[Broken, Broken]),
            };
            campaign((0..20).map(of).collect())
        };
        assert_eq!(
            (
                lost(2).pass_rate_bounds(),
                lost(2).property_lines()[0].bounds
            ),
            (None, None)
        );
        let summary = lost(5);
        let bounds = summary.pass_rate_bounds().expect("a quarter is lost");
        assert_eq!((bounds.lost, bounds.ends()), (5, [0.75, 1.0]));
        assert_eq!(Some(bounds.as_failures.interval), wilson(15, 20));
        assert!(
            summary
                .property_lines()
                .iter()
                .all(|line| line.bounds == Some(bounds))
        );
    }

    /// Five runs with the same trace are no more evidence than one.
    #[test]
    fn runs_with_the_same_trace_have_the_interval_of_one() {
        let mut summary = campaign(
            (0..6)
                .map(|index| run(index, RunStatus::Completed, &[Outcome::Passed]))
                .collect(),
        );
        let low = |summary: &CampaignSummary| {
            summary.property_lines()[0]
                .rate
                .expect("decided")
                .interval
                .low
        };
        let independent = low(&summary);
        summary
            .runs
            .iter_mut()
            .for_each(|run| run.trace_hash = (run.index % 3).to_string());
        let rate = summary.property_lines()[0].rate.expect("decided");
        assert_eq!((rate.count, rate.of), (6, 6));
        assert_eq!(Some(rate.interval), wilson(3, 3));
        assert_eq!(
            summary.pass_rate().expect("decided").interval,
            rate.interval
        );
        assert!(low(&summary) < independent);
    }

    #[test]
    fn a_broken_run_is_neither_passed_nor_failed() {
        use Outcome::{Broken, Failed, Inapplicable, Passed};
        let broken = run(0, RunStatus::Broken, &[Broken, Broken]);
        assert!(!broken.passed() && !broken.failed());
        assert_eq!(campaign(vec![broken.clone()]).exit_code(), 2);
        assert_eq!(
            campaign(vec![run(0, RunStatus::Completed, &[Passed, Inapplicable])]).exit_code(),
            0
        );
        let mixed = campaign(vec![
            broken,
            run(1, RunStatus::Completed, &[Passed, Failed]),
        ]);
        assert_eq!(mixed.exit_code(), 1);
        assert_eq!(mixed.total_score(), Some(0.25));
        assert_eq!(mixed.total_score_without_broken(), Some(0.5));
        assert_eq!(mixed.property_lines()[0].counts.broken, 1);
        assert_eq!(campaign(vec![]).exit_code(), 2);
        assert_eq!(
            campaign(vec![run(0, RunStatus::Completed, &[Inapplicable])]).exit_code(),
            2
        );
    }
}
