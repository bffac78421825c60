//! The cost of a position for a base of a given radius.

use crate::navigate::grid::{CELL_M, Grid};
use crate::route::length;

/// Clearance beside the base beyond which more brings no benefit. Unit: metres.
const AMPLE_M: f64 = 0.35;
/// Factor by which a path with ample clearance may be longer than one that just fits.
const DEAR: f64 = 3.0;
/// Within this distance, a base that is too close to an obstacle may move away from it. Unit:
/// metres.
const ESCAPE_M: f64 = 0.6;

/// A grid with the costs for a base that drives on it.
#[derive(Debug, Clone)]
pub struct Terrain<'a> {
    grid: &'a Grid,
    /// Distance from each cell to the nearest obstacle. Unit: metres.
    clear_m: Vec<f64>,
    /// Distance that the base's centre has to keep. Unit: metres.
    keep_m: f64,
    /// Position of the base, and its clearance there.
    from: [f64; 2],
    from_clear_m: f64,
}

impl<'a> Terrain<'a> {
    /// The terrain for a base at `from` that has to keep a distance.
    pub fn new(grid: &'a Grid, keep_m: f64, from: [f64; 2]) -> Self {
        let clear_m: Vec<f64> = grid
            .seen_m()
            .iter()
            .zip(grid.mapped_m())
            .map(|(a, b)| a.min(*b))
            .collect();
        let from_clear_m = grid.cell(from).map_or(0.0, |cell| clear_m[cell]);
        Self {
            grid,
            clear_m,
            keep_m,
            from,
            from_clear_m,
        }
    }

    /// The grid.
    pub fn grid(&self) -> &Grid {
        self.grid
    }

    /// Cost of a path at a cell, relative to its length: 1 with ample clearance. Returns `None` if
    /// the base can't be there.
    pub fn factor(&self, cell: usize) -> Option<f64> {
        let clear = *self.clear_m.get(cell)?;
        let room = clear - self.keep_m;
        if room < 0.0 {
            let [x, y] = self.grid.middle(cell);
            let near = length(x - self.from[0], y - self.from[1]) <= ESCAPE_M;
            return (near && clear > 0.0 && clear >= self.from_clear_m - CELL_M / 2.0)
                .then_some(2.0 * DEAR);
        }
        let lack = ((AMPLE_M - room) / AMPLE_M).max(0.0);
        Some(1.0 + (DEAR - 1.0) * lack * lack)
    }

    /// Cost of a straight path. Unit: metres. Returns `None` if it is not free.
    pub fn straight(&self, from: [f64; 2], to: [f64; 2]) -> Option<f64> {
        let way = length(to[0] - from[0], to[1] - from[1]);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a few metres of centimetres"
        )]
        let n_steps = (2.0 * way / CELL_M).ceil().max(1.0) as usize;
        let mut cost = 0.0;
        for step in 0..=n_steps {
            let share = step as f64 / n_steps as f64;
            let at = [0, 1].map(|axis| from[axis] + (to[axis] - from[axis]) * share);
            cost += self.factor(self.grid.cell(at)?)? * way / (n_steps + 1) as f64;
        }
        Some(cost)
    }
}
