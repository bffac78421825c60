//! Detects postures in which links of the robot are too close to each other, for motion planning.

use std::cell::Cell;
use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use parry3d::query::distance;
use parry3d::query::gjk::{self, CsoPoint, GJKResult, VoronoiSimplex};
use parry3d::shape::SupportMap;
use rapier3d::math::{Pose as EnginePose, Vector as EngineVector};
use rapier3d::prelude::SharedShape;

use crate::Kinematics;
use crate::convert::{from_vector, to_pose, to_real, to_vector};
use crate::engine::{Owner, collider};
use crate::proximity::Ball;
use crate::separation::{SeparationOutcome, SolidPair};
use crate::sphere_tree::{Cluster, Sphere, sphere_tree};
use actcheck_data::Part;

/// Distance that links keep from each other. Unit: metres. The tracking error of a moving arm.
const CLEAR_M: f64 = 0.01;
/// Share of their distance in a valid posture that links keep if that distance is smaller.
const KEPT_SHARE: f64 = 0.9;

/// Error of distances in 32 bits. Unit: metres.
const ROUNDING_M: f64 = 1e-4;

/// Most solids of a cluster without halves.
const CLUSTER: usize = 4;

/// Robots with at least as many solids remember the directions in which they were apart. Below, it
/// is not worth the memory.
const MANY_SOLIDS: usize = 64;

/// The shapes of a robot's links, and the pairs of links that could collide.
#[derive(Clone)]
pub struct SelfContact {
    links: Vec<Arc<LinkSolids>>,
    pairs: Vec<LinkPair>,
    /// For each pair, the directions in which its solids were apart last.
    apart: Vec<Directions>,
}

/// The directions in which the solids of two links were far enough apart when they were looked at
/// last, in the frames of the first ones; 0 if they were not. They nearly always are so in the next
/// posture too.
#[derive(Clone)]
struct Directions {
    of: Vec<Cell<EngineVector>>,
    /// Number of solids of the second link.
    n_second: usize,
}

impl Directions {
    fn new([first, second]: [&LinkSolids; 2], remembered: bool) -> Self {
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

    /// That of two solids, if directions are remembered.
    fn of(&self, [first, second]: [usize; 2]) -> Option<&Cell<EngineVector>> {
        self.of.get(first * self.n_second + second)
    }
}

/// Two links and the distance that they have to keep. Unit: metres.
#[derive(Clone, Copy)]
struct LinkPair {
    links: (usize, usize),
    clear_m: f64,
}

/// A convex solid with the ball and the box around it, in its link's frame.
#[derive(Debug)]
struct LinkSolid {
    /// Its index among the shapes of the link.
    part: usize,
    pose: EnginePose,
    shape: SharedShape,
    ball: Ball,
    /// Half extents of the box, whose middle is that of the ball. Unit: metres.
    half: Vector3<f64>,
}

/// The convex solids of one link, in its frame.
#[derive(Debug)]
pub(crate) struct LinkSolids {
    solids: Vec<LinkSolid>,
    /// Their indices, those of neighbours next to each other, and the clusters of these.
    order: Vec<usize>,
    clusters: Vec<Cluster>,
    /// Centre of their bounding sphere and bounding box.
    middle: Point3<f64>,
    /// Half extents of that box. Unit: metres.
    half: Vector3<f64>,
    radius: f64,
}

impl SelfContact {
    /// Finds the pairs of links that could collide. Leaves out neighbours, whose shapes overlap at
    /// their joint, pairs of the hand, which the arm does not bring together, and pairs that
    /// overlap in one of the `right` postures, which are known to be valid, such as the one for
    /// driving. Pairs that are close in one of these may come as close in others.
    pub fn new(kinematics: &Kinematics, right: &[Vec<f64>]) -> Self {
        let links: Vec<Arc<LinkSolids>> = kinematics.forms().collect();
        let right: Vec<Vec<Isometry3<f64>>> = right
            .iter()
            .map(|posture| kinematics.links(posture))
            .collect();
        let is_solid = |link: &usize| !links[*link].solids.is_empty();
        let mut pairs = Vec::new();
        for second in (0..links.len()).filter(is_solid) {
            let neighbour = kinematics.solid_parent(second);
            let passes = |first: usize| {
                kinematics.pass(first, second) || kinematics.are_of_hand(first, second)
            };
            let others = (0..second)
                .filter(is_solid)
                .filter(|first| neighbour != Some(*first) && !passes(*first));
            for first in others {
                let pair = LinkPair {
                    links: (first, second),
                    clear_m: CLEAR_M,
                };
                let nearest = right
                    .iter()
                    .map(|poses| gap(&links, pair, poses))
                    .fold(CLEAR_M, f64::min);
                let clear_m = if nearest < CLEAR_M {
                    nearest * KEPT_SHARE
                } else {
                    CLEAR_M
                };
                if clear_m > 0.0 {
                    pairs.push(LinkPair { clear_m, ..pair });
                }
            }
        }
        Self::of(links, pairs)
    }

