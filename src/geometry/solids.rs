//! The convex solids of one body, and the distance of two such bodies.

use std::cell::Cell;

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use parry3d::math::{Pose as EnginePose, Vector as EngineVector};
use parry3d::query::distance;
use parry3d::query::gjk::{self, CsoPoint, GJKResult, VoronoiSimplex};
use parry3d::shape::{SharedShape, SupportMap};

use crate::ball::Ball;
use crate::convert::{from_vector, to_pose, to_real, to_vector};
use crate::convex::convex_shape;
use crate::separation::{SeparationOutcome, SolidPair};
use crate::sphere_tree::{Cluster, Sphere, sphere_tree};
use actcheck_data::Part;

/// Error of distances in 32 bits. Unit: metres.
const ROUNDING_M: f64 = 1e-4;

/// Most solids of a cluster without halves.
const CLUSTER: usize = 4;

/// The directions in which the solids of two bodies were far enough apart when they were looked at
/// last, in the frames of the first ones; 0 if they were not. They nearly always are so in the next
/// posture too.
#[derive(Clone)]
pub struct Directions {
    of: Vec<Cell<EngineVector>>,
    /// Number of solids of the second body.
    n_second: usize,
}

impl Directions {
    /// Returns unknown directions for the solids of two bodies. Only if they are `remembered`, those
    /// that are found are kept.
    pub fn new([first, second]: [&BodySolids; 2], remembered: bool) -> Self {
        let n_second = second.solids.len();
        let n_pairs = if remembered {
            first.solids.len() * n_second
        } else {
            0
        };
        Self {
            of: vec![Cell::new(EngineVector::ZERO); n_pairs],
            n_second,
        }
    }

    /// Whether any direction is known.
    pub fn is_known(&self) -> bool {
        self.of.iter().any(|of| of.get() != EngineVector::ZERO)
    }

    /// That of two solids, if directions are remembered.
    fn of(&self, [first, second]: [usize; 2]) -> Option<&Cell<EngineVector>> {
        self.of.get(first * self.n_second + second)
    }
}

/// A convex solid with the ball and the box around it, in its body's frame.
#[derive(Debug)]
struct BodySolid {
    /// Its index among the shapes of the body.
    part: usize,
    pose: EnginePose,
    shape: SharedShape,
    ball: Ball,
    /// Half extents of the box, whose middle is that of the ball. Unit: metres.
    half: Vector3<f64>,
}

/// The convex solids of one body, in its frame.
#[derive(Debug)]
pub struct BodySolids {
    solids: Vec<BodySolid>,
    /// Their indices, those of neighbours next to each other, and the clusters of these.
    order: Vec<usize>,
    clusters: Vec<Cluster>,
    /// Centre of their bounding sphere and bounding box.
    middle: Point3<f64>,
    /// Half extents of that box. Unit: metres.
    half: Vector3<f64>,
    radius: f64,
}

impl BodySolids {
    /// Returns the shapes with their poses in the body's frame.
    pub fn shapes(&self) -> impl Iterator<Item = (&SharedShape, &EnginePose)> {
        self.solids.iter().map(|solid| (&solid.shape, &solid.pose))
    }

    /// Returns the shapes as [`BodySolids::shapes`], each with its index among the shapes of the
    /// body.
    pub fn parts(&self) -> impl Iterator<Item = (usize, &SharedShape, &EnginePose)> {
        self.solids
            .iter()
            .map(|solid| (solid.part, &solid.shape, &solid.pose))
    }

    /// Returns whether the body has none.
    pub fn is_empty(&self) -> bool {
        self.solids.is_empty()
    }

    /// Returns their number.
    pub fn len(&self) -> usize {
        self.solids.len()
    }

    /// Returns the ball around all of them.
    pub fn ball(&self) -> Ball {
        Ball {
            middle: self.middle,
            radius: self.radius,
        }
    }

