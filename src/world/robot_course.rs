//! Measures the robot's course: joints at their limits, self-collisions, held objects.
//!
//! Self-collisions are measured by the forces between links, and from their shapes and poses: links
//! that pass through each other because of an injected fault have no forces.

use std::collections::BTreeMap;

use nalgebra::Isometry3;

use crate::bodies::Bodies;
use crate::contacts::{Touches, is_held};
use crate::distances::{TOUCH_M, depth_of};
use crate::engine::Engine;
use crate::link_pairs::LinkPairs;
use crate::physics::Owner;
use crate::reach::Reach;
use crate::robot::SimulatedRobot;
use actcheck_data::{HeldCourse, JointCourse, Pose, RobotCourse, SelfCollision, SelfPress};
use actcheck_geometry::from_pose;

/// Control ticks between two self-collision checks. At 60 ticks per second, that is 20 checks per
/// second: a link at 1 m/s moves 5 cm between them.
const TICKS_PER_LOOK: u64 = 3;
/// A motor above this share of its effort limit is overloaded.
const OVERLOAD_SHARE: f64 = 0.99;
/// The depth of links is measured again once they have moved against each other by this much.
/// Units: metres, radians.
const SAME_M: f64 = 5e-4;
const SAME_RAD: f64 = 2e-3;

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
    /// Resets the measurement.
    pub(super) fn begin(&mut self, n_joints: usize) {
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

    /// Records the robot's state after a tick.
    pub(super) fn record(&mut self, engine: &Engine, reach: Reach, now: u64, touches: &Touches) {
        let bodies = engine.bodies();
        self.record_joints(&bodies.robot);
        self.record_held(bodies, touches);
        self.record_pressed_links(now, touches);
        // Links are known to be apart where the robot can touch nothing.
        let may_meet = reach > Reach::Apart || engine.link_pairs().all_pass();
        if may_meet && now.is_multiple_of(TICKS_PER_LOOK) {
            self.record_self_contacts(bodies, engine.link_pairs(), now);
        }
    }

    /// Returns the course since the start. `secs` converts a tick to the time since then.
    pub(super) fn course(&self, bodies: &Bodies, secs: impl Fn(u64) -> f64) -> RobotCourse {
        let tick_secs = bodies.tick_secs();
        let joints = bodies
            .robot
            .model
            .joints
            .iter()
            .zip(&self.joints)
            .map(|(joint, course)| JointCourse {
                name: joint.name.clone(),
                max_excess: course.max_excess,
                max_speed_share: course.max_speed_share,
                overload_secs: course.longest_overload as f64 * tick_secs,
            });
        let contacts = self.self_contacts.iter().map(|((first, second), met)| {
            let mut pair = [*first, *second].map(|link| bodies.name_of(Owner::Link(link)));
            pair.sort();
            let of_hand = bodies.robot.kinematics.are_of_hand(*first, *second);
            SelfCollision {
                pair,
                start_secs: secs(met.tick),
                max_depth_m: met.max_depth_m,
                press: SelfPress {
                    max_force_n: met.max_force_n,
                    of_hand,
                },
            }
        });
        let mut self_contacts: Vec<SelfCollision> = contacts.collect();
        self_contacts.sort_by(|a, b| a.pair.cmp(&b.pair));
        let held = self.held.iter().map(|(idx, (ticks, tilt))| HeldCourse {
            id: bodies.name_of(Owner::Object(*idx)),
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

    fn record_joints(&mut self, robot: &SimulatedRobot) {
        let (positions, velocities) = robot.state();
        let efforts = robot.effort_shares();
        let joints = robot.model.joints.iter().zip(&mut self.joints);
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
            let grips = robot.layout.gripper.contains(idx) || joint.mimic.is_some();
            let overloaded = !grips
                && efforts
                    .get(idx)
                    .is_some_and(|share| *share > OVERLOAD_SHARE);
            course.overloaded = if overloaded { course.overloaded + 1 } else { 0 };
            course.longest_overload = course.longest_overload.max(course.overloaded);
        }
    }

    fn record_held(&mut self, bodies: &Bodies, touches: &Touches) {
        for (idx, object) in bodies.objects.iter().enumerate() {
            if object.fixed || !is_held(&bodies.robot, idx, touches) {
                continue;
            }
            let Some(body) = bodies.physics.bodies.get(object.body) else {
                continue;
            };
            let tilt = Pose::from_isometry(&from_pose(body.position())).tilt();
            let (ticks, most) = self.held.entry(idx).or_insert((0, 0.0));
            (*ticks, *most) = (*ticks + 1, most.max(tilt));
        }
    }

    fn record_self_contacts(&mut self, bodies: &Bodies, link_pairs: &LinkPairs, now: u64) {
        let met = &mut self.self_contacts;
        for (first, second) in link_pairs.iter() {
            let pair = (first, second);
            // The library's depth is fast, and wrong for hulls that only touch.
            if depth_of(bodies, first, second) <= TOUCH_M {
                continue;
            }
            let Some(between) = bodies.pose_between(first, second) else {
                continue;
            };
            if met.get(&pair).is_some_and(|known| known.is_known(&between)) {
                continue;
            }
            let depth = bodies.robot.model.solid_depth_m(first, second, &between);
            if depth > TOUCH_M || met.contains_key(&pair) {
                let known = met.entry(pair).or_insert(LinksMet::at(now));
                known.max_depth_m = known.max_depth_m.max(depth);
                known.measured = Some(between);
            }
        }
    }

    /// Records the forces between links.
    fn record_pressed_links(&mut self, now: u64, touches: &Touches) {
        for (pair, touch) in touches {
            if let (Owner::Link(first), Owner::Link(second)) = pair {
                let known = self
                    .self_contacts
                    .entry((*first, *second))
                    .or_insert(LinksMet::at(now));
                known.max_force_n = known.max_force_n.max(touch.normal_n);
            }
        }
    }
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
