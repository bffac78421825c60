//! Compares two campaigns on the same scenes: which properties hold more or less often, and in
//! which scenes outcomes differ.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::Arc;

use crate::{Difference, PairedTable, PairedTest, Sampling, holm};
use actcheck_base::Outcome;
use actcheck_history::{JudgedOutcome, JudgedRun, OutcomeRow, RunRow, RunStatus, SceneDigest};
use actcheck_verdict::Counts;

/// The subject of a comparison: whole runs, or one property of one action.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Compared {
    /// Whole runs. A run passes if at least one property passed and none failed.
    WholeRun,
    /// Whether the run completed: it passes unless it is broken or timed out. Compared only if a
    /// run did not.
    Completion,
    /// A property over all executions of the action in a run.
    Property {
        /// IRI of the action.
        action: String,
        /// IRI of the property.
        property: String,
    },
}

/// A run of a campaign, with the data needed for a comparison.
#[derive(Debug, Clone, PartialEq)]
pub struct ComparedRun {
    /// ID of the run.
    pub run: String,
    /// Number of the scene in the campaign, and of the run among the scene's runs, both from 0.
    pub place: (u64, u64),
    /// Digest of the scene.
    pub scene: SceneDigest,
    /// Digest over every state; `None` if there is none.
    pub states: Option<u128>,
    /// Most runs have the same outcomes as many others, and share them.
    outcomes: Arc<BTreeMap<Compared, Outcome>>,
}

impl ComparedRun {
    /// The outcomes by subject, over all executions of an action in the run.
    pub fn outcomes(&self) -> &BTreeMap<Compared, Outcome> {
        &self.outcomes
    }
}

/// One line of a comparison.
#[derive(Debug, Clone, PartialEq)]
pub struct ComparedLine {
    /// The subject of the comparison.
    pub of: Compared,
    /// Counts of the scenes that are decided on both sides.
    pub table: PairedTable,
    /// The difference of the rates. `None` if no scene was decided on both sides.
    pub difference: Option<Difference>,
    /// Tests against the hypothesis of no difference.
    pub test: PairedTest,
    /// Two-sided p-value, adjusted for the number of lines.
    pub two_sided_adjusted: f64,
    /// One-sided p-value of "the second is worse", adjusted for the number of lines.
    pub second_worse_adjusted: f64,
    /// Runs that passed in the first campaign and failed in the second: IDs of both.
    pub worse: Vec<(String, String)>,
    /// Runs that failed in the first campaign and passed in the second: IDs of both.
    pub better: Vec<(String, String)>,
    /// Outcomes of the scenes that were not decided on both sides, in the first and in the second
    /// campaign.
    pub left_out: [Counts; 2],
}

/// The comparison of two campaigns.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// Number of scenes in both campaigns.
    pub pairs: u64,
    /// Number of these scenes in which masses, frictions or restitutions differ.
    pub other_physics: u64,
    /// Runs of the first and of the second campaign without a counterpart.
    pub alone: [Vec<String>; 2],
    /// Runs with the same place but different scenes.
    pub other_scene: Vec<(String, String)>,
    /// Subjects judged only in the first and only in the second campaign.
    pub judged_alone: [Vec<Compared>; 2],
    /// Whole runs first, then by action and property.
    pub lines: Vec<ComparedLine>,
    /// How the number of scenes was decided: which tests and intervals are valid.
    pub sampling: Sampling,
    /// Whether both campaigns have the same runs, with the same states and outcomes.
    pub is_same: bool,
}

/// Returns the runs of a campaign for a comparison, sorted by place. Runs without a known scene are
/// left out.
pub fn compared_runs(
    runs: &[RunRow],
    scenes: &BTreeMap<String, SceneDigest>,
    outcomes: &[OutcomeRow],
) -> Vec<ComparedRun> {
    let mut of_run: BTreeMap<&str, Vec<JudgedOutcome>> = BTreeMap::new();
    for row in outcomes {
        of_run.entry(&row.run).or_default().push(JudgedOutcome {
            step: row.step,
            action: Arc::from(row.action.as_str()),
            property: Arc::from(row.property.as_str()),
            outcome: row.outcome,
            margin: row.margin,
        });
    }
    let mut found = ComparedRuns::default();
    for row in runs {
        let outcomes = of_run.remove(row.run.as_str()).unwrap_or_default();
        found.add(JudgedRun {
            row: row.clone(),
            scene: scenes.get(&row.run).cloned(),
            outcomes,
        });
    }
    found.sorted()
}

