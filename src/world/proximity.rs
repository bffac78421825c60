//! Decides which things the robot can touch in the next control tick.
//!
//! A tick in which the robot can touch nothing needs no contacts; one in which only its hand can
//! touch objects needs no contacts of the other links. For each link of the robot, the last
//! measured distance from everything at rest is kept, with the pose of the link at that time. The
//! way that it has moved since, and the longest way in the next tick, are subtracted; the distance
//! is measured again only when too little is left. All of this depends on the state of the
//! simulation alone.

use nalgebra::{Isometry3, Vector3};
use parry3d::bounding_volume::BoundingVolume;
use parry3d::math::Real;

use crate::World;
use crate::clearance::{apart, gap, gap_squared};
use crate::link_pairs::PREDICTION_M;
use crate::object::Object;
use crate::reach::{Reach, Shortcuts};
use crate::robot_course::ROUNDING_M;
use actcheck_geometry::Ball;
use actcheck_geometry::{from_pose, from_vector};
use actcheck_robot::JointKind;
use actcheck_robot::{GRAVITY, axis_in_world};

/// Distances are measured up to this. Unit: metres.
const RANGE_M: f64 = 0.25;
/// Distance that remains after a free tick: the engine finds contacts before they close, in spite
/// of the errors of its 32-bit distances. Unit: metres.
const LEFT_M: f64 = 4e-3;
/// As [`LEFT_M`], between two links of the robot; the smaller one for links that are hardly further
/// apart from the beginning, as the base of a thumb and the wrist. Unit: metres.
const LEFT_OF_LINKS_M: f64 = 1e-3;
const LEAST_LEFT_OF_LINKS_M: f64 = 1e-4;
/// Factor on a squared distance that is more than its rounding error in 32 bits.
const ROUNDED_UP: f64 = 1.0 + 1e-5;
/// Factor on the present and the commanded speeds of joints, because joints overshoot.
const OVERSHOOT: f64 = 1.25;

/// Objects slower than this can't pass through anything in a step. Unit: m/s.
const SLOW_M_S: f64 = 0.05;
/// Ticks for which the engine moves the whole robot after a larger push.
const WHOLE_TICKS: u32 = 30;

/// The distances of the robot's links from everything.
#[derive(Default)]
pub(super) struct ProximityCache {
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
    pub(super) reach: Reach,
    /// Whether something fast can meet something fixed: the engine then sweeps all fast shapes,
    /// which takes long.
    pub(super) sweeps: bool,
    /// Whether links of many pieces in the hand can touch each other.
    pieces_meet: bool,
    /// Ticks for which the engine still moves the whole robot.
    whole_ticks: u32,
    /// The shortcuts that may be taken.
    pub(super) shortcuts: Shortcuts,
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

impl World {
    /// Takes only these shortcuts from now on: for comparisons.
    pub fn take_shortcuts(&mut self, shortcuts: Shortcuts) {
        self.proximity.shortcuts = shortcuts;
    }

    /// Leaves all ticks to the engine, with the whole robot, also those in which the robot touches
    /// nothing: for comparisons.
    pub fn leave_to_engine(&mut self) {
        self.take_shortcuts(Shortcuts::NONE);
    }

    /// Sets the engine's substeps for a tick.
    pub(super) fn set_substeps(&mut self, reach: Reach) {
        let substeps = match reach {
            Reach::Nothing if self.proximity.shortcuts.few_substeps => self.substeps.div_ceil(2),
            // Light fingers whose many pieces press on each other would fly apart.
            Reach::Hand if self.proximity.shortcuts.few_substeps && !self.proximity.pieces_meet => {
                self.substeps.div_ceil(2)
            }
            _ => self.substeps,
        };
        self.engine.integration_parameters.num_solver_iterations = substeps;
    }

    /// Returns the number of ticks so far in which the robot could touch nothing, with everything
    /// else at rest; nothing, with moving objects; movable objects with its hand; and everything.
    pub fn ticks_by_reach(&self) -> [u64; 4] {
        self.proximity.ticks
    }

    /// Returns whether the robot moved through free space in the last tick, without the engine.
    pub fn moved_freely(&self) -> bool {
        self.proximity.reach == Reach::Nothing
    }

