//! Inserts the robot's links and joints into the physics engine.

use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rapier3d::prelude::{
    ActiveHooks, GenericJoint, InteractionGroups, JointAxesMask, JointAxis, MassProperties,
    MotorModel, MultibodyJointHandle, PhysicsWorld, RigidBodyBuilder, RigidBodyHandle,
    SpringCoefficients,
};

use crate::WorldError;
use crate::motor::Motor;
use crate::motor_law::Law;
use crate::physics::{Owner, off_floor, same_shape};
use actcheck_data::RobotProfile;
use actcheck_geometry::{to_pose, to_real, to_vector};
use actcheck_robot::{Joint, JointKind, RobotModel};
use actcheck_robot::{Layout, Named, RobotError};

/// Position error at which a motor reaches its effort limit. Unit: metres. Stiffness is the effort
/// limit divided by this.
const SATURATION_M: f64 = 1e-3;
/// As [`SATURATION_M`], for revolute joints. Unit: radians.
const SATURATION_RAD: f64 = 0.02;
/// Ratio of a motor's damping to its stiffness. Unit: seconds.
const DAMPING_SECS: f64 = 0.02;
/// A joint's viscous friction is strong from this share of its motor's damping on: the motor then
/// makes up for it.
const STRONG_FRICTION: f64 = 0.1;
/// As [`DAMPING_SECS`], for fingers, which close with their full force up to nearly their largest
/// speed.
const FINGER_DAMPING_SECS: f64 = 0.1;
/// Inertia of the motor of a finger, as the finger feels it. Unit: kilograms. Fingers of hobby
/// grippers have gears of 1:50 and more on rotors of some 1e-7 kg·m²; the number is an
/// illustration. Without it, light fingers on a heavy hand swing sideways with a heavy object
/// between them, and their grip alternates.
const ROTOR_KG: f64 = 0.05;
/// Friction of the robot's links other than the fingers: painted metal and plastic.
const LINK_FRICTION: f64 = 0.4;
/// Natural frequency of the joint limits. Unit: hertz. The engine's default limits make a loaded
/// joint bounce back.
pub(super) const STOP_FREQUENCY_HZ: f32 = 60.0;
/// Damping ratio of the joint limits.
pub(super) const STOP_DAMPING: f32 = 5.0;
/// Joint ranges wider than this get no limits in the engine, which saves solver time. Unit: metres
/// or radians.
pub(super) const WIDEST_RANGE: f64 = 20.0;

pub(super) fn insert_links(
    engine: &mut PhysicsWorld,
    model: &RobotModel,
    poses: &[Isometry3<f64>],
    named: &Named,
    profile: &RobotProfile,
) -> Vec<RigidBodyHandle> {
    let on_floor = links_on_floor(model, named, profile);
    let mut bodies = Vec::with_capacity(model.links.len());
    for (idx, (link, pose)) in model.links.iter().zip(poses).enumerate() {
        let builder = if idx == 0 {
            RigidBodyBuilder::fixed()
        } else {
            RigidBodyBuilder::dynamic()
        };
        let inertia = link.inertia.map(to_real);
        let matrix = rapier3d::math::Matrix::from_cols_array(&[
            inertia.m11,
            inertia.m21,
            inertia.m31,
            inertia.m12,
            inertia.m22,
            inertia.m32,
            inertia.m13,
            inertia.m23,
            inertia.m33,
        ]);
        let mass =
            MassProperties::with_inertia_matrix(to_vector(&link.com), to_real(link.mass), matrix);
        let body = engine.insert_body(
            builder
                .pose(to_pose(pose))
                .additional_mass_properties(mass)
                .can_sleep(false),
        );
        let own_joint = idx.checked_sub(1);
        let is_further =
            own_joint.is_some_and(|joint| named.layout.gripper.moves_further_finger(joint));
        let is_finger = is_further || named.finger_links.contains(&idx);
        let friction = if is_finger {
            profile.hand.finger_friction
        } else {
            LINK_FRICTION
        };
        let mut hooks = ActiveHooks::FILTER_CONTACT_PAIRS;
        // `LinkPairs` then drops contacts that can't close: solving all of them takes long.
        if link.has_many_pieces() {
            hooks |= ActiveHooks::MODIFY_SOLVER_CONTACTS;
        }
        for (shape, pose) in link.form().shapes() {
            let collider = same_shape(
                shape,
                pose,
                Owner::Link(idx),
                friction,
                link.has_many_pieces(),
            );
            let groups = if on_floor[idx] {
                off_floor()
            } else {
                InteractionGroups::all()
            };
            let collider = collider.active_hooks(hooks);
            engine.insert_collider(collider.density(0.0).collision_groups(groups), Some(body));
        }
        bodies.push(body);
    }
    bodies
}

