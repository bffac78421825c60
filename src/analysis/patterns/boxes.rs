//! Exhaustive search for the box of cells with the highest score.

use crate::patterns::Condition;
use crate::patterns::cells::{Axis, Conditions};
use crate::patterns::likelihood::{Count, Likelihood, failures_of, one};

/// Summing the boxes of three parameters costs as much as counting this many runs. (Measured with
/// eight cells each.)
const BOXES_IN_RUNS: u64 = 50_000;

/// The best box with up to some number of conditions, and the extent of the search.
#[derive(Debug, Clone, Default)]
pub(super) struct Best {
    /// Conditions on different parameters. Empty if no box scores above 0.
    pub conditions: Vec<Condition>,
    /// Score of the box.
    pub score: f64,
    /// Number of boxes tried with exactly that number of conditions.
    pub tried: u64,
    /// Number of parameters whose triples were combined.
    pub combined: usize,
}

/// The open runs, in the cells of every parameter.
pub(super) struct Runs<'a> {
    axes: &'a [Axis],
    /// For each axis, the cells of the runs.
    cells: Vec<Vec<u8>>,
    ones: Vec<Count>,
    likelihood: &'a Likelihood,
}

impl<'a> Runs<'a> {
    /// Selects the open runs.
    pub fn new(
        axes: &'a [Axis],
        failed: &[bool],
        open: &[bool],
        likelihood: &'a Likelihood,
    ) -> Self {
        let part: Vec<usize> = (0..open.len()).filter(|run| open[*run]).collect();
        let of = |axis: &Axis| part.iter().map(|run| axis.of_run[*run]).collect();
        Self {
            axes,
            cells: axes.iter().map(of).collect(),
            ones: part.iter().map(|run| one(failed[*run])).collect(),
            likelihood,
        }
    }

    /// Returns the boxes with the highest scores and at most one, two, … `most_conditions`
    /// conditions (at most three). Ties go to fewer conditions, then to earlier parameters.
    ///
    /// Every box is tried, except those whose upper bound does not exceed the best score. If all
    /// triples of parameters would take more than `work` steps, only the parameters of the best
    /// pairs are combined, as many as `work` allows.
    pub fn best(&self, most_conditions: usize, work: u64) -> Vec<Best> {
        let mut best = Best::default();
        for axis in 0..self.axes.len() {
            self.lines(axis, &mut best);
        }
        let mut found = vec![best.clone()];
        if most_conditions < 2 {
            return found;
        }
        best.tried = 0;
        let mut promise = vec![0.0f64; self.axes.len()];
        for first in 0..self.axes.len() {
            for second in first + 1..self.axes.len() {
                let score = self.rectangles([first, second], &mut best);
                promise[first] = promise[first].max(score);
                promise[second] = promise[second].max(score);
            }
        }
        found.push(best.clone());
        if most_conditions < 3 {
            return found;
        }
        best.tried = 0;
        let combined = self.promising(&promise, work);
        best.combined = combined.len();
        for (at, first) in combined.iter().enumerate() {
            for (behind, second) in combined[at + 1..].iter().enumerate() {
                let pair = self.places([*first, *second]);
                for third in &combined[at + 1 + behind + 1..] {
                    self.boxes([*first, *second, *third], &pair, &mut best);
                }
            }
        }
        found.push(best);
        found
    }

    /// Selects the most promising parameters for triples, in their original order.
    fn promising(&self, promise: &[f64], work: u64) -> Vec<usize> {
        let runs = self.ones.len() as u64;
        let triples = |count: u64| count * count.saturating_sub(1) * count.saturating_sub(2) / 6;
        let cost = |count: u64| triples(count) * (runs + BOXES_IN_RUNS);
        let affordable = (3..=self.axes.len() as u64)
            .take_while(|count| cost(*count) <= work)
            .last()
            .unwrap_or(3);
        let mut order: Vec<usize> = (0..self.axes.len()).collect();
        order.sort_by(|a, b| promise[*b].total_cmp(&promise[*a]).then(a.cmp(b)));
        order.truncate(usize::try_from(affordable).unwrap_or(usize::MAX));
        order.sort_unstable();
        order
    }

    fn lines(&self, axis: usize, best: &mut Best) {
        let along = &self.axes[axis];
        let mut sums = vec![0; along.cells];
        for (cell, one) in self.cells[axis].iter().zip(&self.ones) {
            sums[usize::from(*cell)] += one;
        }
        best.tried += along.len() as u64;
        let (score, place) = along.highest(&sums, self.likelihood, 0);
        best.take(score, || vec![along.condition(place)]);
    }

