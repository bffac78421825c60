//! An occupancy grid of the floor, from the map and from perception.

use nalgebra::{Isometry3, Point3};

use crate::memory::Standing;
use crate::route::length;
use actcheck_data::{FLOOR_M, Room};
use actcheck_scenario::{FloorPlan, Outline};

/// Edge of a cell. Unit: metres.
pub const CELL_M: f64 = 0.05;
/// Width of the floor around the map that belongs to the grid. Unit: metres.
const AROUND_M: f64 = 2.0;
/// Longest side of a grid. Unit: cells. That of the whole floor is 600.
const MOST_CELLS: usize = 640;
/// Number of points in a cell from which one picture counts it as occupied: fewer are noise.
const HITS: u16 = 3;
/// Evidence from one picture that shows an object in a cell, and from one that shows only floor.
const SEEN_TAKEN: i8 = 3;
const SEEN_FREE: i8 = -1;
/// Largest absolute evidence: further pictures don't add to it.
const SUREST: i8 = 6;
/// Anything seen this close to something on the map counts as that. Unit: metres. Three times the
/// localisation error.
const MAPPED_M: f64 = 0.12;

/// Square cells of the floor, in rows along x. Frame: world, by the base's belief.
#[derive(Debug, Clone)]
pub struct Grid {
    low: [f64; 2],
    columns: usize,
    rows: usize,
    /// Distance from each cell's centre to mapped obstacles; 0 outside of all rooms. Unit: metres.
    mapped_m: Vec<f64>,
    /// Evidence: positive if an obstacle was seen, negative if floor was seen.
    seen: Vec<i8>,
    /// Height of the highest point seen in each cell. Unit: metres.
    tops_m: Vec<f64>,
}

/// Evidence about the floor from one picture.
#[derive(Debug, Clone, Default)]
pub struct Evidence {
    counts: std::collections::BTreeMap<usize, Shown>,
}

/// Evidence about one cell from one picture.
#[derive(Debug, Clone, Copy, Default)]
struct Shown {
    /// Number of object points.
    things: u16,
    /// Number of floor points.
    floor: u16,
    /// Height of the highest point. Unit: metres.
    top_m: f64,
}

impl Evidence {
    /// Adds a floor point.
    pub fn add_floor(&mut self, cell: usize) {
        let shown = self.counts.entry(cell).or_default();
        shown.floor = shown.floor.saturating_add(1);
    }

    /// Adds an object point at a height. Unit: metres.
    pub fn add_thing(&mut self, cell: usize, height_m: f64) {
        let shown = self.counts.entry(cell).or_default();
        shown.things = shown.things.saturating_add(1);
        shown.top_m = shown.top_m.max(height_m);
    }
}

