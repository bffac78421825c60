//! Patterns one after the other: the strongest, then the strongest among the runs that it does not explain.

use crate::analysis::patterns::boxes::Runs;
use crate::analysis::patterns::cells::{Axis, axes};
use crate::analysis::patterns::condition::all_hold;
use crate::analysis::patterns::confirm::{confirm, count};
use crate::analysis::patterns::fold::fold;
use crate::analysis::patterns::likelihood::{Likelihood, one};
use crate::analysis::patterns::refine::{Field, refine};
use crate::analysis::patterns::{Condition, Subject};
use crate::analysis::{Interval, TwoByTwo, benjamini_hochberg, wilson};

/// Fewer failures (or passes) than this show nothing that could be told from chance.
const LEAST_OF_EACH: u64 = 4;

/// How patterns are looked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PatternOptions {
    /// Conditions of a pattern at most: 1 to 3.
    pub most_conditions: usize,
    /// Share of false patterns among those found that is bearable, on average; and the chance at which one is confirmed.
    pub level: f64,
    /// Cells into which numbers are cut at most: 2 to 64.
    pub cells: usize,
    /// Patterns at most.
    pub most_patterns: usize,
    /// Steps of the search for each pattern: runs times combinations of three parameters.
    pub work: u64,
}

impl Default for PatternOptions {
    fn default() -> Self {
        Self { most_conditions: 3, level: 0.05, cells: 8, most_patterns: 8, work: 300_000_000 }
    }
}

/// A condition on scenes under which runs fail more often than elsewhere.
#[derive(Debug, Clone, PartialEq)]
pub struct Pattern {
    /// All of them hold; each is about another parameter.
    pub conditions: Vec<Condition>,
    /// Places of the runs in which they hold.
    pub runs: Vec<usize>,
    /// Among all decided runs.
    pub all: TwoByTwo,
    /// Among the runs that it was found in (without those kept aside, and without those of earlier patterns), with bounds at the cuts: those
    /// between them were not all tried, and so are no part of the test.
    pub searched: TwoByTwo,
    /// Among the runs kept aside that no earlier pattern has.
    pub held_out: TwoByTwo,
    /// Share of its runs that failed.
    pub rate: Interval,
    /// Share of all other runs that failed, where there are others.
    pub elsewhere: Option<Interval>,
    /// How many times as often its runs fail as all runs.
    pub lift: f64,
    /// Weighted relative accuracy: its share of all runs times how much more often they fail than all runs.
    pub wracc: f64,
    /// Fisher's exact test, one-sided, among the runs that it was found in.
    pub p: f64,
    /// The same, adjusted for everything that was tried (Benjamini and Hochberg); an upper bound.
    pub q: f64,
    /// Fisher's exact test, one-sided, among the runs kept aside, adjusted for the patterns that were found (Holm).
    pub p_held_out: f64,
    /// Whether it holds among the runs kept aside too.
    pub confirmed: bool,
}

/// What was found.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Patterns {
    /// In the order in which they were found: what they explain together most first.
    pub patterns: Vec<Pattern>,
    /// Decided runs.
    pub runs: u64,
    /// Of them failed.
    pub failed: u64,
    /// Runs that were kept aside to confirm.
    pub held_out: u64,
    /// Conditions and combinations of them that were tried.
    pub tried: u64,
    /// Parameters that take more than one value.
    pub parameters: usize,
    /// Conditions of a pattern at most: fewer than were asked for where so many more chances to err would hide every pattern.
    pub depth: usize,
    /// Parameters of which every three were combined.
    pub combined: usize,
}

impl Patterns {
    /// Patterns that hold among the runs kept aside too.
    pub fn confirmed(&self) -> impl Iterator<Item = &Pattern> {
        self.patterns.iter().filter(|pattern| pattern.confirmed)
    }
}