    /// Tries all pairs of conditions on two parameters. Returns the score of the best pair.
    fn rectangles(&self, [first, second]: [usize; 2], best: &mut Best) -> f64 {
        let (across, along) = (&self.axes[first], &self.axes[second]);
        let mut sums = vec![0; across.cells * along.cells];
        for (place, one) in self.places([first, second]).iter().zip(&self.ones) {
            sums[*place as usize] += one;
        }
        best.tried += across.len() as u64 * along.len() as u64;
        let mut rows = Vec::new();
        across.expand(&sums, along.cells, &mut rows);
        let mut highest = 0.0f64;
        for (of_first, row) in rows.chunks_exact(along.cells).enumerate() {
            let fewest = self.likelihood.fewest_failures(highest);
            if failures(row) < fewest {
                continue;
            }
            let (score, of_second) = along.highest(row, self.likelihood, fewest);
            highest = highest.max(score);
            best.take(score, || {
                vec![across.condition(of_first), along.condition(of_second)]
            });
        }
        highest
    }

    fn boxes(&self, [first, second, third]: [usize; 3], pair: &[u32], best: &mut Best) {
        let [a, b, c] = [first, second, third].map(|axis| &self.axes[axis]);
        let mut sums = vec![0; a.cells * b.cells * c.cells];
        for ((place, cell), one) in pair.iter().zip(&self.cells[third]).zip(&self.ones) {
            let sum: &mut Count = &mut sums[*place as usize * c.cells + usize::from(*cell)];
            *sum = sum.wrapping_add(*one);
        }
        best.tried += a.len() as u64 * b.len() as u64 * c.len() as u64;
        let (mut planes, mut rows) = (Vec::new(), Vec::new());
        let mut fewest = self.likelihood.fewest_failures(best.score);
        a.expand(&sums, b.cells * c.cells, &mut planes);
        for (of_first, plane) in planes.chunks_exact(b.cells * c.cells).enumerate() {
            if failures(plane) < fewest {
                continue;
            }
            b.expand(plane, c.cells, &mut rows);
            for (of_second, row) in rows.chunks_exact(c.cells).enumerate() {
                if failures(row) < fewest {
                    continue;
                }
                let (score, of_third) = c.highest(row, self.likelihood, fewest);
                if best.take(score, || {
                    vec![
                        a.condition(of_first),
                        b.condition(of_second),
                        c.condition(of_third),
                    ]
                }) {
                    fewest = self.likelihood.fewest_failures(best.score);
                }
            }
        }
    }

    /// Returns the cell of each run in the grid of two parameters.
    fn places(&self, [first, second]: [usize; 2]) -> Vec<u32> {
        let width = self.axes[second].cells as u32;
        let cells = self.cells[first].iter().zip(&self.cells[second]);
        cells
            .map(|(first, second)| u32::from(*first) * width + u32::from(*second))
            .collect()
    }
}

impl Best {
    /// Takes a box if it scores higher. Returns whether it does.
    fn take(&mut self, score: f64, conditions: impl FnOnce() -> Vec<Condition>) -> bool {
        let is_higher = score > self.score;
        if is_higher {
            self.score = score;
            self.conditions = conditions();
        }
        is_higher
    }
}

/// Returns the number of failures in some cells.
fn failures(cells: &[Count]) -> u64 {
    failures_of(cells.iter().fold(0, |sum, count| sum.wrapping_add(*count)))
}

impl Axis {
    /// Returns the highest score of the conditions with at least `fewest` failures, and the index
    /// of its condition, or (0, 0) if no score exceeds 0.
    pub(super) fn highest(
        &self,
        row: &[Count],
        likelihood: &Likelihood,
        fewest: u64,
    ) -> (f64, usize) {
        let mut highest = (0.0, 0);
        let mut place = 0;
        let mut look = |count: Count, place: &mut usize| {
            if failures_of(count) >= fewest {
                let score = likelihood.gain(count);
                if score > highest.0 {
                    highest = (score, *place);
                }
            }
            *place += 1;
        };
        match &self.conditions {
            Conditions::Ranges(_) | Conditions::Arcs(_) => {
                let all = row[1..self.cells]
                    .iter()
                    .fold(0, |sum: Count, count| sum.wrapping_add(*count));
                let mut rest = all;
                for first in 1..self.cells {
                    // The other ranges have no more failures than those that begin here together.
                    if failures_of(rest) < fewest {
                        place = self.cells * (self.cells - 1) / 2;
                        break;
                    }
                    let mut sum: Count = 0;
                    for count in &row[first..self.cells] {
                        sum = sum.wrapping_add(*count);
                        look(sum, &mut place);
                    }
                    rest = rest.wrapping_sub(row[first]);
                }
                if let Conditions::Arcs(_) = self.conditions {
                    let (mut begun, mut outside) = (0, all);
                    for (first, last) in self.gaps() {
                        let from = if begun == first { last } else { first };
                        let before = if begun == first { outside } else { all };
                        outside = row[from..=last]
                            .iter()
                            .fold(before, |sum, count| sum.wrapping_sub(*count));
                        begun = first;
                        look(outside, &mut place);
                    }
                }
            }
            Conditions::Kinds(kinds) => {
                for (_, members) in kinds {
                    look(
                        members
                            .iter()
                            .fold(0, |sum, cell| sum.wrapping_add(row[*cell])),
                        &mut place,
                    );
                }
            }
        }
        highest
    }
}