impl Grid {
    /// The grid of a map, large enough to include `places`.
    pub fn new(plan: &FloorPlan, places: &[[f64; 2]]) -> Self {
        let rooms = plan.rooms.iter().flat_map(|room| [room.low_m, room.high_m]);
        let corners = plan.outlines.iter().flat_map(corners);
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for point in rooms.chain(corners).chain(places.iter().copied()) {
            for axis in 0..2 {
                low[axis] = low[axis].min(point[axis] - AROUND_M);
                high[axis] = high[axis].max(point[axis] + AROUND_M);
            }
        }
        // Furniture may be beyond the end of the floor.
        (low, high) = (
            low.map(|end| end.max(-FLOOR_M - AROUND_M)),
            high.map(|end| end.min(FLOOR_M + AROUND_M)),
        );
        let [columns, rows] = [0, 1].map(|axis| {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a few hundred cells"
            )]
            let count = ((high[axis] - low[axis]) / CELL_M)
                .ceil()
                .clamp(1.0, MOST_CELLS as f64) as usize;
            count
        });
        let n_cells = columns * rows;
        let (seen, tops_m) = (vec![0; n_cells], vec![0.0; n_cells]);
        let mut grid = Self {
            low,
            columns,
            rows,
            mapped_m: Vec::new(),
            seen,
            tops_m,
        };
        let outlines: Vec<_> = plan
            .outlines
            .iter()
            .map(|o| (o.pose.to_isometry().inverse(), o.size_m))
            .collect();
        grid.mapped_m = (0..n_cells)
            .map(|cell| mapped(plan, &outlines, grid.middle(cell)))
            .collect();
        grid
    }

    /// Number of cells along x.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Number of cells.
    pub fn n_cells(&self) -> usize {
        self.columns * self.rows
    }

    /// The cell that contains a point, or `None` outside of the grid.
    pub fn cell(&self, [x, y]: [f64; 2]) -> Option<usize> {
        let (column, row) = ((x - self.low[0]) / CELL_M, (y - self.low[1]) / CELL_M);
        let inside =
            column >= 0.0 && row >= 0.0 && column < self.columns as f64 && row < self.rows as f64;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "inside of the grid"
        )]
        inside.then(|| row as usize * self.columns + column as usize)
    }

    /// The centre of a cell.
    pub fn middle(&self, cell: usize) -> [f64; 2] {
        let (column, row) = (cell % self.columns, cell / self.columns);
        [
            self.low[0] + (column as f64 + 0.5) * CELL_M,
            self.low[1] + (row as f64 + 0.5) * CELL_M,
        ]
    }

    /// Adds the evidence of a picture. A cell in which it shows only floor is free, because rays
    /// reached the floor.
    pub fn learn(&mut self, evidence: &Evidence) {
        for (cell, shown) in &evidence.counts {
            let (Some(seen), Some(top)) = (self.seen.get_mut(*cell), self.tops_m.get_mut(*cell))
            else {
                continue;
            };
            let change = if shown.things >= HITS {
                *top = top.max(shown.top_m);
                SEEN_TAKEN
            } else if shown.things == 0 && shown.floor > 0 {
                SEEN_FREE
            } else {
                0
            };
            *seen = (*seen + change).clamp(-SUREST, SUREST);
        }
    }

    /// Clears all perceived evidence.
    pub fn forget(&mut self) {
        self.seen.fill(0);
        self.tops_m.fill(0.0);
    }

    /// Perceived obstacles that are not on the map.
    pub fn standing(&self) -> Vec<Standing> {
        let taken = (0..self.n_cells())
            .filter(|cell| self.seen[*cell] > 0 && self.mapped_m[*cell] > MAPPED_M);
        taken
            .map(|cell| Standing {
                at_m: self.middle(cell),
                top_m: self.tops_m[cell],
            })
            .collect()
    }

    /// Adds the obstacles seen on an earlier drive.
    pub fn recall(&mut self, standing: &[Standing]) {
        for Standing { at_m, top_m } in standing {
            if let Some(cell) = self.cell(*at_m) {
                self.seen[cell] = SEEN_TAKEN;
                self.tops_m[cell] = top_m.max(self.tops_m[cell]);
            }
        }
    }

    /// Distances from the cells' centres to mapped obstacles. Unit: metres.
    pub fn mapped_m(&self) -> &[f64] {
        &self.mapped_m
    }

    /// Distances from the cells' centres to perceived obstacles. Unit: metres.
    ///
    /// Source: the exact distance transform of Felzenszwalb and Huttenlocher (2012), along columns
    /// and then along rows.
    pub fn seen_m(&self) -> Vec<f64> {
        let far = (self.columns * self.columns + self.rows * self.rows) as f64;
        let mut squares: Vec<f64> = self
            .seen
            .iter()
            .map(|seen| if *seen > 0 { 0.0 } else { far })
            .collect();
        if self.seen.iter().all(|seen| *seen <= 0) {
            return vec![f64::INFINITY; squares.len()];
        }
        for column in 0..self.columns {
            let line: Vec<f64> = (0..self.rows)
                .map(|row| squares[row * self.columns + column])
                .collect();
            for (row, value) in parabolas(&line).into_iter().enumerate() {
                squares[row * self.columns + column] = value;
            }
        }
        for row in squares.chunks_mut(self.columns) {
            row.copy_from_slice(&parabolas(row));
        }
        // To the side of the occupied cell, not to its centre.
        squares
            .into_iter()
            .map(|square| (square.sqrt() - 0.5).max(0.0) * CELL_M)
            .collect()
    }
}

/// The lower envelope at each place of the parabolas rooted at all places.
fn parabolas(line: &[f64]) -> Vec<f64> {
    let mut standing: Vec<(usize, f64)> = Vec::with_capacity(line.len());
    for (place, height) in line.iter().enumerate() {
        let own = height + (place * place) as f64;
        let mut from = f64::NEG_INFINITY;
        while let Some((other, begins)) = standing.last() {
            let theirs = line[*other] + (other * other) as f64;
            from = (own - theirs) / (2 * (place - other)) as f64;
            if from > *begins {
                break;
            }
            standing.pop();
            from = f64::NEG_INFINITY;
        }
        standing.push((place, from));
    }
    let mut idx = 0;
    let at = |place: usize| {
        while standing
            .get(idx + 1)
            .is_some_and(|(_, begins)| *begins < place as f64)
        {
            idx += 1;
        }
        let other = standing[idx].0;
        let off = place.abs_diff(other);
        (off * off) as f64 + line[other]
    };
    (0..line.len()).map(at).collect()
}

fn corners(outline: &Outline) -> [[f64; 2]; 4] {
    let [x, y] = outline.size_m.map(|side| side / 2.0);
    let pose = outline.pose.to_isometry();
    [(x, y), (x, -y), (-x, y), (-x, -y)].map(|(x, y)| {
        let corner = pose * Point3::new(x, y, 0.0);
        [corner.x, corner.y]
    })
}