/// Status and outcomes of a run: the addresses of the texts of each action and property, and the
/// outcome.
type OutcomeKey = Vec<(usize, usize, u8)>;

/// Collects the runs of a campaign for a comparison.
#[derive(Debug, Default)]
pub struct ComparedRuns {
    runs: Vec<ComparedRun>,
    len: usize,
    /// The outcomes so far, by status and the outcomes of each action and property. The texts are
    /// kept, so that addresses stay theirs.
    known: HashMap<OutcomeKey, Arc<BTreeMap<Compared, Outcome>>>,
    texts: HashMap<usize, Arc<str>>,
}

impl ComparedRuns {
    /// Adds a run with its outcomes. One without a known scene only counts.
    pub fn add(&mut self, run: JudgedRun) {
        self.len += 1;
        let JudgedRun {
            row,
            scene: Some(scene),
            outcomes,
        } = run
        else {
            return;
        };
        let outcomes = self.shared(row.status, &outcomes);
        let place = row.repetition.map_or((row.index, 0), |repetition| {
            (repetition.scene, repetition.number)
        });
        self.runs.push(ComparedRun {
            states: u128::from_str_radix(&row.trace_hash, 16).ok(),
            run: row.run,
            place,
            scene,
            outcomes,
        });
    }

    /// Number of added runs.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether no run was added.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The runs, sorted by place.
    pub fn sorted(mut self) -> Vec<ComparedRun> {
        self.runs
            .sort_by(|a, b| (a.place, &a.run).cmp(&(b.place, &b.run)));
        self.runs
    }

    /// The outcomes by subject, shared with earlier runs that have the same ones.
    fn shared(
        &mut self,
        status: RunStatus,
        outcomes: &[JudgedOutcome],
    ) -> Arc<BTreeMap<Compared, Outcome>> {
        let address = |text: &Arc<str>| Arc::as_ptr(text).cast::<u8>() as usize;
        let mut key = vec![(0, 0, status as u8)];
        key.extend(outcomes.iter().map(|own| {
            (
                address(&own.action),
                address(&own.property),
                own.outcome as u8,
            )
        }));
        if let Some(known) = self.known.get(&key) {
            return Arc::clone(known);
        }
        for text in outcomes.iter().flat_map(|own| [&own.action, &own.property]) {
            self.texts.insert(address(text), Arc::clone(text));
        }
        let new = Arc::new(by_subject(status, outcomes));
        self.known.insert(key, Arc::clone(&new));
        new
    }
}

fn by_subject(status: RunStatus, outcomes: &[JudgedOutcome]) -> BTreeMap<Compared, Outcome> {
    let mut found: BTreeMap<Compared, Outcome> = BTreeMap::new();
    for own in outcomes {
        let of = Compared::Property {
            action: own.action.to_string(),
            property: own.property.to_string(),
        };
        let both = found
            .get(&of)
            .map_or(own.outcome, |before| together(*before, own.outcome));
        found.insert(of, both);
    }
    // A broken run is no evidence about the robot, regardless of earlier outcomes.
    let whole = match status {
        RunStatus::Broken => Outcome::Broken,
        RunStatus::Completed | RunStatus::Timeout => found
            .values()
            .copied()
            .reduce(together)
            .unwrap_or(Outcome::Untested),
    };
    found.insert(Compared::WholeRun, whole);
    let completed = if status == RunStatus::Completed {
        Outcome::Passed
    } else {
        Outcome::Failed
    };
    found.insert(Compared::Completion, completed);
    found
}

/// Combines two outcomes: failed if one failed, else broken, timeout or untested if one is, else
/// passed if one passed.
fn together(one: Outcome, other: Outcome) -> Outcome {
    const STRONGEST_FIRST: [Outcome; 6] = [
        Outcome::Failed,
        Outcome::Broken,
        Outcome::Timeout,
        Outcome::Untested,
        Outcome::Passed,
        Outcome::Inapplicable,
    ];
    STRONGEST_FIRST
        .into_iter()
        .find(|outcome| [one, other].contains(outcome))
        .unwrap_or(one)
}

