//! Sequential covering: finds the strongest pattern, then the strongest among the runs that it does
//! not explain, and so on.
//!
//! Patterns with one, two and three conditions are three families of tests, and each gets an equal
//! share of the level. There are thousands of times as many combinations of three conditions as
//! single ones; corrected for all of them, a simple cause would stay hidden.

use crate::patterns::boxes::{Best, Runs};
use crate::patterns::cells::{Axis, axes};
use crate::patterns::condition::all_hold;
use crate::patterns::confirm::{confirm, count};
use crate::patterns::likelihood::{Likelihood, one};
use crate::patterns::refine::{OpenRuns, refine};
use crate::patterns::simplify::simplify;
use crate::patterns::strongest::{Strongest, strongest};
use crate::patterns::{Condition, PatternInput};
use crate::{Interval, TwoByTwo, benjamini_hochberg};

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
        Self {
            most_conditions: 3,
            level: 0.05,
            cells: 8,
            most_patterns: 8,
            work: 40_000_000,
        }
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
    /// Counts among the training runs (without held-out runs and those of earlier patterns), with
    /// bounds at the cuts. Refined bounds are not part of the test, because not all of them were
    /// tried.
    pub searched: TwoByTwo,
    /// Counts among the held-out runs that no earlier pattern contains.
    pub held_out: TwoByTwo,
    /// Failure rate within the pattern.
    pub rate: Interval,
    /// Failure rate of all other runs. `None` if there are none.
    pub elsewhere: Option<Interval>,
    /// Failure rate within the pattern divided by the overall failure rate.
    pub lift: f64,
    /// Weighted relative accuracy: the pattern's share of all runs times the difference between its
    /// failure rate and the overall rate.
    pub wracc: f64,
    /// One-sided p-value of Fisher's exact test among the training runs.
    pub p: f64,
    /// `p` adjusted for all boxes tried (Benjamini and Hochberg, weighted so that patterns with
    /// one, two and three conditions have equal shares), an upper bound.
    ///
    /// Source of the weights: C. R. Genovese, K. Roeder and L. Wasserman, "False discovery control
    /// with p-value weighting", Biometrika 93 (2006) 509–524.
    pub q: f64,
    /// One-sided p-value of Fisher's exact test among the held-out runs, adjusted for the number of
    /// patterns (Holm).
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
    /// Maximum number of conditions tried. It is lower than requested if the correction for more
    /// combinations would hide every pattern.
    pub depth: usize,
    /// Number of parameters whose triples were combined.
    pub combined: usize,
    /// The strongest single conditions, if no pattern is confirmed. They may be due to chance.
    pub strongest: Vec<Strongest>,
}

impl Patterns {
    /// Iterates over the confirmed patterns.
    pub fn confirmed(&self) -> impl Iterator<Item = &Pattern> {
        self.patterns.iter().filter(|pattern| pattern.confirmed)
    }
}

/// Finds the conditions under which runs fail more often than elsewhere.
///
/// The score of a pattern is the likelihood ratio of separate failure rates within and outside
/// against one common rate. Ties go to fewer conditions. The same runs in the same order give the
/// same patterns.
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
    let mut families = Families::default();
    let rounds = search(input, open, &axes, options, &mut found, &mut families);
    found.tried = families.tried.iter().sum();
    let (probabilities, adjusted) = adjusted(&rounds, &families);
    let conditions: Vec<Vec<Condition>> = rounds
        .iter()
        .map(|(conditions, _)| conditions.clone())
        .collect();
    let confirmed = confirm(&conditions, input);
    for ((((conditions, searched), p), q), (held_out, p_held_out)) in rounds
        .into_iter()
        .zip(probabilities)
        .zip(adjusted)
        .zip(confirmed)
    {
        let within = all_hold(&conditions, input);
        let all = count(input, &within, |_| true);
        let (inside, outside) = (
            all.failed_in + all.passed_in,
            all.failed_out + all.passed_out,
        );
        let Some(rate) = input.sampling.interval(all.failed_in, inside) else {
            continue;
        };
        let overall = found.failed as f64 / found.runs as f64;
        found.patterns.push(Pattern {
            conditions,
            runs: (0..within.len()).filter(|run| within[*run]).collect(),
            all,
            searched,
            held_out,
            rate,
            elsewhere: input.sampling.interval(all.failed_out, outside),
            lift: rate.rate / overall,
            wracc: inside as f64 / found.runs as f64 * (rate.rate - overall),
            p,
            q,
            p_held_out,
            confirmed: p_held_out <= options.level,
        });
    }
    if found.confirmed().next().is_none() {
        found.strongest = strongest(input, options, families.count());
    }
    found
}

/// Returns the p-values of patterns, and the adjusted ones.
fn adjusted(rounds: &[(Vec<Condition>, TwoByTwo)], families: &Families) -> (Vec<f64>, Vec<f64>) {
    let tried = families.tried.iter().sum::<u64>().max(1);
    let probabilities: Vec<f64> = rounds
        .iter()
        .map(|(_, table)| table.fisher().greater)
        .collect();
    let weighted = |((conditions, _), p): (&(Vec<Condition>, TwoByTwo), &f64)| {
        p * families.tests(conditions.len()) / tried as f64
    };
    let weighted: Vec<f64> = rounds.iter().zip(&probabilities).map(weighted).collect();
    let adjusted = benjamini_hochberg(&weighted, tried)
        .into_iter()
        .map(|adjusted| adjusted.min(1.0))
        .collect();
    (probabilities, adjusted)
}

