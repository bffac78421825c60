//! Measures the distances between the robot and the objects of the scene.

use parry3d::bounding_volume::Aabb;
use parry3d::query::distance;
use rapier3d::prelude::Collider;

use crate::bodies::Bodies;
use crate::contacts::Touches;
use crate::distances::{are_balls_apart, gap};
use crate::physics::Owner;
use actcheck_data::Clearance;

/// Objects farther away than this are not measured. Unit: metres. An arm's reach.
const RANGE_M: f64 = 0.5;

/// Measures the smallest distance of the robot to each object.
#[derive(Default)]
pub(super) struct ClearanceMeter {
    /// One for each object, at most [`RANGE_M`]. Unit: metres.
    smallest_m: Vec<f64>,
}

impl ClearanceMeter {
    /// Resets the measurement.
    pub(super) fn begin(&mut self, bodies: &Bodies) {
        self.smallest_m = vec![RANGE_M; bodies.objects.len()];
        self.record(bodies);
    }

    /// Records the objects that the robot touches.
    pub(super) fn record_touched(&mut self, touches: &Touches) {
        for pair in touches.keys() {
            if let (Owner::Object(idx), Owner::Link(_)) = pair
                && let Some(smallest) = self.smallest_m.get_mut(*idx)
            {
                *smallest = 0.0;
            }
        }
    }

    /// Records the current distances.
    pub(super) fn record(&mut self, bodies: &Bodies) {
        // The boxes of a link are needed only beside an object.
        let mut boxes: Vec<Option<Vec<(&Collider, Aabb)>>> = vec![None; bodies.robot.bodies.len()];
        for (object, smallest) in bodies.objects.iter().zip(&mut self.smallest_m) {
            let solids: Vec<(&Collider, Aabb)> = bodies.boxed(object.body).collect();
            for (link, boxes) in boxes.iter_mut().enumerate() {
                if *smallest <= 0.0 || are_balls_apart(bodies, link, object, *smallest) {
                    continue;
                }
                let boxes =
                    boxes.get_or_insert_with(|| bodies.boxed(bodies.robot.bodies[link]).collect());
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
    }

    /// Returns the smallest distances since the start, of all objects in range.
    pub(super) fn clearances(&self, bodies: &Bodies) -> Vec<Clearance> {
        let objects = bodies.objects.iter().zip(&self.smallest_m);
        let near = objects.filter(|(_, smallest)| **smallest < RANGE_M);
        near.map(|(object, smallest)| Clearance {
            id: object.id.clone(),
            smallest_m: *smallest,
        })
        .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::object;
    use crate::robot::tests::lonely;
    use crate::simulation::tests::bodies_mut;
    use actcheck_data::{Choices, ObjectModel, Part, Pose, Role, SceneObject, Shape};
    use nalgebra::{Isometry3, Vector3};
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
            let object = object::insert(&mut bodies_mut(&mut world).physics, 0, &aside(&pose));
            let bodies = bodies_mut(&mut world);
            bodies.objects.push(object);
            let mut meter = ClearanceMeter::default();
            meter.begin(bodies);
            let links = bodies
                .robot
                .bodies
                .iter()
                .flat_map(|body| bodies.colliders_of(*body));
            let solids: Vec<&Collider> = bodies.colliders_of(bodies.objects[0].body).collect();
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
            let found = meter.smallest_m[0];
            assert!(
                (found - nearest).abs() < 1e-6,
                "trial {trial}: {found} instead of {nearest}"
            );
            n_near += usize::from(nearest < RANGE_M);
        }
        assert!(n_near > 10, "{n_near} near");
    }
}
