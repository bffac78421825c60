//! The summary of a finished campaign, as plain data.

use crate::{CaseSummary, GuidedSearch};
use actcheck_analysis::{FailureMode, Interval, wilson};
use actcheck_base::{Judgement, Outcome, names};
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
    /// The proportion and its interval.
    pub interval: Interval,
}

impl Proportion {
    /// Replaces the interval if one is given.
    fn with_interval(self, interval: Option<Interval>) -> Self {
        Self { interval: interval.unwrap_or(self.interval), ..self }
    }

    /// The proportion `count` / `of` with its Wilson interval. Returns `None` if `of` is 0.
    pub fn new(count: u64, of: u64) -> Option<Self> {
        Some(Self { count, of, interval: wilson(count, of)? })
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
    /// Proportion of passed among decided outcomes, with its 95 % interval. `None` if none was decided.
    pub rate: Option<Proportion>,
    /// Number of passed outcomes whose property already held before the action.
    pub held_before: u64,
}

impl std::fmt::Display for Proportion {
    /// Writes, for example, `80 % [55–93] (12 of 15)`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let interval = &self.interval;
        let (rate, low, high) = (interval.rate * 100.0, interval.low * 100.0, interval.high * 100.0);
        write!(f, "{rate:.0} % [{low:.0}–{high:.0}] ({} of {})", self.count, self.of)
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
        self.actions.iter().flat_map(|action| action.judgements.iter().map(|j| j.outcome))
    }

    /// Whether at least one property passed and all others passed or were inapplicable.
    pub fn passed(&self) -> bool {
        let counts = Counts::of(self.outcomes());
        counts.passed > 0 && counts.passed + counts.inapplicable == counts.total()
    }

    /// Whether the given property failed in any action.
    pub fn failed_property(&self, property: &str) -> bool {
        let judgements = self.actions.iter().flat_map(|action| &action.judgements);
        judgements.into_iter().any(|judgement| judgement.property == property && judgement.outcome == Outcome::Failed)
    }

    /// Whether any property failed.
    pub fn failed(&self) -> bool {
        self.outcomes().any(|outcome| outcome == Outcome::Failed)
    }
}

impl CampaignSummary {
    /// The paper's T over all runs. Returns `None` if there are no runs.
    pub fn total_score(&self) -> Option<f64> {
        mean(self.runs.iter().map(|run| run.score))
    }

    /// T over the runs that are not broken. Returns `None` if there are none.
    pub fn total_score_without_broken(&self) -> Option<f64> {
        mean(self.runs.iter().filter(|run| run.status != RunStatus::Broken).map(|run| run.score))
    }

    /// Proportion of runs in which everything passed, among the runs that are not broken. Returns `None` if all runs
    /// are broken.
    pub fn pass_rate(&self) -> Option<Proportion> {
        let judged = self.runs.iter().filter(|run| run.status != RunStatus::Broken).count() as u64;
        let passed = self.runs.iter().filter(|run| run.passed()).count() as u64;
        Proportion::new(passed, judged).map(|rate| rate.with_interval(self.interval_of_alike(None)))
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
            all.into_iter().filter(|line| line.counts.total() > 0).collect()
        };
        names.into_iter().map(|name| (name.clone(), lines(name))).collect()
    }

    /// One line for each property, over the actions that the filter accepts.
    fn lines_of(&self, counts: impl Fn(&ActionSummary) -> bool) -> Vec<PropertyLine> {
        let actions: Vec<&ActionSummary> =
            self.runs.iter().flat_map(|run| &run.actions).filter(|action| counts(action)).collect();
        let line = |iri: &String, label: &String| {
            let judgements = actions.iter().flat_map(|action| &action.judgements);
            let own: Vec<&Judgement> = judgements.filter(|judgement| judgement.property == *iri).collect();
            let counts = Counts::of(own.iter().map(|judgement| judgement.outcome));
            let rate = Proportion::new(counts.passed, counts.decided());
            let rate = rate.map(|rate| rate.with_interval(self.interval_of_alike(Some(iri))));
            let held_before = own.iter().filter(|judgement| judgement.held_before == Some(true)).count() as u64;
            PropertyLine { property: iri.clone(), label: label.clone(), counts, rate, held_before }
        };
        self.properties.iter().map(|(iri, label, _)| line(iri, label)).collect()
    }

    /// 0: everything passed. 1: a property failed, in a run or in a case. 2: nothing failed, but something could not be
    /// tested.
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

    pub fn run(index: u64, status: RunStatus, outcomes: &[Outcome]) -> RunSummary {
        let judgements: Vec<Judgement> = outcomes
            .iter()
            .enumerate()
            .map(|(idx, outcome)| Judgement {
                property: format!("http://actions#P{idx}"),
                outcome: *outcome,
                margin: Some(if *outcome == Outcome::Passed { 0.05 } else { -0.016 }),
                witness: "glass_1 moved 0.4 cm, needs more than 2 cm".into(),
                rule_digest: "d".into(),
                held_before: None,
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
            actions: vec![ActionSummary { name: "Pick".into(), score, judgements }],
        }
    }

    pub fn campaign(runs: Vec<RunSummary>) -> CampaignSummary {
        CampaignSummary {
            campaign: "k7f3".into(),
            config: "configs/pick.toml".into(),
            history: "configs/.actcheck".into(),
            program: "actcheck".into(),
            properties: (0..2)
                .map(|i| (format!("http://actions#P{i}"), format!("property {i}"), Some("m".to_owned())))
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

    /// Five runs with the same trace are no more evidence than one.
    #[test]
    fn runs_with_the_same_trace_have_the_interval_of_one() {
        let mut summary = campaign((0..6).map(|index| run(index, RunStatus::Completed, &[Outcome::Passed])).collect());
        let low = |summary: &CampaignSummary| summary.property_lines()[0].rate.expect("decided").interval.low;
        let independent = low(&summary);
        summary.runs.iter_mut().for_each(|run| run.trace_hash = (run.index % 3).to_string());
        let rate = summary.property_lines()[0].rate.expect("decided");
        assert_eq!((rate.count, rate.of), (6, 6));
        assert_eq!(Some(rate.interval), wilson(3, 3));
        assert_eq!(summary.pass_rate().expect("decided").interval, rate.interval);
        assert!(low(&summary) < independent);
    }

    #[test]
    fn a_broken_run_is_neither_passed_nor_failed() {
        use Outcome::{Broken, Failed, Inapplicable, Passed};
        let broken = run(0, RunStatus::Broken, &[Broken, Broken]);
        assert!(!broken.passed() && !broken.failed());
        assert_eq!(campaign(vec![broken.clone()]).exit_code(), 2);
        assert_eq!(campaign(vec![run(0, RunStatus::Completed, &[Passed, Inapplicable])]).exit_code(), 0);
        let mixed = campaign(vec![broken, run(1, RunStatus::Completed, &[Passed, Failed])]);
        assert_eq!(mixed.exit_code(), 1);
        assert_eq!(mixed.total_score(), Some(0.25));
        assert_eq!(mixed.total_score_without_broken(), Some(0.5));
        assert_eq!(mixed.property_lines()[0].counts.broken, 1);
        assert_eq!(campaign(vec![]).exit_code(), 2);
        assert_eq!(campaign(vec![run(0, RunStatus::Completed, &[Inapplicable])]).exit_code(), 2);
    }
}