/// Compares two campaigns by pairs of runs with the same place and the same scene.
///
/// If scenes are repeated, a scene passes if all its runs pass: runs of one scene are too alike to
/// be counted separately. Only repetitions that both sides have are compared. `sampling`: how the
/// number of scenes was decided.
pub fn compare(first: &[ComparedRun], second: &[ComparedRun], sampling: Sampling) -> Comparison {
    let by_place = |runs: &'_ [ComparedRun]| {
        runs.iter()
            .enumerate()
            .map(|(at, run)| (run.place, at))
            .collect()
    };
    let (firsts, seconds): (BTreeMap<_, usize>, BTreeMap<_, usize>) =
        (by_place(first), by_place(second));
    let alone = |runs: &[ComparedRun], other: &BTreeMap<(u64, u64), usize>| {
        runs.iter()
            .filter(|run| !other.contains_key(&run.place))
            .map(|run| run.run.clone())
            .collect::<Vec<_>>()
    };
    let met: Vec<[&ComparedRun; 2]> = firsts
        .iter()
        .filter_map(|(place, at)| Some([&first[*at], &second[*seconds.get(place)?]]))
        .collect();
    let (same, others): (Vec<_>, Vec<_>) = met
        .into_iter()
        .partition(|[a, b]| a.scene.arrangement == b.scene.arrangement);
    let is_same = others.is_empty()
        && same.len() == first.len()
        && same.len() == second.len()
        && same
            .iter()
            .all(|[a, b]| a.states.is_some() && a.states == b.states && a.outcomes == b.outcomes);
    let pairs = scene_pairs(&same);
    let judged = [0, 1].map(|side| {
        pairs
            .iter()
            .flat_map(|pair| pair.outcomes[side].keys().cloned())
            .collect()
    });
    let [judged_first, judged_second]: [BTreeSet<Compared>; 2] = judged;
    Comparison {
        pairs: pairs.len() as u64,
        other_physics: pairs.iter().filter(|pair| pair.other_physics).count() as u64,
        alone: [alone(first, &seconds), alone(second, &firsts)],
        other_scene: others
            .into_iter()
            .map(|[a, b]| (a.run.clone(), b.run.clone()))
            .collect(),
        judged_alone: [
            judged_first.difference(&judged_second).cloned().collect(),
            judged_second.difference(&judged_first).cloned().collect(),
        ],
        lines: lines(&pairs, judged_first.intersection(&judged_second), sampling),
        sampling,
        is_same,
    }
}

/// A scene in both campaigns.
struct ScenePair {
    /// IDs of the scene's first run in each campaign.
    runs: (String, String),
    outcomes: [Arc<BTreeMap<Compared, Outcome>>; 2],
    other_physics: bool,
}

/// Merges the runs of each scene. The argument must be sorted by place.
fn scene_pairs(same: &[[&ComparedRun; 2]]) -> Vec<ScenePair> {
    let mut pairs: Vec<(u64, ScenePair)> = Vec::new();
    for [first, second] in same {
        match pairs.last_mut() {
            Some((scene, pair)) if *scene == first.place.0 => {
                for (known, run) in pair.outcomes.iter_mut().zip([first, second]) {
                    let known = Arc::make_mut(known);
                    for (of, outcome) in run.outcomes.iter() {
                        let before = known.get(of).copied();
                        known.insert(
                            of.clone(),
                            before.map_or(*outcome, |before| together(before, *outcome)),
                        );
                    }
                }
            }
            _ => pairs.push((
                first.place.0,
                ScenePair {
                    runs: (first.run.clone(), second.run.clone()),
                    outcomes: [Arc::clone(&first.outcomes), Arc::clone(&second.outcomes)],
                    other_physics: first.scene.physics != second.scene.physics,
                },
            )),
        }
    }
    pairs.into_iter().map(|(_, pair)| pair).collect()
}

fn lines<'a>(
    pairs: &[ScenePair],
    compared: impl Iterator<Item = &'a Compared>,
    sampling: Sampling,
) -> Vec<ComparedLine> {
    let mut lines: Vec<ComparedLine> = compared.map(|of| line(pairs, of, sampling)).collect();
    // Without discordant scenes its test can never be significant, so it costs the others no
    // correction (Tarone, 1990).
    lines.retain(|line| line.of != Compared::Completion || line.table.both < line.table.pairs());
    let two_sided = holm(
        &lines
            .iter()
            .map(|line| line.test.two_sided)
            .collect::<Vec<f64>>(),
    );
    let worse = holm(
        &lines
            .iter()
            .map(|line| line.test.second_worse)
            .collect::<Vec<f64>>(),
    );
    for ((line, two_sided), worse) in lines.iter_mut().zip(two_sided).zip(worse) {
        (line.two_sided_adjusted, line.second_worse_adjusted) = (two_sided, worse);
    }
    lines
}