    fn of(links: Vec<Arc<LinkSolids>>, pairs: Vec<LinkPair>) -> Self {
        let n_solids: usize = links.iter().map(|link| link.solids.len()).sum();
        let remembered = n_solids >= MANY_SOLIDS;
        let of_pair = |pair: &LinkPair| {
            Directions::new([&links[pair.links.0], &links[pair.links.1]], remembered)
        };
        let apart = pairs.iter().map(of_pair).collect();
        Self {
            links,
            pairs,
            apart,
        }
    }

    /// Returns the pairs that overlap at these link poses.
    pub(crate) fn overlaps(&self, poses: &[Isometry3<f64>]) -> Vec<(usize, usize)> {
        let overlap = |pair: &&LinkPair| gap(&self.links, **pair, poses) <= 0.0;
        self.pairs
            .iter()
            .filter(overlap)
            .map(|pair| pair.links)
            .collect()
    }

    /// Drops these pairs: such links always overlap.
    pub(crate) fn without(mut self, overlapping: &[(usize, usize)]) -> Self {
        self.pairs.retain(|pair| !overlapping.contains(&pair.links));
        Self::of(self.links, self.pairs)
    }

    /// Whether any two links collide, or nearly so, at these link poses (see
    /// [`Kinematics::links`]).
    pub fn touches(&self, poses: &[Isometry3<f64>]) -> bool {
        self.touching(poses).is_some()
    }

    /// The first two links that collide, or nearly so, at these link poses.
    pub fn touching(&self, poses: &[Isometry3<f64>]) -> Option<(usize, usize)> {
        // Most links are far apart.
        let middles: Vec<Point3<f64>> = self
            .links
            .iter()
            .zip(poses)
            .map(|(link, pose)| pose * link.middle)
            .collect();
        let is_near = |LinkPair {
                           links: (first, second),
                           clear_m,
                       }: &LinkPair| {
            let reach = self.links[*first].radius + self.links[*second].radius + clear_m;
            !is_beyond(middles[*first] - middles[*second], reach)
        };
        let mut near = self
            .pairs
            .iter()
            .zip(&self.apart)
            .filter(|(pair, _)| is_near(pair));
        near.find(|(pair, apart)| is_closer(&self.links, **pair, poses, apart))
            .map(|(pair, _)| pair.links)
    }
}

/// Two links alone, for measurements at many poses.
pub(crate) struct TwoLinks([Arc<LinkSolids>; 2]);

impl TwoLinks {
    pub(crate) fn new(solids: [&[Part]; 2]) -> Self {
        Self(solids.map(|solids| Arc::new(LinkSolids::new(solids))))
    }

