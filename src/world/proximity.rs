//! Decides which things the robot can touch in the next control tick.
//!
//! A tick in which the robot can touch nothing needs no contacts; one in which only its hand can
//! touch objects needs no contacts of the other links. For each link of the robot, the last
//! measured distance from everything at rest is kept, with the pose of the link at that time. The
//! way that it has moved since, and the longest way in the next tick, are subtracted; the distance
//! is measured again only when too little is left. All of this depends on the state of the
//! simulation alone.

use nalgebra::{Isometry3, Vector3};
use rapier3d::prelude::PhysicsWorld;

use crate::bodies::Bodies;
use crate::distances::{ROUNDING_M, apart, are_balls_apart, gap, gap_of_link, gap_of_links};
use crate::idle_links::leave_out_idle;
use crate::link_pairs::{LinkPairs, PREDICTION_M};
use crate::object::Object;
use crate::reach::{Reach, Shortcuts};
use crate::spans::spans;
use actcheck_geometry::Ball;
use actcheck_robot::JointKind;
use actcheck_robot::{GRAVITY, axis_in_world};

/// Distance that remains after a free tick: the engine finds contacts before they close, in spite
/// of the errors of its 32-bit distances. Unit: metres.
const LEFT_M: f64 = 4e-3;
/// As [`LEFT_M`], between two links of the robot; the smaller one for links that are hardly further
/// apart from the beginning, as the base of a thumb and the wrist. Unit: metres.
const LEFT_OF_LINKS_M: f64 = 1e-3;
const LEAST_LEFT_OF_LINKS_M: f64 = 1e-4;
/// Factor on the present and the commanded speeds of joints, because joints overshoot.
const OVERSHOOT: f64 = 1.25;

/// Objects slower than this can't pass through anything in a step. Unit: m/s.
const SLOW_M_S: f64 = 0.05;
/// Ticks for which the engine moves the whole robot after a larger push.
const WHOLE_TICKS: u32 = 30;

/// The distances of the robot's links from everything.
#[derive(Default)]
pub struct Proximity {
    /// Distances of links from the floor and all static objects, by the link's index.
    fixed: Vec<Option<Measured>>,
    /// Distances of links from all other objects at rest.
    resting: Vec<Option<Measured>>,
    /// The objects at rest when these distances were measured.
    rest: Vec<bool>,
    /// Distances between the pairs of links that can collide, in their order.
    pairs: Vec<Option<Measured>>,
    /// The joints that move only the first of each pair, and those that move only the second.
    between: Vec<[Vec<usize>; 2]>,
    /// The distance that has to remain between each pair. Unit: metres.
    kept_m: Vec<f64>,
    /// The things that the robot could touch in the last tick.
    reach: Reach,
    /// Whether something fast can meet something fixed: the engine then sweeps all fast shapes,
    /// which takes long.
    sweeps: bool,
    /// Whether links of many pieces in the hand can touch each other.
    pieces_meet: bool,
    /// Ticks for which the engine still moves the whole robot.
    whole_ticks: u32,
    /// The shortcuts that may be taken.
    shortcuts: Shortcuts,
    /// Number of ticks so far with each reach.
    ticks: [u64; 4],
}

/// A distance, and where the link was when it was measured: in the world, or in the frame of the
/// other link.
#[derive(Debug, Clone, Copy)]
struct Measured {
    gap_m: f64,
    pose: Isometry3<f64>,
}

impl Measured {
    /// Returns a lower bound of the distance with the link at another pose. Unit: metres.
    fn left(&self, pose: &Isometry3<f64>, ball: &Ball) -> f64 {
        let shift = (pose * ball.middle - self.pose * ball.middle).norm();
        // At least the angle, for all angles up to half a turn.
        let turn =
            (self.pose.rotation.inverse() * pose.rotation).imag().norm() * std::f64::consts::PI;
        self.gap_m - shift - turn * ball.radius
    }
}

/// The robot at the beginning of a tick.
struct Moment {
    poses: Vec<Isometry3<f64>>,
    /// The axis of each joint: its direction and a point on it. Frame: world.
    axes: Vec<(Vector3<f64>, Vector3<f64>)>,
    /// How far each joint can move in the tick. Units: metres or radians.
    spans: Vec<f64>,
}

