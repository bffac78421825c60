//! Measures the distances between the robot and the objects of the scene.

use std::collections::BTreeMap;

use nalgebra::Point3;
use parry3d::bounding_volume::Aabb;
use parry3d::query::distance;
use rapier3d::math::{Real, Vector};
use rapier3d::prelude::{Collider, RigidBodyHandle};

use crate::World;
use crate::contacts::Touch;
use crate::engine::Owner;
use crate::object::Object;
use crate::robot_course::ROUNDING_M;
use actcheck_data::Clearance;
use actcheck_geometry::Turned;
use actcheck_geometry::{from_pose, from_vector, to_vector};

/// Objects farther away than this are not measured. Unit: metres. An arm's reach.
const RANGE_M: f64 = 0.5;

/// Measures the smallest distance of the robot to each object.
#[derive(Default)]
pub(super) struct ClearanceMeter {
    /// One for each object, at most [`RANGE_M`]. Unit: metres.
    smallest_m: Vec<f64>,
}

impl World {
    /// Resets the measurement.
    pub(super) fn begin_clearance(&mut self) {
        self.recorder.clearance.smallest_m = vec![RANGE_M; self.objects.len()];
        self.record_clearance();
    }

    /// Records the objects that the robot touches.
    pub(super) fn record_touched(&mut self, touches: &BTreeMap<(Owner, Owner), Touch>) {
        for pair in touches.keys() {
            if let (Owner::Object(idx), Owner::Link(_)) = pair
                && let Some(smallest) = self.recorder.clearance.smallest_m.get_mut(*idx)
            {
                *smallest = 0.0;
            }
        }
    }

    /// Records the current distances.
    pub(super) fn record_clearance(&mut self) {
        let mut smallest = std::mem::take(&mut self.recorder.clearance.smallest_m);
        // The boxes of a link are needed only beside an object.
        let mut boxes: Vec<Option<Vec<(&Collider, Aabb)>>> = vec![None; self.robot.bodies.len()];
        for (object, smallest) in self.objects.iter().zip(&mut smallest) {
            let solids: Vec<(&Collider, Aabb)> = self.boxed(object.body).collect();
            for (link, boxes) in boxes.iter_mut().enumerate() {
                if *smallest <= 0.0 || self.are_balls_apart(link, object, *smallest) {
                    continue;
                }
                let boxes =
                    boxes.get_or_insert_with(|| self.boxed(self.robot.bodies[link]).collect());
                for (solid, its_box) in &solids {
                    for (link, link_box) in boxes.iter() {
                        if *smallest > 0.0 && gap(its_box, link_box) < *smallest {
                            let found = distance(
                                solid.position(),
                                solid.shape(),
                                link.position(),
                                link.shape(),
                            );
                            *smallest = smallest.min(
                                found.map_or(f64::INFINITY, |found| f64::from(found.distance)),
                            );
                        }
                    }
                }
            }
        }
        self.recorder.clearance.smallest_m = smallest;
    }

    /// Returns the smallest distances since the start, of all objects in range.
    pub(super) fn clearances(&self) -> Vec<Clearance> {
        let objects = self.objects.iter().zip(&self.recorder.clearance.smallest_m);
        let near = objects.filter(|(_, smallest)| **smallest < RANGE_M);
        near.map(|(object, smallest)| Clearance {
            id: object.id.clone(),
            smallest_m: *smallest,
        })
        .collect()
    }

    /// Returns the distance from a point to the surface of an object's shapes; negative inside.
    /// Unit: metres.
    pub(super) fn distance_to(&self, object: &Object, point: &Point3<f64>) -> f64 {
        let point = to_vector(&point.coords);
        let distances = self.colliders_of(object.body).map(|solid| {
            let nearest = solid.shape().project_point(solid.position(), point, false);
            let way = f64::from((nearest.point - point).length());
            if nearest.is_inside { -way } else { way }
        });
        distances.fold(f64::INFINITY, f64::min)
    }

    /// Returns the colliders of a body with their boxes.
    pub(super) fn boxed(&self, body: RigidBodyHandle) -> impl Iterator<Item = (&Collider, Aabb)> {
        self.colliders_of(body)
            .map(|collider| (collider, collider.compute_aabb()))
    }
}

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

