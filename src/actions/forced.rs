//! Motions that a fault forces on the robot, whatever its skill commands.

use nalgebra::{Point3, Vector3};

use actcheck_scenario::Outline;
use actcheck_world::{Command, World};

/// Time for a forced motion in one direction. Unit: seconds. The slowest joint of a slim mobile
/// manipulator moves half a metre in 2.5 s.
const FORCED_SECS: f64 = 5.0;
/// Time for which the base presses against furniture. Unit: seconds.
const PRESSED_SECS: f64 = 1.0;
/// Smallest depth of the arm in the head. Unit: metres. Four times the depth that counts as a
/// collision.
const DEPTH_M: f64 = 0.02;
/// Tolerance within which a posture is reached. Units: metres or radians.
const REACHED: f64 = 0.01;
/// Numbers of positions tried of a joint of the arm, and of the head's pan and tilt.
const TRIED: [u32; 3] = [9, 7, 3];
/// Horizontal distance from the base's centre within which the arm stays, clear of the furniture in
/// front of it. Unit: metres.
const WITHIN_M: f64 = 0.5;
/// Distance between checked points of the arm. Unit: metres.
const SPACING_M: f64 = 0.05;
/// Effort of a runaway motor as a multiple of its limit.
const RUNAWAY: f64 = 3.0;

/// Drives the base against the nearest furniture, presses for a moment, and drives it back. Returns
/// whether it pressed furniture.
pub fn push_base(world: &mut World) -> bool {
    let (Some(base), Some(by)) = (world.layout().base, to_furniture(world)) else {
        return false;
    };
    let rest = world.hold();
    let mut pushed = rest.clone();
    pushed.positions[base[0]] += by.x;
    pushed.positions[base[1]] += by.y;
    let mut pressed_secs = 0.0;
    let tick = world.tick_secs();
    advance(world, &pushed, |world| {
        pressed_secs += if presses_furniture(world) { tick } else { 0.0 };
        pressed_secs >= PRESSED_SECS
    });
    advance(world, &rest, |world| is_at(world, &rest));
    pressed_secs > 0.0
}

/// Horizontal vector from the base's centre to the nearest point of furniture on the map.
fn to_furniture(world: &World) -> Option<Vector3<f64>> {
    let [x, y, _] = world.snapshot().robot.base_true;
    let way = |outline: &Outline| {
        let pose = outline.pose.to_isometry();
        let local = pose.inverse() * Point3::new(x, y, 0.0);
        let [half_x, half_y] = outline.size_m.map(|side| side / 2.0);
        pose * Point3::new(
            local.x.clamp(-half_x, half_x),
            local.y.clamp(-half_y, half_y),
            0.0,
        ) - Point3::new(x, y, 0.0)
    };
    let ways = world.drive().floor_plan().outlines.iter().map(way);
    ways.min_by(|a, b| a.norm().total_cmp(&b.norm()))
}

fn presses_furniture(world: &World) -> bool {
    let bodies = world.snapshot().bodies;
    bodies
        .iter()
        .any(|body| body.fixed && body.touches.iter().any(|other| other == "robot"))
}

/// Moves the arm through the head, with links that pass through each other, and back. Returns
/// whether it got there.
pub fn arm_through_head(world: &mut World) -> bool {
    let rest = world.hold();
    let Some(positions) = posture_in_head(world, &rest.positions) else {
        return false;
    };
    let inside = Command {
        positions,
        ..rest.clone()
    };
    world.let_links_pass(true);
    advance(world, &inside, |world| is_at(world, &inside));
    let arrived = is_at(world, &inside);
    advance(world, &rest, |world| is_at(world, &rest));
    world.let_links_pass(false);
    arrived
}

/// The posture, with one joint of the arm and the head elsewhere, in which the arm is deepest in
/// the head. Returns `None` if it is never deep enough.
fn posture_in_head(world: &World, from: &[f64]) -> Option<Vec<f64>> {
    let (kinematics, layout) = (world.kinematics(), world.layout());
    let (shoulder, neck) = (*layout.arm.first()?, *layout.head.first()?);
    let mut best: Option<(f64, Vec<f64>)> = None;
    for joint in &layout.arm {
        for posture in spread(
            world,
            from,
            &[&[*joint][..], layout.head.as_slice()].concat(),
        ) {
            let depth = kinematics.depth_between(&posture, shoulder, neck);
            let is_deeper = best
                .as_ref()
                .map_or(depth >= DEPTH_M, |(deepest, _)| depth > *deepest);
            if is_deeper && is_within_reach(world, &posture) {
                best = Some((depth, posture));
            }
        }
    }
    best.map(|(_, posture)| posture)
}

/// Postures with some joints at evenly spaced positions within their limits.
fn spread(world: &World, from: &[f64], joints: &[usize]) -> Vec<Vec<f64>> {
    let mut postures = vec![from.to_vec()];
    for (joint, tried) in joints.iter().zip(TRIED) {
        let limits = &world.kinematics().joints()[*joint];
        let position = |step: u32| {
            limits.lower + (limits.upper - limits.lower) * f64::from(step) / f64::from(tried - 1)
        };
        let moved = |posture: &Vec<f64>, step: u32| {
            let mut posture = posture.clone();
            posture[*joint] = position(step);
            posture
        };
        postures = postures
            .iter()
            .flat_map(|posture| (0..tried).map(move |step| moved(posture, step)))
            .collect();
    }
    postures
}

/// Whether the whole robot is near its base.
fn is_within_reach(world: &World, posture: &[f64]) -> bool {
    let links = world.kinematics().links(posture);
    let middle = world
        .layout()
        .base
        .map_or(links[0], |[.., heading]| links[heading + 1])
        .translation
        .vector;
    let points = world.kinematics().surface_points(SPACING_M);
    points
        .into_iter()
        .all(|(link, point)| ((links[link] * point).coords - middle).xy().norm() <= WITHIN_M)
}

/// Returns the arm's last joint and the effort with which its motor runs away, beyond its limit.
pub fn run_away(world: &mut World) -> Option<(usize, f64)> {
    let joint = *world.layout().arm.last()?;
    world.overdrive(joint, RUNAWAY);
    Some((joint, RUNAWAY * world.kinematics().joints()[joint].effort))
}

/// Holds a command until something is so, at most for the time of a forced motion.
fn advance(world: &mut World, command: &Command, mut is_so: impl FnMut(&World) -> bool) {
    let until = world.time_secs() + FORCED_SECS;
    while world.time_secs() < until && world.fault().is_none() {
        world.step(command);
        if is_so(world) {
            return;
        }
    }
}

/// Whether all joints except the fingers are at their commanded positions.
fn is_at(world: &World, command: &Command) -> bool {
    let gripper = &world.layout().gripper;
    let positions = world.observe().positions;
    let joints = positions.iter().zip(&command.positions).enumerate();
    joints
        .filter(|(idx, _)| !gripper.contains(*idx))
        .all(|(_, (is, wanted))| (is - wanted).abs() < REACHED)
}