impl Proximity {
    /// Knows no distances yet, and may take these shortcuts.
    pub(super) fn with(shortcuts: Shortcuts) -> Self {
        Self {
            shortcuts,
            ..Self::default()
        }
    }

    /// Takes only these shortcuts from now on: for comparisons.
    pub(super) fn take(&mut self, shortcuts: Shortcuts) {
        self.shortcuts = shortcuts;
    }

    /// Sets the engine's substeps for a tick.
    pub(super) fn set_substeps(&self, physics: &mut PhysicsWorld, substeps: usize, reach: Reach) {
        let needed = match reach {
            Reach::Nothing if self.shortcuts.few_substeps => substeps.div_ceil(2),
            // Light fingers whose many pieces press on each other would fly apart.
            Reach::Hand if self.shortcuts.few_substeps && !self.pieces_meet => substeps.div_ceil(2),
            _ => substeps,
        };
        physics.integration_parameters.num_solver_iterations = needed;
    }

    /// Returns the number of ticks so far in which the robot could touch nothing, with everything
    /// else at rest; nothing, with moving objects; movable objects with its hand; and everything.
    pub fn ticks_by_reach(&self) -> [u64; 4] {
        self.ticks
    }

    /// Returns whether the robot moved through free space in the last tick, without the engine.
    pub fn moved_freely(&self) -> bool {
        self.reach == Reach::Nothing
    }

    /// Returns whether the engine moved only the robot's hand in the last tick.
    pub fn moved_hand_alone(&self) -> bool {
        self.reach == Reach::Hand
    }

    /// Returns the reach of the robot in the last tick.
    pub(super) fn last_reach(&self) -> Reach {
        self.reach
    }

    /// Returns the shortcuts that may be taken.
    pub(super) fn shortcuts(&self) -> Shortcuts {
        self.shortcuts
    }

    /// Returns the reach of the robot, with its links at these poses, in the next tick. `is_tied`:
    /// whether the engine must move the whole robot because of a joint with something else.
    pub(super) fn update(
        &mut self,
        bodies: &mut Bodies,
        link_pairs: &LinkPairs,
        is_tied: bool,
        poses: Vec<Isometry3<f64>>,
    ) -> Reach {
        self.sweeps = true;
        let reach = if self.shortcuts == Shortcuts::NONE || is_tied {
            Reach::All
        } else {
            self.measure(bodies, link_pairs, poses)
        };
        bodies.physics.integration_parameters.max_ccd_substeps =
            usize::from(self.sweeps || !self.shortcuts.few_sweeps);
        let reach = self.shortcuts.limit(reach);
        if reach != Reach::Nothing {
            leave_out_idle(bodies, reach);
        }
        self.reach = match reach {
            // A light arm gives way to its hand's contacts within the step.
            Reach::Hand if bodies.robot.is_light || bodies.robot.is_loaded => Reach::All,
            reach => reach,
        };
        self.ticks[self.reach as usize] += 1;
        self.reach
    }

    /// Lets the engine move the whole robot for a while.
    pub(super) fn need_whole(&mut self) {
        self.whole_ticks = WHOLE_TICKS;
    }

