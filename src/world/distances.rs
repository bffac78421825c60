//! Distances and depths between bodies where they are now.

use nalgebra::Point3;
use parry3d::bounding_volume::{Aabb, BoundingSphere, BoundingVolume};
use parry3d::query::{contact, distance};
use rapier3d::math::{Real, Vector};
use rapier3d::prelude::Collider;

use crate::bodies::Bodies;
use crate::object::Object;
use actcheck_geometry::Turned;
use actcheck_geometry::{from_pose, from_vector, to_vector};

/// Links and objects are measured up to this distance. Unit: metres.
const RANGE_M: f64 = 0.25;
/// Factor on a squared distance that is more than its rounding error in 32 bits.
const ROUNDED_UP: f64 = 1.0 + 1e-5;
/// Links that penetrate each other by no more than this only touch. Unit: metres.
pub(super) const TOUCH_M: f64 = 1e-4;
/// Error of positions in 32 bits. Unit: metres.
pub(super) const ROUNDING_M: f64 = 1e-4;

/// A collider with the box around it.
pub(super) type Boxed<'a> = (&'a Collider, Aabb);

/// Returns the distance between two boxes; 0 if they overlap. Unit: metres.
pub(super) fn gap(a: &Aabb, b: &Aabb) -> f64 {
    f64::from(way_between(a, b).length())
}

/// Returns the square of the distance between two boxes: faster. Unit: square metres.
pub(super) fn gap_squared(a: &Aabb, b: &Aabb) -> Real {
    way_between(a, b).length_squared()
}

fn way_between(a: &Aabb, b: &Aabb) -> Vector {
    (a.mins - b.maxs).max(b.mins - a.maxs).max(Vector::ZERO)
}

/// Returns the distance of two colliders with their boxes, or `most` if it is larger. Unit: metres.
pub(super) fn apart((one, its_box): &Boxed<'_>, (other, other_box): &Boxed<'_>, most: f64) -> f64 {
    if gap(its_box, other_box) >= most || turned_boxes_apart(one, other) >= most + ROUNDING_M {
        return most;
    }
    let found = distance(one.position(), one.shape(), other.position(), other.shape());
    found
        .map_or(0.0, |found| f64::from(found.distance))
        .min(most)
}

/// Returns a lower bound of the distance of two colliders, of their boxes in their own frames.
/// Unit: metres.
fn turned_boxes_apart(one: &Collider, other: &Collider) -> f64 {
    let pose = from_pose(&one.position().inv_mul(other.position()));
    let [(middle, half), (other_middle, other_half)] = [one, other].map(|collider| {
        let bounds = collider.shape().compute_local_aabb();
        (
            Point3::from(from_vector(bounds.center())),
            from_vector(bounds.half_extents()),
        )
    });
    let turned = Turned::new(pose.rotation.to_rotation_matrix().into_inner());
    turned.boxes_apart(pose * other_middle - middle, [&half, &other_half])
}

/// Returns the distance from a point to the surface of an object's shapes; negative inside.
/// Unit: metres.
pub(super) fn distance_to(bodies: &Bodies, object: &Object, point: &Point3<f64>) -> f64 {
    let point = to_vector(&point.coords);
    let distances = bodies.colliders_of(object.body).map(|solid| {
        let nearest = solid.shape().project_point(solid.position(), point, false);
        let way = f64::from((nearest.point - point).length());
        if nearest.is_inside { -way } else { way }
    });
    distances.fold(f64::INFINITY, f64::min)
}

/// Returns whether the balls around a link and an object are farther apart than this. Unit:
/// metres.
pub(super) fn are_balls_apart(bodies: &Bodies, link: usize, object: &Object, needed: f64) -> bool {
    let Some(ball) = &bodies.robot.balls[link] else {
        return true;
    };
    let (Some(around), Some(body)) = (
        &object.ball,
        bodies.physics.bodies.get(bodies.robot.bodies[link]),
    ) else {
        return false;
    };
    let way = from_pose(body.position()) * ball.middle - bodies.pose_of(object) * around.middle;
    way.norm() - ball.radius - around.radius >= needed + ROUNDING_M
}

