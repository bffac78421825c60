//! The friction of areas in contact, which the contact points of the engine lack.
//!
//! A pad is soft, and touches an area, not a point: it resists an object that turns about the line
//! between two fingers. Things that roll lose energy where they press each other. Both are torques
//! with a limit: joints without a locked axis, whose motors stop the relative motion as far as the
//! limit allows. The engine solves them with the contacts, so that they act on both bodies alike,
//! never turn a motion around, and hold a thing at rest.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rapier3d::prelude::{
    ContactPair, GenericJoint, ImpulseJointHandle, JointAxesMask, JointAxis, MotorModel,
    RigidBodyHandle,
};

use crate::bodies::Bodies;
use crate::contacts::{has_solved, impulse_of, solved};
use crate::physics::Owner;
use crate::reach::Reach;
use actcheck_geometry::{from_pose, from_vector, to_pose, to_real};

/// Mean lever of the friction of a pad about the middle of the area that it touches: a choice of
/// this order. By Hertz, a ball of soft rubber (1.2 MPa, incompressible) with a radius of 4 cm that
/// is pressed with 7 N touches a circle with a radius of 5.1 mm, and the mean lever under its
/// pressure is 3π/16 of that. It is the same for all forces and shapes here. Unit: metres.
pub(super) const PAD_LEVER_M: f64 = 3e-3;
/// Lever of the force against which a thing rolls, one for all materials. Tables for engineers give
/// 0.5 mm for iron or steel on the same, 1.2 mm to 1.5 mm for wood and 2 mm for plastic on steel.
/// Unit: metres.
pub(super) const ROLLING_LEVER_M: f64 = 5e-4;
/// A thing that turns faster than this about an axis in the plane of a contact rolls. Unit: rad/s.
const ROLLS_RAD_S: f64 = 0.1;
/// Gain of the control of velocity that friction is: high, so that nothing creeps. Unit: N·m·s.
const DAMPING: f32 = 1e4;

/// The friction of one area.
#[derive(Debug, Clone, Copy)]
struct Patch {
    joint: ImpulseJointHandle,
}

/// Two things that press each other, of which the second is an object that moves.
#[derive(Debug, Clone, Copy)]
struct Press {
    bodies: [RigidBodyHandle; 2],
    /// Sum of the normal impulses, from the first to the second.
    normal: Vector3<f64>,
    /// Sum of their magnitudes.
    pressed: f64,
    /// Largest impulse of friction.
    grip: f64,
    /// Impulse of friction.
    friction: Vector3<f64>,
    /// A point of the contact, and moments of the impulses about it.
    at: Point3<f64>,
    first: Vector3<f64>,
    second: f64,
}

impl Press {
    fn new(bodies: [RigidBodyHandle; 2], at: Point3<f64>) -> Self {
        let none = Vector3::zeros();
        Self {
            bodies,
            normal: none,
            pressed: 0.0,
            grip: 0.0,
            friction: none,
            at,
            first: none,
            second: 0.0,
        }
    }

    /// Adds a point with its impulse along the normal and its whole impulse on the second thing.
    fn add(
        &mut self,
        at: Point3<f64>,
        normal: &Vector3<f64>,
        impulse: f64,
        whole: &Vector3<f64>,
        coefficient: f64,
    ) {
        let way = at - self.at;
        self.normal += normal * impulse;
        self.pressed += impulse;
        self.grip += coefficient * impulse;
        self.friction += whole - normal * impulse;
        self.first += way * impulse;
        self.second += way.norm_squared() * impulse;
    }

    /// Returns how far the points are from their middle. Unit: metres.
    fn spread_m(&self) -> f64 {
        let middle = self.first / self.pressed;
        (self.second / self.pressed - middle.norm_squared())
            .max(0.0)
            .sqrt()
    }

    /// Returns the lever of the friction that the points lack for that of a pad, less the share
    /// that carries a load: friction has one limit for both, an ellipse of force and torque. Unit:
    /// metres.
    ///
    /// Source: R. D. Howe and M. R. Cutkosky, "Practical force-motion models for sliding
    /// manipulation", 1996.
    fn lacks_m(&self) -> f64 {
        let used = (self.friction.norm() / self.grip).min(1.0);
        (PAD_LEVER_M * (1.0 - used * used).sqrt() - self.spread_m()).max(0.0)
    }
}

/// The friction of all areas in contact, by the owners of the two sides.
#[derive(Debug, Default)]
pub(super) struct Patches {
    patches: BTreeMap<(Owner, Owner), Patch>,
}

