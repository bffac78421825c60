//! Measures the distances between the robot and the objects of the scene.

use std::collections::BTreeMap;

use nalgebra::Point3;
use parry3d::bounding_volume::Aabb;
use parry3d::query::distance;
use rapier3d::math::Vector;
use rapier3d::prelude::{Collider, RigidBodyHandle};

use crate::World;
use crate::contacts::Touch;
use crate::convert::to_vector;
use crate::engine::Owner;
use crate::object::Object;
use actcheck_data::Clearance;

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
                let boxes = boxes.get_or_insert_with(|| self.boxed(self.robot.bodies[link]).collect());
                for (solid, its_box) in &solids {
                    for (link, link_box) in boxes.iter() {
                        if *smallest > 0.0 && gap(its_box, link_box) < *smallest {
                            let found = distance(solid.position(), solid.shape(), link.position(), link.shape());
                            *smallest = smallest.min(found.map_or(f64::INFINITY, |found| f64::from(found.distance)));
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
        near.map(|(object, smallest)| Clearance { id: object.id.clone(), smallest_m: *smallest }).collect()
    }

    /// Returns the distance from a point to the surface of an object's shapes; negative inside. Unit: metres.
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
        self.colliders_of(body).map(|collider| (collider, collider.compute_aabb()))
    }
}

/// Returns the distance between two boxes; 0 if they overlap. Unit: metres.
pub(super) fn gap(a: &Aabb, b: &Aabb) -> f64 {
    let apart = (a.mins - b.maxs).max(b.mins - a.maxs).max(Vector::ZERO);
    f64::from(apart.length())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gap_of_two_boxes_is_the_distance_of_their_nearest_points() {
        let unit = |x: f32, y: f32| Aabb::new(Vector::new(x, y, 0.0), Vector::new(x + 1.0, y + 1.0, 1.0));
        assert!((gap(&unit(0.0, 0.0), &unit(4.0, 5.0)) - 5.0).abs() < 1e-6);
        assert_eq!(gap(&unit(0.0, 0.0), &unit(0.5, 0.5)), 0.0);
    }
}