    /// Prepares the convex solids of a body. Leaves out tubes.
    pub fn new(solids: &[Part]) -> Self {
        let around = Ball::around(solids).unwrap_or(Ball {
            middle: Point3::origin(),
            radius: 0.0,
        });
        let forms = solids.iter().enumerate().filter_map(|(part, solid)| {
            let (shape, pose) = convex_shape(solid)?;
            let (low, high) = solid.bounds();
            let half = (Vector3::from(high) - Vector3::from(low)) / 2.0;
            let ball = Ball::around(std::slice::from_ref(solid))?;
            Some(BodySolid {
                part,
                pose,
                shape,
                ball,
                half,
            })
        });
        let ends = solids
            .iter()
            .map(Part::bounds)
            .reduce(|(low, high), (lower, upper)| {
                let pick = |of: fn(f64, f64) -> f64, a: [f64; 3], b: [f64; 3]| {
                    [of(a[0], b[0]), of(a[1], b[1]), of(a[2], b[2])]
                };
                (pick(f64::min, low, lower), pick(f64::max, high, upper))
            });
        let half = ends.map_or(Vector3::zeros(), |(low, high)| {
            (Vector3::from(high) - Vector3::from(low)) / 2.0
        });
        let solids: Vec<BodySolid> = forms.collect();
        let mut order: Vec<usize> = (0..solids.len()).collect();
        let sphere = |idx: &usize| Sphere {
            middle: solids[*idx].ball.middle,
            radius: solids[*idx].ball.radius,
        };
        let clusters = sphere_tree(&mut order, CLUSTER, sphere);
        Self {
            solids,
            order,
            clusters,
            middle: around.middle,
            half,
            radius: around.radius,
        }
    }

    /// Returns the indices of the solids, in their order, but not all of those for which the sphere
    /// around them `is_far`.
    fn near(&self, is_far: impl Fn(&Sphere) -> bool) -> Vec<usize> {
        let (mut found, mut idx) = (Vec::with_capacity(self.solids.len()), 0);
        while let Some(cluster) = self.clusters.get(idx) {
            if is_far(&cluster.around) {
                idx = cluster.next;
            } else {
                found.extend(&self.order[cluster.things.clone()]);
                idx += 1;
            }
        }
        found.sort_unstable();
        found
    }
}

/// Returns the distance of two bodies at these poses, or `clear_m` if they are farther apart. Unit:
/// metres.
pub fn gap(bodies: [&BodySolids; 2], poses: [&Isometry3<f64>; 2], clear_m: f64) -> f64 {
    nearest(bodies, poses, clear_m, |solids, b_in_a, towards_b, _| {
        distance_m(solids, b_in_a, towards_b, clear_m)
    })
}

/// Whether two bodies are closer than `clear_m` at these poses. Unit: metres. This takes less than half
/// of the time of [`gap`]: a direction in which the solids are far enough apart suffices.
pub fn is_closer(
    bodies: [&BodySolids; 2],
    poses: [&Isometry3<f64>; 2],
    clear_m: f64,
    apart: &Directions,
) -> bool {
    let found = nearest(
        bodies,
        poses,
        clear_m,
        |solids, b_in_a, towards_b, indices| {
            if are_closer(solids, b_in_a, towards_b, clear_m, apart.of(indices)) {
                0.0
            } else {
                clear_m
            }
        },
    );
    found < clear_m
}

/// Whether two solids are closer than this. Unit: metres. `towards_b`: a direction in the frame of
/// the first, and `last` that in which they were apart last.
fn are_closer(
    [a, b]: [&BodySolid; 2],
    b_in_a: &EnginePose,
    towards_b: EngineVector,
    clear_m: f64,
    last: Option<&Cell<EngineVector>>,
) -> bool {
    let (Some(shape_a), Some(shape_b)) = (a.shape.as_support_map(), b.shape.as_support_map())
    else {
        let found = distance(
            &EnginePose::IDENTITY,
            a.shape.as_ref(),
            b_in_a,
            b.shape.as_ref(),
        );
        return !found.is_ok_and(|found| f64::from(found.distance) >= clear_m);
    };
    let is_apart = |direction: EngineVector| {
        -direction.dot(CsoPoint::from_shapes(b_in_a, shape_a, shape_b, direction).point)
            > to_real(clear_m)
    };
    if last.is_some_and(|last| is_apart(last.get())) {
        return false;
    }
    let direction = towards_b.try_normalize().unwrap_or(EngineVector::X);
    let mut simplex = VoronoiSimplex::new();
    simplex.reset(CsoPoint::from_shapes(b_in_a, shape_a, shape_b, direction));
    let found = gjk::closest_points(
        b_in_a,
        shape_a,
        shape_b,
        to_real(clear_m),
        false,
        &mut simplex,
    );
    match found {
        GJKResult::NoIntersection(direction) if direction != EngineVector::X => {
            last.inspect(|last| last.set(direction));
            false
        }
        // The search also ends with this direction if it does not converge: it counts only if they
        // are apart in it.
        GJKResult::NoIntersection(direction) if is_apart(direction) => false,
        // Nor is it exact in 32 bits.
        _ => match separation(b_in_a, [shape_a, shape_b], towards_b, clear_m) {
            SeparationOutcome::Far(direction) => {
                last.inspect(|last| last.set(to_vector(&direction)));
                false
            }
            SeparationOutcome::Near(found) => found.distance_m < clear_m,
            SeparationOutcome::Nothing => true,
        },
    }
}

