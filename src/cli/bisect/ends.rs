//! The two ends of a bisection, and the answer for a version between them.

use std::rc::Rc;

use super::judge::{Judge, Unjudged};
use super::search::Step;
use super::versions::{Version, Versions};
use super::{BisectArgs, By, LEVEL, MARGIN, text};
use crate::output;
use actcheck_analysis::{
    Answer, Compared, ComparedRun, Likeness, OutcomeFlip, Sampling, compare, like_by_outcomes,
    like_by_rates, outcome_flips,
};
use actcheck_base::{Diagnostic, Diagnostics, names};

/// The outcomes at both ends, which differ.
pub struct Ends<'a> {
    versions: &'a Versions,
    by: By,
    /// Number of scenes in which they differ.
    scenes: u64,
    /// Outcomes that differ from the old to the new end.
    flips: Vec<OutcomeFlip>,
}

type Runs = Rc<Vec<ComparedRun>>;

impl<'a> Ends<'a> {
    /// Judges both ends, in more scenes if these are too few, and prints them.
    ///
    /// # Errors
    /// `X064` the ends don't differ, or the good one is worse than the bad one; `X065` an end can't
    /// be judged.
    pub fn judge(
        args: &BisectArgs,
        versions: &'a Versions,
        judge: &mut Judge<'_>,
    ) -> Result<Self, Diagnostics> {
        let by = args.by.unwrap_or_else(|| judge.usual());
        let mut scenes = args.scenes.min(args.most_scenes);
        loop {
            let [good, bad] = versions.ends().map(|version| {
                judge
                    .runs(version, scenes)
                    .map_err(|why| end_fault(version, why))
            });
            let (good, bad) = (good?, bad?);
            check_names(&args.properties, &good, &bad)?;
            let flips = if versions.finds_fix {
                outcome_flips(&bad, &good)
            } else {
                outcome_flips(&good, &bad)
            };
            let answer = match by {
                By::Outcome => answer_of(&flips, versions.finds_fix),
                By::Rate => compare(&good, &bad, Sampling::Fixed).answer(LEVEL, MARGIN),
            };
            let more = (scenes * 2).min(args.most_scenes);
            match answer {
                Answer::Worse => {
                    let ends = Self {
                        versions,
                        by,
                        scenes,
                        flips,
                    };
                    output::print(&text::ends(versions, &ends.difference(&good, &bad)));
                    return Ok(ends);
                }
                Answer::Same | Answer::Underpowered { .. }
                    if judge.has_more_scenes() && more > scenes =>
                {
                    scenes = more
                }
                other => {
                    return Err(text::no_difference(
                        versions,
                        other,
                        scenes_of(&good, &bad),
                        args.most_scenes,
                    )
                    .into());
                }
            }
        }
    }

    /// The difference of the ends in words.
    fn difference(&self, good: &Runs, bad: &Runs) -> String {
        let comparison = compare(good, bad, Sampling::Fixed);
        match self.by {
            By::Outcome => format!(
                "{} in {}",
                text::count(self.flips.len(), "outcome differs", "outcomes differ"),
                text::count(good.len(), "run", "runs")
            ),
            By::Rate => text::rates(&comparison, |line| {
                comparison.answer_of(line, LEVEL, 0.0) == Answer::Worse
            }),
        }
    }

    /// Judges a version, in more scenes if these are too few.
    pub fn step(
        &mut self,
        args: &BisectArgs,
        version: &Version,
        judge: &mut Judge<'_>,
    ) -> Result<Step, Unjudged> {
        let [old_word, new_word] = if self.versions.finds_fix {
            ["bad", "good"]
        } else {
            ["good", "bad"]
        };
        loop {
            let runs = match judge.runs(version, self.scenes) {
                Ok(runs) => runs,
                Err(Unjudged::Skipped(faults)) => {
                    return Ok(Step {
                        is_new: None,
                        reason: text::first(&faults),
                        word: "skipped",
                    });
                }
                Err(stopped) => return Err(stopped),
            };
            let (likeness, reason) = self.likeness(&runs, judge)?;
            let step = |is_new, word| {
                Ok(Step {
                    is_new,
                    reason,
                    word,
                })
            };
            match (likeness, self.versions.finds_fix && self.by == By::Rate) {
                // Rates are compared with the good end, outcomes with the old end.
                (Likeness::First, false) | (Likeness::Second, true) => {
                    return step(Some(false), old_word);
                }
                (Likeness::Second, false) | (Likeness::First, true) => {
                    return step(Some(true), new_word);
                }
                (Likeness::Undecided, _) => {
                    let more = (self.scenes * 2).min(args.most_scenes);
                    if self.by == By::Outcome || !judge.has_more_scenes() || more <= self.scenes {
                        return step(None, "skipped");
                    }
                    self.scenes = more;
                }
            }
        }
    }

