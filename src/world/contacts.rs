//! Contacts between objects, links and the floor, with their forces.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};
use parry3d::query::TrackedContact;
use rapier3d::prelude::{
    Collider, ContactData, ContactManifold, ContactPair, PhysicsWorld, SolverContact,
};

use crate::bodies::Bodies;
use crate::ownership::Ownership;
use crate::physics::Owner;
use crate::robot::SimulatedRobot;
use actcheck_geometry::{from_pose, from_vector};
use actcheck_robot::Twist;

/// Contact forces below this are solver noise: a tenth of the weight of the lightest shipped model.
/// Unit: newtons.
pub const CONTACT_FLOOR_NEWTONS: f64 = 0.05;

/// The contacts of a moment, by the owners of both sides in order: floor, objects, links.
pub(super) type Touches = BTreeMap<(Owner, Owner), Touch>;

/// The contact of two bodies at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touch {
    /// Sum of the magnitudes of the normal forces. Unit: newtons.
    pub normal_n: f64,
    /// Penetration depth; 0 if they only touch. Unit: metres.
    pub depth_m: f64,
    /// Sum of normal and friction forces on the second of the pair. Unit: newtons. Frame: world.
    pub force_n: Vector3<f64>,
    /// Position of the contact point with the largest normal force. Unit: metres. Frame: world.
    pub point_m: [f64; 3],
    /// Normal force at that point. Unit: newtons.
    strongest_n: f64,
}

impl Touch {
    const NONE: Self = Self {
        normal_n: 0.0,
        depth_m: 0.0,
        force_n: Vector3::new(0.0, 0.0, 0.0),
        point_m: [0.0; 3],
        strongest_n: 0.0,
    };

    /// A touch at one point, with this force on the second of the pair.
    pub(super) fn at(normal_n: f64, force_n: Vector3<f64>, point_m: [f64; 3]) -> Self {
        Self {
            normal_n,
            depth_m: 0.0,
            force_n,
            point_m,
            strongest_n: normal_n,
        }
    }

    /// This touch together with another one of the same bodies.
    pub(super) fn with(&self, other: &Self) -> Self {
        let strongest = if other.strongest_n > self.strongest_n {
            other
        } else {
            self
        };
        Self {
            normal_n: self.normal_n + other.normal_n,
            depth_m: self.depth_m.max(other.depth_m),
            force_n: self.force_n + other.force_n,
            point_m: strongest.point_m,
            strongest_n: strongest.strongest_n,
        }
    }
}

/// Largest force of contacts on a hand that the engine moves alone: a loaded arm gives way. Unit:
/// newtons.
const MOST_PUSH: f64 = 20.0;

/// Returns all contacts above [`CONTACT_FLOOR_NEWTONS`] and the seal of a suction cup, by ordered
/// pair of owners.
pub(super) fn touches(bodies: &Bodies, seal: Option<((Owner, Owner), Touch)>) -> Touches {
    let mut found = contacts(&bodies.physics);
    found.extend(seal);
    // The engine keeps the last contacts of bodies that it no longer moves.
    let has_left = |owner: &Owner| matches!(owner, Owner::Object(idx) if bodies.has_left(*idx));
    found.retain(|(first, second), _| !has_left(first) && !has_left(second));
    found
}

/// Returns the force of all contacts on the robot's hand in the last step, with its torque
/// about the world's origin. Returns zero if the engine does not move the hand. Frame: world.
pub(super) fn push_on_hand(bodies: &Bodies) -> Twist {
    let mut push = Twist::ZERO;
    let Some(hand) = bodies
        .robot
        .hand
        .as_ref()
        .filter(|_| bodies.robot.ownership != Ownership::Nothing)
    else {
        return push;
    };
    let engine = &bodies.physics;
    let per_second = 1.0 / f64::from(engine.integration_parameters.dt);
    let is_ours = |handle| {
        let collider: Option<&Collider> = engine.colliders.get(handle);
        let owner = collider.map(|collider| Owner::from_tag(collider.user_data));
        matches!(owner, Some(Owner::Link(link)) if hand.has(link))
    };
    for pair in engine
        .narrow_phase
        .contact_pairs()
        .filter(|pair| has_solved(pair))
    {
        // Links of the hand push each other with opposite forces.
        let sign = match (is_ours(pair.collider1), is_ours(pair.collider2)) {
            (true, false) => -per_second,
            (false, true) => per_second,
            _ => continue,
        };
        let Some(one) = engine.colliders.get(pair.collider1) else {
            continue;
        };
        for manifold in pair.solver_manifolds() {
            let normal = from_vector(manifold.data.normal);
            for point in solved(manifold).filter(|point| point.data.impulse > 0.0) {
                let force = impulse_of(point, &normal) * sign;
                let at = from_pose(one.position()) * Point3::from(from_vector(point.local_p1));
                push = push.plus(Twist::by_force(&force, &at), 1.0);
            }
        }
    }
    push
}