/// Distance of two solids, 0 if they overlap, or `far_m` if they are farther apart. Unit: metres.
/// Other arguments as for [`are_closer`].
fn distance_m(
    [a, b]: [&BodySolid; 2],
    b_in_a: &EnginePose,
    towards_b: EngineVector,
    far_m: f64,
) -> f64 {
    let (Some(shape_a), Some(shape_b)) = (a.shape.as_support_map(), b.shape.as_support_map())
    else {
        let found = distance(
            &EnginePose::IDENTITY,
            a.shape.as_ref(),
            b_in_a,
            b.shape.as_ref(),
        );
        // An unsupported pair counts as a collision.
        return found.map_or(0.0, |found| f64::from(found.distance));
    };
    match separation(b_in_a, [shape_a, shape_b], towards_b, far_m) {
        SeparationOutcome::Far(_) => far_m,
        SeparationOutcome::Near(found) => found.distance_m.max(0.0),
        SeparationOutcome::Nothing => 0.0,
    }
}

/// Finds how far apart two shapes are, exactly. Arguments as for [`distance_m`].
fn separation(
    b_in_a: &EnginePose,
    [shape_a, shape_b]: [&dyn SupportMap; 2],
    towards_b: EngineVector,
    far_m: f64,
) -> SeparationOutcome {
    let start = from_vector(towards_b.try_normalize().unwrap_or(EngineVector::X));
    SolidPair::new(b_in_a, shape_a, shape_b).separation(start, far_m)
}