    fn measure(
        &mut self,
        bodies: &Bodies,
        link_pairs: &LinkPairs,
        poses: Vec<Isometry3<f64>>,
    ) -> Reach {
        let rest: Vec<bool> = bodies
            .objects
            .iter()
            .map(|object| bodies.rests(object))
            .collect();
        let n_links = bodies.robot.bodies.len();
        if rest != self.rest {
            self.resting.clear();
        }
        self.fixed.resize(n_links, None);
        self.resting.resize(n_links, None);
        self.pairs.resize(link_pairs.iter().count(), None);
        let (positions, velocities) = (&bodies.robot.positions, &bodies.robot.velocities);
        let spans = spans(
            &bodies.robot,
            positions,
            velocities,
            bodies.tick_secs(),
            OVERSHOOT,
        );
        let axes = bodies
            .robot
            .model
            .joints
            .iter()
            .map(|joint| axis_in_world(joint, &poses))
            .collect();
        let now = Moment { poses, axes, spans };
        let mut reach = if rest.iter().all(|rests| *rests) {
            Reach::Nothing
        } else {
            Reach::Apart
        };
        self.rest = rest;
        self.sweeps = fast_objects_meet_fixed(bodies, &self.rest);
        for link in 0..n_links {
            if !self.is_clear_of_fixed(bodies, link, &now) {
                self.sweeps |= links_outrun_contacts(bodies, &now);
                return Reach::All;
            }
            if reach < Reach::All {
                reach = reach.max(self.reach_of_link(bodies, link, &now));
            }
        }
        if reach == Reach::All {
            return reach;
        }
        if self.between.is_empty() {
            self.between = link_pairs
                .iter()
                .map(|(first, second)| joints_between(bodies, first, second))
                .collect();
            self.kept_m = link_pairs
                .iter()
                .zip(&mut self.pairs)
                .map(|(pair, known)| kept_m(bodies, pair, known, &now.poses))
                .collect();
        }
        reach = reach.max(self.reach_between_links(bodies, link_pairs, &now));
        if reach == Reach::Hand && self.whole_ticks > 0 {
            self.whole_ticks -= 1;
            return Reach::All;
        }
        reach
    }

    /// Returns whether a link can't meet the floor or a static object in the tick.
    fn is_clear_of_fixed(&mut self, bodies: &Bodies, link: usize, now: &Moment) -> bool {
        let Some(ball) = bodies.robot.balls[link] else {
            return true;
        };
        // A link that never moves may touch other fixed things.
        if bodies.robot.joints_to(link).next().is_none() {
            return true;
        }
        let measure = || gap_of_link(bodies, link, &|object| object.fixed, true);
        is_clear_within(
            &mut self.fixed[link],
            measure,
            &ball,
            (&now.poses[link], ahead(bodies, link, &ball, now)),
        )
    }

    fn reach_of_link(&mut self, bodies: &Bodies, link: usize, now: &Moment) -> Reach {
        let Some(ball) = bodies.robot.balls[link] else {
            return Reach::Nothing;
        };
        // The engine knows a link that never moves in every tick, as it knows a table.
        if bodies.robot.joints_to(link).next().is_none() {
            return Reach::Nothing;
        }
        let ahead = ahead(bodies, link, &ball, now);
        let rest = &self.rest;
        let rests = |object: &Object| !object.fixed && is_in(bodies, object, rest);
        let measure = || gap_of_link(bodies, link, &rests, false);
        let clear = is_clear_within(
            &mut self.resting[link],
            measure,
            &ball,
            (&now.poses[link], ahead),
        ) && is_clear_of_moving(bodies, link, rest, ahead);
        match (clear, &bodies.robot.hand) {
            (true, _) => Reach::Nothing,
            (false, Some(hand)) if hand.has(link) => Reach::Hand,
            _ => Reach::All,
        }
    }

    fn reach_between_links(
        &mut self,
        bodies: &Bodies,
        link_pairs: &LinkPairs,
        now: &Moment,
    ) -> Reach {
        self.pieces_meet = false;
        if link_pairs.all_pass() {
            return Reach::Nothing;
        }
        let mut reach = Reach::Nothing;
        let pairs = link_pairs
            .iter()
            .zip(&mut self.pairs)
            .zip(&self.between)
            .zip(&self.kept_m);
        for ((((first, second), known), joints), kept_m) in pairs {
            let (Some(one), Some(other)) = (bodies.robot.balls[first], bodies.robot.balls[second])
            else {
                continue;
            };
            let pose = now.poses[first].inverse() * now.poses[second];
            let mut ahead = 0.0;
            for (link, ball, joints) in [(first, &one, &joints[0]), (second, &other, &joints[1])] {
                ahead += joints
                    .iter()
                    .map(|joint| way(bodies, *joint, link, ball, now))
                    .sum::<f64>();
            }
            if gap_of_balls(bodies, first, second, &pose)
                .is_some_and(|balls_m| balls_m - ahead >= *kept_m)
            {
                continue;
            }
            if known.is_none_or(|known| known.left(&pose, &other) - ahead < *kept_m) {
                *known = Some(Measured {
                    gap_m: gap_of_links(bodies, first, second),
                    pose,
                });
            }
            if known.is_some_and(|known| known.left(&pose, &other) - ahead >= *kept_m) {
                continue;
            }
            let in_hand = bodies
                .robot
                .hand
                .as_ref()
                .is_some_and(|hand| hand.has(first) && hand.has(second));
            reach = reach.max(if in_hand { Reach::Hand } else { Reach::All });
            self.pieces_meet |= in_hand
                && [first, second]
                    .iter()
                    .any(|link| bodies.robot.model.links[*link].has_many_pieces());
        }
        reach
    }
}