impl Patches {
    /// Sets the friction of all areas in contact for the next tick, by the forces of the last step,
    /// and notes whether the hand carries much.
    pub(super) fn rub(&mut self, bodies: &mut Bodies, reach: Reach) {
        bodies.robot.is_loaded = false;
        if reach == Reach::Nothing {
            return;
        }
        let presses = self.presses(bodies);
        bodies.robot.is_loaded = carried_kg(bodies, presses.keys()) > bodies.robot.most_carried_kg;
        let per_second = f64::from(bodies.physics.integration_parameters.inv_dt());
        let mut left = std::mem::take(&mut self.patches);
        for (pair, press) in &presses {
            let known = left.remove(pair);
            let Some((frame, limits)) = limits(bodies, *pair, press, known.is_some()) else {
                remove_patch(bodies, known);
                continue;
            };
            let limits = limits.map(|limit| limit * per_second);
            if let Some(patch) = set_patch(bodies, known, press.bodies, &frame, limits) {
                self.patches.insert(*pair, patch);
            }
        }
        for (pair, patch) in left {
            if both_rest(bodies, pair) {
                self.patches.insert(pair, patch);
            } else {
                remove_patch(bodies, Some(patch));
            }
        }
    }

    /// Returns the things that press the moving objects, by pairs with such an object at the second
    /// place.
    fn presses(&self, bodies: &Bodies) -> BTreeMap<(Owner, Owner), Press> {
        let mut found: BTreeMap<(Owner, Owner), Press> = BTreeMap::new();
        for pair in bodies
            .physics
            .narrow_phase
            .contact_pairs()
            .filter(|pair| has_solved(pair))
        {
            let Some((owners, handles, turned)) = moving_pair(bodies, pair) else {
                continue;
            };
            if !self.may_rub(bodies, owners, handles) {
                continue;
            }
            let Some(one) = bodies.physics.colliders.get(pair.collider1) else {
                continue;
            };
            let one = from_pose(one.position());
            let sign = if turned { -1.0 } else { 1.0 };
            for manifold in pair.solver_manifolds() {
                let (normal, coefficient) = (
                    from_vector(manifold.data.normal),
                    f64::from(manifold.data.friction),
                );
                for point in solved(manifold).filter(|point| point.data.impulse > 0.0) {
                    let at = one * Point3::from(from_vector(point.local_p1));
                    let whole = impulse_of(point, &normal) * sign;
                    let press = found
                        .entry(owners)
                        .or_insert_with(|| Press::new(handles, at));
                    press.add(
                        at,
                        &(normal * sign),
                        f64::from(point.data.impulse),
                        &whole,
                        coefficient,
                    );
                }
            }
        }
        found
    }

    /// Returns whether two bodies need a look at their contact: links of the robot, and things that
    /// may roll.
    fn may_rub(
        &self,
        bodies: &Bodies,
        owners: (Owner, Owner),
        handles: [RigidBodyHandle; 2],
    ) -> bool {
        let [one, other] = handles.map(|handle| {
            bodies
                .physics
                .bodies
                .get(handle)
                .map(|body| from_vector(body.angvel()))
        });
        matches!(owners.0, Owner::Link(_))
            || self.patches.contains_key(&owners)
            || one
                .zip(other)
                .is_some_and(|(one, other)| (other - one).norm() > ROLLS_RAD_S)
    }
}

fn remove_patch(bodies: &mut Bodies, patch: Option<Patch>) {
    if let Some(patch) = patch {
        bodies.physics.impulse_joints.remove(patch.joint, false);
    }
}

/// Returns the frame of an area, with x along its normal and y along the axis about which the
/// second thing rolls, and its largest impulses about x, and about y and z. Returns `None` if
/// nothing is to be added.
fn limits(
    bodies: &Bodies,
    pair: (Owner, Owner),
    press: &Press,
    known: bool,
) -> Option<(Isometry3<f64>, [f64; 2])> {
    let [one, other] = press.bodies.map(|handle| bodies.physics.bodies.get(handle));
    let normal = press.normal.try_normalize(1e-12)?;
    let turn = from_vector(other?.angvel())
        - one.map_or_else(Vector3::zeros, |body| from_vector(body.angvel()));
    let rolls = turn - normal * turn.dot(&normal);
    let limits = match pair.0 {
        Owner::Link(link) if bodies.robot.is_pad(link) => [press.grip * press.lacks_m(), 0.0],
        _ if known || rolls.norm() > ROLLS_RAD_S => [0.0, press.pressed * ROLLING_LEVER_M],
        _ => return None,
    };
    if limits == [0.0, 0.0] {
        return None;
    }
    // At least one of two axes is far from the normal.
    let any = if normal.x.abs() < 0.8 {
        Vector3::x()
    } else {
        Vector3::y()
    };
    let along = rolls
        .try_normalize(1e-6)
        .or_else(|| (any - normal * any.dot(&normal)).try_normalize(1e-6))?;
    let axes = Matrix3::from_columns(&[normal, along, normal.cross(&along)]);
    let turned = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    Some((
        Isometry3::from_parts(Translation3::from(press.at.coords), turned),
        limits,
    ))
}

