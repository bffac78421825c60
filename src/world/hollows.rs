//! Closes hollow objects while nothing is at their mouths: see `shell.rs`.

use nalgebra::{Isometry3, Vector3};
use parry3d::bounding_volume::BoundingVolume;
use parry3d::query::distance;
use parry3d::shape::Cylinder;
use rapier3d::prelude::{Collider, RigidBody};

use crate::bodies::Bodies;
use crate::object::Object;
use crate::reach::{Reach, Shortcuts};
use actcheck_geometry::{from_pose, from_vector, to_pose, to_real};

/// Distance of things at rest from an open mouth. Unit: metres. Longer than the way of a hand in a
/// tick.
const MOUTH_M: f64 = 0.02;

/// Returns whether all tubes of an object are closed, and there is one: for comparisons.
pub(super) fn are_closed(bodies: &Bodies, id: &str) -> bool {
    let hollows = bodies
        .objects
        .iter()
        .filter(|object| object.id == id)
        .flat_map(|object| &object.hollows);
    let closed: Vec<bool> = hollows.map(|hollow| hollow.is_closed()).collect();
    !closed.is_empty() && closed.iter().all(|closed| *closed)
}

/// Decides for each hollow object whether it is closed in the next tick.
pub(super) fn close_hollows(bodies: &mut Bodies, shortcuts: Shortcuts, reach: Reach) {
    if !shortcuts.shells || reach == Reach::Nothing {
        return;
    }
    for object in 0..bodies.objects.len() {
        for tube in 0..bodies.objects[object].hollows.len() {
            let closed = can_be_closed(bodies, object, tube);
            let Bodies {
                physics, objects, ..
            } = &mut *bodies;
            let Object { body, hollows, .. } = &mut objects[object];
            if closed != hollows[tube].is_closed() {
                hollows[tube].close(physics, *body, closed);
            }
        }
    }
}

/// Returns whether nothing is at the mouth of a tube, or inside.
fn can_be_closed(bodies: &Bodies, object: usize, tube: usize) -> bool {
    let Some(body) = bodies.physics.bodies.get(bodies.objects[object].body) else {
        return false;
    };
    let hollow = &bodies.objects[object].hollows[tube];
    let (asleep, shown) = (body.is_sleeping(), hollow.is_closed());
    if asleep && !shown {
        return false;
    }
    let mouth = to_pose(&hollow.mouth_at(&from_pose(body.position())));
    // The axis of the engine's cylinders is y.
    let lid = Cylinder::new(to_real(1e-3), to_real(hollow.radius));
    let turned = to_pose(&Isometry3::rotation(
        Vector3::x() * std::f64::consts::FRAC_PI_2,
    ));
    let lid_at = mouth * turned;
    let around = lid.aabb(&lid_at);
    let links = bodies.robot.bodies.iter().copied();
    let others = bodies
        .objects
        .iter()
        .enumerate()
        .filter(|(idx, _)| *idx != object)
        .map(|(_, other)| other);
    // Between things at rest, nothing changes.
    let others = others.filter(|other| !asleep || !bodies.rests(other));
    let near = links.chain(others.map(|other| other.body));
    for (body_near, handle) in
        near.filter_map(|handle| Some((bodies.physics.bodies.get(handle)?, handle)))
    {
        let margin = to_real(MOUTH_M + way_between(body, body_near, bodies.tick_secs()));
        // A body with an impossible state is a fault, which is found after the step.
        if !margin.is_finite() {
            return shown;
        }
        let at_mouth = |solid: &Collider| {
            around.loosened(margin).intersects(&solid.compute_aabb())
                && distance(&lid_at, &lid, solid.position(), solid.shape())
                    .is_ok_and(|gap| gap.distance < margin)
        };
        let is_inside = |solid: &Collider| !shown && hollow.contains(body.position(), solid);
        if bodies
            .colliders_of(handle)
            .any(|solid| at_mouth(solid) || is_inside(solid))
        {
            return false;
        }
    }
    true
}

/// Returns how far two bodies can approach each other in a tick. Unit: metres.
fn way_between(one: &RigidBody, other: &RigidBody, tick_secs: f64) -> f64 {
    let speed = |body: &RigidBody| from_vector(body.linvel());
    (speed(one) - speed(other)).norm() * tick_secs
}
