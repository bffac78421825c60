//! What is said about a campaign when it is over, as plain data.

use crate::analysis::{FailureMode, Interval, wilson};
use crate::base::names;
use crate::history::{Repetition, RunDetail, RunRecord, RunStatus};
use crate::report::{CaseSummary, GuidedSearch};
use crate::verdict::{Counts, Judgement, Outcome, mean};

/// A campaign in short.
#[derive(Debug, Clone, PartialEq)]
pub struct CampaignSummary {
    /// Its id in the history.
    pub campaign: String,
    /// Its configuration, as the user named it.
    pub config: String,
    /// Where the history lies, as the user named it.
    pub history: String,
    /// How the user calls this program, for the commands that show more.
    pub program: String,
    /// Every property that was judged, in order: IRI, label, unit of its margin.
    pub properties: Vec<(String, String, Option<String>)>,
    /// The runs, by index.
    pub runs: Vec<RunSummary>,
    /// How scenes were chosen, where counts of runs are no rates.
    pub search: Option<GuidedSearch>,
    /// Runs that share the same set of failed properties, most frequent first.
    pub failure_modes: Vec<FailureMode>,
    /// The project's cases, which ran first. They count for the exit code, and for nothing else.
    pub regressions: Vec<CaseSummary>,
    /// Whether a program that performs actions was told the truth, which no robot knows.
    pub privileged: bool,
    /// Runs that were asked for.
    pub planned: u64,
    /// Scenes that could not be built and were drawn again.
    pub discards: u64,
    /// The budget that ended it; nothing where it came to its planned runs or was interrupted.
    pub ended_by: Option<EndedBy>,
    /// Whether it was stopped before its end.
    pub interrupted: bool,
}

/// The budget that ended a campaign.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EndedBy {
    /// `time`, `width` or `failures`.
    pub budget: &'static str,
    /// In words.
    pub told: String,
}

/// A run in short.
#[derive(Debug, Clone, PartialEq)]
pub struct RunSummary {
    /// Its id in the history.
    pub id: String,
    /// Position in the campaign, from 0.
    pub index: u64,
    /// Which run of which scene it is, where scenes are run more than once.
    pub repetition: Option<Repetition>,
    /// Importance weight of its scene, where a search chose it.
    pub weight: Option<f64>,
    /// Names of its actions.
    pub test: String,
    /// How it ended.
    pub status: RunStatus,
    /// Why, where it did not complete.
    pub reason: Option<String>,
    /// The paper's S.
    pub score: f64,
    /// Its actions, in order.
    pub actions: Vec<ActionSummary>,
}

/// An action in short.
#[derive(Debug, Clone, PartialEq)]
pub struct ActionSummary {
    /// Local name.
    pub name: String,
    /// The paper's A.
    pub score: f64,
    /// One for each property.
    pub judgements: Vec<Judgement>,
}

/// A share of things counted, with its 95 % Wilson interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Share {
    /// How many.
    pub count: u64,
    /// Of how many.
    pub of: u64,
    /// The share and its interval.
    pub interval: Interval,
}

impl Share {
    /// The same with another interval, where there is one.
    fn knowing(self, interval: Option<Interval>) -> Self {
        Self { interval: interval.unwrap_or(self.interval), ..self }
    }

    /// The share of `count` in `of`; nothing where `of` is 0.
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
    /// All six outcomes.
    pub counts: Counts,
    /// Share of passed among the decided, with its 95 % Wilson interval; nothing where none was decided.
    pub rate: Option<Share>,
    /// Those of the passed that had held before the action already.
    pub held_before: u64,
}

impl std::fmt::Display for Share {
    /// Such as `80 % [55–93] (12 of 15)`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let interval = &self.interval;
        let (rate, low, high) = (interval.rate * 100.0, interval.low * 100.0, interval.high * 100.0);
        write!(f, "{rate:.0} % [{low:.0}–{high:.0}] ({} of {})", self.count, self.of)
    }
}

