//! Failure rates by one or two parameters, for heat maps.

use crate::patterns::simplest_between;
use crate::{Interval, Parameter, PatternInput, Values};

/// Maximum number of cells along a numeric axis.
const MOST_CELLS: usize = 8;

/// Failure rates by one or two parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct TwoWay {
    /// Names of the parameters: that of the rows and, if there are two, that of the columns.
    pub by: Vec<String>,
    /// Labels of the rows.
    pub down: Vec<String>,
    /// Labels of the columns. A single empty label if there is only one parameter.
    pub across: Vec<String>,
    /// Cells by row and column. Runs without a value are in no cell.
    pub cells: Vec<Vec<TwoWayCell>>,
}

/// A cell.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TwoWayCell {
    /// Number of decided runs.
    pub runs: u64,
    /// Number of failed runs among them.
    pub failed: u64,
    /// Failure rate. `None` without runs.
    pub failing: Option<Interval>,
}

/// Counts failures by one or two named parameters. Returns `None` if one does not exist.
///
/// Numeric ranges are cut into equal steps, so that positions form an undistorted map.
pub fn two_way(input: &PatternInput, by: &[&str]) -> Option<TwoWay> {
    let parameter = |name: &str| {
        input
            .parameters
            .iter()
            .find(|parameter| parameter.name == name)
    };
    let down = labelled(parameter(by.first()?)?);
    let across = match by.get(1) {
        Some(name) => labelled(parameter(name)?),
        None => (vec![String::new()], vec![Some(0); input.len()]),
    };
    let mut cells = vec![vec![TwoWayCell::default(); across.0.len()]; down.0.len()];
    for run in 0..input.len() {
        if let (Some(row), Some(column)) = (down.1[run], across.1[run]) {
            let cell = &mut cells[row][column];
            cell.runs += 1;
            cell.failed += u64::from(input.failed[run]);
        }
    }
    cells
        .iter_mut()
        .flatten()
        .for_each(|cell| cell.failing = input.sampling.interval(cell.failed, cell.runs));
    let by = by.iter().take(2).map(|name| (*name).to_owned()).collect();
    Some(TwoWay {
        by,
        down: down.0,
        across: across.0,
        cells,
    })
}

/// Returns labels, and the index of each run's label.
fn labelled(parameter: &Parameter) -> (Vec<String>, Vec<Option<usize>>) {
    match &parameter.values {
        Values::Kinds { of_run, names, .. } => {
            let mut order: Vec<usize> = (0..names.len()).collect();
            order.sort_by_key(|place| &names[*place]);
            let mut rank = vec![0; names.len()];
            order
                .iter()
                .enumerate()
                .for_each(|(at, place)| rank[*place] = at);
            let labels = order.iter().map(|place| names[*place].clone()).collect();
            (
                labels,
                of_run
                    .iter()
                    .map(|of| of.map(|of| rank[of as usize]))
                    .collect(),
            )
        }
        Values::Numbers(numbers) | Values::Angles(numbers) => {
            let bounds = bounds(numbers);
            let labels = bounds
                .windows(2)
                .map(|pair| format!("{} – {}", pair[0], pair[1]))
                .collect();
            let last = bounds.len().saturating_sub(2);
            let cell = |value: &f64| {
                let below = bounds.partition_point(|bound| *bound <= *value);
                (!value.is_nan() && !bounds.is_empty()).then(|| below.saturating_sub(1).min(last))
            };
            (labels, numbers.iter().map(cell).collect())
        }
    }
}

/// Returns the bounds of a few equal, round steps that cover all numbers.
fn bounds(numbers: &[f64]) -> Vec<f64> {
    let known = || numbers.iter().copied().filter(|number| number.is_finite());
    let (Some(least), Some(most)) = (
        known().min_by(f64::total_cmp),
        known().max_by(f64::total_cmp),
    ) else {
        return Vec::new();
    };
    if least == most {
        return vec![least, most];
    }
    // Round steps are 1, 2 and 5 times a power of ten. For integers, the step is at least 1.
    let finest = if known().all(|number| number.fract() == 0.0) {
        1.0
    } else {
        0.0
    };
    let rough = f64::max((most - least) / MOST_CELLS as f64, finest);
    let power = libm::exp10(libm::floor(libm::log10(rough)));
    let step = [1.0, 2.0, 5.0, 10.0]
        .map(|times| times * power)
        .into_iter()
        .find(|step| *step >= rough)
        .unwrap_or(rough);
    let first = libm::floor(least / step);
    let count = (libm::floor(most / step) - first) as usize + 1;
    let near = |number: f64| simplest_between(number - step * 1e-6, number + step * 1e-6);
    (0..=count)
        .map(|at| near((first + at as f64) * step))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_round_and_cover_all_values() {
        let expected = [-0.6, -0.4, -0.2, 0.0, 0.2, 0.4, 0.6];
        let found = bounds(&[-0.599, 0.598, f64::NAN]);
        assert_eq!(found.len(), expected.len());
        assert!(
            found
                .iter()
                .zip(expected)
                .all(|(a, b)| (a - b).abs() < 1e-12),
            "{found:?}"
        );
        assert_eq!(bounds(&[2.0, 2.0]), [2.0, 2.0]);
        assert!(bounds(&[f64::NAN]).is_empty());
        let counts = bounds(&[0.0, 1.0, 6.0]);
        assert_eq!(counts, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
    }
}