    /// Returns whether the engine moved only the robot's hand in the last tick.
    pub fn moved_hand_alone(&self) -> bool {
        self.proximity.reach == Reach::Hand
    }

    /// Returns whether the engine swept fast shapes in the last tick, so that they pass through
    /// nothing fixed.
    pub fn swept(&self) -> bool {
        self.engine.integration_parameters.max_ccd_substeps > 0
    }

    /// Returns the reach of the robot, with its links at these poses, in the next tick.
    pub(super) fn update_proximity(&mut self, poses: Vec<Isometry3<f64>>) -> Reach {
        let mut cache = std::mem::take(&mut self.proximity);
        cache.sweeps = true;
        let reach = if cache.shortcuts == Shortcuts::NONE {
            Reach::All
        } else {
            self.reach(&mut cache, poses)
        };
        self.engine.integration_parameters.max_ccd_substeps =
            usize::from(cache.sweeps || !cache.shortcuts.few_sweeps);
        let reach = cache.shortcuts.limit(reach);
        if reach != Reach::Nothing {
            self.leave_out_idle(reach);
        }
        cache.reach = match reach {
            // A light arm gives way to its hand's contacts within the step.
            Reach::Hand if self.robot.is_light || self.robot.is_loaded => Reach::All,
            reach => reach,
        };
        cache.ticks[cache.reach as usize] += 1;
        self.proximity = cache;
        self.proximity.reach
    }

    /// Lets the engine move the whole robot for a while.
    pub(super) fn need_whole(&mut self) {
        self.proximity.whole_ticks = WHOLE_TICKS;
    }

    fn reach(&self, cache: &mut ProximityCache, poses: Vec<Isometry3<f64>>) -> Reach {
        if !self.sliding.is_empty() || self.sealed().is_some() {
            return Reach::All;
        }
        let rest: Vec<bool> = self
            .objects
            .iter()
            .map(|object| self.rests(object))
            .collect();
        let n_links = self.robot.bodies.len();
        if rest != cache.rest {
            cache.resting.clear();
        }
        cache.fixed.resize(n_links, None);
        cache.resting.resize(n_links, None);
        cache.pairs.resize(self.link_pairs.iter().count(), None);
        let (positions, velocities) = (&self.robot.positions, &self.robot.velocities);
        let spans = self
            .robot
            .spans(positions, velocities, self.tick_secs(), OVERSHOOT);
        let axes = self
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
        cache.rest = rest;
        cache.sweeps = self.fast_objects_meet_fixed(&cache.rest);
        for link in 0..n_links {
            if !self.is_clear_of_fixed(cache, link, &now) {
                cache.sweeps |= self.links_outrun_contacts(&now);
                return Reach::All;
            }
            if reach < Reach::All {
                reach = reach.max(self.reach_of_link(cache, link, &now));
            }
        }
        if reach == Reach::All {
            return reach;
        }
        if cache.between.is_empty() {
            cache.between = self
                .link_pairs
                .iter()
                .map(|(first, second)| self.joints_between(first, second))
                .collect();
            cache.kept_m = self
                .link_pairs
                .iter()
                .zip(&mut cache.pairs)
                .map(|(pair, known)| self.kept_m(pair, known, &now.poses))
                .collect();
        }
        reach = reach.max(self.reach_between_links(cache, &now));
        if reach == Reach::Hand && cache.whole_ticks > 0 {
            cache.whole_ticks -= 1;
            return Reach::All;
        }
        reach
    }

    /// Returns whether an object is fixed or asleep.
    pub(super) fn rests(&self, object: &Object) -> bool {
        self.engine
            .bodies
            .get(object.body)
            .is_none_or(|body| body.is_fixed() || body.is_sleeping())
    }

    /// Returns whether a link can't meet the floor or a static object in the tick.
    fn is_clear_of_fixed(&self, cache: &mut ProximityCache, link: usize, now: &Moment) -> bool {
        let Some(ball) = self.robot.balls[link] else {
            return true;
        };
        // A link that never moves may touch other fixed things.
        if self.robot.joints_to(link).next().is_none() {
            return true;
        }
        let measure = || self.gap_of_link(link, &|object| object.fixed, true);
        is_clear_within(
            &mut cache.fixed[link],
            measure,
            &ball,
            (&now.poses[link], self.ahead(link, &ball, now)),
        )
    }