/// Returns whether contacts push a hand that moves alone harder than its arm would hold
/// unmoved.
pub(super) fn is_pushed_hard(bodies: &Bodies) -> bool {
    bodies.robot.push_on_hand.shift.norm() > MOST_PUSH
}

/// Returns whether both fingers touch an object, each with any of its links.
pub(super) fn is_held(robot: &SimulatedRobot, object: usize, touches: &Touches) -> bool {
    let touches = |link: &usize| touches.contains_key(&(Owner::Object(object), Owner::Link(*link)));
    robot
        .fingers
        .iter()
        .all(|finger| finger.iter().any(touches))
}

/// Returns whether the engine solved any point of a pair of colliders in the last step: it keeps
/// many pairs that are near.
pub(super) fn has_solved(pair: &ContactPair) -> bool {
    pair.solver_manifolds()
        .iter()
        .any(|manifold| !manifold.data.solver_contacts.is_empty())
}

/// Returns the points of a contact that the engine solved in the last step. It leaves out some of
/// those that it found: they keep the impulse of an earlier step.
pub(super) fn solved(
    manifold: &ContactManifold,
) -> impl Iterator<Item = &TrackedContact<ContactData>> {
    let indices = manifold
        .data
        .solver_contacts
        .iter()
        .flat_map(SolverContact::contact_indices);
    indices.filter_map(|index| manifold.points.get(usize::try_from(index).ok()?))
}

/// Returns the impulse of normal force and friction on the second of a pair in the last step. Unit:
/// N·s.
pub(super) fn impulse_of(
    point: &TrackedContact<ContactData>,
    normal: &Vector3<f64>,
) -> Vector3<f64> {
    let impulse = f64::from(point.data.impulse);
    // The engine keeps friction only for the last substep, and as it acts on the first of the pair.
    let last = f64::from(point.data.warmstart_impulse);
    let share = if last > 0.0 { impulse / last } else { 0.0 };
    normal * impulse - from_vector(point.data.warmstart_tangent_world) * share
}

/// Returns the contacts above [`CONTACT_FLOOR_NEWTONS`] that the engine found, by ordered pair of
/// owners.
fn contacts(engine: &PhysicsWorld) -> Touches {
    let mut found: Touches = BTreeMap::new();
    let per_second = 1.0 / f64::from(engine.integration_parameters.dt);
    for pair in engine
        .narrow_phase
        .contact_pairs()
        .filter(|pair| has_solved(pair))
    {
        let of = |handle| engine.colliders.get(handle);
        let (Some(one), Some(other)) = (of(pair.collider1), of(pair.collider2)) else {
            continue;
        };
        let [first, second] = [one, other].map(|collider| Owner::from_tag(collider.user_data));
        let (key, sign) = if first <= second {
            ((first, second), 1.0)
        } else {
            ((second, first), -1.0)
        };
        for manifold in pair.solver_manifolds() {
            let normal = from_vector(manifold.data.normal);
            for point in solved(manifold) {
                let impulse = f64::from(point.data.impulse);
                if impulse <= 0.0 {
                    continue;
                }
                let touch = found.entry(key).or_insert(Touch::NONE);
                touch.depth_m = touch.depth_m.max(-f64::from(point.dist));
                touch.normal_n += impulse * per_second;
                if impulse * per_second > touch.strongest_n {
                    touch.strongest_n = impulse * per_second;
                    touch.point_m = (from_pose(one.position())
                        * Point3::from(from_vector(point.local_p1)))
                    .coords
                    .into();
                }
                touch.force_n += impulse_of(point, &normal) * (sign * per_second);
            }
        }
    }
    found.retain(|_, touch| touch.normal_n > CONTACT_FLOOR_NEWTONS);
    found
}