/// Marks the links below a planar base, such as wheels, which do not collide with the floor. The
/// planar joints support and move the base; wheels in contact with the floor would disturb it.
pub(super) fn links_on_floor(
    model: &RobotModel,
    named: &Named,
    profile: &RobotProfile,
) -> Vec<bool> {
    let Layout {
        arm, head, gripper, ..
    } = &named.layout;
    let mut on_floor = vec![profile.core.planar_base];
    for (idx, joint) in model.joints.iter().enumerate() {
        let lifted = arm.contains(&idx) || head.contains(&idx) || gripper.contains(idx);
        on_floor.push(on_floor[joint.parent] && !lifted);
    }
    on_floor
}

/// Inserts a joint between its links. Returns `None` if it would close a loop.
pub(super) fn insert_joint(
    engine: &mut PhysicsWorld,
    joint: &Joint,
    idx: usize,
    bodies: &[RigidBodyHandle],
) -> Option<MultibodyJointHandle> {
    let data = engine_joint(joint);
    let handle =
        engine
            .multibody_joints
            .insert(bodies[joint.parent], bodies[idx + 1], data, true)?;
    if let Some((multibody, link)) = engine.multibody_joints.get_mut(handle) {
        // `LinkPairs` decides which links collide.
        multibody.set_self_contacts_enabled(true);
        let dof = multibody
            .link(link)
            .map(rapier3d::prelude::MultibodyLink::assembly_id);
        if let Some(dof) = dof {
            multibody.damping_mut()[dof] = to_real(joint.damping);
        }
    }
    Some(handle)
}

/// Returns the motors of all joints, and inserts the joints.
pub(super) fn insert_joints(
    engine: &mut PhysicsWorld,
    model: &RobotModel,
    bodies: &[RigidBodyHandle],
    named: &Named,
    profile: &RobotProfile,
) -> Result<Vec<Motor>, WorldError> {
    let mut motors = Vec::with_capacity(model.joints.len());
    for (idx, joint) in model.joints.iter().enumerate() {
        let handle = insert_joint(engine, joint, idx, bodies).ok_or_else(|| RobotError::Urdf {
            name: profile.core.urdf.name.to_string(),
            reason: format!("joint `{}` closes a loop", joint.name),
        })?;
        let gripper = &named.layout.gripper;
        let saturation = if joint.kind == JointKind::Prismatic {
            SATURATION_M
        } else {
            SATURATION_RAD
        };
        let armature = gripper.armature(idx, ROTOR_KG);
        let (saturation, max_effort, damping_secs) =
            match gripper.lever_m(idx).zip(gripper.effort_per_n(idx)) {
                Some((lever_m, effort_per_n)) => {
                    let effort = joint.effort.min(profile.hand.grip_force_n * effort_per_n);
                    (SATURATION_M / lever_m, effort, FINGER_DAMPING_SECS)
                }
                // The coupling moves it.
                None if gripper.follows(idx) => (saturation, 0.0, DAMPING_SECS),
                None => (saturation, joint.effort, DAMPING_SECS),
            };
        let stiffness = (max_effort / saturation).max(1.0);
        let damping = stiffness * damping_secs;
        let axis = engine_axis(joint);
        motors.push(Motor {
            joint: handle,
            axis,
            stiffness,
            damping,
            max_effort,
            target: 0.0,
            setpoint: 0.0,
            setpoint_velocity: 0.0,
            push: None,
            law: Law::default(),
            armature,
            began: 0.0,
            effort: 0.0,
            strength: 1.0,
            fastest: gripper.fastest(idx, joint.velocity),
            friction: if joint.damping > STRONG_FRICTION * damping {
                joint.damping
            } else {
                0.0
            },
        });
    }
    Ok(motors)
}

/// Returns the engine's axis of a joint, whose joints move along or about the x axis of a local
/// frame.
fn engine_axis(joint: &Joint) -> JointAxis {
    match joint.kind {
        JointKind::Prismatic => JointAxis::LinX,
        JointKind::Revolute => JointAxis::AngX,
    }
}

/// Converts a joint for the engine.
fn engine_joint(joint: &Joint) -> GenericJoint {
    let locked = match joint.kind {
        JointKind::Prismatic => JointAxesMask::LOCKED_PRISMATIC_AXES,
        JointKind::Revolute => JointAxesMask::LOCKED_REVOLUTE_AXES,
    };
    let axis = engine_axis(joint);
    let turned = x_onto(&joint.axis);
    let frame = Isometry3::from_parts(Translation3::identity(), turned);
    let mut data = GenericJoint::new(locked);
    data.set_local_frame1(to_pose(&(joint.origin * frame)));
    data.set_local_frame2(to_pose(&frame));
    data.set_motor_model(axis, MotorModel::ForceBased);
    if joint.upper - joint.lower < WIDEST_RANGE {
        data.softness = SpringCoefficients {
            natural_frequency: STOP_FREQUENCY_HZ,
            damping_ratio: STOP_DAMPING,
        };
        data.set_limits(axis, [to_real(joint.lower), to_real(joint.upper)]);
    }
    data
}

/// Returns a rotation that maps the x axis to `axis`.
fn x_onto(axis: &Vector3<f64>) -> UnitQuaternion<f64> {
    Rotation3::rotation_between(&Vector3::x(), axis).map_or_else(
        || UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI),
        |rotation| UnitQuaternion::from_rotation_matrix(&rotation),
    )
}
