//! Motions of the hand that a fault forces on the robot, whatever its skill commands.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::whereabouts::{body, others_by_distance};
use actcheck_data::{BodyState, Snapshot};
use actcheck_world::{Command, World, ik};

/// How far an object is dragged, and then lifted. Unit: metres. Less than a lift, more than a push
/// by closing fingers.
const DRAGGED_M: f64 = 0.035;
const BARELY_LIFTED_M: f64 = 0.008;
/// How far a neighbour is moved aside before it is put back. Unit: metres.
const ASIDE_M: f64 = 0.06;
/// How far objects are swept, or pushed by an object in the hand. Unit: metres.
const PUSHED_M: f64 = 0.12;
/// Gap between an object in the hand and another one before it pushes that one. Unit: metres.
const BESIDE_M: f64 = 0.06;
/// Height of a pushing object's lowest point above that of the pushed one. Unit: metres.
const ABOVE_FOOT_M: f64 = 0.015;
/// Height of a sweeping hand above the lowest point of an object. Unit: metres. It does not touch
/// the table.
const SWEEP_M: f64 = 0.06;
/// Things lower than this are on the floor, out of the hand's reach. Unit: metres.
const OFF_FLOOR_M: f64 = 0.2;
/// A thing that moved by more was swept or pushed. Unit: metres.
const MOVED_M: f64 = 0.02;
/// Time for a forced motion of the hand over short distances, and to the object and back. Unit:
/// seconds.
const SHORT_SECS: f64 = 1.5;
const LONG_SECS: f64 = 4.0;

/// A robot under a forced motion: where its joints are commanded to be.
struct Forced<'w> {
    world: &'w mut World,
    at: Command,
}

impl<'w> Forced<'w> {
    /// Begins at the present posture. A hand that holds an object keeps pressing.
    fn new(world: &'w mut World) -> Self {
        let mut at = world.hold();
        if in_hand(&world.snapshot()).is_some() {
            at.gripper_opening_m = 0.0;
        }
        Self { world, at }
    }

    /// Moves all joints evenly to these positions.
    fn glide(&mut self, to: &[f64], secs: f64) {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a few hundred ticks"
        )]
        let ticks = (secs / self.world.tick_secs()).ceil() as u32;
        let from = self.at.positions.clone();
        for tick in 1..=ticks {
            let share = f64::from(tick) / f64::from(ticks);
            let between = from
                .iter()
                .zip(to)
                .map(|(from, to)| from + (to - from) * share);
            self.at.positions = between.collect();
            self.world.step(&self.at);
        }
    }

    /// The posture in which the hand is moved by a vector and not turned.
    fn moved_by(&self, by: Vector3<f64>) -> Option<Vec<f64>> {
        let now = self.world.kinematics().grasp(&self.at.positions);
        self.reaching(
            &self.at.positions,
            Isometry3::from_parts(
                Translation3::from(now.translation.vector + by),
                now.rotation,
            ),
        )
    }

    /// The posture near a seed with the hand in this pose.
    fn reaching(&self, seed: &[f64], target: Isometry3<f64>) -> Option<Vec<f64>> {
        let layout = self.world.layout();
        let mut mobility = vec![0.0; seed.len()];
        layout.arm.iter().for_each(|joint| mobility[*joint] = 1.0);
        layout
            .base
            .into_iter()
            .flatten()
            .for_each(|joint| mobility[joint] = 1.0);
        ik::solve(
            self.world.kinematics(),
            seed,
            &ik::IkRequest { target, mobility },
        )
    }
}

/// The object that both fingers touch.
pub(super) fn in_hand(now: &Snapshot) -> Option<&BodyState> {
    let robot = &now.robot;
    let held = robot
        .left_touches
        .iter()
        .find(|thing| robot.right_touches.contains(thing))?;
    body(now, held).filter(|held| !held.fixed)
}

/// Drags the object in the hand towards the robot, lifts it by less than a centimetre, and returns
/// the command that stays there. Returns `None` if the hand can't reach that place.
pub(super) fn drag(world: &mut World) -> Option<Command> {
    let [x, y, _] = world.snapshot().robot.base_true;
    let mut robot = Forced::new(world);
    let hand = robot.world.snapshot().robot.gripper.position;
    let back = Vector3::new(x - hand[0], y - hand[1], 0.0).normalize() * DRAGGED_M;
    let dragged = robot.moved_by(back)?;
    robot.glide(&dragged, SHORT_SECS);
    let lifted = robot.moved_by(Vector3::z() * BARELY_LIFTED_M)?;
    robot.glide(&lifted, SHORT_SECS);
    Some(robot.at)
}

/// Moves the object's nearest neighbour aside, away from the object, and back. Returns whether
/// there is one.
pub(super) fn move_neighbour(world: &mut World, object: &str) -> bool {
    let now = world.snapshot();
    let (Some(own), Some(neighbour)) = (
        body(&now, object),
        others_by_distance(&now, object).first().copied(),
    ) else {
        return false;
    };
    let away = Vector3::from(neighbour.pose.position) - Vector3::from(own.pose.position);
    let aside = Vector3::new(away.x, away.y, 0.0).normalize() * ASIDE_M;
    let hold = Forced::new(world).at;
    let ticks = (SHORT_SECS / world.tick_secs()).ceil();
    let mut share = 0.0;
    while share < 1.0 {
        share = (share + 1.0 / ticks).min(1.0);
        let out = aside * libm::sin(std::f64::consts::PI * share).max(0.0);
        let mut pose = neighbour.pose;
        pose.position = (Vector3::from(pose.position) + out).into();
        world.perturb(&neighbour.id, actcheck_world::Perturbation::Pose(pose));
        world.step(&hold);
    }
    true
}