    /// Returns whether a link is so fast that it could pass through something thin without a sweep.
    fn links_outrun_contacts(&self, now: &Moment) -> bool {
        let speeds = (0..self.robot.bodies.len()).filter_map(|link| self.speed_of_link(link, now));
        speeds.fold(0.0, f64::max) > self.outruns_m_s()
    }

    /// Returns the speed at which half of the least distance at which the engine prepares contacts
    /// is passed in a step: the rest is for the change of speed within the tick. Unit: m/s.
    fn outruns_m_s(&self) -> f64 {
        PREDICTION_M / 2.0 * f64::from(self.steps_per_tick) / self.tick_secs()
    }

    /// Returns a bound of the present speed of a link's points; `None` without shapes. Unit: m/s.
    fn speed_of_link(&self, link: usize, now: &Moment) -> Option<f64> {
        let ball = self.robot.balls[link].as_ref()?;
        let middle = (now.poses[link] * ball.middle).coords;
        let (mut linear, mut angular) = (Vector3::zeros(), Vector3::zeros());
        for joint in self.robot.joints_to(link) {
            let ((axis, point), speed) = (now.axes[joint], self.robot.velocities[joint]);
            match self.robot.model.joints[joint].kind {
                JointKind::Prismatic => linear += axis * speed,
                JointKind::Revolute => {
                    linear += axis.cross(&(middle - point)) * speed;
                    angular += axis * speed;
                }
            }
        }
        Some(linear.norm() + angular.norm() * ball.radius)
    }

    fn reach_of_link(&self, cache: &mut ProximityCache, link: usize, now: &Moment) -> Reach {
        let Some(ball) = self.robot.balls[link] else {
            return Reach::Nothing;
        };
        // The engine knows a link that never moves in every tick, as it knows a table.
        if self.robot.joints_to(link).next().is_none() {
            return Reach::Nothing;
        }
        let ahead = self.ahead(link, &ball, now);
        let rest = &cache.rest;
        let rests = |object: &Object| !object.fixed && self.is_in(object, rest);
        let measure = || self.gap_of_link(link, &rests, false);
        let clear = is_clear_within(
            &mut cache.resting[link],
            measure,
            &ball,
            (&now.poses[link], ahead),
        ) && self.is_clear_of_moving(link, rest, ahead);
        match (clear, &self.robot.hand) {
            (true, _) => Reach::Nothing,
            (false, Some(hand)) if hand.has(link) => Reach::Hand,
            _ => Reach::All,
        }
    }

    /// Returns how far a link can move in the tick. Unit: metres.
    fn ahead(&self, link: usize, ball: &Ball, now: &Moment) -> f64 {
        self.robot
            .joints_to(link)
            .map(|joint| self.way(joint, link, ball, now))
            .sum()
    }

    /// Returns whether an object that is not slow can meet the floor or a static object in the
    /// tick.
    fn fast_objects_meet_fixed(&self, rest: &[bool]) -> bool {
        let moving = self.objects.iter().zip(rest).filter(|(_, rests)| !**rests);
        // Sweeps of objects bring sweeps of links, which the engine makes for links that outrun
        // half of their thinnest piece: of many thin pieces, nearly always.
        let slow_m_s = if self.robot.model.has_many_pieces() {
            self.outruns_m_s()
        } else {
            SLOW_M_S
        };
        moving
            .filter_map(|(object, _)| Some((object, self.speed_of(object)?)))
            .any(|(object, speed)| {
                let needed = self.way_of_object(speed) + LEFT_M;
                speed > slow_m_s
                    && self.boxed(object.body).any(|(_, its_box)| {
                        let fixed = self.objects.iter().filter(|other| other.fixed);
                        f64::from(its_box.mins.z) < needed
                            || fixed
                                .flat_map(|other| self.colliders_of(other.body))
                                .any(|other| gap(&its_box, &other.compute_aabb()) < needed)
                    })
            })
    }

    /// Returns the largest speed of an object's points. Unit: m/s.
    pub(super) fn speed_of(&self, object: &Object) -> Option<f64> {
        let body = self.engine.bodies.get(object.body)?;
        let size = Vector3::from(object.model.size_m).norm();
        Some(from_vector(body.linvel()).norm() + from_vector(body.angvel()).norm() * size)
    }

