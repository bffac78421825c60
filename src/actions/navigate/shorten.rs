//! Shortens a path over cells to a few straight legs.

use crate::navigate::search::cheapest;
use crate::navigate::terrain::Terrain;

/// Factor by which a straight leg may cost more than the cells it replaces, which only go in eight
/// directions.
const TOLERATED: f64 = 1.001;

/// The path between two places as the ends of its straight legs, without the first place. Returns
/// `None` if there is no path.
pub fn way(terrain: &Terrain<'_>, from: [f64; 2], to: [f64; 2]) -> Option<Vec<[f64; 2]>> {
    let grid = terrain.grid();
    let cells = cheapest(terrain, grid.cell(from)?, grid.cell(to)?)?;
    let mut points: Vec<[f64; 2]> = cells.into_iter().map(|cell| grid.middle(cell)).collect();
    match points.as_mut_slice() {
        [only] => *only = to,
        [first, .., last] => (*first, *last) = (from, to),
        [] => return None,
    }
    if points.len() == 1 {
        return Some(points);
    }
    Some(shortened(terrain, &points))
}

/// From each point, the longest straight leg that costs no more than the path.
fn shortened(terrain: &Terrain<'_>, points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut sums = vec![0.0];
    for pair in points.windows(2) {
        let step = terrain.straight(pair[0], pair[1]).unwrap_or(f64::INFINITY);
        sums.push(sums.last().copied().unwrap_or(0.0) + step);
    }
    let mut kept = Vec::new();
    let mut at = 0;
    while at + 1 < points.len() {
        let serves = |next: &usize| {
            let straight = terrain.straight(points[at], points[*next]);
            straight.is_some_and(|straight| straight <= (sums[*next] - sums[at]) * TOLERATED)
        };
        at = (at + 2..points.len()).rev().find(serves).unwrap_or(at + 1);
        kept.push(points[at]);
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::navigate::grid::Grid;
    use crate::route::length;
    use actcheck_data::{Pose, Room};
    use actcheck_scenario::{FloorPlan, Outline};

    /// A room divided by a wall that leaves a door of 90 cm at the upper end.
    fn two_rooms() -> Grid {
        let across = Outline {
            pose: Pose::upright([0.0, -0.45, 0.0], 0.0),
            size_m: [0.1, 3.1],
        };
        let upper = Outline {
            pose: Pose::upright([0.0, 2.05, 0.0], 0.0),
            size_m: [4.0, 0.1],
        };
        let room = Room {
            name: "hall".to_owned(),
            low_m: [-2.0, -2.0],
            high_m: [2.0, 2.0],
        };
        let plan = FloorPlan {
            outlines: vec![across, upper],
            rooms: vec![room],
            ..FloorPlan::default()
        };
        Grid::new(&plan, &[])
    }

    fn total(from: [f64; 2], way: &[[f64; 2]]) -> f64 {
        let ends = std::iter::once(&from).chain(way);
        ends.zip(way)
            .map(|(a, b)| length(b[0] - a[0], b[1] - a[1]))
            .sum()
    }

    #[test]
    fn a_free_route_is_one_leg_and_a_door_is_found() {
        let grid = two_rooms();
        let from = [-1.33, -0.97];
        let terrain = Terrain::new(&grid, 0.3, from);
        let straight = way(&terrain, from, [-1.1, 1.0]).expect("nothing is in the way");
        assert_eq!(straight, [[-1.1, 1.0]]);
        let around = way(&terrain, from, [1.0, -0.5]).expect("a route leads through the door");
        assert_eq!(around.last(), Some(&[1.0, -0.5]));
        // Through the middle of the door it would be 5.1 m; clearance at corners makes it longer.
        assert!((5.1..5.8).contains(&total(from, &around)), "{around:?}");
        let crossed = around
            .iter()
            .filter(|at| at[0].abs() < 0.3)
            .all(|at| (1.3..1.8).contains(&at[1]));
        assert!(crossed && around.len() <= 12, "{around:?}");
        assert_eq!(way(&terrain, from, from), Some(vec![from]));
    }

    #[test]
    fn routes_need_space_for_the_base_and_never_end_in_walls() {
        let grid = two_rooms();
        let wide = Terrain::new(&grid, 0.5, [-1.0, 0.0]);
        assert_eq!(way(&wide, [-1.0, 0.0], [1.0, 0.0]), None);
        let slim = Terrain::new(&grid, 0.3, [-1.0, 0.0]);
        assert_eq!(way(&slim, [-1.0, 0.0], [0.1, 0.0]), None);
        assert_eq!(way(&slim, [-1.0, 0.0], [9.0, 0.0]), None);
    }

    #[test]
    fn a_base_too_near_a_wall_can_move_away() {
        let grid = two_rooms();
        let from = [-0.2, 0.0];
        let terrain = Terrain::new(&grid, 0.3, from);
        let away = way(&terrain, from, [-1.0, 0.0]).expect("it can move away from the wall");
        assert_eq!(away.last(), Some(&[-1.0, 0.0]));
    }
}
