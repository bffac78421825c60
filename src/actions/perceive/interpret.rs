//! From points to a surface and the objects on it.

use std::collections::BTreeSet;

use nalgebra::{
    Isometry3, Matrix3, Point2, Point3, Rotation3, Translation3, UnitQuaternion, Vector2, Vector3,
};

use crate::perceive::cloud::{cube_of, thinned};
use crate::perceive::cluster::clusters;
use crate::perceive::kinds::recognise;
use crate::perceive::plane::{Plane, Prior, find};
use crate::perceive::rectangle::{Rectangle, smallest_around};
use actcheck_data::{KnownKind, PerceivedPlane, PerceivedThing, Pose};

/// Edge of the grid cubes used for downsampling. Unit: metres. About the pixel spacing at a
/// distance of one metre.
pub const GRID_M: f64 = 0.005;
/// Tables are neither on the floor nor above the robot's head, and the robot knows its own tilt to
/// better than 5 degrees. The inlier distance is three times the range noise of depth cameras at
/// 1.5 m.
const PRIOR: Prior = Prior {
    heights_m: (0.2, 1.3),
    tilt_rad: 0.09,
    off_m: 0.01,
};
/// Arbitrary: the guesses need not differ from run to run.
const SEED: u64 = 1;
/// Wider gaps separate surfaces. Unit: metres. The shadow of a bottle is about this wide.
const SURFACE_GAP_M: f64 = 0.1;
/// Grid for finding those gaps. Unit: metres.
const SURFACE_GRID_M: f64 = 0.02;
/// Shortest side of a surface. Unit: metres.
const LEAST_SIDE_M: f64 = 0.15;
/// Points lower than this above the surface belong to the surface. Unit: metres. Four times the
/// range noise at a slant.
const RISE_M: f64 = 0.008;
/// Largest height of an object on a surface. Unit: metres.
const HIGHEST_M: f64 = 0.6;
/// How far objects may overhang the edge. Unit: metres.
const OVER_EDGE_M: f64 = 0.02;
/// Points farther apart belong to different objects. Unit: metres. At a slant, pixels on top of an
/// object are this far apart.
const APART_M: f64 = 0.02;
/// Clusters with fewer points are noise. Unit: points of the grid; a fork shows fifty.
const LEAST_POINTS: usize = 15;

/// A surface: its plane and its horizontal outline.
#[derive(Debug, Clone, PartialEq)]
pub struct Surface {
    plane: Plane,
    /// Outline, seen from above. Frame: world.
    pub outline: Rectangle,
}

impl Surface {
    /// The largest level surface among points. Returns `None` if no level plane is found or the
    /// largest surface is too small.
    pub fn find(points: &[Point3<f64>]) -> Option<Self> {
        let (plane, inliers) = find(points, &PRIOR, SEED)?;
        let inliers: Vec<Point3<f64>> = inliers.into_iter().map(|idx| points[idx]).collect();
        let coarse = thinned(&inliers, SURFACE_GRID_M);
        let piece = clusters(&coarse, SURFACE_GAP_M)
            .into_iter()
            .max_by_key(Vec::len)?;
        let cubes: BTreeSet<[i64; 3]> = piece
            .into_iter()
            .map(|idx| cube_of(&coarse[idx], SURFACE_GRID_M))
            .collect();
        // Coarse points end up to half a step before the edge; the fine points in their cubes
        // locate the edge.
        let of_piece = inliers
            .iter()
            .filter(|point| cubes.contains(&cube_of(point, SURFACE_GRID_M)));
        let outline: Vec<Point2<f64>> = of_piece.map(Point3::xy).collect();
        let outline = smallest_around(&outline)?;
        let large = outline.size_m.iter().all(|side| *side >= LEAST_SIDE_M);
        large.then_some(Self { plane, outline })
    }

    /// Its corners. Frame: world.
    pub fn corners(&self) -> [Point3<f64>; 4] {
        self.outline.corners().map(|corner| self.lifted(&corner))
    }

    /// The point of the plane above or below a horizontal position.
    fn lifted(&self, level: &Point2<f64>) -> Point3<f64> {
        let low = Point3::new(level.x, level.y, 0.0);
        Point3::new(
            level.x,
            level.y,
            -self.plane.above(&low) / self.plane.normal.z,
        )
    }

    /// The surface as it is reported.
    pub fn perceived(&self) -> PerceivedPlane {
        let up = self.plane.normal.into_inner();
        let along = Vector3::new(
            libm::cos(self.outline.yaw),
            libm::sin(self.outline.yaw),
            0.0,
        );
        let left = up.cross(&along).normalize();
        let axes = Matrix3::from_columns(&[left.cross(&up), left, up]);
        let rotation =
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
        let middle = Translation3::from(self.lifted(&self.outline.centre).coords);
        let pose = Pose::from_isometry(&Isometry3::from_parts(middle, rotation));
        PerceivedPlane {
            pose,
            size_m: self.outline.size_m,
        }
    }

