//! Follows a path: the base pose at each tick, within speed and acceleration limits.

use crate::route::{length, wrapped};

/// Largest change of velocity at a corner of the path. Unit: m/s.
const JOLT: f64 = 0.08;
/// A base whose heading deviates this much from its path turns on the spot first. Unit: radians.
const ASIDE_RAD: f64 = 0.7;
/// Distance ahead on the path that the base faces. Unit: metres.
const AHEAD_M: f64 = 0.3;
/// At this distance from the goal, the base starts turning to its final heading. Unit: metres.
const ARRIVAL_M: f64 = 0.15;
/// Tolerance within which a goal is reached. Units: metres, or radians.
const THERE: f64 = 1e-4;

/// Motion limits of a base.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Unit: m/s.
    pub speed: f64,
    /// Unit: m/s².
    pub acceleration: f64,
    /// Unit: rad/s.
    pub turn_speed: f64,
    /// Unit: rad/s².
    pub turn_acceleration: f64,
}

/// A base following its path.
#[derive(Debug, Clone)]
pub struct Follower {
    /// x, y, heading. Headings are not wrapped.
    at: [f64; 3],
    /// Ends of the remaining legs, the nearest first.
    left: Vec<[f64; 2]>,
    /// Final heading. Unit: radians.
    heading: f64,
    speed: f64,
    turn_speed: f64,
}

impl Follower {
    /// A base at rest.
    pub fn new(at: [f64; 3], way: Vec<[f64; 2]>, heading: f64) -> Self {
        Self {
            at,
            left: way,
            heading,
            speed: 0.0,
            turn_speed: 0.0,
        }
    }

    /// Commanded pose of the base at the moment.
    pub fn at(&self) -> [f64; 3] {
        self.at
    }

    /// The rest of the path, starting at the base.
    pub fn left(&self) -> impl Iterator<Item = [f64; 2]> {
        std::iter::once([self.at[0], self.at[1]]).chain(self.left.iter().copied())
    }

    /// Whether the base neither moves nor turns.
    pub fn is_still(&self) -> bool {
        self.speed == 0.0 && self.turn_speed == 0.0
    }

    /// Whether the base is at its goal and at rest.
    pub fn has_arrived(&self) -> bool {
        self.left.is_empty() && self.is_still() && wrapped(self.heading - self.at[2]).abs() <= THERE
    }

    /// The point at this distance ahead on the path, or its end. Unit: metres.
    pub fn ahead(&self, mut distance: f64) -> [f64; 2] {
        let mut from = [self.at[0], self.at[1]];
        for to in &self.left {
            let leg = length(to[0] - from[0], to[1] - from[1]);
            if leg >= distance && leg > 0.0 {
                return [0, 1].map(|axis| from[axis] + (to[axis] - from[axis]) * distance / leg);
            }
            distance -= leg;
            from = *to;
        }
        from
    }

    /// Advances one tick. With `stop`, the base brakes as fast as its limits allow.
    pub fn advance(&mut self, limits: &Limits, tick_secs: f64, stop: bool) {
        let end = self.left_m();
        let wanted = if end <= ARRIVAL_M {
            self.heading
        } else {
            self.towards_way()
        };
        let aside = wrapped(wanted - self.at[2]);
        self.turn(if stop { 0.0 } else { aside }, limits, tick_secs);
        let facing = if end <= ARRIVAL_M {
            1.0
        } else {
            (1.0 - aside.abs() / ASIDE_RAD).max(0.0)
        };
        let goal = if stop {
            0.0
        } else {
            (limits.speed * facing).min(self.braking(limits))
        };
        let change = limits.acceleration * tick_secs;
        self.speed = goal
            .clamp(self.speed - change, self.speed + change)
            .max(0.0);
        self.go(self.speed * tick_secs);
        if self.left.is_empty() {
            self.speed = 0.0;
        }
    }