    fn likeness(&self, runs: &Runs, judge: &mut Judge<'_>) -> Result<(Likeness, String), Unjudged> {
        match self.by {
            By::Outcome => {
                let likeness = like_by_outcomes(&self.flips, runs);
                Ok((likeness, text::outcomes(likeness, &self.flips, runs)))
            }
            By::Rate => {
                let [good, bad] = self.versions.ends().map(|end| judge.runs(end, self.scenes));
                let (good, bad) = (good?, bad?);
                let likeness = like_by_rates([&good, &bad], runs, LEVEL, MARGIN);
                let reason = if likeness == Likeness::Undecided {
                    format!(
                        "{} are too few to decide; see --most-scenes",
                        text::count(runs.len(), "scene", "scenes")
                    )
                } else {
                    let ends = compare(&good, &bad, Sampling::Fixed);
                    let worse = |of: &Compared| {
                        ends.lines.iter().any(|line| {
                            line.of == *of && ends.answer_of(line, LEVEL, MARGIN) == Answer::Worse
                        })
                    };
                    text::rates(&compare(&good, runs, Sampling::Fixed), |line| {
                        worse(&line.of)
                    })
                };
                Ok((likeness, reason))
            }
        }
    }

    /// The flips between two neighbouring versions that belong to the difference of the ends.
    pub fn relevant_flips(&self, before: &Runs, after: &Runs) -> Vec<OutcomeFlip> {
        let is_relevant = |flip: &OutcomeFlip| match self.by {
            By::Outcome => self
                .flips
                .iter()
                .any(|end| end.place == flip.place && end.of == flip.of),
            By::Rate if self.versions.finds_fix => flip.is_better(),
            By::Rate => flip.is_worse(),
        };
        outcome_flips(before, after)
            .into_iter()
            .filter(is_relevant)
            .collect()
    }

    /// Number of scenes in which versions were judged last.
    pub fn scenes(&self) -> u64 {
        self.scenes
    }
}

/// The answer of single outcomes, from the good to the bad end.
fn answer_of(flips: &[OutcomeFlip], finds_fix: bool) -> Answer {
    let is_better = |flip: &OutcomeFlip| {
        if finds_fix {
            flip.is_worse()
        } else {
            flip.is_better()
        }
    };
    match flips {
        [] => Answer::NoDifference,
        flips if flips.iter().all(is_better) => Answer::Better,
        _ => Answer::Worse,
    }
}

fn scenes_of(good: &Runs, bad: &Runs) -> usize {
    good.len().min(bad.len())
}

/// X045: neither end judges a named property.
fn check_names(named: &[String], good: &Runs, bad: &Runs) -> Result<(), Diagnostics> {
    let missing = |name: &&String| {
        !judged(good)
            .chain(judged(bad))
            .any(|iri| iri == *name || names::local(iri) == *name)
    };
    let mut faults = Diagnostics::new();
    for name in named.iter().filter(missing) {
        let message = format!("neither end judges a property `{name}`");
        faults.push(
            Diagnostic::error("X045", message).help("`actcheck list --rules` lists all properties"),
        );
    }
    faults.or(())
}

/// The IRIs of judged properties.
fn judged(runs: &Runs) -> impl Iterator<Item = &str> {
    runs.iter()
        .flat_map(|run| run.outcomes().keys())
        .filter_map(|of| match of {
            Compared::WholeRun | Compared::Completion => None,
            Compared::Property { property, .. } => Some(property.as_str()),
        })
}

/// X065: an end can't be judged. The faults of its rules follow.
fn end_fault(version: &Version, why: Unjudged) -> Diagnostics {
    match why {
        Unjudged::Stopped(faults) => faults,
        Unjudged::Skipped(faults) => {
            let message = format!("{} can't be judged: {}", version.name, text::first(&faults));
            let help = "name another revision with `--good` or `--bad`; only revisions between the ends are skipped";
            Diagnostic::error("X065", message).help(help).into()
        }
    }
}