/// Returns the least of the distances of all pairs of solids by `measure`, or `clear_m` if all are
/// farther apart. Unit: metres. `measure` gets the pose of the second solid and
/// the direction of its middle in the frame of the first, and the indices of both.
fn nearest(
    [a, b]: [&BodySolids; 2],
    [pose_a, pose_b]: [&Isometry3<f64>; 2],
    clear_m: f64,
    measure: impl Fn([&BodySolid; 2], &EnginePose, EngineVector, [usize; 2]) -> f64,
) -> f64 {
    let apart = pose_a * a.middle - pose_b * b.middle;
    if apart.norm() > a.radius + b.radius + clear_m {
        return clear_m;
    }
    let mut nearest = clear_m;
    let b_in_a = pose_a.inverse() * pose_b;
    let turned = Turned::new(b_in_a.rotation.to_rotation_matrix().into_inner());
    let middle_b = b_in_a * b.middle;
    // Most solids of two bodies are far from the box around the other body.
    if turned.boxes_apart(middle_b - a.middle, [&a.half, &b.half]) > clear_m + ROUNDING_M {
        return clear_m;
    }
    let far = clear_m + ROUNDING_M;
    let is_far_from_a = |of_b: &Sphere| {
        is_beyond(
            b_in_a * of_b.middle - a.middle,
            a.radius + of_b.radius + far,
        )
    };
    let near_b = b.near(is_far_from_a).into_iter();
    let of_b = near_b.map(|idx| (idx, &b.solids[idx], b_in_a * b.solids[idx].ball.middle));
    let near_a = |(_, solid, middle): &(usize, &BodySolid, Point3<f64>)| {
        let way = middle - a.middle;
        !is_beyond(way, a.radius + solid.ball.radius + far)
            && turned.boxes_apart(way, [&a.half, &solid.half]) <= far
    };
    let of_b: Vec<(usize, &BodySolid, Point3<f64>)> = of_b.filter(near_a).collect();
    if of_b.is_empty() {
        return clear_m;
    }
    let placed = to_pose(&b_in_a);
    let is_far_from_b =
        |of_a: &Sphere| is_beyond(middle_b - of_a.middle, of_a.radius + b.radius + far);
    for idx_a in a.near(is_far_from_b) {
        let solid_a = &a.solids[idx_a];
        let (way, far) = (middle_b - solid_a.ball.middle, nearest + ROUNDING_M);
        if is_beyond(way, solid_a.ball.radius + b.radius + far)
            || turned.boxes_apart(way, [&solid_a.half, &b.half]) > far
        {
            continue;
        }
        for (idx_b, solid_b, middle_b) in &of_b {
            let way = middle_b - solid_a.ball.middle;
            let apart = way.norm() - solid_a.ball.radius - solid_b.ball.radius;
            let far = nearest + ROUNDING_M;
            if apart > far || turned.boxes_apart(way, [&solid_a.half, &solid_b.half]) > far {
                continue;
            }
            let b_in_a = solid_a.pose.inv_mul(&(placed * solid_b.pose));
            let towards_b = solid_a.pose.rotation.inverse() * to_vector(&way);
            nearest = nearest.min(measure(
                [solid_a, solid_b],
                &b_in_a,
                towards_b,
                [idx_a, *idx_b],
            ));
            if nearest <= 0.0 {
                return nearest;
            }
        }
    }
    nearest
}

/// Whether a way is longer than this. Unit: metres.
fn is_beyond(way: Vector3<f64>, length_m: f64) -> bool {
    way.norm_squared() > length_m * length_m
}

/// The rotation of one box relative to another.
pub struct Turned {
    turned: Matrix3<f64>,
    /// Its elements without their signs.
    spread: Matrix3<f64>,
}

impl Turned {
    /// Prepares a rotation matrix.
    pub fn new(turned: Matrix3<f64>) -> Self {
        Self {
            spread: turned.abs(),
            turned,
        }
    }

    /// Returns a lower bound of the distance of two boxes with these half extents, along the axes
    /// of both: the second one is turned, and its middle is at `way` from that of the first. Unit:
    /// metres.
    pub fn boxes_apart(&self, way: Vector3<f64>, [first, second]: [&Vector3<f64>; 2]) -> f64 {
        let along_first = way.abs() - first - self.spread * second;
        let along_second = self.turned.tr_mul(&way).abs() - second - self.spread.tr_mul(first);
        along_first.max().max(along_second.max())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_are_never_farther_apart_than_said() {
        let [first, second] = [Vector3::new(0.1, 0.2, 0.3), Vector3::new(0.3, 0.1, 0.05)];
        let cuboid = |half: &Vector3<f64>| {
            parry3d::shape::Cuboid::new([half.x as f32, half.y as f32, half.z as f32].into())
        };
        let shapes = [cuboid(&first), cuboid(&second)];
        let mut close = 0;
        for step in 0..400 {
            let [a, b] = [f64::from(step) * 0.7, f64::from(step) * 0.31];
            let way = Vector3::new(libm::cos(a), libm::sin(a) * libm::cos(b), libm::sin(b))
                * (0.2 + f64::from(step) * 0.002);
            let pose = Isometry3::new(way, Vector3::new(b, a, 0.4));
            let bound = Turned::new(pose.rotation.to_rotation_matrix().into_inner())
                .boxes_apart(way, [&first, &second]);
            let true_m = distance(
                &EnginePose::IDENTITY,
                &shapes[0],
                &to_pose(&pose),
                &shapes[1],
            )
            .map_or(0.0, |found| f64::from(found.distance));
            assert!(bound <= true_m + ROUNDING_M, "{bound} {true_m}");
            close += usize::from(bound > 0.0 && true_m - bound < 0.02);
        }
        assert!(
            close > 40,
            "the bound is close where a face is nearest: {close}"
        );
    }
}
