//! Creates snapshots of the true state.

use std::collections::BTreeSet;

use nalgebra::Point3;

use crate::bodies::Bodies;
use crate::distances::distance_to;
use crate::drive::Drive;
use crate::engine::Engine;
use crate::object::Object;
use crate::physics::Owner;
use crate::robot::SimulatedRobot;
use actcheck_data::{BodyState, LinkState, Pose, RobotState, Snapshot};
use actcheck_geometry::from_vector;

/// Share of a body's weight that a contact must carry for the body to rest on it. Low enough for
/// several supports.
const CARRIED_SHARE: f64 = 0.1;

/// Returns the true state of the world.
pub(super) fn snapshot(engine: &Engine, drive: &Drive) -> Snapshot {
    let bodies = engine.bodies();
    let pairs = pairs(engine);
    let robot = robot_state(engine, drive, &pairs);
    let grasp = Point3::from(robot.gripper.position);
    let states = bodies.objects.iter().enumerate().map(|(idx, object)| {
        let grasp_distance_m = (!object.fixed).then(|| distance_to(bodies, object, &grasp));
        BodyState {
            grasp_distance_m,
            ..body(bodies, idx, object, &pairs)
        }
    });
    Snapshot {
        time_secs: bodies.time_secs(),
        bodies: states.collect(),
        robot,
    }
}

fn pairs(engine: &Engine) -> Vec<ContactPair> {
    engine
        .touches()
        .into_iter()
        .map(|((first, second), touch)| ContactPair {
            first,
            second,
            lift_on_second_n: touch.force_n.z,
        })
        .collect()
}

fn body(bodies: &Bodies, idx: usize, object: &Object, pairs: &[ContactPair]) -> BodyState {
    let pose = bodies.pose_of(object);
    let mut touching = BTreeSet::new();
    let mut carriers = BTreeSet::new();
    let enough = CARRIED_SHARE * object.mass_kg * actcheck_robot::GRAVITY;
    for pair in pairs {
        let (other, lift) = match (pair.first, pair.second) {
            (other, Owner::Object(own)) if own == idx => (other, pair.lift_on_second_n),
            (Owner::Object(own), other) if own == idx => (other, -pair.lift_on_second_n),
            _ => continue,
        };
        let name = thing(bodies, other);
        if lift > enough {
            carriers.insert(name.clone());
        }
        touching.insert(name);
    }
    if let Some(attached) = object.attached.as_ref().filter(|_| !bodies.has_left(idx)) {
        carriers.insert(bodies.objects[attached.to].id.clone());
    }
    let (aabb_min, aabb_max) = bodies.aabb(object);
    let body = bodies.physics.bodies.get(object.body);
    let velocities = body.map(|body| {
        let linear = from_vector(body.velocity_at_point(body.translation()));
        (linear.into(), from_vector(body.angvel()).into())
    });
    let (linear_velocity, angular_velocity) = velocities.unwrap_or_default();
    BodyState {
        id: object.id.clone(),
        model: object.model.name.clone(),
        category: object.model.category.clone(),
        fixed: object.fixed,
        pose: Pose::from_isometry(&pose),
        linear_velocity,
        angular_velocity,
        aabb_min,
        aabb_max,
        mass_kg: object.mass_kg,
        friction: object.friction,
        restitution: object.restitution,
        touches: touching.into_iter().collect(),
        rests_on: carriers.into_iter().collect(),
        asleep: body.is_some_and(rapier3d::prelude::RigidBody::is_sleeping) || bodies.has_left(idx),
        size_m: object.model.size_m,
        grasp_distance_m: None,
        part: object.attached.as_ref().and_then(|attached| {
            Some((
                bodies.objects[attached.whole].id.clone(),
                bodies.part_position(object)?,
            ))
        }),
        left_world: bodies.has_left(idx),
    }
}

fn robot_state(engine: &Engine, drive: &Drive, pairs: &[ContactPair]) -> RobotState {
    let bodies = engine.bodies();
    let joints = bodies.robot.joint_states();
    let positions: Vec<f64> = joints.iter().map(|joint| joint.position).collect();
    let touched_by = |finger: &[usize]| -> Vec<String> {
        let objects = pairs
            .iter()
            .filter_map(|pair| match (pair.first, pair.second) {
                (Owner::Object(idx), Owner::Link(own)) if finger.contains(&own) => {
                    Some(thing(bodies, Owner::Object(idx)))
                }
                _ => None,
            });
        let sorted: BTreeSet<String> = objects.collect();
        sorted.into_iter().collect()
    };
    let base_true = bodies.base_true();
    let [left, right] = &bodies.robot.fingers;
    RobotState {
        base_true,
        base_believed: drive.believed(base_true),
        gripper: Pose::from_isometry(&bodies.robot.kinematics.grasp(&positions)),
        gripper_opening_m: engine.opening_m(&positions),
        left_touches: touched_by(left),
        right_touches: touched_by(right),
        joints,
        links: link_states(&bodies.robot, &positions),
        cup: engine.cup_state(),
    }
}

fn link_states(robot: &SimulatedRobot, positions: &[f64]) -> Vec<LinkState> {
    let poses = robot.kinematics.links(positions);
    let links = robot.model.links.iter().zip(poses);
    links
        .map(|(link, pose)| LinkState {
            name: link.name.clone(),
            pose: Pose::from_isometry(&pose),
        })
        .collect()
}

/// Returns the name of an owner in snapshots; all links are `robot`.
fn thing(bodies: &Bodies, owner: Owner) -> String {
    match owner {
        Owner::Link(_) => "robot".to_owned(),
        other => bodies.name_of(other),
    }
}

/// Two owners in contact, ordered: floor, objects, links.
struct ContactPair {
    first: Owner,
    second: Owner,
    /// Upward force of the first on the second. Unit: newtons.
    lift_on_second_n: f64,
}