fn line(pairs: &[ScenePair], of: &Compared, sampling: Sampling) -> ComparedLine {
    let mut table = PairedTable::default();
    let (mut worse, mut better, mut left_out) = (Vec::new(), Vec::new(), [Counts::default(); 2]);
    for pair in pairs {
        let outcomes = pair
            .outcomes
            .each_ref()
            .map(|known| known.get(of).copied().unwrap_or(Outcome::Untested));
        let [Some(a), Some(b)] = outcomes.map(decided) else {
            left_out
                .iter_mut()
                .zip(outcomes)
                .for_each(|(counts, outcome)| counts.add(outcome));
            continue;
        };
        table.add(a, b);
        match (a, b) {
            (true, false) => worse.push(pair.runs.clone()),
            (false, true) => better.push(pair.runs.clone()),
            _ => {}
        }
    }
    let test = table.test_by(sampling);
    ComparedLine {
        of: of.clone(),
        table,
        difference: table.difference_by(sampling),
        test,
        two_sided_adjusted: test.two_sided,
        second_worse_adjusted: test.second_worse,
        worse,
        better,
        left_out,
    }
}

/// Returns whether the property passed, or `None` if the outcome is no evidence about the robot.
fn decided(outcome: Outcome) -> Option<bool> {
    match outcome {
        Outcome::Passed => Some(true),
        Outcome::Failed => Some(false),
        Outcome::Inapplicable | Outcome::Broken | Outcome::Timeout | Outcome::Untested => None,
    }
}

