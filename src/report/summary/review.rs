//! A comparison with its flipped runs, for the review of a change.

use std::collections::BTreeMap;

use crate::summary::compared_name;
use crate::{CompareSummary, Divergence, FlipGroup, SharedEvent};
use actcheck_analysis::{Answer, ComparedLine};
use actcheck_base::{Judgement, Outcome, names};
use actcheck_history::RunDetail;

/// Differences of positions below this are not named. Unit: metres.
const NAMED_M: f64 = 0.005;

/// One of two runs of a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct ReviewRun {
    /// Its name among the replays. Runs of two histories can have the same id.
    pub key: String,
    /// Its details.
    pub detail: RunDetail,
}

/// Both runs of a scene that flipped.
#[derive(Debug, Clone, PartialEq)]
pub struct ReviewPair {
    /// The run of the first and of the second side.
    pub runs: [ReviewRun; 2],
    /// When they begin to differ; `None` if they move alike, or without their motion.
    pub divergence: Option<Divergence>,
}

/// A comparison with runs that flipped.
#[derive(Debug)]
pub struct Review<'a> {
    /// The comparison.
    pub summary: &'a CompareSummary,
    /// Some of the flipped scenes, by the ids of both runs.
    pub pairs: &'a BTreeMap<(String, String), ReviewPair>,
}

impl Divergence {
    /// Returns the moment in a sentence.
    pub fn sentence(&self) -> String {
        let phase = match self.phases.each_ref().map(Option::as_deref) {
            [Some(first), Some(second)] if first == second => format!(" ({first})"),
            [Some(first), Some(second)] => format!(" ({first} in A, {second} in B)"),
            [Some(first), None] => format!(" ({first} in A; B has ended)"),
            [None, Some(second)] => format!(" ({second} in B; A has ended)"),
            [None, None] => String::new(),
        };
        let event = |words: &str, moment: &Option<SharedEvent>| {
            let moment = moment.as_ref()?;
            let [a, b] = moment.secs;
            let gripper = moved(moment.gripper_m)?;
            Some(format!(
                "; when it {words} (at {a:.1} s in A, {b:.1} s in B), B's gripper is {gripper}"
            ))
        };
        format!(
            "both runs are the same until {:.1} s{phase}{}{}",
            self.secs,
            event(TOUCHES, &self.touch).unwrap_or_default(),
            event(RELEASES, &self.release).unwrap_or_default()
        )
    }
}

/// The events in words.
const TOUCHES: &str = "first touches the target";
const RELEASES: &str = "lets go of the target";

/// Where a point is relative to another; `None` if it is near. Frame: world.
fn moved(by: [f64; 3]) -> Option<String> {
    let [x, y, z] = by;
    let (aside, up) = (libm::hypot(x, y), z.abs());
    let way = if z > 0.0 { "higher" } else { "lower" };
    match (aside >= NAMED_M, up >= NAMED_M) {
        (false, false) => None,
        (false, true) => Some(format!("{:.1} cm {way}", 100.0 * up)),
        (true, false) => Some(format!("{:.1} cm aside", 100.0 * aside)),
        (true, true) => Some(format!(
            "{:.1} cm {way} and {:.1} cm aside",
            100.0 * up,
            100.0 * aside
        )),
    }
}

impl Review<'_> {
    /// The answer as a sentence.
    pub fn headline(&self) -> String {
        let summary = self.summary;
        let lines = &summary.comparison.lines;
        let with = |wanted: Answer| {
            let (level, margin) = (summary.answer_level(), summary.margin);
            let of_it = lines
                .iter()
                .filter(|line| summary.comparison.answer_of(line, level, margin) == wanted);
            let names: Vec<String> = of_it.map(|line| compared_name(&line.of)).collect();
            names.join(", ")
        };
        let worse = self.gated();
        if !worse.is_empty() {
            let names: Vec<String> = worse.iter().map(|line| compared_name(&line.of)).collect();
            return format!("B is worse than A: {}", names.join(", "));
        }
        match summary.answer() {
            Answer::Worse => format!("B is worse than A: {}", with(Answer::Worse)),
            Answer::Better => format!("B is better than A: {}", with(Answer::Better)),
            Answer::Same => "A and B are the same: states and outcomes of all runs".to_owned(),
            Answer::NoDifference => "A and B do not differ".to_owned(),
            Answer::Underpowered {
                scenes: Some(scenes),
            } => {
                format!("Undecided: about {scenes} scenes would decide")
            }
            Answer::Underpowered { scenes: None } => {
                "Undecided: over a million scenes would decide".to_owned()
            }
        }
    }

    /// The answer in a word: worse if the comparison fails for it.
    pub fn answer(&self) -> &'static str {
        match self.gated().is_empty() {
            true => self.summary.answer().word(),
            false => Answer::Worse.word(),
        }
    }

    /// The lines for which the comparison fails, by its one-sided test.
    fn gated(&self) -> Vec<&ComparedLine> {
        let level = self.summary.level;
        level.map_or_else(Vec::new, |level| self.summary.comparison.worse_at(level))
    }

    /// The pairs of a group that are known in detail.
    pub fn of_group<'b>(
        &'b self,
        group: &'b FlipGroup<'_>,
    ) -> impl Iterator<Item = &'b ReviewPair> {
        group.runs.iter().filter_map(|pair| self.pairs.get(pair))
    }

    /// Where the pairs of a group begin to differ, in a sentence; `None` if none of them does.
    pub fn origin(&self, group: &FlipGroup<'_>) -> Option<String> {
        let mut phases: BTreeMap<&str, usize> = BTreeMap::new();
        let mut found: Vec<&Divergence> = Vec::new();
        for pair in self.of_group(group) {
            let Some(of_pair) = &pair.divergence else {
                continue;
            };
            found.push(of_pair);
            if let Some(phase) = of_pair.phases.iter().flatten().next() {
                *phases.entry(phase).or_default() += 1;
            }
        }
        let (phase, count) = phases.into_iter().max_by_key(|(_, count)| *count)?;
        let events: [(&str, OfPair); 2] = [
            (TOUCHES, |found| found.touch.as_ref()),
            (RELEASES, |found| found.release.as_ref()),
        ];
        let of_events = events.into_iter().filter_map(|(words, event)| {
            let mut rises: Vec<f64> = found
                .iter()
                .filter_map(|found| Some(event(found)?.gripper_m[2]))
                .collect();
            rises.sort_by(f64::total_cmp);
            let rise = moved([0.0, 0.0, *rises.get(rises.len() / 2)?])?;
            Some(format!(
                "; when it {words}, B's gripper is {rise} (median of {})",
                rises.len()
            ))
        });
        Some(format!(
            "in {count} of {} pairs, both runs are the same until {phase}{}",
            found.len(),
            of_events.collect::<String>()
        ))
    }
}

/// An event of two runs.
type OfPair = fn(&Divergence) -> Option<&SharedEvent>;

/// The outcomes of a run, each with the step and the name of its action.
pub(crate) fn outcomes_of(run: &RunDetail) -> impl Iterator<Item = (u32, &str, &Judgement)> {
    run.actions.iter().flat_map(|action| {
        let judged = action.judgements.iter();
        judged.map(|judgement| (action.step, names::local(&action.action), judgement))
    })
}

/// The failures of a run, each with its witness.
pub(crate) fn failures_of(run: &RunDetail) -> impl Iterator<Item = (&str, &Judgement)> {
    outcomes_of(run)
        .filter(|(.., judgement)| judgement.outcome == Outcome::Failed)
        .map(|(_, action, judgement)| (action, judgement))
}
