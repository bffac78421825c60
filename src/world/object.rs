//! The objects of a scene in the engine.

use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use rapier3d::prelude::{
    CoefficientCombineRule, ColliderBuilder, MassProperties, PhysicsWorld, RigidBodyBuilder,
    RigidBodyHandle,
};

use crate::attach::Attachment;
use crate::physics::{LENGTH_UNIT, Owner, collider};
use crate::shell::{Hollow, hollows_of};
use actcheck_data::{Inertia, ObjectModel, Part, Role, SceneObject};
use actcheck_geometry::Ball;
use actcheck_geometry::{to_pose, to_real, to_vector};

/// A body slower than this may fall asleep. Unit: m/s of its farthest point.
const SLEEP_SPEED: f32 = 0.02;
/// Time below that speed until it falls asleep. Unit: seconds.
const SLEEP_AFTER_SECS: f32 = 0.3;

/// One object of the scene in the engine.
pub(super) struct Object {
    pub(super) id: String,
    pub(super) model: Arc<ObjectModel>,
    /// Whether it is static.
    pub(super) fixed: bool,
    /// Whether it slides when it is pushed hard, although it is static otherwise.
    pub(super) slides: bool,
    /// Whether it is on the robot's floor plan, like furniture and unlike other objects.
    pub(super) on_map: bool,
    pub(super) body: RigidBodyHandle,
    /// The ball around its shapes, in its frame.
    pub(super) ball: Option<Ball>,
    pub(super) mass_kg: f64,
    pub(super) friction: f64,
    pub(super) restitution: f64,
    /// Its initial pose in the scene.
    pub(super) placed: Isometry3<f64>,
    /// Its tubes, if it can move.
    pub(super) hollows: Vec<Hollow>,
    /// Its attachment to another object, if it is a part of it.
    pub(super) attached: Option<Attachment>,
}

/// Returns whether an object in this role slides when it is pushed: furniture that is not built in.
fn slides(role: Role, built_in: bool) -> bool {
    role == Role::Platform && !built_in
}

/// Adds one object with the shapes of its model.
pub(super) fn insert(engine: &mut PhysicsWorld, idx: usize, object: &SceneObject) -> Object {
    let placed = object.pose.to_isometry();
    let fixed = object.is_fixed();
    let builder = if fixed {
        RigidBodyBuilder::fixed()
    } else {
        RigidBodyBuilder::dynamic()
    };
    let spread = object
        .model
        .inertia
        .map(|inertia| mass_properties(&inertia, object));
    let builder = match spread {
        Some(properties) => builder.additional_mass_properties(properties),
        None => builder,
    };
    let body = engine.insert_body(builder.pose(to_pose(&placed)));
    if let Some(body) = engine.bodies.get_mut(body) {
        let activation = body.activation_mut();
        activation.normalized_linear_threshold = SLEEP_SPEED / LENGTH_UNIT;
        activation.time_until_sleep = SLEEP_AFTER_SECS;
    }
    // If the model states its inertia, the shapes have no mass of their own.
    let density = if spread.is_some() {
        0.0
    } else {
        object.mass_kg / object.model.volume().max(1e-9)
    };
    let mut parts = Vec::new();
    for part in &object.model.parts {
        let colliders = part
            .solids()
            .iter()
            .filter_map(|solid| of_object(solid, idx, object))
            .collect::<Vec<_>>();
        let insert = |collider: ColliderBuilder| {
            engine.insert_collider(collider.density(to_real(density)), Some(body))
        };
        parts.push(colliders.into_iter().map(insert).collect::<Vec<_>>());
    }
    let hollows = match fixed {
        true => Vec::new(),
        false => hollows_of(&object.model.parts, &parts, |solid| {
            of_object(solid, idx, object)
        }),
    };
    if !hollows.is_empty() {
        weigh(engine, body);
    }
    Object {
        id: object.id.clone(),
        model: object.model.clone(),
        fixed,
        slides: slides(object.role, object.model.fixed),
        on_map: object.role == Role::Platform,
        body,
        ball: Ball::around(&object.model.parts),
        mass_kg: object.mass_kg,
        friction: object.friction,
        restitution: object.restitution,
        placed,
        hollows,
        attached: None,
    }
}

/// Gives the mass of a body's colliders to the body, so that it does not depend on which of them
/// are enabled.
fn weigh(engine: &mut PhysicsWorld, handle: RigidBodyHandle) {
    let Some(body) = engine.bodies.get_mut(handle) else {
        return;
    };
    body.recompute_mass_properties_from_colliders(&engine.colliders);
    let whole = body.mass_properties().local_mprops;
    for collider in body.colliders() {
        if let Some(collider) = engine.colliders.get_mut(*collider) {
            collider.set_density(0.0);
        }
    }
    body.set_additional_mass_properties(whole, false);
}

/// Returns the collider of a convex solid of an object in the scene. Returns `None` if it has no
/// volume.
fn of_object(solid: &Part, idx: usize, object: &SceneObject) -> Option<ColliderBuilder> {
    let collider = collider(
        solid,
        Owner::Object(idx),
        object.friction,
        object.restitution,
    )?;
    Some(collider.restitution_combine_rule(CoefficientCombineRule::Average))
}

/// Returns the mass properties that a model states, scaled to the mass in the scene.
fn mass_properties(inertia: &Inertia, object: &SceneObject) -> MassProperties {
    let scale = object.mass_kg / object.model.mass_kg;
    // The engine takes columns, which equal the rows of a symmetric matrix.
    let [x, y, z] = inertia
        .about_com
        .map(|row| to_vector(&(Vector3::from(row) * scale)));
    let about_com = rapier3d::math::Matrix::from_cols(x, y, z);
    MassProperties::with_inertia_matrix(
        to_vector(&Vector3::from(inertia.com_m)),
        to_real(object.mass_kg),
        about_com,
    )
}