    /// The objects on the surface, seen from `eye`.
    pub fn things(
        &self,
        points: &[Point3<f64>],
        eye: &Point3<f64>,
        kinds: &[KnownKind],
    ) -> Vec<PerceivedThing> {
        let standing: Vec<Point3<f64>> = points
            .iter()
            .filter(|point| self.carries(point))
            .copied()
            .collect();
        let clusters = clusters(&standing, APART_M)
            .into_iter()
            .filter(|cluster| cluster.len() >= LEAST_POINTS);
        clusters
            .filter_map(|cluster| {
                let points: Vec<Point3<f64>> =
                    cluster.into_iter().map(|idx| standing[idx]).collect();
                self.thing(&points, eye, kinds)
            })
            .collect()
    }

    /// Whether a point belongs to an object on the surface.
    fn carries(&self, point: &Point3<f64>) -> bool {
        let local = self.outline.local(&point.xy());
        let inside = local
            .iter()
            .zip(self.outline.size_m)
            .all(|(off, side)| off.abs() <= side / 2.0 + OVER_EDGE_M);
        inside && (RISE_M..=HIGHEST_M).contains(&self.plane.above(point))
    }

    /// The object that these points belong to.
    fn thing(
        &self,
        points: &[Point3<f64>],
        eye: &Point3<f64>,
        kinds: &[KnownKind],
    ) -> Option<PerceivedThing> {
        let level: Vec<Point2<f64>> = points.iter().map(Point3::xy).collect();
        let mut outline = smallest_around(&level)?;
        let height = points
            .iter()
            .map(|point| self.plane.above(point))
            .fold(0.0, f64::max);
        let [first, second] = outline.size_m;
        let mut size_m = [first, second, height];
        let fit = recognise(size_m, kinds);
        let mut yaw = outline.yaw;
        if let Some(fit) = fit {
            let [x, y, _] = fit.kind.size_m;
            let known = if fit.crosswise { [y, x] } else { [x, y] };
            outline = completed(&outline, known, &eye.xy());
            size_m = [outline.size_m[0], outline.size_m[1], height];
            if fit.crosswise {
                yaw += std::f64::consts::FRAC_PI_2;
                size_m.swap(0, 1);
            }
        }
        let foot = self.lifted(&outline.centre);
        let category = fit.map(|fit| fit.kind.category.clone());
        Some(PerceivedThing {
            category,
            pose: Pose::upright(foot.coords.into(), yaw),
            size_m,
        })
    }
}

