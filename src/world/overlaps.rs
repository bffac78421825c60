//! Finds things that the robot overlaps before the simulation begins.

use std::fmt;

use nalgebra::Vector3;
use parry3d::query::contact;
use rapier3d::prelude::Collider;

use crate::bodies::Bodies;
use crate::distances::{Boxed, are_balls_apart, gap};
use crate::object::Object;
use crate::physics::FLOOR_GROUP;
use actcheck_geometry::{SeparationOutcome, SolidPair};
use actcheck_geometry::{from_pose, to_vector};

/// Depth up to which things touch and do not overlap. Unit: metres. Contacts are up to 1.8 mm deep
/// in a firm grasp, and the colliders of wheels and feet are as much larger than these.
const TOUCH_M: f64 = 0.002;
/// The same for a link that never moves and the floor or furniture, of which it is a part: plates,
/// screws and cables of bases reach below the origin that is put on them. Unit: metres.
const MOUNT_M: f64 = 0.02;

/// The shifts with which a depth is searched, one after the other: rounding errors let a search
/// fail where middles or faces coincide, as of a capsule in the middle of a cylinder. Unit: metres.
const SHIFTS_M: [[f64; 3]; 4] = [
    [0.0, 0.0, 0.0],
    [7e-6, 3e-6, -5e-6],
    [-2e-5, 4e-5, 3e-5],
    [9e-5, -7e-5, 2e-5],
];

/// A link of the robot that is inside another thing.
#[derive(Debug, Clone, PartialEq)]
pub struct Overlap {
    /// Name of the link.
    pub link: String,
    /// Id of the object, or `floor`.
    pub thing: String,
    /// How far the link would have to move to be outside. Unit: metres.
    pub depth_m: f64,
}

impl fmt::Display for Overlap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            link,
            thing,
            depth_m,
        } = self;
        let thing = if thing == "floor" {
            "the floor".to_owned()
        } else {
            format!("`{thing}`")
        };
        write!(
            f,
            "the robot's `{link}` is {:.1} cm inside {thing} at the start",
            depth_m * 100.0
        )
    }
}

/// Returns the links of the robot that are inside furniture, objects or the floor, the deepest
/// first. Things that touch do not count, nor do those that the engine lets pass through each
/// other, such as wheels and the floor.
pub(super) fn overlaps(bodies: &Bodies) -> Vec<Overlap> {
    let mut found = Vec::new();
    for (link, body) in bodies.robot.bodies.iter().enumerate() {
        let solids: Vec<Boxed<'_>> = bodies.boxed(*body).collect();
        let is_mount = bodies.robot.joints_to(link).next().is_none();
        let mut note = |thing: &str, depth_m: f64, is_fixed: bool| {
            let allowed_m = if is_mount && is_fixed {
                MOUNT_M
            } else {
                TOUCH_M
            };
            if depth_m > allowed_m {
                let link = bodies.robot.model.links[link].name.clone();
                found.push(Overlap {
                    link,
                    thing: thing.to_owned(),
                    depth_m,
                });
            }
        };
        let in_floor = solids
            .iter()
            .filter(|(solid, _)| meets_floor(solid))
            .map(|(solid, _)| -lowest_m(solid));
        note("floor", in_floor.fold(0.0, f64::max), true);
        for object in bodies
            .objects
            .iter()
            .filter(|object| !are_balls_apart(bodies, link, object, 0.0))
        {
            note(&object.id, depth_in(bodies, &solids, object), object.fixed);
        }
    }
    found.sort_by(|a, b| b.depth_m.total_cmp(&a.depth_m));
    found
}

