//! Configures the physics engine: gravity, solver, shapes, and the owners of colliders.

use nalgebra::Vector3;
use rapier3d::math::Pose;
use rapier3d::prelude::{
    CoefficientCombineRule, ColliderBuilder, Group, IntegrationParameters, InteractionGroups,
    InteractionTestMode, PhysicsWorld, RigidBodyBuilder, RigidBodyHandle, SharedShape,
    SpringCoefficients,
};

use crate::{WorldError, fault, fresh};
use actcheck_data::{Part, Physics};
use actcheck_geometry::{Hull, convex_shape};
use actcheck_geometry::{to_pose, to_real, to_vector};
use actcheck_robot::GRAVITY;

/// The owner of a collider.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Owner {
    /// The floor.
    Floor,
    /// Object by its index in the scene.
    Object(usize),
    /// Link of the robot by its index.
    Link(usize),
}

impl Owner {
    /// Returns the owner as a collider's user data.
    pub fn to_tag(self) -> u128 {
        match self {
            Self::Floor => 0,
            Self::Object(idx) => 2 * (idx as u128) + 2,
            Self::Link(idx) => 2 * (idx as u128) + 1,
        }
    }

    /// Returns the owner from a collider's user data.
    pub fn from_tag(tag: u128) -> Self {
        let tag = tag & !SHELL;
        let idx = usize::try_from(tag.saturating_sub(1) / 2).unwrap_or(usize::MAX);
        match tag {
            0 => Self::Floor,
            tag if tag % 2 == 1 => Self::Link(idx),
            _ => Self::Object(idx),
        }
    }
}

/// Mark in the user data of a collider that replaces others: see `shell.rs`.
pub const SHELL: u128 = 1 << 127;

/// Natural frequency of contacts between moving bodies. Unit: hertz. Reduces the penetration in a
/// grasp from 1.8 mm (at 30 Hz, the engine's default) to a few tenths of a millimetre.
const CONTACT_FREQUENCY_HZ: f32 = 90.0;
/// Natural frequency of contacts with static bodies. Unit: hertz. Stiffer contacts lift a rolling
/// rim a little in every step, which keeps objects rocking; at 20 Hz a salt mill sinks in and
/// tilts.
const SUPPORT_FREQUENCY_HZ: f32 = 30.0;
/// Damping ratio of contacts: the engine's default, which keeps stacks at rest.
const CONTACT_DAMPING: f32 = 10.0;
/// The engine's unit of length. It keeps pairs of shapes whose boxes are nearer to each other than
/// 8 cm in this unit, and looks at them in every step. Unit: metres.
pub const LENGTH_UNIT: f32 = 0.125;
/// Friction coefficient of the floor: that of wood.
pub(super) const FLOOR_FRICTION: f32 = 0.5;

/// Creates an engine without bodies.
///
/// # Errors
/// [`WorldError::Scene`] if `physics` has fewer than 30 steps per second or no iterations.
pub fn engine(physics: &Physics) -> Result<PhysicsWorld, WorldError> {
    if physics.steps_per_second < 30 || physics.iterations == 0 {
        let what = format!(
            "physics can't run with {} steps per second and {} iterations",
            physics.steps_per_second, physics.iterations
        );
        return Err(WorldError::Scene { what });
    }
    let softness = |frequency| SpringCoefficients {
        natural_frequency: frequency,
        damping_ratio: CONTACT_DAMPING,
    };
    let defaults = IntegrationParameters::default();
    let parameters = IntegrationParameters {
        length_unit: LENGTH_UNIT,
        normalized_allowed_linear_error: defaults.normalized_allowed_linear_error / LENGTH_UNIT,
        normalized_max_corrective_velocity: defaults.normalized_max_corrective_velocity
            / LENGTH_UNIT,
        normalized_prediction_distance: defaults.normalized_prediction_distance / LENGTH_UNIT,
        normalized_max_linear_velocity: defaults.normalized_max_linear_velocity / LENGTH_UNIT,
        dt: 1.0 / to_real(f64::from(physics.steps_per_second)),
        num_solver_iterations: physics.iterations as usize,
        // Without it, friction acts only in the second of the solver's two passes, and every grasp
        // slips slowly.
        friction_in_bias_pass: true,
        contact_softness: softness(CONTACT_FREQUENCY_HZ),
        static_contact_softness: softness(SUPPORT_FREQUENCY_HZ),
        // Recycled contacts may be off by centimetres, but contacts decide verdicts.
        contact_recycling: false,
        ..defaults
    };
    let gravity = to_vector(&Vector3::new(0.0, 0.0, -GRAVITY));
    let narrow_phase = fresh::narrow_phase();
    Ok(PhysicsWorld {
        gravity,
        integration_parameters: parameters,
        narrow_phase,
        ..PhysicsWorld::default()
    })
}