/// A collider with the box around it.
pub(super) type Boxed<'a> = (&'a Collider, Aabb);

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::object;
    use crate::robot::tests::lonely;
    use actcheck_data::{Choices, ObjectModel, Part, Pose, Role, SceneObject, Shape};
    use actcheck_geometry::to_pose;
    use nalgebra::{Isometry3, Vector3};
    use rapier3d::prelude::{ColliderBuilder, SharedShape};
    use std::sync::Arc;

    /// A box of 10 cm, half a metre aside of the origin of its body, as a drawer may be.
    fn aside(pose: &Isometry3<f64>) -> SceneObject {
        let at = Isometry3::translation(0.5, 0.0, 0.0);
        let part = Part {
            pose: Pose::from_isometry(&at),
            shape: Shape::Box { size: [0.1; 3] },
        };
        let model = ObjectModel {
            name: "drawer".to_owned(),
            category: String::new(),
            mass_kg: 1.0,
            friction: 0.5,
            restitution: 0.0,
            origin_m: [0.0; 3],
            size_m: [0.1; 3],
            parts: vec![part],
            fixed: false,
            inertia: None,
            surface: None,
            moving: Vec::new(),
            digest: String::new(),
        };
        SceneObject {
            id: "drawer_1".to_owned(),
            model: Arc::new(model),
            role: Role::Target,
            pose: Pose::from_isometry(pose),
            mass_kg: 1.0,
            friction: 0.5,
            restitution: 0.0,
            attached: None,
        }
    }

    #[test]
    fn distances_are_those_of_all_shapes() {
        let mut choices = Choices::random(4, 0);
        let mut n_near = 0;
        for trial in 0..40 {
            let mut world = lonely();
            let mut number = |most: f64| choices.real("at".into(), -most, most, 0.0);
            let place = Vector3::new(number(1.0) - 1.0, number(1.0), 0.7 + number(0.7));
            let pose = Isometry3::new(place, Vector3::new(number(3.0), number(3.0), number(3.0)));
            let object = object::insert(&mut world.engine, 0, &aside(&pose));
            world.objects.push(object);
            world.begin_clearance();
            let links = world
                .robot
                .bodies
                .iter()
                .flat_map(|body| world.colliders_of(*body));
            let solids: Vec<&Collider> = world.colliders_of(world.objects[0].body).collect();
            let all = links.flat_map(|link| solids.iter().map(move |solid| (link, *solid)));
            let nearest = all.map(|(link, solid)| {
                let found = distance(
                    solid.position(),
                    solid.shape(),
                    link.position(),
                    link.shape(),
                );
                found.map_or(f64::INFINITY, |found| f64::from(found.distance))
            });
            let nearest = nearest.fold(RANGE_M, f64::min);
            let found = world.recorder.clearance.smallest_m[0];
            assert!(
                (found - nearest).abs() < 1e-6,
                "trial {trial}: {found} instead of {nearest}"
            );
            n_near += usize::from(nearest < RANGE_M);
        }
        assert!(n_near > 10, "{n_near} near");
    }

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
        let links = [4, 6];
        for (idx, hull) in hulls.iter().cycle().take(12).enumerate() {
            let mut number = |most: f64| choices.real("at".into(), -most, most, 0.0);
            let place = Isometry3::new(
                Vector3::new(number(0.1), number(0.1), number(0.1)),
                Vector3::new(number(3.0), number(3.0), number(3.0)),
            );
            let shape = SharedShape::new(hull.with_memory());
            let collider = ColliderBuilder::new(shape).position(to_pose(&place));
            world
                .engine
                .insert_collider(collider, Some(world.robot.bodies[links[idx % 2]]));
        }
        let (mut n_near, mut n_touching) = (0, 0);
        for _ in 0..200 {
            let mut number = |most: f64| choices.real("at".into(), -most, most, 0.0);
            for idx in 0..world.robot.positions.len() {
                world.robot.positions[idx] += number(0.3);
            }
            world.robot.put_state(&mut world.engine);
            let [solids, others] = links.map(|link| {
                world
                    .colliders_of(world.robot.bodies[link])
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
                world.gap_of_links(links[0], links[1]).to_bits(),
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