/// Returns whether a link is so fast that it could pass through something thin without a sweep.
fn links_outrun_contacts(bodies: &Bodies, now: &Moment) -> bool {
    let speeds = (0..bodies.robot.bodies.len()).filter_map(|link| speed_of_link(bodies, link, now));
    speeds.fold(0.0, f64::max) > outruns_m_s(bodies)
}

/// Returns the speed at which half of the least distance at which the engine prepares contacts
/// is passed in a step: the rest is for the change of speed within the tick. Unit: m/s.
fn outruns_m_s(bodies: &Bodies) -> f64 {
    PREDICTION_M / 2.0 * f64::from(bodies.clock.steps_per_tick) / bodies.tick_secs()
}

/// Returns a bound of the present speed of a link's points; `None` without shapes. Unit: m/s.
fn speed_of_link(bodies: &Bodies, link: usize, now: &Moment) -> Option<f64> {
    let ball = bodies.robot.balls[link].as_ref()?;
    let middle = (now.poses[link] * ball.middle).coords;
    let (mut linear, mut angular) = (Vector3::zeros(), Vector3::zeros());
    for joint in bodies.robot.joints_to(link) {
        let ((axis, point), speed) = (now.axes[joint], bodies.robot.velocities[joint]);
        match bodies.robot.model.joints[joint].kind {
            JointKind::Prismatic => linear += axis * speed,
            JointKind::Revolute => {
                linear += axis.cross(&(middle - point)) * speed;
                angular += axis * speed;
            }
        }
    }
    Some(linear.norm() + angular.norm() * ball.radius)
}

/// Returns how far a link can move in the tick. Unit: metres.
fn ahead(bodies: &Bodies, link: usize, ball: &Ball, now: &Moment) -> f64 {
    bodies
        .robot
        .joints_to(link)
        .map(|joint| way(bodies, joint, link, ball, now))
        .sum()
}

/// Returns whether an object that is not slow can meet the floor or a static object in the
/// tick.
fn fast_objects_meet_fixed(bodies: &Bodies, rest: &[bool]) -> bool {
    let moving = bodies
        .objects
        .iter()
        .zip(rest)
        .filter(|(_, rests)| !**rests);
    // Sweeps of objects bring sweeps of links, which the engine makes for links that outrun
    // half of their thinnest piece: of many thin pieces, nearly always.
    let slow_m_s = if bodies.robot.model.has_many_pieces() {
        outruns_m_s(bodies)
    } else {
        SLOW_M_S
    };
    moving
        .filter_map(|(object, _)| Some((object, bodies.speed_of(object)?)))
        .any(|(object, speed)| {
            let needed = way_of_object(bodies, speed) + LEFT_M;
            speed > slow_m_s
                && bodies.boxed(object.body).any(|(_, its_box)| {
                    let fixed = bodies.objects.iter().filter(|other| other.fixed);
                    f64::from(its_box.mins.z) < needed
                        || fixed
                            .flat_map(|other| bodies.colliders_of(other.body))
                            .any(|other| gap(&its_box, &other.compute_aabb()) < needed)
                })
        })
}

/// Returns how far an object of this speed can move in the tick. Unit: metres.
fn way_of_object(bodies: &Bodies, speed: f64) -> f64 {
    let secs = bodies.tick_secs();
    OVERSHOOT * speed * secs + GRAVITY * secs * secs
}