/// Measures the distance of a link from these objects, and from the floor. Unit: metres.
pub(super) fn gap_of_link(
    bodies: &Bodies,
    link: usize,
    these: &dyn Fn(&Object) -> bool,
    floor: bool,
) -> f64 {
    let mut nearest = RANGE_M;
    let these = bodies.objects.iter().filter(|object| these(object));
    let others: Vec<_> = these.flat_map(|object| bodies.boxed(object.body)).collect();
    for solid in bodies.boxed(bodies.robot.bodies[link]) {
        if floor && !bodies.robot.off_floor[link] {
            // The distance from the top of so large a slab would be inexact.
            nearest = nearest.min(f64::from(solid.1.mins.z));
        }
        nearest = others.iter().fold(nearest, |nearest, other| {
            nearest.min(apart(&solid, other, nearest))
        });
    }
    nearest
}

/// Returns the distance of two links, or [`RANGE_M`] if it is larger. Unit: metres.
pub(super) fn gap_of_links(bodies: &Bodies, first: usize, second: usize) -> f64 {
    let [solids, others] =
        [first, second].map(|link| bodies.boxed(bodies.robot.bodies[link]).collect::<Vec<_>>());
    let Some(around) = others
        .iter()
        .map(|(_, its_box)| *its_box)
        .reduce(|one, other| one.merged(&other))
    else {
        return RANGE_M;
    };
    // Most others are farther apart than those with the nearest boxes.
    let (mut least, mut begin) = (Real::INFINITY, None);
    for solid in &solids {
        if gap_squared(&solid.1, &around) >= least {
            continue;
        }
        for other in &others {
            let squared = gap_squared(&solid.1, &other.1);
            if squared < least {
                (least, begin) = (squared, Some((solid, other)));
            }
        }
    }
    let mut nearest = begin.map_or(RANGE_M, |(solid, other)| apart(solid, other, RANGE_M));
    let is_far = |squared: Real, nearest: f64| f64::from(squared) > nearest * nearest * ROUNDED_UP;
    for solid in &solids {
        if is_far(gap_squared(&solid.1, &around), nearest) {
            continue;
        }
        for other in &others {
            if !is_far(gap_squared(&solid.1, &other.1), nearest) {
                nearest = nearest.min(apart(solid, other, nearest));
            }
        }
    }
    nearest
}

/// Returns the penetration depth of two links; 0 if they are apart. Unit: metres.
pub(super) fn depth_of(bodies: &Bodies, first: usize, second: usize) -> f64 {
    let (one, other) = (ball_of(bodies, first), ball_of(bodies, second));
    let far = |(middle, radius): (Point3<f64>, f64), around: Option<(Point3<f64>, f64)>| {
        around.is_some_and(|(other, its_radius)| {
            (middle - other).norm() > radius + its_radius + ROUNDING_M
        })
    };
    if one.is_some_and(|one| far(one, other)) {
        return 0.0;
    }
    // Most shapes of a link are far from the other link.
    let near = |idx: usize, around: Option<(Point3<f64>, f64)>| {
        let solids = bodies
            .colliders_of(bodies.robot.bodies[idx])
            .zip(&bodies.robot.balls_of_shapes[idx]);
        let balls = solids.map(|(solid, ball)| (placed(ball, solid), solid));
        balls.filter(move |(ball, _)| !far(*ball, around))
    };
    let of_second: Vec<((Point3<f64>, f64), &Collider)> = near(second, one).collect();
    let mut deepest = 0.0f64;
    for ((middle, radius), a) in near(first, other) {
        for ((other, other_radius), b) in &of_second {
            if (middle - other).norm() > radius + other_radius {
                continue;
            }
            let met = contact(a.position(), a.shape(), b.position(), b.shape(), 0.0)
                .ok()
                .flatten();
            deepest = deepest.max(met.map_or(0.0, |met| -f64::from(met.dist)));
        }
    }
    deepest
}