/// Returns the number of cells for a number of runs. With few runs, many narrow ranges would only
/// add false positives.
pub(super) fn cells(runs: usize, most: usize) -> usize {
    (libm::cbrt(runs as f64) as usize)
        .clamp(4, 64)
        .min(most.max(2))
}

/// The families of tests: patterns with one, two and three conditions.
#[derive(Debug, Clone, Copy, Default)]
struct Families {
    /// Number of boxes tried in each.
    tried: [u64; 3],
}

impl Families {
    fn add(&mut self, found: &[Best]) {
        self.tried
            .iter_mut()
            .zip(found)
            .for_each(|(tried, best)| *tried += best.tried);
    }

    /// Number of families with tests.
    fn count(&self) -> usize {
        self.tried.iter().filter(|tried| **tried > 0).count()
    }

    /// Number of tests that a pattern with this many conditions is corrected for: those of its
    /// family, times the number of families.
    fn tests(&self, conditions: usize) -> f64 {
        let tried = conditions
            .checked_sub(1)
            .and_then(|family| self.tried.get(family))
            .copied()
            .unwrap_or_default();
        tried as f64 * self.count() as f64
    }
}

/// Finds patterns, each with its counts among the runs that were still open when it was found.
fn search(
    input: &PatternInput,
    mut open: Vec<bool>,
    axes: &[Axis],
    options: &PatternOptions,
    found: &mut Patterns,
    families: &mut Families,
) -> Vec<(Vec<Condition>, TwoByTwo)> {
    let mut rounds: Vec<(Vec<Condition>, TwoByTwo)> = Vec::new();
    while rounds.len() < options.most_patterns {
        let whole = count(input, &vec![true; input.len()], |run| open[run]);
        if whole.failed_in.min(whole.passed_in) < LEAST_OF_EACH {
            break;
        }
        let depth = affordable_depth(axes, whole, options);
        found.depth = found.depth.max(depth);
        let likelihood = Likelihood::new(
            (0..open.len())
                .filter(|run| open[*run])
                .map(|run| one(input.failed[run]))
                .sum(),
        );
        let runs = Runs::new(axes, &input.failed, &open, &likelihood);
        let best = runs.best(depth, options.work);
        families.add(&best);
        found.combined = best
            .iter()
            .map(|best| best.combined)
            .fold(found.combined, usize::max);
        let open_runs = OpenRuns {
            input,
            open: &open,
            axes,
            likelihood: &likelihood,
        };
        // Later patterns are weaker: if none is significant now, they are not either.
        let rank = rounds.len() as f64 + 1.0;
        let Some((mut conditions, table)) = significant(
            best,
            &open_runs,
            families,
            [options.level * rank, options.level],
        ) else {
            break;
        };
        // Bounds between the cuts describe the pattern better. They are not part of the test,
        // because not all of them were tried.
        refine(&mut conditions, &open_runs);
        let within = all_hold(&conditions, input);
        open.iter_mut()
            .zip(&within)
            .for_each(|(open, within)| *open &= !within);
        rounds.push((conditions, table));
    }
    rounds
}

/// Returns the significant pattern with the highest score, simplified, with its counts among the
/// open runs. Boxes with more conditions have higher scores.
fn significant(
    best: Vec<Best>,
    open_runs: &OpenRuns<'_>,
    families: &Families,
    [level, simpler_level]: [f64; 2],
) -> Option<(Vec<Condition>, TwoByTwo)> {
    let found = best
        .into_iter()
        .rev()
        .map(|best| best.conditions)
        .filter(|conditions| !conditions.is_empty());
    found
        .map(|mut conditions| {
            simplify(&mut conditions, open_runs, simpler_level);
            let within = all_hold(&conditions, open_runs.input);
            (
                conditions,
                count(open_runs.input, &within, |run| open_runs.open[run]),
            )
        })
        .find(|(conditions, table)| {
            table.fisher().greater * families.tests(conditions.len()) <= level
        })
}

/// Returns the maximum number of conditions, at least one, with which a pattern of half of all
/// failures and no passes would still be significant.
///
/// It depends only on the numbers of runs and failures, not on which runs failed, so that the
/// choice does not bias the test.
fn affordable_depth(axes: &[Axis], whole: TwoByTwo, options: &PatternOptions) -> usize {
    let failed_in = whole.failed_in.div_ceil(2);
    let ideal = TwoByTwo {
        failed_in,
        passed_in: 0,
        failed_out: whole.failed_in - failed_in,
        passed_out: whole.passed_in,
    };
    let p = ideal.fisher().greater;
    // Number of boxes of one, two and three conditions: sums of products of the numbers of
    // conditions on different parameters.
    let mut boxes = [1.0, 0.0, 0.0, 0.0];
    for axis in axes {
        for conditions in (1..boxes.len()).rev() {
            boxes[conditions] += boxes[conditions - 1] * axis.len() as f64;
        }
    }
    let affordable = |depth: &usize| p * boxes[1..=*depth].iter().sum::<f64>() <= options.level;
    (2..=options.most_conditions.min(3))
        .rev()
        .find(affordable)
        .unwrap_or(1)
}
