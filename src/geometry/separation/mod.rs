//! Distance and penetration of two convex solids, in 64 bits.
//!
//! The engine searches for them in 32 bits. Between hulls with many corners it ends too early and
//! is millimetres wrong, or finds bodies to overlap that don't touch: a finger pressed a can along
//! a direction 40° off, and links of an arm collided that were 8 mm apart.

mod depth;
mod simplex;

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use parry3d::math::Pose;
use parry3d::shape::SupportMap;

use crate::convert::{from_vector, to_vector};
use simplex::Simplex;

/// Error of a distance. Unit: metres.
const TOLERANCE_M: f64 = 1e-7;
/// Steps after which a search ends. Most need 5 to 20.
const N_STEPS: usize = 100;

/// How far apart two convex solids are.
#[derive(Debug, Clone, Copy)]
pub struct Separation {
    /// Their distance; negative: by how much they overlap in the direction in which they overlap
    /// least. Unit: metres.
    pub distance_m: f64,
    /// From the first to the second solid, the direction of the distance or least overlap. Frame:
    /// the first solid.
    pub normal: Vector3<f64>,
    /// The points of the first and of the second solid that are this distance apart. Frame: the
    /// first solid.
    pub points: [Vector3<f64>; 2],
}

/// The outcome of a search.
pub enum SeparationOutcome {
    /// They are farther apart than asked for, along this direction.
    Far(Vector3<f64>),
    /// They are nearer, by this.
    Near(Separation),
    /// They overlap, but the search failed because of rounding errors.
    Nothing,
}

/// Two solids of which one point after the other is asked for.
pub struct SolidPair<'a> {
    first: &'a dyn SupportMap,
    second: &'a dyn SupportMap,
    /// Pose of the second in the frame of the first.
    turn: Matrix3<f64>,
    shift: Vector3<f64>,
}

/// A point of the set of all differences between points of two solids, and those two points.
#[derive(Debug, Clone, Copy)]
struct Corner {
    point: Vector3<f64>,
    of: [Vector3<f64>; 2],
}

impl<'a> SolidPair<'a> {
    /// Two solids, with the pose of the second in the frame of the first.
    pub fn new(pose: &Pose, first: &'a dyn SupportMap, second: &'a dyn SupportMap) -> Self {
        let [x, y, z, w] = pose.rotation.to_array().map(f64::from);
        let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
            .to_rotation_matrix()
            .into_inner();
        Self {
            first,
            second,
            turn,
            shift: from_vector(pose.translation),
        }
    }

    /// Finds their distance if it is less than `far_m`, or how much they overlap. The search begins
    /// with the direction `start`, of length 1.
    pub fn separation(&self, start: Vector3<f64>, far_m: f64) -> SeparationOutcome {
        self.separation_near(start, far_m, &mut Vec::new())
    }

    /// As [`SolidPair::separation`]. The search begins with these points of both solids, each in
    /// the frame of its solid, if there are any, and leaves those with which it ended; none if they
    /// overlap.
    pub fn separation_near(
        &self,
        start: Vector3<f64>,
        far_m: f64,
        corners: &mut Vec<[Vector3<f64>; 2]>,
    ) -> SeparationOutcome {
        let corner = self.corner(start);
        let apart_m = -corner.point.dot(&start);
        // Solids that were far apart along a direction a moment ago still are.
        if apart_m >= far_m {
            return SeparationOutcome::Far(start);
        }
        let mut simplex = self.begun(corner, corners);
        corners.clear();
        let mut best = (apart_m, start);
        let mut last_m = f64::INFINITY;
        for _ in 0..N_STEPS {
            let length_m = simplex.nearest().norm();
            if length_m <= TOLERANCE_M {
                break;
            }
            let normal = -simplex.nearest() / length_m;
            let corner = self.corner(normal);
            let apart_m = -corner.point.dot(&normal);
            if apart_m >= far_m {
                return SeparationOutcome::Far(normal);
            }
            if apart_m > best.0 {
                best = (apart_m, normal);
            }
            let converged = length_m - apart_m <= TOLERANCE_M;
            // Rounding leaves nothing to gain: the points found are the nearest ones.
            let stuck = length_m >= last_m || simplex.has(&corner);
            if converged || stuck {
                corners.extend(simplex.corners().iter().map(|corner| self.apart(corner)));
                return SeparationOutcome::Near(Separation {
                    distance_m: length_m,
                    normal,
                    points: simplex.points(),
                });
            }
            last_m = length_m;
            simplex.add(corner);
            if simplex.is_around_origin() {
                break;
            }
        }
        if best.0 > -TOLERANCE_M {
            return SeparationOutcome::Near(Separation {
                distance_m: best.0.max(0.0),
                normal: best.1,
                points: simplex.points(),
            });
        }
        depth::depth(self, &simplex).map_or(SeparationOutcome::Nothing, SeparationOutcome::Near)
    }