/// Returns whether a link that moves this far can't meet any moving object in the tick.
fn is_clear_of_moving(bodies: &Bodies, link: usize, rest: &[bool], ahead: f64) -> bool {
    let moving = bodies
        .objects
        .iter()
        .zip(rest)
        .filter(|(_, rests)| !**rests);
    moving
        .filter_map(|(object, _)| Some((object, bodies.speed_of(object)?)))
        .all(|(object, speed)| {
            let needed = ahead + way_of_object(bodies, speed) + LEFT_M;
            if are_balls_apart(bodies, link, object, needed) {
                return true;
            }
            let others = bodies.boxed(object.body).collect::<Vec<_>>();
            bodies.boxed(bodies.robot.bodies[link]).all(|solid| {
                others
                    .iter()
                    .all(|other| apart(&solid, other, needed) >= needed)
            })
        })
}

/// Returns whether an object is among those that this list, in scene order, marks.
fn is_in(bodies: &Bodies, object: &Object, marked: &[bool]) -> bool {
    bodies
        .objects
        .iter()
        .zip(marked)
        .any(|(other, marked)| *marked && std::ptr::eq(other, object))
}

/// Returns the joints that move only the first of two links, and those that move only the
/// second.
fn joints_between(bodies: &Bodies, first: usize, second: usize) -> [Vec<usize>; 2] {
    [(first, second), (second, first)].map(|(one, other)| {
        let joints = bodies
            .robot
            .joints_to(one)
            .filter(|joint| !bodies.robot.moves(*joint, other));
        joints.collect()
    })
}

/// Returns the distance that has to remain between two links: half of that at the beginning, if
/// they are near. Unit: metres.
fn kept_m(
    bodies: &Bodies,
    (first, second): (usize, usize),
    known: &mut Option<Measured>,
    poses: &[Isometry3<f64>],
) -> f64 {
    let far = |balls_m: f64| balls_m >= 2.0 * LEFT_OF_LINKS_M;
    let pose = poses[first].inverse() * poses[second];
    if gap_of_balls(bodies, first, second, &pose).is_some_and(far) {
        return LEFT_OF_LINKS_M;
    }
    let gap_m = gap_of_links(bodies, first, second);
    *known = Some(Measured { gap_m, pose });
    (gap_m / 2.0).clamp(LEAST_LEFT_OF_LINKS_M, LEFT_OF_LINKS_M)
}

/// Returns the distance of the balls around two links, less rounding errors; `None` if one has
/// no shape. `pose` is that of the second in the frame of the first. Unit: metres.
fn gap_of_balls(
    bodies: &Bodies,
    first: usize,
    second: usize,
    pose: &Isometry3<f64>,
) -> Option<f64> {
    let (one, other) = (
        bodies.robot.balls[first].as_ref()?,
        bodies.robot.balls[second].as_ref()?,
    );
    Some((pose * other.middle - one.middle).norm() - one.radius - other.radius - ROUNDING_M)
}

/// Returns how far one joint can move any point of a link in the tick. Unit: metres.
fn way(bodies: &Bodies, joint: usize, link: usize, ball: &Ball, now: &Moment) -> f64 {
    let (axis, point) = now.axes[joint];
    match bodies.robot.model.joints[joint].kind {
        JointKind::Prismatic => now.spans[joint],
        JointKind::Revolute => {
            let arm: Vector3<f64> = (now.poses[link] * ball.middle).coords - point;
            now.spans[joint] * (arm.cross(&axis).norm() + ball.radius)
        }
    }
}

/// Returns whether more of a distance is left than a link at a pose can move in the tick. It is
/// measured again if the known one does not suffice.
fn is_clear_within(
    known: &mut Option<Measured>,
    measure: impl Fn() -> f64,
    ball: &Ball,
    (pose, ahead): (&Isometry3<f64>, f64),
) -> bool {
    let suffices = |known: Measured| known.left(pose, ball) - ahead >= LEFT_M;
    if !known.is_some_and(suffices) {
        *known = Some(Measured {
            gap_m: measure(),
            pose: *pose,
        });
    }
    known.is_some_and(suffices)
}