    fn left_m(&self) -> f64 {
        let ends: Vec<[f64; 2]> = self.left().collect();
        ends.windows(2)
            .map(|pair| length(pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]))
            .sum()
    }

    fn towards_way(&self) -> f64 {
        let [x, y] = self.ahead(AHEAD_M);
        libm::atan2(y - self.at[1], x - self.at[0])
    }

    fn turn(&mut self, aside: f64, limits: &Limits, tick_secs: f64) {
        let change = limits.turn_acceleration * tick_secs;
        // The turning speed from which the base can still stop in time.
        let fastest = (2.0 * limits.turn_acceleration * aside.abs())
            .sqrt()
            .min(limits.turn_speed);
        let fastest = fastest.min(aside.abs() / tick_secs);
        let goal = fastest.copysign(aside);
        self.turn_speed = goal.clamp(self.turn_speed - change, self.turn_speed + change);
        if aside.abs() <= THERE && self.turn_speed.abs() <= change {
            self.at[2] += aside;
            self.turn_speed = 0.0;
            return;
        }
        self.at[2] += self.turn_speed * tick_secs;
    }

    /// The highest speed that allows braking for the remaining corners and for the end. Unit: m/s.
    fn braking(&self, limits: &Limits) -> f64 {
        let ends: Vec<[f64; 2]> = self.left().collect();
        let mut fastest = f64::INFINITY;
        let mut way = 0.0;
        for (idx, pair) in ends.windows(2).enumerate() {
            way += length(pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]);
            let at_corner = ends
                .get(idx + 2)
                .map_or(0.0, |next| corner_speed(pair[0], pair[1], *next));
            fastest = fastest.min((at_corner * at_corner + 2.0 * limits.acceleration * way).sqrt());
        }
        fastest
    }

    fn go(&mut self, mut distance: f64) {
        while let Some(to) = self.left.first().copied() {
            let (dx, dy) = (to[0] - self.at[0], to[1] - self.at[1]);
            let leg = length(dx, dy);
            if leg > distance + THERE {
                self.at[0] += dx / leg * distance;
                self.at[1] += dy / leg * distance;
                return;
            }
            (self.at[0], self.at[1]) = (to[0], to[1]);
            distance = (distance - leg).max(0.0);
            self.left.remove(0);
        }
    }
}

/// The highest speed around a corner. Unit: m/s.
fn corner_speed(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    let heading = |from: [f64; 2], to: [f64; 2]| libm::atan2(to[1] - from[1], to[0] - from[0]);
    let half = wrapped(heading(b, c) - heading(a, b)).abs() / 2.0;
    JOLT / (2.0 * libm::sin(half)).max(1e-3)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits {
        speed: 0.2,
        acceleration: 0.3,
        turn_speed: 0.9,
        turn_acceleration: 1.5,
    };
    const TICK: f64 = 1.0 / 60.0;

    /// Poses at each tick until arrival.
    fn drive(from: [f64; 3], way: &[[f64; 2]], heading: f64) -> Vec<[f64; 3]> {
        let mut follower = Follower::new(from, way.to_vec(), heading);
        let mut poses = vec![from];
        while !follower.has_arrived() {
            follower.advance(&LIMITS, TICK, false);
            poses.push(follower.at());
            assert!(
                poses.len() < 60 * 120,
                "the base does not arrive: {follower:?}"
            );
        }
        poses
    }

    #[test]
    fn the_drive_keeps_its_limits_and_reaches_the_goal() {
        let poses = drive([0.0, 0.0, 2.0], &[[1.0, 0.0], [1.0, 1.0], [0.5, 1.4]], -1.0);
        let [x, y, heading] = poses.last().copied().expect("the drive has poses");
        assert!(
            (x - 0.5).abs() < 1e-9
                && (y - 1.4).abs() < 1e-9
                && wrapped(heading + 1.0).abs() < 2.0 * THERE
        );
        let velocities: Vec<[f64; 3]> = poses
            .windows(2)
            .map(|pair| [0, 1, 2].map(|axis| (pair[1][axis] - pair[0][axis]) / TICK))
            .collect();
        for [vx, vy, turning] in &velocities {
            assert!(
                length(*vx, *vy) <= LIMITS.speed * 1.01 + THERE / TICK,
                "{vx} {vy}"
            );
            assert!(turning.abs() <= LIMITS.turn_speed * 1.01, "{turning}");
        }
        for pair in velocities.windows(2) {
            let jolt = length(pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]);
            assert!(jolt <= JOLT * 1.2 + 2.0 * THERE / TICK, "{jolt}");
            assert!(
                (pair[1][2] - pair[0][2]).abs()
                    <= LIMITS.turn_acceleration * TICK * 1.5 + THERE / TICK
            );
        }
        // It turned before it drove.
        let first = poses
            .iter()
            .position(|pose| pose[0] > 0.01)
            .expect("it drives");
        assert!(poses[first][2].abs() < ASIDE_RAD);
    }

    #[test]
    fn a_stop_takes_the_shortest_time() {
        let mut follower = Follower::new([0.0; 3], vec![[3.0, 0.0]], 0.0);
        (0..120).for_each(|_| follower.advance(&LIMITS, TICK, false));
        let from = follower.at()[0];
        let mut n_ticks = 0;
        while !follower.is_still() {
            follower.advance(&LIMITS, TICK, true);
            n_ticks += 1;
            assert!(n_ticks < 60, "the base does not stop");
        }
        let braked = LIMITS.speed * LIMITS.speed / (2.0 * LIMITS.acceleration);
        assert!((follower.at()[0] - from - braked).abs() < 0.01);
    }

    #[test]
    fn a_route_of_zero_length_is_a_turn() {
        let poses = drive([0.5, 0.5, 3.0], &[[0.5, 0.5]], -3.0);
        // The short way round.
        assert!(poses.iter().all(|pose| pose[2] >= 3.0 - 1e-9) && poses.len() < 90);
        assert!(
            (poses.last().expect("the drive has poses")[2] - (std::f64::consts::TAU - 3.0)).abs()
                < 2.0 * THERE
        );
    }
}