impl Comparison {
    /// Returns the lines in which the second campaign is significantly worse: one-sided, exact, and
    /// adjusted so that the probability of any false finding is at most `level`.
    pub fn worse_at(&self, level: f64) -> Vec<&ComparedLine> {
        self.lines
            .iter()
            .filter(|line| line.second_worse_adjusted <= level)
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample_rows::{outcome_row, run_row};

    fn run(index: u64, arrangement: &str, outcomes: &[(&str, Outcome)]) -> ComparedRun {
        let scene = SceneDigest {
            arrangement: arrangement.to_owned(),
            physics: String::new(),
        };
        let row = run_row(index);
        let outcome =
            |(property, outcome): &(&str, Outcome)| outcome_row(index, property, *outcome);
        let outcomes: Vec<OutcomeRow> = outcomes.iter().map(outcome).collect();
        let scenes = BTreeMap::from([(row.run.clone(), scene)]);
        compared_runs(&[row], &scenes, &outcomes).remove(0)
    }

    use Outcome::{Broken, Failed, Inapplicable, Passed, Timeout, Untested};

    #[test]
    fn runs_are_paired_by_scene_and_unpaired_ones_are_counted() {
        let a = [
            run(0, "x", &[("p", Passed)]),
            run(1, "y", &[("p", Passed)]),
            run(2, "z", &[("p", Failed)]),
        ];
        let b = [
            run(1, "y", &[("p", Failed)]),
            run(2, "other", &[("p", Failed)]),
            run(3, "w", &[("p", Passed)]),
        ];
        let found = compare(&a, &b, Sampling::Fixed);
        assert_eq!(found.pairs, 1);
        assert_eq!(
            found.alone,
            [vec!["k-1".to_owned()], vec!["k-4".to_owned()]]
        );
        assert_eq!(found.other_scene, [("k-3".to_owned(), "k-3".to_owned())]);
        assert_eq!(found.lines.len(), 2);
        assert!(
            found
                .lines
                .iter()
                .all(|line| line.worse.len() == 1 && line.table.only_first == 1)
        );
    }

    #[test]
    fn uninformative_outcomes_are_excluded_on_both_sides_and_counted() {
        let open = [Inapplicable, Broken, Timeout, Untested];
        let runs = |outcomes: &[Outcome]| -> Vec<ComparedRun> {
            (0u64..)
                .zip(outcomes)
                .map(|(index, outcome)| run(index, "s", &[("p", *outcome)]))
                .collect()
        };
        let a = runs(&[&[Passed, Failed][..], &[Passed; 4]].concat());
        let b = runs(&[&[Passed, Passed][..], &open].concat());
        let found = compare(&a, &b, Sampling::Fixed);
        for line in &found.lines {
            assert_eq!(
                line.table,
                PairedTable {
                    both: 1,
                    only_second: 1,
                    ..PairedTable::default()
                }
            );
            assert_eq!(
                line.left_out[0],
                Counts {
                    passed: 4,
                    ..Counts::default()
                }
            );
            assert_eq!(line.left_out[1], Counts::of(open));
        }
    }

    #[test]
    fn a_run_fails_with_one_failed_property_and_is_open_with_one_undecided() {
        let whole =
            |outcomes: &[(&str, Outcome)]| run(0, "s", outcomes).outcomes[&Compared::WholeRun];
        assert_eq!(
            whole(&[("p", Passed), ("q", Failed), ("r", Timeout)]),
            Failed
        );
        assert_eq!(whole(&[("p", Passed), ("q", Timeout)]), Timeout);
        assert_eq!(whole(&[("p", Passed), ("q", Inapplicable)]), Passed);
        assert_eq!(whole(&[("p", Inapplicable)]), Inapplicable);
        assert_eq!(whole(&[]), Untested);
    }

    #[test]
    fn a_repeated_scene_counts_once_and_passes_if_all_its_runs_pass() {
        let runs = |outcomes: &[&[Outcome]]| -> Vec<ComparedRun> {
            let scenes = (0u64..).zip(outcomes).flat_map(|(scene, outcomes)| {
                (0u64..).zip(*outcomes).map(move |(number, outcome)| {
                    let index = 10 * scene + number;
                    ComparedRun {
                        place: (scene, number),
                        ..run(index, "s", &[("p", *outcome)])
                    }
                })
            });
            scenes.collect()
        };
        let a = runs(&[
            &[Passed, Passed, Failed],
            &[Passed, Passed, Passed],
            &[Passed, Broken, Passed],
        ]);
        let b = runs(&[&[Passed, Passed], &[Passed, Failed], &[Passed, Passed]]);
        let found = compare(&a, &b, Sampling::Fixed);
        assert_eq!(
            (found.pairs, found.alone[0].len(), found.alone[1].len()),
            (3, 3, 0)
        );
        for line in &found.lines {
            assert_eq!(
                line.table,
                PairedTable {
                    both: 1,
                    only_first: 1,
                    ..PairedTable::default()
                }
            );
            assert_eq!(
                (line.worse.as_slice(), line.left_out[0].broken),
                (&[("k-11".to_owned(), "k-11".to_owned())][..], 1)
            );
        }
    }

    /// Regression: a program that crashed or hung whenever it would have failed was not worse than
    /// one that failed.
    #[test]
    fn a_rise_of_runs_that_do_not_complete_is_worse() {
        let runs = |lost: u64, outcome: Outcome, status: RunStatus| -> Vec<ComparedRun> {
            let one = |index: u64| {
                let mut row = run_row(index);
                let is_lost = index < lost;
                row.status = if is_lost {
                    status
                } else {
                    RunStatus::Completed
                };
                let scene = SceneDigest {
                    arrangement: "s".to_owned(),
                    physics: String::new(),
                };
                let outcomes = [outcome_row(
                    index,
                    "p",
                    if is_lost { outcome } else { Passed },
                )];
                compared_runs(
                    &[row.clone()],
                    &BTreeMap::from([(row.run, scene)]),
                    &outcomes,
                )
                .remove(0)
            };
            (0..30).map(one).collect()
        };
        let none = runs(0, Passed, RunStatus::Completed);
        for (outcome, status) in [(Broken, RunStatus::Broken), (Timeout, RunStatus::Timeout)] {
            let crashing = runs(8, outcome, status);
            let found = compare(&none, &crashing, Sampling::Fixed);
            let worse: Vec<&Compared> = found
                .worse_at(0.05)
                .into_iter()
                .map(|line| &line.of)
                .collect();
            assert_eq!(worse, [&Compared::Completion], "{found:?}");
            // Two more such runs may be chance, an equal number does not count, and fewer are
            // better.
            for first in [
                runs(6, outcome, status),
                crashing.clone(),
                runs(20, outcome, status),
            ] {
                assert!(
                    compare(&first, &crashing, Sampling::Fixed)
                        .worse_at(0.05)
                        .is_empty()
                );
            }
        }
        assert!(
            compare(&none, &none, Sampling::Fixed)
                .lines
                .iter()
                .all(|line| line.of != Compared::Completion)
        );
    }

    #[test]
    fn properties_judged_on_one_side_only_are_named() {
        let a = [run(0, "s", &[("old", Passed), ("p", Passed)])];
        let b = [run(0, "s", &[("new", Passed), ("p", Passed)])];
        let found = compare(&a, &b, Sampling::Fixed);
        let names = |list: &[Compared]| -> Vec<String> {
            list.iter()
                .map(|of| match of {
                    Compared::WholeRun | Compared::Completion => String::new(),
                    Compared::Property { property, .. } => property.clone(),
                })
                .collect()
        };
        assert_eq!(
            found.judged_alone.each_ref().map(|list| names(list)),
            [["old"], ["new"]]
        );
        assert_eq!(found.lines.len(), 2);
    }
}
