//! Attaches the moving parts of objects, such as drawers and doors, to their carriers.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rapier3d::prelude::{
    ActiveHooks, GenericJoint, JointAxesMask, JointAxis, MotorModel, PhysicsWorld, RigidBodyHandle,
    SpringCoefficients,
};

use actcheck_data::{PartJoint, SceneObject};
use actcheck_geometry::{to_pose, to_real};

/// Gain of the control of velocity that friction is: it acts with its full force at any speed above
/// a few millimetres per second. Unit: N·s/m per newton, or N·m·s per newton metre.
const FRICTION_GAIN: f64 = 200.0;
/// Natural frequency of the joints. Unit: hertz. Stiff, so that a drawer does not leave its rails.
const FREQUENCY_HZ: f32 = 60.0;
/// Damping ratio of the joints.
const DAMPING: f32 = 5.0;

/// The attachment of a part to its carrier.
#[derive(Debug, Clone)]
pub(super) struct Attachment {
    /// Index of the object that carries it.
    pub(super) to: usize,
    /// Index of the object that it is a part of.
    pub(super) whole: usize,
    /// Frame of the joint, with x along its axis, in the frame of the carrier.
    on_carrier: Isometry3<f64>,
    /// The same, in the frame of the part.
    on_part: Isometry3<f64>,
    /// How it moves.
    joint: PartJoint,
}

impl Attachment {
    /// Returns how far a part is off the axis of its joint, with carrier and part at these poses.
    /// Unit: metres.
    pub(super) fn off_axis_m(&self, carrier: &Isometry3<f64>, part: &Isometry3<f64>) -> f64 {
        let moved = self.moved(carrier, part);
        let along = if self.joint.slides {
            0.0
        } else {
            moved.translation.x
        };
        Vector3::new(along, moved.translation.y, moved.translation.z).norm()
    }

    /// Returns the position of the joint, with carrier and part at these poses. Units: metres or
    /// radians.
    pub(super) fn position(&self, carrier: &Isometry3<f64>, part: &Isometry3<f64>) -> f64 {
        let moved = self.moved(carrier, part);
        match self.joint.slides {
            true => moved.translation.x,
            // About x.
            false => 2.0 * libm::atan2(moved.rotation.i, moved.rotation.w),
        }
    }

    /// Returns the pose of the moved frame of the joint in its fixed one.
    fn moved(&self, carrier: &Isometry3<f64>, part: &Isometry3<f64>) -> Isometry3<f64> {
        let carrier = carrier * self.on_carrier;
        carrier.inverse() * (part * self.on_part)
    }
}

/// Attaches the parts among the objects to their carriers. `bodies` are those of the objects, in
/// the order of the scene. Returns the attachments by the index of the part.
pub(super) fn attach(
    engine: &mut PhysicsWorld,
    scene: &[SceneObject],
    bodies: &[RigidBodyHandle],
) -> BTreeMap<usize, Attachment> {
    let mut attachments = BTreeMap::new();
    let indices: BTreeMap<&str, usize> = scene
        .iter()
        .enumerate()
        .map(|(idx, object)| (object.id.as_str(), idx))
        .collect();
    for (idx, part) in scene.iter().enumerate() {
        let Some(attached) = &part.attached else {
            continue;
        };
        let (Some(to), Some(whole)) = (
            indices.get(attached.to.as_str()),
            indices.get(attached.whole.as_str()),
        ) else {
            continue;
        };
        let axis = Vector3::from(attached.joint.axis);
        let along = Rotation3::rotation_between(&Vector3::x(), &axis).unwrap_or_else(|| {
            Rotation3::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI)
        });
        let at = Translation3::from(Vector3::from(attached.joint.anchor_m));
        let frame =
            attached.frame.to_isometry() * Isometry3::from_parts(at, UnitQuaternion::from(along));
        let attachment = Attachment {
            to: *to,
            whole: *whole,
            on_carrier: scene[*to].pose.to_isometry().inverse() * frame,
            on_part: part.pose.to_isometry().inverse() * frame,
            joint: attached.joint,
        };
        insert(engine, bodies[*to], bodies[idx], &attachment);
        for handle in engine
            .bodies
            .get(bodies[idx])
            .map(|body| body.colliders().to_vec())
            .unwrap_or_default()
        {
            if let Some(collider) = engine.colliders.get_mut(handle) {
                collider.set_active_hooks(ActiveHooks::FILTER_CONTACT_PAIRS);
            }
        }
        attachments.insert(idx, attachment);
    }
    attachments
}

fn insert(
    engine: &mut PhysicsWorld,
    carrier: RigidBodyHandle,
    part: RigidBodyHandle,
    attachment: &Attachment,
) {
    let PartJoint {
        slides,
        range,
        damping,
        friction,
        ..
    } = attachment.joint;
    let (locked, axis) = match slides {
        true => (JointAxesMask::LOCKED_PRISMATIC_AXES, JointAxis::LinX),
        false => (JointAxesMask::LOCKED_REVOLUTE_AXES, JointAxis::AngX),
    };
    let framed = |locked| {
        let mut joint = GenericJoint::new(locked);
        joint.set_local_frame1(to_pose(&attachment.on_carrier));
        joint.set_local_frame2(to_pose(&attachment.on_part));
        joint.set_contacts_enabled(false);
        joint.softness = SpringCoefficients::new(FREQUENCY_HZ, DAMPING);
        joint
    };
    let mut joint = framed(locked);
    if range.iter().any(|end| end.is_finite()) {
        joint.set_limits(axis, range.map(to_real));
    }
    if damping > 0.0 {
        joint.set_motor_model(axis, MotorModel::ForceBased);
        joint.set_motor(axis, 0.0, 0.0, 0.0, to_real(damping));
    }
    engine.impulse_joints.insert(carrier, part, joint, true);
    if friction > 0.0 {
        let mut joint = framed(JointAxesMask::empty());
        joint.set_motor_model(axis, MotorModel::ForceBased);
        joint.set_motor(axis, 0.0, 0.0, 0.0, to_real(friction * FRICTION_GAIN));
        joint.set_motor_max_force(axis, to_real(friction));
        engine.impulse_joints.insert(carrier, part, joint, true);
    }
}