    /// The simplex of some points of both solids, each in the frame of its solid, or of a corner if
    /// there are none.
    fn begun(&self, corner: Corner, points: &[[Vector3<f64>; 2]]) -> Simplex {
        let mut corners = points.iter().map(|[first, second]| {
            let second = self.turn * second + self.shift;
            Corner {
                point: first - second,
                of: [*first, second],
            }
        });
        let mut simplex = Simplex::new(corners.next().unwrap_or(corner));
        corners.for_each(|corner| simplex.add(corner));
        simplex
    }

    /// The two points of a corner, each in the frame of its solid.
    fn apart(&self, corner: &Corner) -> [Vector3<f64>; 2] {
        let [first, second] = corner.of;
        [first, self.turn.tr_mul(&(second - self.shift))]
    }

    /// The point of the differences that is farthest along a direction.
    fn corner(&self, direction: Vector3<f64>) -> Corner {
        let first = from_vector(self.first.local_support_point(to_vector(&direction)));
        let second = self
            .second
            .local_support_point(to_vector(&-self.turn.tr_mul(&direction)));
        let second = self.turn * from_vector(second) + self.shift;
        Corner {
            point: first - second,
            of: [first, second],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Isometry3, Translation3};
    use parry3d::query::contact;
    use parry3d::shape::{ConvexPolyhedron, Cuboid, Cylinder, Shape};

    use crate::convert::{to_pose, to_real};

    const FAR_M: f64 = 1.0;

    /// Numbers from -1 to 1 without a pattern.
    fn spread(n: u32) -> f64 {
        (libm::sin(f64::from(n) * 12.9898) * 43758.5453).fract()
    }

    fn pose(n: u32, size_m: f64) -> Isometry3<f64> {
        let at = |k: u32| spread(n * 7 + k);
        let place = Translation3::new(at(0) * size_m, at(1) * size_m, at(2) * size_m);
        Isometry3::from_parts(
            place,
            UnitQuaternion::new(3.0 * Vector3::new(at(3), at(4), at(5))),
        )
    }

    fn found(b_in_a: &Isometry3<f64>, [a, b]: [&dyn Shape; 2]) -> Option<Separation> {
        let solids = SolidPair::new(&to_pose(b_in_a), a.as_support_map()?, b.as_support_map()?);
        match solids.separation(Vector3::x(), FAR_M) {
            SeparationOutcome::Near(found) => Some(found),
            SeparationOutcome::Far(_) | SeparationOutcome::Nothing => None,
        }
    }

    /// Boxes side by side: the gap along each axis is known, and turning both changes nothing.
    #[test]
    fn boxes_are_as_far_apart_and_as_deep_as_calculated() {
        let half = [
            Vector3::new(0.02, 0.05, 0.03),
            Vector3::new(0.04, 0.01, 0.06),
        ];
        let boxes = half.map(|half| Cuboid::new(to_vector(&half)));
        let (mut apart, mut deep) = (0, 0);
        for trial in 0..300 {
            let shift =
                Vector3::new(spread(trial), spread(trial + 1000), spread(trial + 2000)) * 0.12;
            let gaps = shift.abs() - half[0] - half[1];
            let beyond = gaps.sup(&Vector3::zeros());
            let true_m = if beyond.norm() > 0.0 {
                beyond.norm()
            } else {
                gaps.max()
            };
            let b_in_a = Isometry3::from(Translation3::from(shift));
            let found = found(&b_in_a, [&boxes[0], &boxes[1]]).map(|found| found.distance_m);
            assert!(
                found.is_some_and(|found| (found - true_m).abs() < 2e-6),
                "{trial}: {found:?}, {true_m}"
            );
            if true_m > 0.0 { apart += 1 } else { deep += 1 }
        }
        assert!(apart > 50 && deep > 50, "{apart} apart, {deep} deep");
    }

    /// Hulls with many corners: each result is a proof, because no two points are nearer than the
    /// gap along the normal. The library is wrong by more than a tenth of a millimetre for some.
    #[test]
    fn hulls_are_as_far_apart_as_their_nearest_points() {
        let corners = |n: u32| {
            (0..70).map(move |k| {
                let at = Vector3::new(
                    spread(n + 3 * k),
                    spread(n + 3 * k + 1),
                    spread(n + 3 * k + 2),
                );
                to_vector(&(at.normalize() * 0.04))
            })
        };
        let cylinder = Cylinder::new(0.06, 0.033);
        let (mut apart, mut deep, mut wrong) = (0, 0, 0);
        for trial in 0..400 {
            let points: Vec<_> = corners(trial * 331).collect();
            let hull = ConvexPolyhedron::from_convex_hull(&points)
                .expect("corners of a ball are not flat");
            let b_in_a = pose(trial, 0.09);
            let found = found(&b_in_a, [&hull, &cylinder])
                .unwrap_or_else(|| panic!("trial {trial}: nothing"));
            let solids = SolidPair::new(&to_pose(&b_in_a), &hull, &cylinder);
            let along_m = -solids.corner(found.normal).point.dot(&found.normal);
            let between = found.points[1] - found.points[0];
            assert!(
                (along_m - found.distance_m).abs() < 2e-6,
                "trial {trial}: {found:?}, {along_m} along the normal"
            );
            assert!(
                (between.dot(&found.normal) - found.distance_m).abs() < 2e-6,
                "trial {trial}: {found:?}"
            );
            // The normal of round bodies that are deep in each other is known less well than the
            // depth.
            let aside = (between - found.normal * found.distance_m).norm();
            assert!(
                aside < 1e-4 || found.distance_m < -0.001,
                "trial {trial}: {found:?} {aside}"
            );
            if found.distance_m > 0.0 {
                apart += 1
            } else {
                deep += 1
            }
            let by_library = contact(
                &to_pose(&Isometry3::identity()),
                &hull,
                &to_pose(&b_in_a),
                &cylinder,
                to_real(FAR_M),
            );
            let dist = by_library
                .ok()
                .flatten()
                .map_or(f64::INFINITY, |contact| f64::from(contact.dist));
            wrong += usize::from((dist - found.distance_m).abs() > 1e-4);
        }
        assert!(
            apart > 50 && deep > 50 && wrong > 0,
            "{apart} apart, {deep} deep, {wrong} wrong in the library"
        );
    }

    /// Corners of a piece of a finger of the Z1 in the package `example-robot-data`. Unit: metres.
    const FINGER: [[f32; 3]; 28] = [
        [0.058619052, 0.029, -0.007873807],
        [0.058619052, 0.028, 0.031029738],
        [0.068457074, 0.029, -0.007873807],
        [0.0805177, 0.028, -0.007873807],
        [0.08053078, -0.019952381, -0.007873807],
        [0.078463405, -0.019952381, -0.007873807],
        [0.058619052, -0.016, -0.007873807],
        [0.058619052, -0.019952381, 0.028934136],
        [0.07580366, 0.028, 0.018379707],
        [0.077632405, -0.019952381, 0.015376182],
        [0.07860654, 0.028, 0.013405322],
        [0.0707983, 0.028, 0.024105689],
        [0.06624331, 0.028, 0.02754847],
        [0.07107899, -0.019952381, 0.02384857],
        [0.08014518, -0.019952381, 0.0092840865],
        [0.06290158, 0.028, 0.029376797],
        [0.062278073, -0.019952381, 0.029663078],
        [0.07621755, -0.019952381, 0.017759578],
        [0.08121735, 0.028, 0.004276989],
        [0.080823205, -0.019952381, 0.0065965657],
        [0.081499696, -0.019952381, 4.140804e-5],
        [0.059702437, -0.019952381, 0.030687068],
        [0.058619052, -0.019952381, 0.031041319],
        [0.081076786, -0.019952381, -0.005216082],
        [0.08146865, 0.028, -0.0014271765],
        [0.07997167, 0.028, 0.009849146],
        [0.058619052, -0.015471666, 0.031041827],
        [0.08107865, 0.028, -0.0052163517],
    ];

    /// Many corners of the differences of a cylinder and this finger are in one plane, where
    /// rounding errors tear the polytope. Without a limit, the number of its faces doubles with
    /// each step, and the search takes seconds.
    #[test]
    fn a_search_with_a_torn_polytope_ends() {
        let points = FINGER.map(|[x, y, z]| parry3d::math::Vector::new(x, y, z));
        let hull = ConvexPolyhedron::from_convex_hull(&points).expect("a finger is not flat");
        let cylinder = Cylinder::new(0.008, 0.033);
        let pose = Pose {
            rotation: parry3d::math::Rotation::from_xyzw(
                1.2443363e-10,
                -0.41314983,
                -2.7427602e-10,
                0.91066307,
            ),
            translation: parry3d::math::Vector::new(0.08137189, 9.995261e-11, 0.034244776),
            ..Pose::IDENTITY
        };
        let found = SolidPair::new(&pose, &hull, &cylinder).separation(Vector3::x(), 0.5);
        assert!(matches!(found, SeparationOutcome::Nothing));
    }
}
