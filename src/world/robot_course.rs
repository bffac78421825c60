//! Measures the robot's course: joints at their limits, self-collisions, held objects.
//!
//! Self-collisions are measured by the forces between links, and from their shapes and poses: links
//! that pass through each other because of an injected fault have no forces.

use actcheck_data::{HeldCourse, JointCourse, Pose, RobotCourse, SelfCollision, SelfPress};
use std::collections::BTreeMap;

use nalgebra::{Isometry3, Point3};
use parry3d::bounding_volume::BoundingSphere;
use parry3d::query::contact;
use rapier3d::prelude::{Collider, RigidBodyHandle};

use crate::World;
use crate::contacts::Touch;
use crate::engine::{Owner, SHELL};
use crate::reach::Reach;
use actcheck_geometry::{from_pose, from_vector};

/// Control ticks between two self-collision checks. At 60 ticks per second, that is 20 checks per
/// second: a link at 1 m/s moves 5 cm between them.
const TICKS_PER_LOOK: u64 = 3;
/// A motor above this share of its effort limit is overloaded.
const OVERLOAD_SHARE: f64 = 0.99;
/// Links that penetrate each other by no more than this only touch. Unit: metres.
pub(super) const TOUCH_M: f64 = 1e-4;
/// The depth of links is measured again once they have moved against each other by this much.
/// Units: metres, radians.
const SAME_M: f64 = 5e-4;
const SAME_RAD: f64 = 2e-3;
/// Error of positions in 32 bits. Unit: metres.
pub(super) const ROUNDING_M: f64 = 1e-4;

/// Measures a [`RobotCourse`].
#[derive(Default)]
pub(super) struct RobotMeter {
    joints: Vec<JointMeter>,
    /// Pairs of links that pressed or penetrated each other.
    self_contacts: BTreeMap<(usize, usize), LinksMet>,
    /// Number of ticks, and largest tilt.
    held: BTreeMap<usize, (u64, f64)>,
}

/// Two links that pressed or penetrated each other.
#[derive(Debug, Clone, Copy)]
struct LinksMet {
    /// Tick of the first detection.
    tick: u64,
    max_depth_m: f64,
    max_force_n: f64,
    /// The pose of the second in the frame of the first when their depth was last measured.
    measured: Option<Isometry3<f64>>,
}

impl LinksMet {
    fn at(tick: u64) -> Self {
        Self {
            tick,
            max_depth_m: 0.0,
            max_force_n: 0.0,
            measured: None,
        }
    }

    /// Whether the depth at a pose is about that at the last one.
    fn is_known(&self, between: &Isometry3<f64>) -> bool {
        self.measured.is_some_and(|last| {
            let shift = (last.translation.vector - between.translation.vector).norm();
            shift < SAME_M && last.rotation.angle_to(&between.rotation) < SAME_RAD
        })
    }
}

#[derive(Debug, Clone, Copy)]
struct JointMeter {
    max_excess: f64,
    max_speed_share: f64,
    overloaded: u64,
    longest_overload: u64,
}

impl RobotMeter {
    fn begin(&mut self, n_joints: usize) {
        let nothing = JointMeter {
            max_excess: f64::NEG_INFINITY,
            max_speed_share: 0.0,
            overloaded: 0,
            longest_overload: 0,
        };
        self.joints = vec![nothing; n_joints];
        self.self_contacts.clear();
        self.held.clear();
    }
}

impl World {
    /// Returns the pose of a link in the frame of another one.
    pub fn pose_between(&self, first: usize, second: usize) -> Option<Isometry3<f64>> {
        let pose = |link: usize| {
            self.engine
                .bodies
                .get(self.robot.bodies[link])
                .map(|body| from_pose(body.position()))
        };
        Some(pose(first)?.inverse() * pose(second)?)
    }

    /// Resets the measurement.
    pub(super) fn begin_robot_course(&mut self) {
        self.recorder.robot.begin(self.robot.model.joints.len());
    }

    /// Records the robot's state after a tick.
    pub(super) fn record_robot(&mut self, touches: &BTreeMap<(Owner, Owner), Touch>) {
        self.record_joints();
        self.record_held(touches);
        self.record_pressed_links(touches);
        if self.recorder.n_ticks().is_multiple_of(TICKS_PER_LOOK) {
            self.record_self_contacts();
        }
    }

