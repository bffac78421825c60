//! Furniture that slides when it is pushed.
//!
//! Furniture is static: that is fast, and objects rest on it quietly. Once the robot pushes it
//! harder than its friction on the floor can resist, it becomes a body that slides on the floor
//! against this friction, until it is left alone.

use std::collections::BTreeMap;

use rapier3d::prelude::{
    GenericJoint, Group, ImpulseJointHandle, InteractionGroups, InteractionTestMode, JointAxesMask,
    JointAxis, LockedAxes, MotorModel, PhysicsWorld, RigidBodyBuilder, RigidBodyHandle,
    RigidBodyType,
};

use crate::bodies::Bodies;
use crate::contacts::Touches;
use crate::object::Object;
use crate::physics::{Owner, off_floor};
use actcheck_geometry::{from_vector, to_pose, to_real};
use actcheck_robot::GRAVITY;

/// Furniture slower than this has stopped. Unit: m/s and rad/s.
const STOPPED: f64 = 2e-3;
/// Time without a push after which stopped furniture is static again. Unit: seconds.
const LEFT_ALONE_SECS: f64 = 0.3;
/// Gain of the friction's velocity control. High: friction acts with its full force at any speed.
/// Unit: N·s/m per newton of friction.
const GAIN: f64 = 200.0;
/// Lever of the friction against turning, as a share of the longer side: the mean distance of the
/// legs.
const LEVER_SHARE: f64 = 0.4;

/// One piece of furniture while it slides.
#[derive(Debug, Clone, Copy)]
struct Sliding {
    joint: ImpulseJointHandle,
    anchor: RigidBodyHandle,
    /// Time since the last push. Unit: seconds.
    alone_secs: f64,
}

/// The furniture of a world that slides at the moment.
#[derive(Debug, Default)]
pub(super) struct Furniture {
    /// By the index of the object.
    sliding: BTreeMap<usize, Sliding>,
}

impl Furniture {
    /// Returns whether any furniture slides.
    pub(super) fn slides(&self) -> bool {
        !self.sliding.is_empty()
    }

    /// Lets furniture slide that is pushed harder than its friction, and stops furniture that is
    /// left alone.
    pub(super) fn move_pushed(&mut self, bodies: &mut Bodies, touches: &Touches) {
        let pushes = pushes(touches);
        for idx in 0..bodies.objects.len() {
            let object = &bodies.objects[idx];
            if !object.slides {
                continue;
            }
            let push_n = pushes.get(&idx).copied().unwrap_or(0.0);
            match self.sliding.get(&idx).copied() {
                None if push_n > friction_n(object) => {
                    let sliding = release(&mut bodies.physics, object);
                    self.sliding.insert(idx, sliding);
                }
                None => {}
                Some(sliding) => self.keep_sliding(bodies, idx, sliding, push_n > 0.0),
            }
        }
    }

    fn keep_sliding(
        &mut self,
        bodies: &mut Bodies,
        idx: usize,
        mut sliding: Sliding,
        pushed: bool,
    ) {
        let Some(body) = bodies.physics.bodies.get(bodies.objects[idx].body) else {
            return;
        };
        let moves = from_vector(body.linvel()).norm() > STOPPED
            || from_vector(body.angvel()).norm() > STOPPED;
        sliding.alone_secs = if pushed || moves {
            0.0
        } else {
            sliding.alone_secs + bodies.tick_secs()
        };
        if sliding.alone_secs > LEFT_ALONE_SECS {
            self.sliding.remove(&idx);
            fix(&mut bodies.physics, &bodies.objects[idx], sliding);
        } else {
            self.sliding.insert(idx, sliding);
        }
    }
}

/// Largest force of the floor's friction on a piece of furniture. Unit: newtons.
fn friction_n(object: &Object) -> f64 {
    object.friction * object.mass_kg * GRAVITY
}

/// Horizontal force of the robot on each object, by index. Unit: newtons.
fn pushes(touches: &Touches) -> BTreeMap<usize, f64> {
    let mut forces: BTreeMap<usize, [f64; 2]> = BTreeMap::new();
    for (pair, touch) in touches {
        if let (Owner::Object(idx), Owner::Link(_)) = pair {
            let force = forces.entry(*idx).or_default();
            *force = [force[0] - touch.force_n.x, force[1] - touch.force_n.y];
        }
    }
    forces
        .into_iter()
        .map(|(idx, [x, y])| (idx, (x * x + y * y).sqrt()))
        .collect()
}

/// Makes a piece of furniture slide: it keeps its height and stays upright, and friction resists
/// its motion.
fn release(engine: &mut PhysicsWorld, object: &Object) -> Sliding {
    let pose = engine
        .bodies
        .get(object.body)
        .map_or(to_pose(&object.placed), |body| *body.position());
    let anchor = engine.insert_body(RigidBodyBuilder::fixed().pose(pose));
    if let Some(body) = engine.bodies.get_mut(object.body) {
        body.set_body_type(RigidBodyType::Dynamic, true);
        body.set_locked_axes(
            LockedAxes::TRANSLATION_LOCKED_Z
                | LockedAxes::ROTATION_LOCKED_X
                | LockedAxes::ROTATION_LOCKED_Y,
            true,
        );
    }
    set_groups(engine, object.body, off_floor());
    let friction = friction_n(object);
    let [length, width, _] = object.model.size_m;
    let torque = friction * LEVER_SHARE * length.max(width);
    let mut joint = GenericJoint::new(JointAxesMask::empty());
    for (axis, most) in [
        (JointAxis::LinX, friction),
        (JointAxis::LinY, friction),
        (JointAxis::AngZ, torque),
    ] {
        joint.set_motor_model(axis, MotorModel::ForceBased);
        joint.set_motor(axis, 0.0, 0.0, 0.0, to_real(most * GAIN));
        joint.set_motor_max_force(axis, to_real(most));
    }
    let joint = engine
        .impulse_joints
        .insert(anchor, object.body, joint, true);
    Sliding {
        joint,
        anchor,
        alone_secs: 0.0,
    }
}

/// Makes a piece of furniture static again, where it is now.
fn fix(engine: &mut PhysicsWorld, object: &Object, sliding: Sliding) {
    engine.impulse_joints.remove(sliding.joint, true);
    engine.remove_body(sliding.anchor);
    if let Some(body) = engine.bodies.get_mut(object.body) {
        body.set_body_type(RigidBodyType::Fixed, true);
    }
    set_groups(
        engine,
        object.body,
        InteractionGroups::new(Group::ALL, Group::ALL, InteractionTestMode::And),
    );
}

fn set_groups(engine: &mut PhysicsWorld, body: RigidBodyHandle, groups: InteractionGroups) {
    let handles = engine
        .bodies
        .get(body)
        .map(|body| body.colliders().to_vec())
        .unwrap_or_default();
    for handle in handles {
        if let Some(collider) = engine.colliders.get_mut(handle) {
            collider.set_collision_groups(groups);
        }
    }
}