/// Returns the centre and the radius of the ball around a link; `None` without shapes. Frame:
/// world. Unit: metres.
fn ball_of(bodies: &Bodies, link: usize) -> Option<(Point3<f64>, f64)> {
    let ball = bodies.robot.balls[link].as_ref()?;
    let body = bodies.physics.bodies.get(bodies.robot.bodies[link])?;
    Some((from_pose(body.position()) * ball.middle, ball.radius))
}

/// Returns centre and radius of a solid's bounding ball, which is in the solid's frame. Frame:
/// world. Unit: metres.
fn placed(around: &BoundingSphere, solid: &Collider) -> (Point3<f64>, f64) {
    let pose = from_pose(solid.position());
    (
        pose * Point3::from(from_vector(around.center)),
        f64::from(around.radius),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::tests::lonely;
    use crate::simulation::tests::bodies_mut;
    use actcheck_data::Choices;
    use actcheck_geometry::to_pose;
    use nalgebra::{Isometry3, Vector3};
    use rapier3d::prelude::{ColliderBuilder, SharedShape};

    /// All pairs of the shapes of two links, without looking at boxes first.
    #[test]
    fn gaps_of_links_are_those_of_all_shapes() {
        let mut world = lonely();
        let mut choices = Choices::random(8, 0);
        let hulls: Vec<_> = (0..3)
            .map(|_| {
                let mut number =
                    || actcheck_geometry::to_real(choices.real("at".into(), -0.06, 0.06, 0.0));
                let corners: Vec<Vector> = (0..20)
                    .map(|_| Vector::new(number(), number(), number()))
                    .collect();
                actcheck_geometry::Hull::of(&corners).expect("the corners are not in a plane")
            })
            .collect();
        let bodies = bodies_mut(&mut world);
        let links = [4, 6];
        for (idx, hull) in hulls.iter().cycle().take(12).enumerate() {
            let mut number = |most: f64| choices.real("at".into(), -most, most, 0.0);
            let place = Isometry3::new(
                Vector3::new(number(0.1), number(0.1), number(0.1)),
                Vector3::new(number(3.0), number(3.0), number(3.0)),
            );
            let shape = SharedShape::new(hull.with_memory());
            let collider = ColliderBuilder::new(shape).position(to_pose(&place));
            bodies
                .physics
                .insert_collider(collider, Some(bodies.robot.bodies[links[idx % 2]]));
        }
        let (mut n_near, mut n_touching) = (0, 0);
        for _ in 0..200 {
            let mut number = |most: f64| choices.real("at".into(), -most, most, 0.0);
            for idx in 0..bodies.robot.positions.len() {
                bodies.robot.positions[idx] += number(0.3);
            }
            bodies.robot.put_state(&mut bodies.physics);
            let [solids, others] = links.map(|link| {
                bodies
                    .colliders_of(bodies.robot.bodies[link])
                    .collect::<Vec<_>>()
            });
            let gaps = solids.iter().flat_map(|one| {
                others.iter().map(|other| {
                    let found =
                        distance(one.position(), one.shape(), other.position(), other.shape());
                    f64::from(found.expect("both are convex").distance)
                })
            });
            let nearest = gaps.fold(0.25, f64::min);
            assert_eq!(
                gap_of_links(bodies, links[0], links[1]).to_bits(),
                nearest.to_bits()
            );
            (n_near, n_touching) = (
                n_near + u32::from(nearest < 0.25),
                n_touching + u32::from(nearest == 0.0),
            );
        }
        assert!(
            n_near - n_touching > 40,
            "{n_near} near, of which {n_touching} touch"
        );
    }

    #[test]
    fn the_gap_of_two_boxes_is_the_distance_of_their_nearest_points() {
        let unit =
            |x: f32, y: f32| Aabb::new(Vector::new(x, y, 0.0), Vector::new(x + 1.0, y + 1.0, 1.0));
        assert!((gap(&unit(0.0, 0.0), &unit(4.0, 5.0)) - 5.0).abs() < 1e-6);
        assert_eq!(gap(&unit(0.0, 0.0), &unit(0.5, 0.5)), 0.0);
    }
}