    /// Returns the course since the start.
    pub(super) fn end_robot_course(&self) -> RobotCourse {
        let (meter, tick_secs) = (&self.recorder.robot, self.tick_secs());
        let joints = self
            .robot
            .model
            .joints
            .iter()
            .zip(&meter.joints)
            .map(|(joint, course)| JointCourse {
                name: joint.name.clone(),
                max_excess: course.max_excess,
                max_speed_share: course.max_speed_share,
                overload_secs: course.longest_overload as f64 * tick_secs,
            });
        let contacts = meter.self_contacts.iter().map(|((first, second), met)| {
            let mut pair = [*first, *second].map(|link| self.name_of(Owner::Link(link)));
            pair.sort();
            let of_hand = self.robot.kinematics.are_of_hand(*first, *second);
            SelfCollision {
                pair,
                start_secs: self.recorder.secs_since_begin(met.tick),
                max_depth_m: met.max_depth_m,
                press: SelfPress {
                    max_force_n: met.max_force_n,
                    of_hand,
                },
            }
        });
        let mut self_contacts: Vec<SelfCollision> = contacts.collect();
        self_contacts.sort_by(|a, b| a.pair.cmp(&b.pair));
        let held = meter.held.iter().map(|(idx, (ticks, tilt))| HeldCourse {
            id: self.name_of(Owner::Object(*idx)),
            held_secs: *ticks as f64 * tick_secs,
            max_tilt_rad: *tilt,
        });
        RobotCourse {
            joints: joints.collect(),
            self_contacts,
            held: held.collect(),
            ..RobotCourse::default()
        }
    }

    fn record_joints(&mut self) {
        let (positions, velocities) = self.robot.state();
        let efforts = self.robot.effort_shares();
        let joints = self
            .robot
            .model
            .joints
            .iter()
            .zip(&mut self.recorder.robot.joints);
        for (idx, (joint, course)) in joints.enumerate() {
            let (Some(position), Some(velocity)) = (positions.get(idx), velocities.get(idx)) else {
                continue;
            };
            course.max_excess = course
                .max_excess
                .max((joint.lower - position).max(position - joint.upper));
            if joint.velocity > 0.0 {
                course.max_speed_share =
                    course.max_speed_share.max(velocity.abs() / joint.velocity);
            }
            let grips = self.robot.layout.gripper.contains(idx) || joint.mimic.is_some();
            let overloaded = !grips
                && efforts
                    .get(idx)
                    .is_some_and(|share| *share > OVERLOAD_SHARE);
            course.overloaded = if overloaded { course.overloaded + 1 } else { 0 };
            course.longest_overload = course.longest_overload.max(course.overloaded);
        }
    }

    fn record_held(&mut self, touches: &BTreeMap<(Owner, Owner), Touch>) {
        for (idx, object) in self.objects.iter().enumerate() {
            if object.fixed || !self.is_held(idx, touches) {
                continue;
            }
            let Some(body) = self.engine.bodies.get(object.body) else {
                continue;
            };
            let tilt = Pose::from_isometry(&from_pose(body.position())).tilt();
            let (ticks, most) = self.recorder.robot.held.entry(idx).or_insert((0, 0.0));
            (*ticks, *most) = (*ticks + 1, most.max(tilt));
        }
    }

    /// Returns whether both fingers touch an object, each with any of its links.
    pub(super) fn is_held(&self, object: usize, touches: &BTreeMap<(Owner, Owner), Touch>) -> bool {
        let touches =
            |link: &usize| touches.contains_key(&(Owner::Object(object), Owner::Link(*link)));
        self.robot
            .fingers
            .iter()
            .all(|finger| finger.iter().any(touches))
    }

    fn record_self_contacts(&mut self) {
        if self.proximity.reach <= Reach::Apart && !self.link_pairs.pass {
            // They are known to be apart.
            return;
        }
        let now = self.recorder.n_ticks();
        let mut met = std::mem::take(&mut self.recorder.robot.self_contacts);
        for (first, second) in self.link_pairs.iter() {
            let pair = (first, second);
            // The library's depth is fast, and wrong for hulls that only touch.
            if self.depth_of(first, second) <= TOUCH_M {
                continue;
            }
            let Some(between) = self.pose_between(first, second) else {
                continue;
            };
            if met.get(&pair).is_some_and(|known| known.is_known(&between)) {
                continue;
            }
            let depth = self.robot.model.solid_depth_m(first, second, &between);
            if depth > TOUCH_M || met.contains_key(&pair) {
                let known = met.entry(pair).or_insert(LinksMet::at(now));
                known.max_depth_m = known.max_depth_m.max(depth);
                known.measured = Some(between);
            }
        }
        self.recorder.robot.self_contacts = met;
    }

    /// Records the forces between links.
    fn record_pressed_links(&mut self, touches: &BTreeMap<(Owner, Owner), Touch>) {
        let now = self.recorder.n_ticks();
        for (pair, touch) in touches {
            if let (Owner::Link(first), Owner::Link(second)) = pair {
                let known = self
                    .recorder
                    .robot
                    .self_contacts
                    .entry((*first, *second))
                    .or_insert(LinksMet::at(now));
                known.max_force_n = known.max_force_n.max(touch.normal_n);
            }
        }
    }

