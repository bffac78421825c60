//! Sequential covering: finds the strongest pattern, then the strongest among the runs that it does not explain, and so
//! on.

use crate::patterns::boxes::Runs;
use crate::patterns::cells::{Axis, axes};
use crate::patterns::condition::all_hold;
use crate::patterns::confirm::{confirm, count};
use crate::patterns::likelihood::{Likelihood, one};
use crate::patterns::refine::{OpenRuns, refine};
use crate::patterns::simplify::simplify;
use crate::patterns::{Condition, PatternInput};
use crate::{Interval, TwoByTwo, benjamini_hochberg, wilson};

/// Minimum number of failures and of passes. With fewer, no pattern can be significant.
const LEAST_OF_EACH: u64 = 4;

/// Options of pattern mining.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PatternOptions {
    /// Maximum number of conditions of a pattern: 1 to 3.
    pub most_conditions: usize,
    /// Accepted false discovery rate, and significance level of the confirmation.
    pub level: f64,
    /// Maximum number of cells of a numeric parameter: 2 to 64.
    pub cells: usize,
    /// Maximum number of patterns.
    pub most_patterns: usize,
    /// Maximum number of steps of the search for each pattern: runs times triples of parameters.
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
    /// Conjunction of conditions on different parameters.
    pub conditions: Vec<Condition>,
    /// Indices of the runs in which they hold.
    pub runs: Vec<usize>,
    /// Counts among all decided runs.
    pub all: TwoByTwo,
    /// Counts among the training runs (without held-out runs and those of earlier patterns), with bounds at the cuts.
    /// Refined bounds are not part of the test, because not all of them were tried.
    pub searched: TwoByTwo,
    /// Counts among the held-out runs that no earlier pattern contains.
    pub held_out: TwoByTwo,
    /// Failure rate within the pattern.
    pub rate: Interval,
    /// Failure rate of all other runs. `None` if there are none.
    pub elsewhere: Option<Interval>,
    /// Failure rate within the pattern divided by the overall failure rate.
    pub lift: f64,
    /// Weighted relative accuracy: the pattern's share of all runs times the difference between its failure rate and
    /// the overall rate.
    pub wracc: f64,
    /// One-sided p-value of Fisher's exact test among the training runs.
    pub p: f64,
    /// `p` adjusted for all boxes tried (Benjamini and Hochberg), an upper bound.
    pub q: f64,
    /// One-sided p-value of Fisher's exact test among the held-out runs, adjusted for the number of patterns (Holm).
    pub p_held_out: f64,
    /// Whether the pattern is significant among the held-out runs.
    pub confirmed: bool,
}

/// The result of pattern mining.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Patterns {
    /// Patterns in the order of discovery, strongest first.
    pub patterns: Vec<Pattern>,
    /// Number of decided runs.
    pub runs: u64,
    /// Number of failed runs.
    pub failed: u64,
    /// Number of held-out runs for the confirmation.
    pub held_out: u64,
    /// Number of conditions and combinations of conditions tried.
    pub tried: u64,
    /// Number of parameters that vary.
    pub parameters: usize,
    /// Maximum number of conditions tried. It is lower than requested if the correction for more combinations would
    /// hide every pattern.
    pub depth: usize,
    /// Number of parameters whose triples were combined.
    pub combined: usize,
}

impl Patterns {
    /// Iterates over the confirmed patterns.
    pub fn confirmed(&self) -> impl Iterator<Item = &Pattern> {
        self.patterns.iter().filter(|pattern| pattern.confirmed)
    }
}