impl RunSummary {
    /// The short form of a record.
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
            actions,
        }
    }

    /// The short form of a run that is read from the history: the same as that of its record.
    pub fn again(run: &RunDetail) -> Self {
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
            actions: actions.collect(),
        }
    }

    /// Outcomes of all properties of all actions.
    pub fn outcomes(&self) -> impl Iterator<Item = Outcome> + '_ {
        self.actions.iter().flat_map(|action| action.judgements.iter().map(|j| j.outcome))
    }

    /// Whether something passed and everything else passed or did not apply.
    pub fn passed(&self) -> bool {
        let counts = Counts::of(self.outcomes());
        counts.passed > 0 && counts.passed + counts.inapplicable == counts.total()
    }

    /// Whether this property failed in one of its actions.
    pub fn failed_property(&self, property: &str) -> bool {
        let judgements = self.actions.iter().flat_map(|action| &action.judgements);
        judgements.into_iter().any(|judgement| judgement.property == property && judgement.outcome == Outcome::Failed)
    }

    /// Whether a property failed.
    pub fn failed(&self) -> bool {
        self.outcomes().any(|outcome| outcome == Outcome::Failed)
    }
}

impl CampaignSummary {
    /// The paper's T over all runs.
    pub fn total_score(&self) -> Option<f64> {
        mean(self.runs.iter().map(|run| run.score))
    }

    /// T over the runs that simulation and tool did not spoil.
    pub fn total_score_without_broken(&self) -> Option<f64> {
        mean(self.runs.iter().filter(|run| run.status != RunStatus::Broken).map(|run| run.score))
    }

    /// Runs in which everything passed, among the runs that were not broken, with the interval.
    pub fn pass_rate(&self) -> Option<Share> {
        let judged = self.runs.iter().filter(|run| run.status != RunStatus::Broken).count() as u64;
        let passed = self.runs.iter().filter(|run| run.passed()).count() as u64;
        Share::new(passed, judged).map(|rate| rate.knowing(self.interval_of_repeated(None)))
    }

    /// All outcomes of all properties.
    pub fn counts(&self) -> Counts {
        Counts::of(self.runs.iter().flat_map(RunSummary::outcomes))
    }

    /// One line for each property.
    pub fn property_lines(&self) -> Vec<PropertyLine> {
        self.lines_of(|_| true)
    }

    /// Every action that was to be performed, in the order in which tests list them, with one line for each of its
    /// properties.
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

    /// One line for each property, over some of the actions.
    fn lines_of(&self, counts: impl Fn(&ActionSummary) -> bool) -> Vec<PropertyLine> {
        let actions: Vec<&ActionSummary> =
            self.runs.iter().flat_map(|run| &run.actions).filter(|action| counts(action)).collect();
        let line = |iri: &String, label: &String| {
            let judgements = actions.iter().flat_map(|action| &action.judgements);
            let own: Vec<&Judgement> = judgements.filter(|judgement| judgement.property == *iri).collect();
            let counts = Counts::of(own.iter().map(|judgement| judgement.outcome));
            let rate = Share::new(counts.passed, counts.decided());
            let rate = rate.map(|rate| rate.knowing(self.interval_of_repeated(Some(iri))));
            let held_before = own.iter().filter(|judgement| judgement.held_before == Some(true)).count() as u64;
            PropertyLine { property: iri.clone(), label: label.clone(), counts, rate, held_before }
        };
        self.properties.iter().map(|(iri, label, _)| line(iri, label)).collect()
    }

    /// 0: everything passed. 1: a property failed, in a run or a regression. 2: something could not be tested and nothing
    /// failed.
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
pub(super) mod tests {
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
        let score = crate::verdict::action_score(outcomes.iter().copied());
        RunSummary {
            id: format!("k7f3-{}", index + 1),
            index,
            repetition: None,
            weight: None,
            test: "Pick".into(),
            status,
            reason: (status != RunStatus::Completed).then(|| "body left the world".into()),
            score,
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

    #[test]
    fn a_broken_run_is_no_failure_and_no_pass() {
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
