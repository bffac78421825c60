//! Refinement of range bounds to the best separation of failures and passes.

use std::ops::RangeInclusive;

use crate::patterns::cells::{Axis, Conditions, Cut};
use crate::patterns::condition::all_hold;
use crate::patterns::likelihood::{Count, Likelihood, one};
use crate::patterns::{Condition, PatternInput, simplest_between};

/// Bounds depend on each other, but converge quickly.
const MOST_PASSES: usize = 4;

/// The open runs, and the score of patterns among them.
pub(super) struct OpenRuns<'a> {
    pub input: &'a PatternInput,
    pub open: &'a [bool],
    pub axes: &'a [Axis],
    pub likelihood: &'a Likelihood,
}

/// Moves each bound in turn to the position with the highest score between the adjacent cuts, with
/// all other bounds fixed.
pub(super) fn refine(conditions: &mut [Condition], open_runs: &OpenRuns<'_>) {
    for _ in 0..MOST_PASSES {
        let before = conditions.to_vec();
        for at in 0..conditions.len() {
            let mut others = conditions.to_vec();
            let condition = others.remove(at);
            if let Some(better) = refined(&condition, &others, open_runs) {
                conditions[at] = better;
            }
        }
        if *conditions == *before {
            break;
        }
    }
}

/// Sorted distinct values with cumulative counts: the runs below each value, and below the end.
struct Scale {
    values: Vec<f64>,
    below: Vec<Count>,
}

impl Scale {
    fn new(numbers: &[f64], part: &[bool], open_runs: &OpenRuns<'_>) -> Self {
        let mut pairs: Vec<(f64, Count)> = (0..numbers.len())
            .filter(|run| part[*run] && open_runs.open[*run] && !numbers[*run].is_nan())
            .map(|run| (numbers[run], one(open_runs.input.failed[run])))
            .collect();
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut scale = Self {
            values: Vec::new(),
            below: vec![0],
        };
        let mut sum = 0;
        for (value, one) in pairs {
            sum += one;
            if scale.values.last() == Some(&value) {
                scale.below.pop();
            } else {
                scale.values.push(value);
            }
            scale.below.push(sum);
        }
        scale
    }

    /// Returns the number of values below a bound.
    fn place(&self, bound: f64) -> usize {
        self.values.partition_point(|value| *value < bound)
    }

    /// Returns a bound with this many values below it, or `None` if that is all values or none.
    fn bound(&self, place: usize) -> Option<f64> {
        (place > 0 && place < self.values.len())
            .then(|| simplest_between(self.values[place - 1], self.values[place]))
    }
}

fn refined(
    condition: &Condition,
    others: &[Condition],
    open_runs: &OpenRuns<'_>,
) -> Option<Condition> {
    let parameter = condition.parameter();
    // An arc is refined by the range that it leaves out.
    let (low, high, is_arc) = match condition {
        Condition::Range { low, high, .. } => (*low, *high, false),
        Condition::Arc { from, to, .. } => (Some(*to), Some(*from), true),
        Condition::Kind { .. } => return None,
    };
    let numbers = open_runs.input.parameters[parameter].values.numbers()?;
    let (Conditions::Ranges(cuts) | Conditions::Arcs(cuts)) = &open_runs
        .axes
        .iter()
        .find(|axis| axis.parameter == parameter)?
        .conditions
    else {
        return None;
    };
    let scale = Scale::new(numbers, &all_hold(others, open_runs.input), open_runs);
    let end = scale.values.len();
    let score = |first: usize, last: usize| {
        let between = scale.below[last] - scale.below[first];
        open_runs.likelihood.gain(if is_arc {
            scale.below[end] - between
        } else {
            between
        })
    };
    let (low, high) = refined_bounds([low, high], cuts, &scale, score);
    match (is_arc, low, high) {
        (true, Some(to), Some(from)) => Some(even(parameter, from, to, open_runs.input)),
        (true, ..) => None,
        (false, ..) => Some(Condition::Range {
            parameter,
            low,
            high,
        }),
    }
}

/// Returns an arc with the same runs whose bounds have the same size, if there is one: it is easier
/// to read.
fn even(parameter: usize, from: f64, to: f64, input: &PatternInput) -> Condition {
    let arc = Condition::Arc {
        parameter,
        from,
        to,
    };
    let holds = arc.holds(input);
    [from, -to]
        .into_iter()
        .filter(|bound| *bound > 0.0)
        .map(|bound| Condition::Arc {
            parameter,
            from: bound,
            to: -bound,
        })
        .find(|even| even.holds(input) == holds)
        .unwrap_or(arc)
}

/// Moves the bounds of a range of values, one after the other, to the positions with the highest
/// score.
fn refined_bounds(
    [mut low, mut high]: [Option<f64>; 2],
    cuts: &[Cut],
    scale: &Scale,
    score: impl Fn(usize, usize) -> f64,
) -> (Option<f64>, Option<f64>) {
    let end = scale.values.len();
    let (mut first, last) = (
        low.map_or(0, |low| scale.place(low)),
        high.map_or(end, |high| scale.place(high)),
    );
    if let Some(bound) = low {
        let window = window(bound, cuts, scale).filter(|place| *place <= last);
        let best = best(first, window, |place| score(place, last));
        if best != first {
            (first, low) = (best, scale.bound(best));
        }
    }
    if let Some(bound) = high {
        let window = window(bound, cuts, scale).filter(|place| *place >= first);
        let best = best(last, window, |place| score(first, place));
        if best != last {
            high = scale.bound(best);
        }
    }
    (low, high)
}

/// Returns the position with the highest score. Ties go to the current position.
fn best(now: usize, places: impl Iterator<Item = usize>, score: impl Fn(usize) -> f64) -> usize {
    let mut best = (score(now), now);
    for place in places {
        let score = score(place);
        if score > best.0 {
            best = (score, place);
        }
    }
    best.1
}

/// Returns the positions from the cut before a bound to the cut after it.
fn window(bound: f64, cuts: &[Cut], scale: &Scale) -> RangeInclusive<usize> {
    let before = cuts
        .iter()
        .rev()
        .map(|cut| cut.bound)
        .find(|cut| *cut < bound);
    let behind = cuts.iter().map(|cut| cut.bound).find(|cut| *cut > bound);
    before.map_or(0, |cut| scale.place(cut))
        ..=behind.map_or(scale.values.len(), |cut| scale.place(cut))
}