    /// Returns how far an object of this speed can move in the tick. Unit: metres.
    fn way_of_object(&self, speed: f64) -> f64 {
        let secs = self.tick_secs();
        OVERSHOOT * speed * secs + GRAVITY * secs * secs
    }

    /// Returns whether a link that moves this far can't meet any moving object in the tick.
    fn is_clear_of_moving(&self, link: usize, rest: &[bool], ahead: f64) -> bool {
        let moving = self.objects.iter().zip(rest).filter(|(_, rests)| !**rests);
        moving
            .filter_map(|(object, _)| Some((object, self.speed_of(object)?)))
            .all(|(object, speed)| {
                let needed = ahead + self.way_of_object(speed) + LEFT_M;
                if self.are_balls_apart(link, object, needed) {
                    return true;
                }
                let others = self.boxed(object.body).collect::<Vec<_>>();
                self.boxed(self.robot.bodies[link]).all(|solid| {
                    others
                        .iter()
                        .all(|other| apart(&solid, other, needed) >= needed)
                })
            })
    }

    /// Returns whether the balls around a link and an object are farther apart than this. Unit:
    /// metres.
    pub(super) fn are_balls_apart(&self, link: usize, object: &Object, needed: f64) -> bool {
        let Some(ball) = &self.robot.balls[link] else {
            return true;
        };
        let (Some(around), Some(body)) = (
            &object.ball,
            self.engine.bodies.get(self.robot.bodies[link]),
        ) else {
            return false;
        };
        let way = from_pose(body.position()) * ball.middle - self.pose_of(object) * around.middle;
        way.norm() - ball.radius - around.radius >= needed + ROUNDING_M
    }

    /// Returns whether an object is among those that this list, in scene order, marks.
    fn is_in(&self, object: &Object, marked: &[bool]) -> bool {
        self.objects
            .iter()
            .zip(marked)
            .any(|(other, marked)| *marked && std::ptr::eq(other, object))
    }

    /// Returns the joints that move only the first of two links, and those that move only the
    /// second.
    fn joints_between(&self, first: usize, second: usize) -> [Vec<usize>; 2] {
        [(first, second), (second, first)].map(|(one, other)| {
            let joints = self
                .robot
                .joints_to(one)
                .filter(|joint| !self.robot.moves(*joint, other));
            joints.collect()
        })
    }

    /// Returns the distance that has to remain between two links: half of that at the beginning, if
    /// they are near. Unit: metres.
    fn kept_m(
        &self,
        (first, second): (usize, usize),
        known: &mut Option<Measured>,
        poses: &[Isometry3<f64>],
    ) -> f64 {
        let far = |balls_m: f64| balls_m >= 2.0 * LEFT_OF_LINKS_M;
        let pose = poses[first].inverse() * poses[second];
        if self.gap_of_balls(first, second, &pose).is_some_and(far) {
            return LEFT_OF_LINKS_M;
        }
        let gap_m = self.gap_of_links(first, second);
        *known = Some(Measured { gap_m, pose });
        (gap_m / 2.0).clamp(LEAST_LEFT_OF_LINKS_M, LEFT_OF_LINKS_M)
    }

    /// Returns the distance of the balls around two links, less rounding errors; `None` if one has
    /// no shape. `pose` is that of the second in the frame of the first. Unit: metres.
    fn gap_of_balls(&self, first: usize, second: usize, pose: &Isometry3<f64>) -> Option<f64> {
        let (one, other) = (
            self.robot.balls[first].as_ref()?,
            self.robot.balls[second].as_ref()?,
        );
        Some((pose * other.middle - one.middle).norm() - one.radius - other.radius - ROUNDING_M)
    }

