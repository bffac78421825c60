//! Poses and distances of bodies, for faults.

use actcheck_data::{BodyState, Pose, Snapshot};
use actcheck_world::World;

/// Distance a teleported object moves. Unit: metres. Out of any hand, but still within the world.
const TELEPORT_M: f64 = 0.5;
/// How far outside the rooms a robot is carried off, or how far backwards if there are no rooms.
/// Unit: metres. Beyond the walls.
const CARRIED_OFF_M: f64 = 1.0;
/// Gap between a base and an object put in front of it. Unit: metres. Too short for the base to
/// stop when it sees the object.
const BEFORE_BASE_M: f64 = 0.03;
/// Radius of a base: that of a slim mobile manipulator. Unit: metres.
const BASE_RADIUS_M: f64 = 0.22;
/// Height of an object's foot above its new place at which the fast part of lowering ends. Unit:
/// metres.
const LOWERED_M: f64 = 0.05;
/// Margin that the widest opening must leave beside another object for it to be picked by mistake.
/// Unit: metres.
const ROOM_M: f64 = 0.02;

/// Whether both fingers touch an object.
pub(super) fn holds(snapshot: &Snapshot, object: &str) -> bool {
    let touches = |things: &[String]| things.iter().any(|thing| thing == object);
    touches(&snapshot.robot.left_touches) && touches(&snapshot.robot.right_touches)
}

/// Whether a body is well above another, within its outline.
pub(super) fn is_above(body: &BodyState, place: &BodyState) -> bool {
    let over = |axis: usize| {
        let middle = f64::midpoint(body.aabb_min[axis], body.aabb_max[axis]);
        (place.aabb_min[axis]..=place.aabb_max[axis]).contains(&middle)
    };
    over(0) && over(1) && body.aabb_min[2] - place.aabb_max[2] > LOWERED_M
}

/// The pose of a body on the floor right in front of a base, with its current orientation.
pub(super) fn before(body: &BodyState, [x, y, heading]: [f64; 3]) -> Pose {
    let half = |axis: usize| (body.aabb_max[axis] - body.aabb_min[axis]) / 2.0;
    let away = BASE_RADIUS_M + libm::hypot(half(0), half(1)) + BEFORE_BASE_M;
    let foot = body.pose.position[2] - body.aabb_min[2];
    Pose {
        position: [
            x + libm::cos(heading) * away,
            y + libm::sin(heading) * away,
            foot,
        ],
        ..body.pose
    }
}

/// A base pose outside all rooms, or well behind the current one if there are no rooms.
pub(super) fn outside(world: &World, [x, y, heading]: [f64; 3]) -> [f64; 3] {
    let ends = world
        .drive()
        .floor_plan()
        .rooms
        .iter()
        .map(|room| room.high_m[0]);
    match ends.max_by(f64::total_cmp) {
        Some(end) => [end + CARRIED_OFF_M, y, heading],
        None => [
            x - libm::cos(heading) * CARRIED_OFF_M,
            y - libm::sin(heading) * CARRIED_OFF_M,
            heading,
        ],
    }
}

pub(super) fn body<'a>(snapshot: &'a Snapshot, id: &str) -> Option<&'a BodyState> {
    snapshot.bodies.iter().find(|body| body.id == id)
}

/// Distance from a point to the bounding box of a body. Unit: metres.
pub(super) fn box_distance(body: &BodyState, point: [f64; 3]) -> f64 {
    let outside = |axis: usize| {
        (body.aabb_min[axis] - point[axis])
            .max(point[axis] - body.aabb_max[axis])
            .max(0.0)
    };
    (0..3)
        .map(|axis| outside(axis) * outside(axis))
        .sum::<f64>()
        .sqrt()
}

/// The pose of a body, moved horizontally away from the robot's base.
pub(super) fn farther(body: &BodyState, [base_x, base_y, _]: [f64; 3]) -> Pose {
    let [x, y, z] = body.pose.position;
    let (dx, dy) = (x - base_x, y - base_y);
    let scale = TELEPORT_M / libm::hypot(dx, dy).max(1e-6);
    Pose {
        position: [x + dx * scale, y + dy * scale, z],
        ..body.pose
    }
}

/// All movable bodies except one object, nearest to it first.
pub(super) fn others_by_distance<'a>(snapshot: &'a Snapshot, object: &str) -> Vec<&'a BodyState> {
    let Some(own) = body(snapshot, object) else {
        return Vec::new();
    };
    let distance = |other: &BodyState| {
        let [x, y, _] = own.pose.position;
        libm::hypot(other.pose.position[0] - x, other.pose.position[1] - y)
    };
    let mut others: Vec<&BodyState> = snapshot
        .bodies
        .iter()
        .filter(|body| !body.fixed && body.id != object)
        .collect();
    others.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
    others
}

/// The nearest other object that fits into the hand.
pub(super) fn mistaken(start: &Snapshot, object: &str, world: &World) -> Option<String> {
    let widest = world.profile().hand.max_opening_m - ROOM_M;
    let fits = |body: &&&BodyState| {
        let side = |axis: usize| body.aabb_max[axis] - body.aabb_min[axis];
        side(0).min(side(1)) <= widest
    };
    others_by_distance(start, object)
        .iter()
        .find(fits)
        .map(|body| body.id.clone())
}