/// Looks for the conditions under which runs fail more often than elsewhere.
///
/// The score of a pattern is the likelihood ratio of two rates, within and outside, against one; of those that score alike the one with
/// fewer conditions is taken. The same runs in the same order give the same patterns.
pub fn mine(subject: &Subject, options: &PatternOptions) -> Patterns {
    let mut found = Patterns {
        runs: subject.len() as u64,
        failed: subject.failed.iter().filter(|failed| **failed).count() as u64,
        held_out: subject.held_out.iter().filter(|held_out| **held_out).count() as u64,
        ..Patterns::default()
    };
    let open: Vec<bool> = subject.held_out.iter().map(|held_out| !held_out).collect();
    let runs = open.iter().filter(|open| **open).count();
    let axes = axes(subject, &open, cells(runs, options.cells));
    found.parameters = axes.len();
    let rounds = search(subject, open, &axes, options, &mut found);
    let probabilities: Vec<f64> = rounds.iter().map(|(_, table)| table.fisher().greater).collect();
    let adjusted = benjamini_hochberg(&probabilities, found.tried);
    let conditions: Vec<Vec<Condition>> = rounds.iter().map(|(conditions, _)| conditions.clone()).collect();
    let confirmed = confirm(&conditions, subject);
    for ((((conditions, searched), p), q), (held_out, p_held_out)) in
        rounds.into_iter().zip(probabilities).zip(adjusted).zip(confirmed)
    {
        let within = all_hold(&conditions, subject);
        let all = count(subject, &within, |_| true);
        let (inside, outside) = (all.failed_in + all.passed_in, all.failed_out + all.passed_out);
        let Some(rate) = wilson(all.failed_in, inside) else { continue };
        let overall = found.failed as f64 / found.runs as f64;
        found.patterns.push(Pattern {
            conditions,
            runs: (0..within.len()).filter(|run| within[*run]).collect(),
            all,
            searched,
            held_out,
            rate,
            elsewhere: wilson(all.failed_out, outside),
            lift: rate.rate / overall,
            wracc: inside as f64 / found.runs as f64 * (rate.rate - overall),
            p,
            q,
            p_held_out,
            confirmed: p_held_out <= options.level,
        });
    }
    found
}

/// As many cells as the runs are worth: with few runs, many narrow ranges would only be so many chances to err.
fn cells(runs: usize, most: usize) -> usize {
    (libm::cbrt(runs as f64) as usize).clamp(4, 64).min(most.max(2))
}

/// The patterns with their counts among the runs that were still open when each was found.
fn search(
    subject: &Subject,
    mut open: Vec<bool>,
    axes: &[Axis],
    options: &PatternOptions,
    found: &mut Patterns,
) -> Vec<(Vec<Condition>, TwoByTwo)> {
    let mut rounds: Vec<(Vec<Condition>, TwoByTwo)> = Vec::new();
    while rounds.len() < options.most_patterns {
        let whole = count(subject, &vec![true; subject.len()], |run| open[run]);
        if whole.failed_in.min(whole.passed_in) < LEAST_OF_EACH {
            break;
        }
        let depth = affordable_depth(axes, whole, options);
        found.depth = found.depth.max(depth);
        let likelihood =
            Likelihood::new((0..open.len()).filter(|run| open[*run]).map(|run| one(subject.failed[run])).sum());
        let runs = Runs::new(axes, &subject.failed, &open, &likelihood);
        let mut best = runs.best(depth, options.work);
        found.tried += best.tried;
        found.combined = found.combined.max(best.combined);
        if best.conditions.is_empty() {
            break;
        }
        let field = Field { subject, open: &open, axes, likelihood: &likelihood };
        fold(&mut best.conditions, &field, options.level);
        let table = count(subject, &all_hold(&best.conditions, subject), |run| open[run]);
        // What comes later is weaker: where this one is no finding, neither are those.
        let rank = rounds.len() as f64 + 1.0;
        if table.fisher().greater * found.tried as f64 / rank > options.level {
            break;
        }
        // Bounds between the cuts describe better what was found; they take no part in the test, as they were not all tried.
        refine(&mut best.conditions, &field);
        let within = all_hold(&best.conditions, subject);
        open.iter_mut().zip(&within).for_each(|(open, within)| *open &= !within);
        rounds.push((best.conditions, table));
    }
    rounds
}

/// As many conditions as still let a pattern be told from chance that has half of all failures and no pass; at least one.
///
/// It depends on how many runs there are and how many failed, not on which: looking deeper in many runs and less deep in few is no
/// choice by result.
fn affordable_depth(axes: &[Axis], whole: TwoByTwo, options: &PatternOptions) -> usize {
    let failed_in = whole.failed_in.div_ceil(2);
    let ideal =
        TwoByTwo { failed_in, passed_in: 0, failed_out: whole.failed_in - failed_in, passed_out: whole.passed_in };
    let p = ideal.fisher().greater;
    // How many boxes there are of one, two and three conditions: sums of products of the conditions on different parameters.
    let mut boxes = [1.0, 0.0, 0.0, 0.0];
    for axis in axes {
        for conditions in (1..boxes.len()).rev() {
            boxes[conditions] += boxes[conditions - 1] * axis.len() as f64;
        }
    }
    let affordable = |depth: &usize| p * boxes[1..=*depth].iter().sum::<f64>() <= options.level;
    (2..=options.most_conditions.min(3)).rev().find(affordable).unwrap_or(1)
}