/// How deep solids are in an object. Unit: metres.
fn depth_in(bodies: &Bodies, solids: &[Boxed<'_>], object: &Object) -> f64 {
    let mut deepest: f64 = 0.0;
    for (other, its_box) in bodies.boxed(object.body) {
        for (solid, own_box) in solids {
            if gap(own_box, &its_box) <= 0.0
                && solid.collision_groups().test(other.collision_groups())
            {
                deepest = deepest.max(depth_m(solid, other));
            }
        }
    }
    deepest
}

fn meets_floor(solid: &Collider) -> bool {
    solid.collision_groups().filter.intersects(FLOOR_GROUP)
}

/// Height of the lowest point of a solid. Unit: metres.
fn lowest_m(solid: &Collider) -> f64 {
    let down = to_vector(&-Vector3::z());
    match solid.shape().as_support_map() {
        Some(shape) => f64::from(shape.support_point(solid.position(), down).z),
        None => f64::from(solid.compute_aabb().mins.z),
    }
}

/// How deep two solids are in each other; 0 if they are apart. Unit: metres.
fn depth_m(one: &Collider, other: &Collider) -> f64 {
    let pose = one.position().inv_mul(other.position());
    if let (Some(first), Some(second)) =
        (one.shape().as_support_map(), other.shape().as_support_map())
    {
        let towards = from_pose(&pose).translation.vector;
        let start = towards.try_normalize(1e-9).unwrap_or_else(Vector3::x);
        for [x, y, z] in SHIFTS_M {
            let mut shifted = pose;
            shifted.translation += to_vector(&Vector3::new(x, y, z));
            match SolidPair::new(&shifted, first, second).separation(start, TOUCH_M) {
                SeparationOutcome::Far(_) => return 0.0,
                SeparationOutcome::Near(found) => return (-found.distance_m).max(0.0),
                SeparationOutcome::Nothing => {}
            }
        }
        let found = by_library(one, other).filter(|depth_m| *depth_m > 0.0);
        return found.unwrap_or(most_m(one, other));
    }
    by_library(one, other).unwrap_or(0.0)
}

/// How deep two solids are in each other by the library, which finds nothing for some that are.
/// Unit: metres.
fn by_library(one: &Collider, other: &Collider) -> Option<f64> {
    let met = contact(
        one.position(),
        one.shape(),
        other.position(),
        other.shape(),
        0.0,
    );
    let depth_m = met.ok().flatten().map(|met| -f64::from(met.dist));
    depth_m.filter(|depth_m| depth_m.is_finite())
}

/// How deep the boxes around two solids that overlap are in each other: these are at most as deep.
/// Unit: metres.
fn most_m(one: &Collider, other: &Collider) -> f64 {
    let (one, other) = (one.compute_aabb(), other.compute_aabb());
    let least = (one.maxs - other.mins).min(other.maxs - one.mins);
    f64::from(least.min_element()).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::tests::lonely;
    use rapier3d::math::{Pose, Rotation, Vector};
    use rapier3d::prelude::{Ball, Capsule, ColliderBuilder, SharedShape};

    /// Solids 8 cm or more across in all directions, with corners and without.
    fn solids() -> Vec<SharedShape> {
        let corners: Vec<Vector> = (0..40_u8)
            .map(|idx| {
                let along = f32::from(idx) / 20.0 - 0.975;
                let around = f32::from(idx) * 2.4;
                let across = (1.0 - along * along).sqrt();
                Vector::new(across * around.cos(), across * around.sin(), along) * 0.06
            })
            .collect();
        let hull = actcheck_geometry::Hull::of(&corners).expect("the corners are not in a plane");
        vec![
            SharedShape::cuboid(0.04, 0.05, 0.3),
            SharedShape::cuboid(0.06, 0.06, 0.06),
            SharedShape::cylinder(0.2, 0.05),
            SharedShape(std::sync::Arc::new(Ball::new(0.05))),
            SharedShape(std::sync::Arc::new(Capsule::new(
                Vector::new(0.0, 0.0, -0.1),
                Vector::new(0.0, 0.0, 0.1),
                0.05,
            ))),
            SharedShape(std::sync::Arc::new(hull)),
        ]
    }

    /// Faces, edges and middles that coincide are the hard cases of a search.
    #[test]
    fn no_solid_inside_another_is_overlooked() {
        let turns = [
            Rotation::IDENTITY,
            Rotation::from_rotation_x(std::f32::consts::FRAC_PI_2),
            Rotation::from_rotation_y(std::f32::consts::FRAC_PI_4),
            Rotation::from_xyzw(0.1, -0.7, 0.3, 0.5).normalize(),
        ];
        let shifts = [0.0, 1e-7, 1e-3, 0.01, 0.03];
        let mut n_pairs = 0;
        for (one, other) in solids()
            .iter()
            .flat_map(|one| solids().into_iter().map(move |other| (one.clone(), other)))
        {
            for turn in turns {
                for (x, y, z) in shifts
                    .iter()
                    .flat_map(|x| shifts.iter().map(move |y| (*x, *y, x - y)))
                {
                    let pose = Pose::from_parts(Vector::new(x, y, z), turn);
                    let fixed = ColliderBuilder::new(one.clone()).build();
                    let moved = ColliderBuilder::new(other.clone()).position(pose).build();
                    let found_m = depth_m(&fixed, &moved);
                    assert!(
                        (0.01..1.0).contains(&found_m),
                        "{:?} and {:?} at {pose:?}: {found_m} m",
                        one.shape_type(),
                        other.shape_type()
                    );
                    n_pairs += 1;
                }
            }
        }
        assert_eq!(n_pairs, 36 * 4 * 25);
    }

    #[test]
    fn a_robot_on_its_wheels_overlaps_nothing() {
        assert_eq!(lonely().overlaps(), []);
    }
}
