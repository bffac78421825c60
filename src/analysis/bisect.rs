//! Whether a version of rules, program or skill is like the first or the second end of a bisection.

use std::collections::{BTreeMap, BTreeSet};

use crate::compare::{Compared, ComparedRun};
use crate::{Answer, ComparedLine, Comparison, Sampling, compare};
use actcheck_base::Outcome;

/// The end of a bisection that a version is like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Likeness {
    /// It is like the first end.
    First,
    /// It is like the second end.
    Second,
    /// Its outcomes decide neither.
    Undecided,
}

/// An outcome that differs between two versions.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OutcomeFlip {
    /// Number of the scene in the campaign, and of the run among the scene's runs, both from 0.
    pub place: (u64, u64),
    /// Ids of the first and of the second version's run.
    pub runs: [String; 2],
    /// The action and the property; never a whole run.
    pub of: Compared,
    /// Both outcomes. `None` if a version does not judge the property.
    pub outcomes: [Option<Outcome>; 2],
}

impl OutcomeFlip {
    /// Whether it passed in the first version and failed in the second.
    pub fn is_worse(&self) -> bool {
        self.outcomes == [Some(Outcome::Passed), Some(Outcome::Failed)]
    }

    /// Whether it failed in the first version and passed in the second.
    pub fn is_better(&self) -> bool {
        self.outcomes == [Some(Outcome::Failed), Some(Outcome::Passed)]
    }
}

/// Returns the outcomes that differ between two versions, in the order of the scenes. Runs of other
/// scenes are left out.
pub fn outcome_flips(first: &[ComparedRun], second: &[ComparedRun]) -> Vec<OutcomeFlip> {
    let others: BTreeMap<_, &ComparedRun> = second.iter().map(|run| (run.place, run)).collect();
    let mut flips = Vec::new();
    for run in first {
        let Some(other) = others
            .get(&run.place)
            .filter(|other| other.scene.arrangement == run.scene.arrangement)
        else {
            continue;
        };
        let all: BTreeSet<&Compared> = run
            .outcomes()
            .keys()
            .chain(other.outcomes().keys())
            .collect();
        for of in all
            .into_iter()
            .filter(|of| matches!(of, Compared::Property { .. }))
        {
            let outcomes = [run, other].map(|run| run.outcomes().get(of).copied());
            if outcomes[0] != outcomes[1] {
                let runs = [run.run.clone(), other.run.clone()];
                flips.push(OutcomeFlip {
                    place: run.place,
                    runs,
                    of: of.clone(),
                    outcomes,
                });
            }
        }
    }
    flips
}

/// Decides by single outcomes: for runs that are the same each time.
///
/// `flips` are those from the first to the second end. A version is like the second end if one of
/// these outcomes differs from the first end. It is undecided if one of them is broken, untested or
/// a timeout instead, or if it has none of the runs.
pub fn like_by_outcomes(flips: &[OutcomeFlip], version: &[ComparedRun]) -> Likeness {
    let runs: BTreeMap<_, &ComparedRun> = version.iter().map(|run| (run.place, run)).collect();
    let (mut seen, mut unclear) = (false, false);
    for flip in flips {
        let Some(run) = runs.get(&flip.place) else {
            continue;
        };
        let outcome = run.outcomes().get(&flip.of).copied();
        seen = true;
        if outcome == flip.outcomes[0] {
            continue;
        }
        let is_open = matches!(
            outcome,
            Some(Outcome::Broken | Outcome::Timeout | Outcome::Untested)
        );
        if outcome == flip.outcomes[1] || !is_open {
            return Likeness::Second;
        }
        unclear = true;
    }
    if seen && !unclear {
        Likeness::First
    } else {
        Likeness::Undecided
    }
}

/// Decides by rates, in the lines in which the second end is worse than the first.
///
/// A version is like the second end if it is worse than the first end in one of them. It is like
/// the first if, in each of them, it is better than the second end, or not different from the
/// first. See [`Comparison::answer_of`] for the level and the margin.
pub fn like_by_rates(
    ends: [&[ComparedRun]; 2],
    version: &[ComparedRun],
    level: f64,
    margin: f64,
) -> Likeness {
    let [first, second] = ends;
    let wanted: BTreeSet<Compared> =
        worse_lines(&compare(first, second, Sampling::Fixed), level, margin);
    let answers = |comparison: &Comparison| -> BTreeMap<Compared, Answer> {
        comparison
            .lines
            .iter()
            .map(|line| (line.of.clone(), comparison.answer_of(line, level, margin)))
            .collect()
    };
    let [from_first, from_second] =
        [first, second].map(|end| answers(&compare(end, version, Sampling::Fixed)));
    if wanted
        .iter()
        .any(|of| from_first.get(of) == Some(&Answer::Worse))
    {
        return Likeness::Second;
    }
    let is_like_first = |of: &Compared| {
        from_second.get(of) == Some(&Answer::Better)
            || matches!(
                from_first.get(of),
                Some(Answer::Same | Answer::NoDifference | Answer::Better)
            )
    };
    if !wanted.is_empty() && wanted.iter().all(is_like_first) {
        Likeness::First
    } else {
        Likeness::Undecided
    }
}

