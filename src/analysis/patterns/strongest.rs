//! The strongest conditions where no pattern is beyond chance, and the number of runs that would
//! decide.

use crate::patterns::cells::{Axis, axes};
use crate::patterns::condition::all_hold;
use crate::patterns::confirm::count;
use crate::patterns::likelihood::{Likelihood, one};
use crate::patterns::mine::cells;
use crate::patterns::{Condition, PatternInput, PatternOptions};
use crate::runs_needed::{POWER, TwoRates};
use crate::{Interval, Sampling, TwoByTwo};

/// Maximum number of conditions.
const MOST: usize = 3;
/// A condition of fewer failed runs is hardly a condition.
const LEAST_FAILED: u64 = 2;

/// A condition under which runs failed more often than elsewhere, perhaps by chance.
#[derive(Debug, Clone, PartialEq)]
pub struct Strongest {
    /// The condition.
    pub condition: Condition,
    /// Counts among all decided runs.
    pub all: TwoByTwo,
    /// Failure rate of the runs in which it holds.
    pub rate: Interval,
    /// Failure rate of all other runs.
    pub elsewhere: Interval,
    /// One-sided p-value of Fisher's exact test among all decided runs.
    pub p: f64,
    /// `p` corrected for all single conditions (Bonferroni), as patterns are: times their number
    /// and the number of families.
    pub p_corrected: f64,
    /// Number of runs with which a difference of this size, if it is real, is found and confirmed
    /// with a probability of 80 %: significant among the two thirds that are searched, after the
    /// same correction, and among the third that is held out.
    pub runs_needed: Option<f64>,
}

/// Returns the strongest condition of each of the parameters with the strongest ones, strongest
/// first.
///
/// All runs are used, held out or not, with bounds at the cuts.
pub(super) fn strongest(
    input: &PatternInput,
    options: &PatternOptions,
    families: usize,
) -> Vec<Strongest> {
    let everyone = vec![true; input.len()];
    let all = (0..input.len()).map(|run| one(input.failed[run])).sum();
    let likelihood = Likelihood::new(all);
    let axes = axes(input, &everyone, cells(input.len(), options.cells));
    let tests = axes.iter().map(Axis::len).sum::<usize>() as f64 * families.max(1) as f64;
    let mut best: Vec<(f64, Condition)> = axes
        .iter()
        .filter_map(|axis| best_of(axis, input, &likelihood))
        .collect();
    best.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut known: Vec<Vec<bool>> = Vec::new();
    let mut found = Vec::new();
    for (_, condition) in best {
        let holds = all_hold(std::slice::from_ref(&condition), input);
        // Parameters may say the same in different ways.
        if known.contains(&holds) {
            continue;
        }
        let table = count(input, &holds, |_| true);
        if table.failed_in >= LEAST_FAILED {
            found.extend(assessed(
                condition,
                table,
                input.sampling,
                (tests, options.level),
            ));
            known.push(holds);
        }
        if found.len() == MOST {
            break;
        }
    }
    found
}

/// Returns the condition of an axis with the highest score above 0.
fn best_of(axis: &Axis, input: &PatternInput, likelihood: &Likelihood) -> Option<(f64, Condition)> {
    let mut sums = vec![0; axis.cells];
    for (cell, failed) in axis.of_run.iter().zip(&input.failed) {
        sums[usize::from(*cell)] += one(*failed);
    }
    let (score, place) = axis.highest(&sums, likelihood, 0);
    (score > 0.0).then(|| (score, axis.condition(place)))
}

fn assessed(
    condition: Condition,
    all: TwoByTwo,
    sampling: Sampling,
    (tests, level): (f64, f64),
) -> Option<Strongest> {
    let (inside, outside) = (
        all.failed_in + all.passed_in,
        all.failed_out + all.passed_out,
    );
    let (rate, elsewhere) = (
        sampling.interval(all.failed_in, inside)?,
        sampling.interval(all.failed_out, outside)?,
    );
    let p = all.fisher().greater;
    let rates = TwoRates {
        within: rate.rate,
        outside: elsewhere.rate,
        share: inside as f64 / (inside + outside) as f64,
    };
    let searched = rates
        .runs_needed(level / tests, POWER)
        .map(|runs| runs * 1.5);
    let confirmed = rates.runs_needed(level, POWER).map(|runs| runs * 3.0);
    Some(Strongest {
        condition,
        all,
        rate,
        elsewhere,
        p,
        p_corrected: (p * tests).min(1.0),
        runs_needed: searched
            .zip(confirmed)
            .map(|(searched, confirmed)| searched.max(confirmed).ceil()),
    })
}