    /// Returns the penetration depth of two links; 0 if they are apart. Unit: metres.
    pub(super) fn depth_of(&self, first: usize, second: usize) -> f64 {
        let (one, other) = (self.ball_of(first), self.ball_of(second));
        let far = |(middle, radius): (Point3<f64>, f64), around: Option<(Point3<f64>, f64)>| {
            around.is_some_and(|(other, its_radius)| {
                (middle - other).norm() > radius + its_radius + ROUNDING_M
            })
        };
        if one.is_some_and(|one| far(one, other)) {
            return 0.0;
        }
        // Most shapes of a link are far from the other link.
        let near = |idx: usize, around: Option<(Point3<f64>, f64)>| {
            let solids = self
                .colliders_of(self.robot.bodies[idx])
                .zip(&self.robot.balls_of_shapes[idx]);
            let balls = solids.map(|(solid, ball)| (placed(ball, solid), solid));
            balls.filter(move |(ball, _)| !far(*ball, around))
        };
        let of_second: Vec<((Point3<f64>, f64), &Collider)> = near(second, one).collect();
        let mut deepest = 0.0f64;
        for ((middle, radius), a) in near(first, other) {
            for ((other, other_radius), b) in &of_second {
                if (middle - other).norm() > radius + other_radius {
                    continue;
                }
                let met = contact(a.position(), a.shape(), b.position(), b.shape(), 0.0)
                    .ok()
                    .flatten();
                deepest = deepest.max(met.map_or(0.0, |met| -f64::from(met.dist)));
            }
        }
        deepest
    }

    /// Returns the centre and the radius of the ball around a link; `None` without shapes. Frame:
    /// world. Unit: metres.
    fn ball_of(&self, link: usize) -> Option<(Point3<f64>, f64)> {
        let ball = self.robot.balls[link].as_ref()?;
        let body = self.engine.bodies.get(self.robot.bodies[link])?;
        Some((from_pose(body.position()) * ball.middle, ball.radius))
    }

    /// Returns the colliders of a body, without shells.
    pub(super) fn colliders_of(&self, body: RigidBodyHandle) -> impl Iterator<Item = &Collider> {
        let handles = self
            .engine
            .bodies
            .get(body)
            .map(rapier3d::prelude::RigidBody::colliders)
            .unwrap_or_default();
        let colliders = handles
            .iter()
            .filter_map(|handle| self.engine.colliders.get(*handle));
        colliders.filter(|collider| collider.user_data & SHELL == 0)
    }
}

/// Returns centre and radius of a solid's bounding ball, which is in the solid's frame. Frame:
/// world. Unit: metres.
fn placed(around: &BoundingSphere, solid: &Collider) -> (Point3<f64>, f64) {
    let pose: Isometry3<f64> = from_pose(solid.position());
    (
        pose * Point3::from(from_vector(around.center)),
        f64::from(around.radius),
    )
}

#[cfg(test)]
mod tests {
    use crate::robot::tests::lonely;

    /// A posture with the hand inside the robot's body is detected; the home posture has no
    /// self-collision.
    #[test]
    fn self_collisions_and_exceeded_joint_limits_are_detected() {
        let mut world = lonely();
        world.begin_record();
        let hold = world.hold();
        for _ in 0..30 {
            world.step(&hold);
        }
        let quiet = world.end_record().robot;
        assert!(quiet.self_contacts.is_empty(), "{quiet:?}");
        assert!(
            quiet
                .joints
                .iter()
                .all(|joint| joint.max_excess < 1e-3 && joint.max_speed_share < 0.5),
            "{quiet:?}"
        );
        assert!(
            quiet.joints.iter().all(|joint| joint.overload_secs < 0.2),
            "{quiet:?}"
        );

        world.begin_record();
        world.let_links_pass(true);
        let mut bent = hold.clone();
        for (slot, idx) in world.layout().arm.clone().into_iter().enumerate() {
            let joint = &world.kinematics().joints()[idx];
            bent.positions[idx] = if slot % 2 == 0 {
                joint.lower
            } else {
                joint.upper
            };
        }
        for _ in 0..400 {
            world.step(&bent);
        }
        let folded = world.end_record().robot;
        let [first, ..] = folded.self_contacts.as_slice() else {
            panic!("{folded:?}")
        };
        assert!(
            first.max_depth_m > 0.005 && first.start_secs > 0.0,
            "{folded:?}"
        );
    }
}