/// The subjects in which the second side of a comparison is worse.
fn worse_lines(comparison: &Comparison, level: f64, margin: f64) -> BTreeSet<Compared> {
    let worse = |line: &&ComparedLine| comparison.answer_of(line, level, margin) == Answer::Worse;
    comparison
        .lines
        .iter()
        .filter(worse)
        .map(|line| line.of.clone())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample_rows::{outcome_row, run_row};
    use actcheck_base::Outcome::{Broken, Failed, Passed};
    use actcheck_history::{OutcomeRow, RunRow, SceneDigest};

    /// Runs of one property, with its outcome in each scene; `None` if it is not judged.
    fn runs(outcomes: &[Option<Outcome>]) -> Vec<ComparedRun> {
        let numbered = || (0u64..).zip(outcomes);
        let outcome = |(index, outcome): (u64, &Option<Outcome>)| {
            outcome.map(|outcome| outcome_row(index, "p", outcome))
        };
        let rows: Vec<RunRow> = numbered().map(|(index, _)| run_row(index)).collect();
        let scene = |row: &RunRow| SceneDigest {
            arrangement: row.run.clone(),
            physics: String::new(),
        };
        let scenes = rows
            .iter()
            .map(|row| (row.run.clone(), scene(row)))
            .collect();
        let outcomes: Vec<OutcomeRow> = numbered().filter_map(outcome).collect();
        crate::compared_runs(&rows, &scenes, &outcomes)
    }

    #[test]
    fn a_version_with_a_changed_outcome_is_like_the_second_end() {
        let good = runs(&[Some(Passed), Some(Passed), Some(Failed), None]);
        let bad = runs(&[Some(Failed), Some(Passed), Some(Failed), Some(Failed)]);
        let flips = outcome_flips(&good, &bad);
        assert_eq!(
            flips.iter().map(|flip| flip.place.0).collect::<Vec<_>>(),
            [0, 3]
        );
        assert!(flips[0].is_worse() && !flips[1].is_worse() && !flips[0].is_better());
        let like = |outcomes: &[Option<Outcome>]| like_by_outcomes(&flips, &runs(outcomes));
        // The outcomes of scenes that both ends agree on don't count.
        assert_eq!(
            like(&[Some(Passed), Some(Failed), Some(Passed), None]),
            Likeness::First
        );
        assert_eq!(
            like(&[Some(Passed), Some(Passed), Some(Passed), Some(Failed)]),
            Likeness::Second
        );
        assert_eq!(
            like(&[None, Some(Passed), Some(Failed), None]),
            Likeness::Second
        );
        assert_eq!(
            like(&[Some(Broken), Some(Passed), Some(Passed), None]),
            Likeness::Undecided
        );
        assert_eq!(like(&[]), Likeness::Undecided);
    }

    #[test]
    fn rates_decide_between_the_ends_with_few_scenes() {
        let with = |passed: usize, of: usize| -> Vec<ComparedRun> {
            runs(
                &(0..of)
                    .map(|n| Some(if n < passed { Passed } else { Failed }))
                    .collect::<Vec<_>>(),
            )
        };
        let (good, bad) = (with(20, 20), with(6, 20));
        let like = |version: &[ComparedRun]| like_by_rates([&good, &bad], version, 0.05, 0.05);
        // Twenty equal scenes are too few for `no difference`, but enough to be better than the bad
        // end.
        assert_eq!(like(&with(20, 20)), Likeness::First);
        assert_eq!(like(&with(19, 20)), Likeness::First);
        assert_eq!(like(&with(7, 20)), Likeness::Second);
        assert_eq!(like(&with(2, 2)), Likeness::Undecided);
        // The ends themselves don't differ.
        assert_eq!(
            like_by_rates([&good, &good], &bad, 0.05, 0.05),
            Likeness::Undecided
        );
    }
}