/// Sets the largest torques of an area about x, and about y and z of its frame.
fn set_patch(
    bodies: &mut Bodies,
    known: Option<Patch>,
    handles: [RigidBodyHandle; 2],
    frame: &Isometry3<f64>,
    [twist, rolling]: [f64; 2],
) -> Option<Patch> {
    let [one, other] = handles.map(|handle| {
        bodies
            .physics
            .bodies
            .get(handle)
            .map(|body| from_pose(body.position()))
    });
    let mut data = GenericJoint::new(JointAxesMask::empty());
    data.set_local_frame1(to_pose(&(one?.inverse() * frame)));
    data.set_local_frame2(to_pose(&(other?.inverse() * frame)));
    for (axis, limit) in [
        (JointAxis::AngX, twist),
        (JointAxis::AngY, rolling),
        (JointAxis::AngZ, rolling),
    ] {
        if limit > 0.0 {
            data.set_motor_model(axis, MotorModel::ForceBased);
            data.set_motor(axis, 0.0, 0.0, 0.0, DAMPING);
            data.set_motor_max_force(axis, to_real(limit));
        }
    }
    if let Some(patch) = known
        && let Some(joint) = bodies.physics.impulse_joints.get_mut(patch.joint, false)
    {
        joint.data = data;
        return Some(patch);
    }
    Some(Patch {
        joint: bodies
            .physics
            .impulse_joints
            .insert(handles[0], handles[1], data, false),
    })
}

/// Returns the owners and bodies of a contact of an object that moves, which comes second, and
/// whether the engine has them the other way round.
fn moving_pair(
    bodies: &Bodies,
    pair: &ContactPair,
) -> Option<((Owner, Owner), [RigidBodyHandle; 2], bool)> {
    let colliders = [
        bodies.physics.colliders.get(pair.collider1)?,
        bodies.physics.colliders.get(pair.collider2)?,
    ];
    let owners = colliders.map(|collider| Owner::from_tag(collider.user_data));
    let is_fixed = |idx: usize| bodies.is_fixed(&bodies.objects[idx]);
    let turned = match owners {
        [Owner::Object(one), Owner::Object(other)] => {
            is_fixed(other) || one > other && !is_fixed(one)
        }
        [Owner::Object(_), _] => true,
        [_, Owner::Object(_)] => false,
        _ => return None,
    };
    let [first, second] = if turned {
        [owners[1], owners[0]]
    } else {
        owners
    };
    if both_rest(bodies, (first, second)) {
        return None;
    }
    let body = |owner: Owner| match owner {
        // The floor has no body of its own.
        Owner::Floor => bodies.floor,
        Owner::Object(idx) => bodies.objects[idx].body,
        Owner::Link(link) => bodies.robot.bodies[link],
    };
    Some(((first, second), [body(first), body(second)], turned))
}

/// Returns whether the objects of a pair rest.
fn both_rest(bodies: &Bodies, pair: (Owner, Owner)) -> bool {
    let rests = |owner: Owner| match owner {
        Owner::Object(idx) => bodies.rests(&bodies.objects[idx]),
        Owner::Floor | Owner::Link(_) => true,
    };
    rests(pair.0) && rests(pair.1)
}

/// Returns the mass of the objects that the hand touches. Unit: kilograms.
fn carried_kg<'a>(bodies: &Bodies, pairs: impl Iterator<Item = &'a (Owner, Owner)>) -> f64 {
    let Some(hand) = &bodies.robot.hand else {
        return 0.0;
    };
    let touched = pairs.filter_map(|pair| match pair {
        (Owner::Link(link), Owner::Object(idx)) if hand.has(*link) => Some(*idx),
        _ => None,
    });
    touched
        .collect::<BTreeSet<usize>>()
        .into_iter()
        .map(|idx| bodies.objects[idx].mass_kg)
        .sum()
}