/// The collision group of the floor.
pub const FLOOR_GROUP: Group = Group::GROUP_32;

/// Returns the collision groups of a body that does not collide with the floor.
pub fn off_floor() -> InteractionGroups {
    InteractionGroups::new(
        Group::ALL,
        Group::ALL.difference(FLOOR_GROUP),
        InteractionTestMode::And,
    )
}

/// Adds the floor: a slab with its top at z = 0. Returns a fixed body at the origin, without a
/// shape, for joints to the floor.
pub fn add_floor(engine: &mut PhysicsWorld) -> RigidBodyHandle {
    let half = to_real(fault::WORLD_RADIUS_M + 1.0);
    let floor = ColliderBuilder::cuboid(half, half, 0.5)
        .position(to_pose(&nalgebra::Isometry3::translation(0.0, 0.0, -0.5)))
        .friction(FLOOR_FRICTION)
        .friction_combine_rule(CoefficientCombineRule::GeometricMean)
        .collision_groups(InteractionGroups::new(
            FLOOR_GROUP,
            Group::ALL,
            InteractionTestMode::And,
        ))
        .user_data(Owner::Floor.to_tag());
    engine.insert_collider(floor, None);
    engine.insert_body(RigidBodyBuilder::fixed())
}

/// Returns a collider for a convex solid in its body's frame. Returns `None` for tubes, which the
/// caller must decompose first, and for points without a volume.
///
/// The friction of two surfaces is the geometric mean of their coefficients: a scene's value is
/// that against the same material.
pub fn collider(
    solid: &Part,
    owner: Owner,
    friction: f64,
    restitution: f64,
) -> Option<ColliderBuilder> {
    let (shape, pose) = convex_shape(solid)?;
    Some(with_surface(
        ColliderBuilder::new(shape)
            .position(pose)
            .restitution(to_real(restitution)),
        owner,
        friction,
    ))
}

/// Returns the collider of a shape that another one has already, at the same pose. A hull
/// `with_memory` remembers the shapes around it.
pub fn same_shape(
    shape: &SharedShape,
    pose: &Pose,
    owner: Owner,
    friction: f64,
    with_memory: bool,
) -> ColliderBuilder {
    // Hulls remember boxes and shapes around them, which are others in each simulation.
    let own = match shape.as_shape::<Hull>().filter(|_| with_memory) {
        Some(hull) => SharedShape::new(hull.with_memory()),
        None => SharedShape(shape.clone_dyn().into()),
    };
    with_surface(
        ColliderBuilder::new(own).position(*pose).restitution(0.0),
        owner,
        friction,
    )
}

fn with_surface(builder: ColliderBuilder, owner: Owner, friction: f64) -> ColliderBuilder {
    builder
        .friction(to_real(friction))
        .friction_combine_rule(CoefficientCombineRule::GeometricMean)
        .user_data(owner.to_tag())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn owners_are_recovered_from_their_numbers() {
        for owner in [
            Owner::Floor,
            Owner::Object(0),
            Owner::Object(7),
            Owner::Link(0),
            Owner::Link(12),
        ] {
            for marks in [0, SHELL] {
                assert_eq!(Owner::from_tag(owner.to_tag() | marks), owner);
            }
        }
    }
}
