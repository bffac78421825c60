//! Silhouettes of boxes in an image: the outline of their projected corners, clipped at the eye.

use nalgebra::Point3;

use crate::rays::Lens;

/// Distance of the near clipping plane. Unit: metres. No shape of a robot is this close to its
/// camera.
const NEAR_M: f64 = 1e-3;
/// Margin of outlines, so that rounding does not lose a pixel. Unit: pixels.
const RIM_PX: f64 = 1.0;

/// A convex outline. Unit: pixels; columns to the right, rows down.
pub struct Silhouette {
    low: [f64; 2],
    high: [f64; 2],
    /// Bounding half-planes: the unit normal outwards, and the outline's extent along it.
    sides: Vec<([f64; 2], f64)>,
}

impl Silhouette {
    /// Returns the outline of a box given by its corners; each bit of a corner's index selects the
    /// side along one axis. Returns `None` if the box is behind the eye or outside the image.
    /// Frame: camera.
    pub fn of(corners: &[Point3<f64>; 8], lens: &Lens) -> Option<Self> {
        let points: Vec<[f64; 2]> = in_front(corners)
            .iter()
            .filter_map(|point| lens.pixel(point))
            .filter(|at| at[0].is_finite())
            .collect();
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for point in &points {
            for axis in 0..2 {
                (low[axis], high[axis]) = (low[axis].min(point[axis]), high[axis].max(point[axis]));
            }
        }
        let inside = high[0] >= 0.0
            && high[1] >= 0.0
            && low[0] <= lens.width as f64
            && low[1] <= lens.height as f64;
        inside.then(|| Self {
            low,
            high,
            sides: sides(&points),
        })
    }

    /// Returns the first and last column, and the first and last row, of its bounding box in the
    /// image.
    pub fn within(&self, width: usize, height: usize) -> [usize; 4] {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to the picture"
        )]
        let within = |at: f64, count: usize| at.floor().clamp(0.0, (count - 1) as f64) as usize;
        let (low, high) = (
            self.low.map(|at| at - RIM_PX),
            self.high.map(|at| at + RIM_PX),
        );
        [
            within(low[0], width),
            within(high[0], width),
            within(low[1], height),
            within(high[1], height),
        ]
    }

    /// Whether it may overlap a square: the square is not completely beyond any of its sides.
    pub fn meets(&self, [column, row]: [usize; 2], size: usize) -> bool {
        let (left, top, size) = (column as f64, row as f64, size as f64);
        self.sides.iter().all(|([x, y], reach)| {
            let nearest = x * (if *x > 0.0 { left } else { left + size })
                + y * (if *y > 0.0 { top } else { top + size });
            nearest <= reach + RIM_PX
        })
    }
}

/// Returns the corners of the part of a box in front of the eye.
fn in_front(corners: &[Point3<f64>; 8]) -> Vec<Point3<f64>> {
    let mut points: Vec<Point3<f64>> = corners
        .iter()
        .filter(|corner| corner.x >= NEAR_M)
        .copied()
        .collect();
    for from in 0..8usize {
        for to in [from | 1, from | 2, from | 4]
            .into_iter()
            .filter(|to| *to != from)
        {
            let (a, b) = (corners[from], corners[to]);
            if (a.x < NEAR_M) != (b.x < NEAR_M) {
                let share = (NEAR_M - a.x) / (b.x - a.x);
                let [y, z] = [a.y + (b.y - a.y) * share, a.z + (b.z - a.z) * share];
                points.push(Point3::new(NEAR_M, y, z));
            }
        }
    }
    points
}

/// Returns the lines through two of the points that have all others on one side.
fn sides(points: &[[f64; 2]]) -> Vec<([f64; 2], f64)> {
    let mut sides = Vec::new();
    for (idx, from) in points.iter().enumerate() {
        for to in &points[idx + 1..] {
            let way = [to[0] - from[0], to[1] - from[1]];
            let length = libm::hypot(way[0], way[1]);
            if length < 1e-6 {
                continue;
            }
            for normal in [
                [way[1] / length, -way[0] / length],
                [-way[1] / length, way[0] / length],
            ] {
                let along = |point: &[f64; 2]| normal[0] * point[0] + normal[1] * point[1];
                let reach = along(from).max(along(to));
                if points.iter().all(|point| along(point) <= reach + 1e-6) {
                    sides.push((normal, reach));
                }
            }
        }
    }
    sides
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::Stream;

    const LENS: Lens = Lens {
        width: 80,
        height: 60,
        focal_px: 60.0,
    };

    /// Points of random boxes, including boxes around the eye, are only visible in tiles that
    /// overlap the outline.
    #[test]
    fn every_point_of_a_box_is_inside_its_outline() {
        let stream = Stream::new(3);
        let (mut n_seen, mut n_spared) = (0, 0);
        for number in 0..300u64 {
            let unit = |part: u64| stream.unit(20 * number + part);
            let low = [0, 1, 2].map(|axis| 4.0 * unit(axis) - 2.0);
            let size = [3, 4, 5].map(|axis| 0.02 + 1.5 * unit(axis));
            let turn = nalgebra::UnitQuaternion::from_euler_angles(
                6.0 * unit(6),
                6.0 * unit(7),
                6.0 * unit(8),
            );
            let at = |share: [f64; 3]| {
                turn * Point3::new(
                    low[0] + size[0] * share[0],
                    low[1] + size[1] * share[1],
                    low[2] + size[2] * share[2],
                )
            };
            let corners = [0, 1, 2, 3, 4, 5, 6, 7]
                .map(|bits| at([0, 1, 2].map(|axis| f64::from(bits >> axis & 1))));
            let silhouette = Silhouette::of(&corners, &LENS);
            for sample in 0..200u64 {
                let share = [0, 1, 2].map(|axis| Stream::new(number + 7).unit(3 * sample + axis));
                let point = at(share);
                let Some([x, y]) = LENS.pixel(&point).filter(|_| point.x > 2.0 * NEAR_M) else {
                    continue;
                };
                if !(0.0..80.0).contains(&x) || !(0.0..60.0).contains(&y) {
                    continue;
                }
                n_seen += 1;
                let tile = [x, y].map(|value| value as usize / 8 * 8);
                assert!(
                    silhouette
                        .as_ref()
                        .is_some_and(|outline| outline.meets(tile, 8)),
                    "{number}: {x} {y}"
                );
            }
            let tiles = (0..80usize).map(|tile| [tile % 10 * 8, tile / 10 * 8]);
            n_spared += silhouette.map_or(0, |outline| {
                tiles.filter(|tile| !outline.meets(*tile, 8)).count()
            });
        }
        assert!(n_seen > 2000 && n_spared > 2000, "{n_seen} {n_spared}");
    }
}
