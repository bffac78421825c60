//! Attaches the moving parts of objects, such as drawers and doors, to their carriers.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rapier3d::prelude::{
    ActiveHooks, GenericJoint, JointAxesMask, JointAxis, MotorModel, PhysicsWorld, RigidBodyHandle,
    SpringCoefficients,
};

use crate::World;
use crate::object::Object;
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
    pub(super) joint: PartJoint,
}

/// Attaches the parts among the objects, which are in the order of the scene.
pub(super) fn attach(engine: &mut PhysicsWorld, scene: &[SceneObject], objects: &mut [Object]) {
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
        insert(engine, objects[*to].body, objects[idx].body, &attachment);
        for handle in engine
            .bodies
            .get(objects[idx].body)
            .map(|body| body.colliders().to_vec())
            .unwrap_or_default()
        {
            if let Some(collider) = engine.colliders.get_mut(handle) {
                collider.set_active_hooks(ActiveHooks::FILTER_CONTACT_PAIRS);
            }
        }
        objects[idx].attached = Some(attachment);
    }
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

impl World {
    /// Returns the pose of the moved frame of a part's joint in its fixed one. Returns `None` if it
    /// is not a part.
    fn moved(&self, object: &Object) -> Option<(Isometry3<f64>, PartJoint)> {
        let attachment = object.attached.as_ref()?;
        let carrier = self.pose_of(&self.objects[attachment.to]) * attachment.on_carrier;
        Some((
            carrier.inverse() * (self.pose_of(object) * attachment.on_part),
            attachment.joint,
        ))
    }

    /// Returns how far a part is off the axis of its joint. Returns `None` if it is not a part.
    /// Unit: metres.
    pub(super) fn off_its_joint_m(&self, object: &Object) -> Option<f64> {
        let (moved, joint) = self.moved(object)?;
        let along = if joint.slides {
            0.0
        } else {
            moved.translation.x
        };
        Some(Vector3::new(along, moved.translation.y, moved.translation.z).norm())
    }

    /// Returns the position of the joint of an object that is a part of another one. Units: metres
    /// or radians.
    pub(super) fn part_position(&self, object: &Object) -> Option<f64> {
        let (moved, joint) = self.moved(object)?;
        Some(match joint.slides {
            true => moved.translation.x,
            // About x.
            false => 2.0 * libm::atan2(moved.rotation.i, moved.rotation.w),
        })
    }

    /// Returns the whole that each part belongs to, by their indices in the scene.
    pub(super) fn wholes(&self) -> BTreeMap<usize, usize> {
        let parts = self.objects.iter().enumerate();
        parts
            .filter_map(|(idx, object)| Some((idx, object.attached.as_ref()?.whole)))
            .collect()
    }
}