    fn reach_between_links(&self, cache: &mut ProximityCache, now: &Moment) -> Reach {
        cache.pieces_meet = false;
        if self.link_pairs.pass {
            return Reach::Nothing;
        }
        let mut reach = Reach::Nothing;
        let pairs = self
            .link_pairs
            .iter()
            .zip(&mut cache.pairs)
            .zip(&cache.between)
            .zip(&cache.kept_m);
        for ((((first, second), known), joints), kept_m) in pairs {
            let (Some(one), Some(other)) = (self.robot.balls[first], self.robot.balls[second])
            else {
                continue;
            };
            let pose = now.poses[first].inverse() * now.poses[second];
            let mut ahead = 0.0;
            for (link, ball, joints) in [(first, &one, &joints[0]), (second, &other, &joints[1])] {
                ahead += joints
                    .iter()
                    .map(|joint| self.way(*joint, link, ball, now))
                    .sum::<f64>();
            }
            if self
                .gap_of_balls(first, second, &pose)
                .is_some_and(|balls_m| balls_m - ahead >= *kept_m)
            {
                continue;
            }
            if known.is_none_or(|known| known.left(&pose, &other) - ahead < *kept_m) {
                *known = Some(Measured {
                    gap_m: self.gap_of_links(first, second),
                    pose,
                });
            }
            if known.is_some_and(|known| known.left(&pose, &other) - ahead >= *kept_m) {
                continue;
            }
            let in_hand = self
                .robot
                .hand
                .as_ref()
                .is_some_and(|hand| hand.has(first) && hand.has(second));
            reach = reach.max(if in_hand { Reach::Hand } else { Reach::All });
            cache.pieces_meet |= in_hand
                && [first, second]
                    .iter()
                    .any(|link| self.robot.model.links[*link].has_many_pieces());
        }
        reach
    }

    /// Returns how far one joint can move any point of a link in the tick. Unit: metres.
    fn way(&self, joint: usize, link: usize, ball: &Ball, now: &Moment) -> f64 {
        let (axis, point) = now.axes[joint];
        match self.robot.model.joints[joint].kind {
            JointKind::Prismatic => now.spans[joint],
            JointKind::Revolute => {
                let arm: Vector3<f64> = (now.poses[link] * ball.middle).coords - point;
                now.spans[joint] * (arm.cross(&axis).norm() + ball.radius)
            }
        }
    }

    /// Measures the distance of a link from these objects, and from the floor. Unit: metres.
    fn gap_of_link(&self, link: usize, these: &dyn Fn(&Object) -> bool, floor: bool) -> f64 {
        let mut nearest = RANGE_M;
        let these = self.objects.iter().filter(|object| these(object));
        let others: Vec<_> = these.flat_map(|object| self.boxed(object.body)).collect();
        for solid in self.boxed(self.robot.bodies[link]) {
            if floor && !self.robot.off_floor[link] {
                // The distance from the top of so large a slab would be inexact.
                nearest = nearest.min(f64::from(solid.1.mins.z));
            }
            nearest = others.iter().fold(nearest, |nearest, other| {
                nearest.min(apart(&solid, other, nearest))
            });
        }
        nearest
    }

    /// Returns the distance of two links, or [`RANGE_M`] if it is larger. Unit: metres.
    pub(super) fn gap_of_links(&self, first: usize, second: usize) -> f64 {
        let [solids, others] =
            [first, second].map(|link| self.boxed(self.robot.bodies[link]).collect::<Vec<_>>());
        let Some(around) = others
            .iter()
            .map(|(_, its_box)| *its_box)
            .reduce(|one, other| one.merged(&other))
        else {
            return RANGE_M;
        };
        // Most others are farther apart than those with the nearest boxes.
        let (mut least, mut begin) = (Real::INFINITY, None);
        for solid in &solids {
            if gap_squared(&solid.1, &around) >= least {
                continue;
            }
            for other in &others {
                let squared = gap_squared(&solid.1, &other.1);
                if squared < least {
                    (least, begin) = (squared, Some((solid, other)));
                }
            }
        }
        let mut nearest = begin.map_or(RANGE_M, |(solid, other)| apart(solid, other, RANGE_M));
        let is_far =
            |squared: Real, nearest: f64| f64::from(squared) > nearest * nearest * ROUNDED_UP;
        for solid in &solids {
            if is_far(gap_squared(&solid.1, &around), nearest) {
                continue;
            }
            for other in &others {
                if !is_far(gap_squared(&solid.1, &other.1), nearest) {
                    nearest = nearest.min(apart(solid, other, nearest));
                }
            }
        }
        nearest
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