/// Moves the hand to the object on the table that is nearest to the base, and on through it, and
/// back. Returns whether it moved the object.
pub(super) fn sweep(world: &mut World) -> bool {
    let now = world.snapshot();
    let Some(thing) = nearest_to_base(&now) else {
        return false;
    };
    let id = thing.id.clone();
    let middle = [0, 1].map(|axis| f64::midpoint(thing.aabb_min[axis], thing.aabb_max[axis]));
    let wide = (0..2)
        .map(|axis| thing.aabb_max[axis] - thing.aabb_min[axis])
        .fold(0.0, f64::max);
    let [x, y, _] = now.robot.base_true;
    let heading = libm::atan2(middle[1] - y, middle[0] - x);
    let level = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading);
    let place = Vector3::new(middle[0], middle[1], thing.aabb_min[2] + SWEEP_M);
    let mut robot = Forced::new(world);
    let rest = robot.at.positions.clone();
    // Across the line of sight: the hand comes from one side or the other.
    let across = Vector3::new(-libm::sin(heading), libm::cos(heading), 0.0);
    let found = [across, -across].into_iter().find_map(|along| {
        let beside = Isometry3::from_parts(
            Translation3::from(place - along * (wide / 2.0 + BESIDE_M)),
            level,
        );
        let seeds = seeds(robot.world, &rest, &beside);
        Some((
            along,
            seeds.iter().find_map(|seed| robot.reaching(seed, beside))?,
        ))
    });
    let Some((along, there)) = found else {
        return false;
    };
    robot.glide(&there, LONG_SECS);
    if let Some(through) = robot.moved_by(along * (wide + BESIDE_M + PUSHED_M)) {
        robot.glide(&through, SHORT_SECS);
    }
    robot.glide(&there, SHORT_SECS);
    robot.glide(&rest, LONG_SECS);
    moved(world, &now, &id)
}

/// Pushes the nearest other object with the one in the hand, and moves back. Returns whether that
/// one moved.
pub(super) fn push_with_held(world: &mut World) -> bool {
    let now = world.snapshot();
    let Some(held) = in_hand(&now) else {
        return false;
    };
    let others = others_by_distance(&now, &held.id);
    let Some(other) = others
        .into_iter()
        .find(|other| other.aabb_min[2] > OFF_FLOOR_M)
    else {
        return false;
    };
    let centre = |body: &BodyState| {
        [0, 1].map(|axis| f64::midpoint(body.aabb_min[axis], body.aabb_max[axis]))
    };
    let wide = |body: &BodyState| {
        (0..2)
            .map(|axis| body.aabb_max[axis] - body.aabb_min[axis])
            .fold(0.0, f64::max)
    };
    let (from, to) = (centre(held), centre(other));
    let way = Vector3::new(to[0] - from[0], to[1] - from[1], 0.0);
    let apart = way.norm() - (wide(held) + wide(other)) / 2.0 - BESIDE_M;
    let along = way.normalize();
    let down = Vector3::z() * (other.aabb_min[2] + ABOVE_FOOT_M - held.aabb_min[2]);
    let id = other.id.clone();
    let mut robot = Forced::new(world);
    let rest = robot.at.positions.clone();
    let legs = [
        (along * apart, LONG_SECS),
        (down, LONG_SECS),
        (along * (BESIDE_M + PUSHED_M), SHORT_SECS),
    ];
    let mut postures = vec![rest];
    for (by, secs) in legs {
        let Some(next) = robot.moved_by(by) else {
            break;
        };
        robot.glide(&next, secs);
        postures.push(next);
    }
    for posture in postures.iter().rev().skip(1) {
        robot.glide(posture, LONG_SECS);
    }
    moved(world, &now, &id)
}

/// Postures of the robot's profile with the hand about at a place, the base turned and moved
/// accordingly.
fn seeds(world: &World, from: &[f64], target: &Isometry3<f64>) -> Vec<Vec<f64>> {
    let (layout, kinematics) = (world.layout(), world.kinematics());
    let placed = |posture: &Vec<f64>| {
        let mut positions = from.to_vec();
        layout
            .arm
            .iter()
            .zip(posture)
            .for_each(|(joint, value)| positions[*joint] = *value);
        if let Some([x, y, _]) = layout.base {
            let miss = target.translation.vector - kinematics.grasp(&positions).translation.vector;
            (positions[x], positions[y]) = (positions[x] + miss.x, positions[y] + miss.y);
        }
        positions
    };
    world.profile().postures.iter().map(placed).collect()
}

/// The movable object off the floor that is nearest to the base.
fn nearest_to_base(now: &Snapshot) -> Option<&BodyState> {
    let [x, y, _] = now.robot.base_true;
    let distance =
        |body: &&BodyState| libm::hypot(body.pose.position[0] - x, body.pose.position[1] - y);
    let things = now
        .bodies
        .iter()
        .filter(|body| !body.fixed && body.aabb_min[2] > OFF_FLOOR_M);
    things.min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

/// Whether a body is elsewhere than it was.
fn moved(world: &World, before: &Snapshot, id: &str) -> bool {
    let now = world.snapshot();
    let places = [before, &now]
        .map(|snapshot| body(snapshot, id).map(|body| Vector3::from(body.pose.position)));
    matches!(places, [Some(was), Some(is)] if (is - was).norm() > MOVED_M)
}