/// Distance from a point to everything on the map; 0 outside of all rooms, if there are rooms.
/// Unit: metres.
fn mapped(plan: &FloorPlan, outlines: &[(Isometry3<f64>, [f64; 2])], [x, y]: [f64; 2]) -> f64 {
    let in_room = |room: &Room| {
        (room.low_m[0]..=room.high_m[0]).contains(&x)
            && (room.low_m[1]..=room.high_m[1]).contains(&y)
    };
    if !plan.rooms.is_empty() && !plan.rooms.iter().any(in_room) {
        return 0.0;
    }
    let beside = |(from_world, size_m): &(Isometry3<f64>, [f64; 2])| {
        let local = from_world * Point3::new(x, y, 0.0);
        length(
            (local.x.abs() - size_m[0] / 2.0).max(0.0),
            (local.y.abs() - size_m[1] / 2.0).max(0.0),
        )
    };
    outlines.iter().map(beside).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::Pose;

    fn hall() -> Grid {
        let outline = Outline {
            pose: Pose::upright([1.0, 0.0, 0.0], 0.3),
            size_m: [0.4, 0.2],
        };
        let room = Room {
            name: "hall".to_owned(),
            low_m: [-2.0, -1.0],
            high_m: [2.0, 1.0],
        };
        let plan = FloorPlan {
            outlines: vec![outline],
            rooms: vec![room],
            ..FloorPlan::default()
        };
        Grid::new(&plan, &[])
    }

    #[test]
    fn points_and_cells_convert_into_each_other() {
        let grid = hall();
        for cell in [0, 17, grid.n_cells() - 1] {
            assert_eq!(grid.cell(grid.middle(cell)), Some(cell));
        }
        assert_eq!(grid.cell([99.0, 0.0]), None);
        assert_eq!(grid.cell([0.0, -99.0]), None);
    }

    #[test]
    fn the_map_blocks_furniture_and_the_outside_of_rooms() {
        let grid = hall();
        let mapped = |at: [f64; 2]| grid.mapped_m()[grid.cell(at).expect("it is on the grid")];
        assert_eq!(mapped([1.0, 0.0]), 0.0);
        assert_eq!(mapped([0.0, 1.5]), 0.0);
        assert!(
            (mapped([-1.0, 0.0]) - 1.77).abs() < 0.06,
            "{}",
            mapped([-1.0, 0.0])
        );
    }

    #[test]
    fn distances_to_seen_obstacles_are_exact() {
        let mut grid = hall();
        assert!(grid.seen_m().iter().all(|distance| distance.is_infinite()));
        let taken = [[0.0, 0.0], [0.6, -0.4], [-1.2, 0.7]]
            .map(|at| grid.cell(at).expect("it is on the grid"));
        let mut evidence = Evidence::default();
        for cell in taken {
            (0..3).for_each(|_| evidence.add_thing(cell, 0.3));
        }
        grid.learn(&evidence);
        for (cell, distance) in grid.seen_m().into_iter().enumerate() {
            let [x, y] = grid.middle(cell);
            let nearest = taken.iter().map(|taken| {
                let [u, v] = grid.middle(*taken);
                length(x - u, y - v)
            });
            let nearest = (nearest.fold(f64::INFINITY, f64::min) - CELL_M / 2.0).max(0.0);
            assert!(
                (distance - nearest).abs() < 1e-9,
                "{distance} for {nearest} at ({x}, {y})"
            );
        }
    }

    #[test]
    fn noise_does_not_block_cells_and_seen_floor_frees_them() {
        let mut grid = hall();
        let cell = grid.cell([0.0, 0.0]).expect("it is on the grid");
        let picture = |things: u16, floor: u16| {
            let mut evidence = Evidence::default();
            (0..things).for_each(|_| evidence.add_thing(cell, 0.3));
            (0..floor).for_each(|_| evidence.add_floor(cell));
            evidence
        };
        grid.learn(&picture(2, 40));
        assert!(grid.seen_m()[cell].is_infinite());
        grid.learn(&picture(9, 0));
        assert_eq!(grid.seen_m()[cell], 0.0);
        for _ in 0..3 {
            grid.learn(&picture(0, 5));
        }
        assert!(grid.seen_m()[cell].is_infinite());
        grid.learn(&picture(9, 0));
        grid.forget();
        assert!(grid.seen_m()[cell].is_infinite());
    }

    #[test]
    fn only_unmapped_obstacles_are_remembered_for_the_next_drive() {
        let mut grid = hall();
        let cells = [[0.0, 0.0], [1.25, 0.0]].map(|at| grid.cell(at).expect("it is on the grid"));
        let mut evidence = Evidence::default();
        for cell in cells {
            (0..3).for_each(|_| evidence.add_thing(cell, 0.3));
        }
        grid.learn(&evidence);
        let standing = grid.standing();
        assert_eq!(
            standing,
            [Standing {
                at_m: grid.middle(cells[0]),
                top_m: 0.3
            }]
        );
        let mut next = hall();
        next.recall(&standing);
        assert_eq!(next.standing(), standing);
    }
}