    /// Whether they overlap with the first one at the origin and the second one at a pose.
    pub(crate) fn overlap(&self, pose: Isometry3<f64>) -> bool {
        gap(
            &self.0,
            LinkPair {
                links: (0, 1),
                clear_m: CLEAR_M,
            },
            &[Isometry3::identity(), pose],
        ) <= 0.0
    }
}

/// Returns the distance of two links at these link poses, or their clearance if they are farther
/// apart. Unit: metres.
fn gap(links: &[Arc<LinkSolids>], pair: LinkPair, poses: &[Isometry3<f64>]) -> f64 {
    nearest(links, pair, poses, |solids, b_in_a, towards_b, _| {
        distance_m(solids, b_in_a, towards_b, pair.clear_m)
    })
}

/// Whether two links are closer than their clearance at these link poses. This takes less than half
/// of the time of [`gap`]: a direction in which the solids are far enough apart suffices.
fn is_closer(
    links: &[Arc<LinkSolids>],
    pair: LinkPair,
    poses: &[Isometry3<f64>],
    apart: &Directions,
) -> bool {
    let clear_m = pair.clear_m;
    let found = nearest(links, pair, poses, |solids, b_in_a, towards_b, indices| {
        if are_closer(solids, b_in_a, towards_b, clear_m, apart.of(indices)) {
            0.0
        } else {
            clear_m
        }
    });
    found < clear_m
}

/// Whether two solids are closer than this. Unit: metres. `towards_b`: a direction in the frame of
/// the first, and `last` that in which they were apart last.
fn are_closer(
    [a, b]: [&LinkSolid; 2],
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
    [a, b]: [&LinkSolid; 2],
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

/// Returns the least of the distances of all pairs of solids by `measure`, or the clearance of the
/// links if all are farther apart. Unit: metres. `measure` gets the pose of the second solid and
/// the direction of its middle in the frame of the first, and the indices of both.
fn nearest(
    links: &[Arc<LinkSolids>],
    LinkPair {
        links: (first, second),
        clear_m,
    }: LinkPair,
    poses: &[Isometry3<f64>],
    measure: impl Fn([&LinkSolid; 2], &EnginePose, EngineVector, [usize; 2]) -> f64,
) -> f64 {
    let (a, b) = (&links[first], &links[second]);
    let apart = poses[first] * a.middle - poses[second] * b.middle;
    if apart.norm() > a.radius + b.radius + clear_m {
        return clear_m;
    }
    let mut nearest = clear_m;
    let b_in_a = poses[first].inverse() * poses[second];
    let turned = Turned::new(b_in_a.rotation.to_rotation_matrix().into_inner());
    let middle_b = b_in_a * b.middle;
    // Most solids of two links are far from the box around the other link.
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
    let near_a = |(_, solid, middle): &(usize, &LinkSolid, Point3<f64>)| {
        let way = middle - a.middle;
        !is_beyond(way, a.radius + solid.ball.radius + far)
            && turned.boxes_apart(way, [&a.half, &solid.half]) <= far
    };
    let of_b: Vec<(usize, &LinkSolid, Point3<f64>)> = of_b.filter(near_a).collect();
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
pub(crate) struct Turned {
    turned: Matrix3<f64>,
    /// Its elements without their signs.
    spread: Matrix3<f64>,
}

impl Turned {
    pub(crate) fn new(turned: Matrix3<f64>) -> Self {
        Self {
            spread: turned.abs(),
            turned,
        }
    }

    /// Returns a lower bound of the distance of two boxes with these half extents, along the axes
    /// of both: the second one is turned, and its middle is at `way` from that of the first. Unit:
    /// metres.
    pub(crate) fn boxes_apart(
        &self,
        way: Vector3<f64>,
        [first, second]: [&Vector3<f64>; 2],
    ) -> f64 {
        let along_first = way.abs() - first - self.spread * second;
        let along_second = self.turned.tr_mul(&way).abs() - second - self.spread.tr_mul(first);
        along_first.max().max(along_second.max())
    }
}

impl Ball {
    /// Returns a ball around solids: that around their bounding box. Returns `None` if there are
    /// none.
    pub(super) fn around(solids: &[actcheck_data::Part]) -> Option<Self> {
        let mut low = [f64::INFINITY; 3];
        let mut high = [f64::NEG_INFINITY; 3];
        for solid in solids {
            let (lower, upper) = solid.bounds();
            for axis in 0..3 {
                low[axis] = low[axis].min(lower[axis]);
                high[axis] = high[axis].max(upper[axis]);
            }
        }
        let (low, high) = (Point3::from(low), Point3::from(high));
        let ball = Self {
            middle: nalgebra::center(&low, &high),
            radius: (high - low).norm() / 2.0,
        };
        (!solids.is_empty()).then_some(ball)
    }
}

impl LinkSolids {
    /// Returns the shapes with their poses in the link's frame.
    pub(crate) fn shapes(&self) -> impl Iterator<Item = (&SharedShape, &EnginePose)> {
        self.solids.iter().map(|solid| (&solid.shape, &solid.pose))
    }

    /// Returns the shapes as [`LinkSolids::shapes`], each with its index among the shapes of the
    /// link.
    pub(crate) fn parts(&self) -> impl Iterator<Item = (usize, &SharedShape, &EnginePose)> {
        self.solids
            .iter()
            .map(|solid| (solid.part, &solid.shape, &solid.pose))
    }

    pub(crate) fn new(solids: &[actcheck_data::Part]) -> Self {
        let around = Ball::around(solids).unwrap_or(Ball {
            middle: Point3::origin(),
            radius: 0.0,
        });
        let forms = solids.iter().enumerate().filter_map(|(part, solid)| {
            let form = collider(solid, Owner::Floor, 0.0, 0.0)?;
            let (low, high) = solid.bounds();
            let half = (Vector3::from(high) - Vector3::from(low)) / 2.0;
            let ball = Ball::around(std::slice::from_ref(solid))?;
            Some(LinkSolid {
                part,
                pose: form.position,
                shape: form.shape,
                ball,
                half,
            })
        });
        let ends =
            solids
                .iter()
                .map(actcheck_data::Part::bounds)
                .reduce(|(low, high), (lower, upper)| {
                    let pick = |of: fn(f64, f64) -> f64, a: [f64; 3], b: [f64; 3]| {
                        [of(a[0], b[0]), of(a[1], b[1]), of(a[2], b[2])]
                    };
                    (pick(f64::min, low, lower), pick(f64::max, high, upper))
                });
        let half = ends.map_or(Vector3::zeros(), |(low, high)| {
            (Vector3::from(high) - Vector3::from(low)) / 2.0
        });
        let solids: Vec<LinkSolid> = forms.collect();
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

    /// Skipping solids by the boxes around their links never changes whether links are too close.
    #[test]
    fn links_touch_exactly_if_two_of_their_solids_do() {
        let world = crate::robot::tests::lonely();
        let kinematics = world.kinematics();
        let start = world.observe().positions;
        let itself = SelfContact::new(kinematics, std::slice::from_ref(&start));
        // Only robots of many solids remember directions.
        let remember = |pair: &LinkPair| {
            Directions::new(
                [&itself.links[pair.links.0], &itself.links[pair.links.1]],
                true,
            )
        };
        let remembered: Vec<Directions> = itself.pairs.iter().map(remember).collect();
        let (mut close, mut apart) = (0, 0);
        for trial in 0..150 {
            let mut posture = start.clone();
            for (idx, joint) in kinematics.joints().iter().enumerate() {
                let share = libm::sin(f64::from(trial) * 3.1 + idx as f64 * 1.9);
                posture[idx] = (posture[idx] + share * 2.0).clamp(joint.lower, joint.upper);
            }
            let poses = kinematics.links(&posture);
            let least = |pair: &LinkPair| {
                let (first, second) = pair.links;
                let of = |link: usize| {
                    itself.links[link]
                        .solids
                        .iter()
                        .map(move |solid| (link, solid))
                };
                let placed =
                    |(link, solid): (usize, &LinkSolid)| to_pose(&poses[link]) * solid.pose;
                let all = of(first).flat_map(|a| of(second).map(move |b| (a, b)));
                let gaps = all.map(|(a, b)| {
                    let found = distance(
                        &placed(a),
                        a.1.shape.as_ref(),
                        &placed(b),
                        b.1.shape.as_ref(),
                    );
                    found.map_or(0.0, |found| f64::from(found.distance))
                });
                gaps.fold(f64::INFINITY, f64::min) - pair.clear_m
            };
            for ((pair, directions), remembered) in
                itself.pairs.iter().zip(&itself.apart).zip(&remembered)
            {
                let spare = least(pair);
                if spare.abs() > ROUNDING_M {
                    for directions in [directions, remembered] {
                        let is_closer = is_closer(&itself.links, *pair, &poses, directions);
                        assert_eq!(is_closer, spare < 0.0, "{:?} by {spare}", pair.links);
                    }
                    if spare < 0.0 { close += 1 } else { apart += 1 }
                }
            }
        }
        assert!(close > 100 && apart > 1000, "{close} close, {apart} apart");
        let is_known = |direction: &Cell<EngineVector>| direction.get() != EngineVector::ZERO;
        assert!(
            remembered
                .iter()
                .flat_map(|directions| &directions.of)
                .any(is_known)
        );
    }
}