/// Finds the conditions under which runs fail more often than elsewhere.
///
/// The score of a pattern is the likelihood ratio of separate failure rates within and outside against one common rate.
/// Ties go to fewer conditions. The same runs in the same order give the same patterns.
pub fn mine(input: &PatternInput, options: &PatternOptions) -> Patterns {
    let mut found = Patterns {
        runs: input.len() as u64,
        failed: input.failed.iter().filter(|failed| **failed).count() as u64,
        held_out: input.held_out.iter().filter(|held_out| **held_out).count() as u64,
        ..Patterns::default()
    };
    let open: Vec<bool> = input.held_out.iter().map(|held_out| !held_out).collect();
    let runs = open.iter().filter(|open| **open).count();
    let axes = axes(input, &open, cells(runs, options.cells));
    found.parameters = axes.len();
    let rounds = search(input, open, &axes, options, &mut found);
    let probabilities: Vec<f64> = rounds.iter().map(|(_, table)| table.fisher().greater).collect();
    let adjusted = benjamini_hochberg(&probabilities, found.tried);
    let conditions: Vec<Vec<Condition>> = rounds.iter().map(|(conditions, _)| conditions.clone()).collect();
    let confirmed = confirm(&conditions, input);
    for ((((conditions, searched), p), q), (held_out, p_held_out)) in
        rounds.into_iter().zip(probabilities).zip(adjusted).zip(confirmed)
    {
        let within = all_hold(&conditions, input);
        let all = count(input, &within, |_| true);
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

/// Returns the number of cells for a number of runs. With few runs, many narrow ranges would only add false positives.
fn cells(runs: usize, most: usize) -> usize {
    (libm::cbrt(runs as f64) as usize).clamp(4, 64).min(most.max(2))
}

/// Finds patterns, each with its counts among the runs that were still open when it was found.
fn search(
    input: &PatternInput,
    mut open: Vec<bool>,
    axes: &[Axis],
    options: &PatternOptions,
    found: &mut Patterns,
) -> Vec<(Vec<Condition>, TwoByTwo)> {
    let mut rounds: Vec<(Vec<Condition>, TwoByTwo)> = Vec::new();
    while rounds.len() < options.most_patterns {
        let whole = count(input, &vec![true; input.len()], |run| open[run]);
        if whole.failed_in.min(whole.passed_in) < LEAST_OF_EACH {
            break;
        }
        let depth = affordable_depth(axes, whole, options);
        found.depth = found.depth.max(depth);
        let likelihood =
            Likelihood::new((0..open.len()).filter(|run| open[*run]).map(|run| one(input.failed[run])).sum());
        let runs = Runs::new(axes, &input.failed, &open, &likelihood);
        let mut best = runs.best(depth, options.work);
        found.tried += best.tried;
        found.combined = found.combined.max(best.combined);
        if best.conditions.is_empty() {
            break;
        }
        let open_runs = OpenRuns { input, open: &open, axes, likelihood: &likelihood };
        simplify(&mut best.conditions, &open_runs, options.level);
        let table = count(input, &all_hold(&best.conditions, input), |run| open[run]);
        // Later patterns are weaker: if this one is not significant, they are not either.
        let rank = rounds.len() as f64 + 1.0;
        if table.fisher().greater * found.tried as f64 / rank > options.level {
            break;
        }
        // Bounds between the cuts describe the pattern better. They are not part of the test, because not all of them
        // were tried.
        refine(&mut best.conditions, &open_runs);
        let within = all_hold(&best.conditions, input);
        open.iter_mut().zip(&within).for_each(|(open, within)| *open &= !within);
        rounds.push((best.conditions, table));
    }
    rounds
}

/// Returns the maximum number of conditions, at least one, with which a pattern of half of all failures and no passes
/// would still be significant.
///
/// It depends only on the numbers of runs and failures, not on which runs failed, so that the choice does not bias the
/// test.
fn affordable_depth(axes: &[Axis], whole: TwoByTwo, options: &PatternOptions) -> usize {
    let failed_in = whole.failed_in.div_ceil(2);
    let ideal =
        TwoByTwo { failed_in, passed_in: 0, failed_out: whole.failed_in - failed_in, passed_out: whole.passed_in };
    let p = ideal.fisher().greater;
    // Number of boxes of one, two and three conditions: sums of products of the numbers of conditions on different
    // parameters.
    let mut boxes = [1.0, 0.0, 0.0, 0.0];
    for axis in axes {
        for conditions in (1..boxes.len()).rev() {
            boxes[conditions] += boxes[conditions - 1] * axis.len() as f64;
        }
    }
    let affordable = |depth: &usize| p * boxes[1..=*depth].iter().sum::<f64>() <= options.level;
    (2..=options.most_conditions.min(3)).rev().find(affordable).unwrap_or(1)
}