/// The outline extended to the known side lengths. The missing part is behind the visible part, so
/// the centre moves away from the eye by half of the missing length in that direction.
fn completed(outline: &Rectangle, known: [f64; 2], eye: &Point2<f64>) -> Rectangle {
    let away = Vector2::from(outline.local(eye))
        .try_normalize(1e-6)
        .map_or(Vector2::zeros(), |towards| -towards);
    let mut out = *outline;
    let mut shift = Vector2::zeros();
    for side in 0..2 {
        let missing = (known[side] - outline.size_m[side]).max(0.0);
        shift[side] = away[side] * missing / 2.0;
        out.size_m[side] += missing;
    }
    let (sin, cos) = (libm::sin(outline.yaw), libm::cos(outline.yaw));
    out.centre += Vector2::new(cos * shift.x - sin * shift.y, sin * shift.x + cos * shift.y);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    const EYE: Point3<f64> = Point3::new(-1.0, 0.0, 1.4);

    fn kinds() -> Vec<KnownKind> {
        let kind = |name: &str, size_m| KnownKind {
            name: name.to_owned(),
            category: name.to_owned(),
            size_m,
            rim: None,
            is_box: false,
        };
        vec![
            kind("box", [0.1, 0.06, 0.15]),
            kind("can", [0.066, 0.066, 0.115]),
        ]
    }

    /// Points at a spacing of 3 mm on the sides and the top of a box at z = 0.7; only those
    /// accepted by `cut`.
    fn block(
        centre: [f64; 2],
        yaw: f64,
        size: [f64; 3],
        cut: impl Fn(&Point3<f64>) -> bool,
    ) -> Vec<Point3<f64>> {
        let pose = Pose::upright([centre[0], centre[1], 0.7], yaw).to_isometry();
        let steps = |extent: f64| (0..=100).map(move |idx| extent * (f64::from(idx) / 100.0 - 0.5));
        let mut points = Vec::new();
        for a in steps(1.0) {
            for b in steps(1.0) {
                points.push(Point3::new(a * size[0], b * size[1], size[2]));
                for side in [-0.5, 0.5] {
                    points.push(Point3::new(
                        a * size[0],
                        side * size[1],
                        (b + 0.5) * size[2],
                    ));
                    points.push(Point3::new(
                        side * size[0],
                        a * size[1],
                        (b + 0.5) * size[2],
                    ));
                }
            }
        }
        points
            .into_iter()
            .map(|point| pose * point)
            .filter(cut)
            .collect()
    }

    /// Points at a spacing of 4 mm on a 0.8 × 0.6 m table top at z = 0.7, with a yaw of 0.2 rad.
    fn table() -> Vec<Point3<f64>> {
        let pose = Pose::upright([0.1, 0.0, 0.7], 0.2).to_isometry();
        let xs = (0..=200).map(|idx| 0.8 * (f64::from(idx) / 200.0 - 0.5));
        xs.flat_map(|x| {
            (0..=150)
                .map(move |idx| pose * Point3::new(x, 0.6 * (f64::from(idx) / 150.0 - 0.5), 0.0))
        })
        .collect()
    }

    fn off(a: f64, b: f64) -> f64 {
        (a - b).abs()
    }

    #[test]
    fn a_surface_has_the_true_height_outline_and_tilt() {
        let surface = Surface::find(&thinned(&table(), GRID_M)).expect("a surface is found");
        let seen = surface.perceived();
        // The mean of a cube's points is at most half its edge from the outermost of them.
        assert!(
            off(seen.pose.position[0], 0.1) < GRID_M && off(seen.pose.position[1], 0.0) < GRID_M,
            "{seen:?}"
        );
        assert!(
            off(seen.pose.position[2], 0.7) < 1e-6 && seen.pose.tilt() < 1e-6,
            "{seen:?}"
        );
        assert!(off(seen.pose.yaw(), 0.2) < 0.01, "{}", seen.pose.yaw());
        assert!(
            off(seen.size_m[0], 0.8) < GRID_M && off(seen.size_m[1], 0.6) < GRID_M,
            "{:?}",
            seen.size_m
        );
    }

    #[test]
    fn objects_have_the_true_poses_sizes_and_kinds() {
        let mut points = table();
        points.extend(block([0.0, 0.1], 0.5, [0.1, 0.06, 0.15], |_| true));
        points.extend(block([0.25, -0.1], 0.1, [0.2, 0.12, 0.05], |_| true));
        let points = thinned(&points, GRID_M);
        let surface = Surface::find(&points).expect("a surface is found");
        let things = surface.things(&points, &EYE, &kinds());
        assert_eq!(things.len(), 2, "{things:?}");
        let [first, second] = [&things[0], &things[1]];
        assert_eq!(
            (first.category.as_deref(), second.category.as_deref()),
            (Some("box"), None)
        );
        assert!(
            off(first.pose.position[0], 0.0) < 0.003 && off(first.pose.position[1], 0.1) < 0.003,
            "{first:?}"
        );
        assert!(off(first.pose.yaw(), 0.5) < 0.06, "{}", first.pose.yaw());
        assert!(off(first.pose.position[2], 0.7) < 0.002);
        for (seen, known) in first.size_m.iter().zip([0.1, 0.06, 0.15]) {
            assert!(off(*seen, known) < 0.006, "{:?}", first.size_m);
        }
        assert!(
            off(second.size_m[0], 0.2) < 0.008 && off(second.size_m[2], 0.05) < 0.003,
            "{second:?}"
        );
    }

    #[test]
    fn hidden_parts_are_completed_with_the_known_size() {
        // Only the front half of a can-sized block is seen, from the negative x side.
        let size = [0.066, 0.066, 0.115];
        let mut points = table();
        points.extend(block([0.1, 0.0], 0.0, size, |point| point.x < 0.117));
        let points = thinned(&points, GRID_M);
        let things = Surface::find(&points)
            .expect("a table")
            .things(&points, &EYE, &kinds());
        assert_eq!(
            things
                .iter()
                .map(|thing| thing.category.as_deref())
                .collect::<Vec<_>>(),
            [Some("can")]
        );
        let seen = &things[0];
        assert!(
            off(seen.pose.position[0], 0.1) < 0.005 && off(seen.pose.position[1], 0.0) < 0.003,
            "{seen:?}"
        );
        assert!(
            seen.size_m
                .iter()
                .zip(size)
                .all(|(seen, known)| off(*seen, known) < 0.006),
            "{seen:?}"
        );
    }

    #[test]
    fn objects_close_together_are_seen_as_one() {
        let mut points = table();
        points.extend(block([0.0, 0.0], 0.0, [0.06, 0.06, 0.1], |_| true));
        points.extend(block([0.0, 0.075], 0.0, [0.06, 0.06, 0.1], |_| true));
        let points = thinned(&points, GRID_M);
        assert_eq!(
            Surface::find(&points)
                .expect("a table")
                .things(&points, &EYE, &kinds())
                .len(),
            1
        );
    }

    #[test]
    fn the_larger_of_two_tables_is_the_surface() {
        let far = table()
            .into_iter()
            .map(|point| point + Vector3::new(1.5, 0.0, 0.0));
        let near = table().into_iter().filter(|point| point.x < 0.0);
        let points = thinned(&near.chain(far).collect::<Vec<_>>(), GRID_M);
        let seen = Surface::find(&points)
            .expect("a surface is found")
            .perceived();
        assert!(off(seen.pose.position[0], 1.6) < 0.01, "{seen:?}");
    }
}
