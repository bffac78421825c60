//! The opening of a gripper as a function of its joints, and the reverse.

use crate::gripper::coupling::Follower;
use crate::gripper::table::{Entry, interpolated};

/// Largest speed of a fingertip. Unit: m/s. A finger that is faster throws the object away before
/// the other arrives.
const FASTEST_M_S: f64 = 0.1;

/// Smallest factor of a coupled joint with a part of the rotors' inertia.
const LEAST_FACTOR: f64 = 0.2;

/// A finger that moves less than this is fixed. Unit: metres.
const FIXED_M: f64 = 1e-3;

/// A joint that a motor of the gripper moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Leader {
    pub(super) joint: usize,
    /// Position where the gripper is closed.
    pub(super) closed: f64,
    /// Position where it is open.
    pub(super) open: f64,
    /// Way of the fingertips per way of the joint, on average. Unit: 1, or metres per radian.
    pub lever_m: f64,
    /// Share of the force on its side of the object: the others there give the rest.
    pub(super) force_share: f64,
}

impl Leader {
    /// The motor's effort per force on its side of the object. Unit: 1, or newton metres per
    /// newton.
    fn effort_per_n(&self) -> f64 {
        self.lever_m * self.force_share
    }

    /// 1 if its positive direction opens the finger, otherwise -1.
    fn opens(&self) -> f64 {
        (self.open - self.closed).signum()
    }
}

/// The opening of a gripper as a function of its joints.
#[derive(Debug, Clone, PartialEq)]
pub struct Gripper {
    /// Those that move the left and the right finger, then those of further fingers.
    pub(super) leaders: Vec<Leader>,
    /// Number of leaders that move the left and the right finger: only these determine the opening.
    pub(super) n_measured: usize,
    /// Joints that mimic a leader, without a motor of their own.
    pub(super) followers: Vec<Follower>,
    /// Index of the leader that moves the left and the right finger. A finger that does not move
    /// has the other's.
    pub sides: [usize; 2],
    /// From closed to open; empty for two sliding fingers, each at half of the opening.
    pub(super) table: Vec<Entry>,
    /// Widest opening; for two sliding fingers, twice the smaller upper limit. Unit: metres.
    pub(super) widest_m: f64,
}

impl Gripper {
    /// A suction cup of this diameter, which has no joints. Unit: metres.
    pub(super) fn cup(diameter_m: f64) -> Self {
        Self {
            leaders: Vec::new(),
            n_measured: 0,
            followers: Vec::new(),
            sides: [0, 0],
            table: Vec::new(),
            widest_m: diameter_m,
        }
    }

    /// Returns all joints that move the fingers, those with a motor first.
    pub fn joints(&self) -> impl Iterator<Item = usize> + '_ {
        let leaders = self.leaders.iter().map(|leader| leader.joint);
        leaders.chain(self.followers.iter().map(|follower| follower.joint))
    }

    /// Returns whether a joint moves a finger.
    pub fn contains(&self, joint: usize) -> bool {
        self.joints().any(|own| own == joint)
    }

    /// Returns whether a joint follows another of this gripper and has no motor.
    pub fn follows(&self, joint: usize) -> bool {
        self.followers
            .iter()
            .any(|follower| follower.joint == joint)
    }

    /// Returns whether a joint moves a finger beside the two whose gap is the opening.
    pub fn moves_further_finger(&self, joint: usize) -> bool {
        let follower = self
            .followers
            .iter()
            .find(|follower| follower.joint == joint)
            .map(|own| own.leader);
        let leader =
            follower.or_else(|| self.leaders.iter().position(|leader| leader.joint == joint));
        leader.is_some_and(|idx| idx >= self.n_measured)
    }

    /// Returns the inertia of the motors' rotors on a joint, with the inertia of a rotor at the
    /// fingertips in kilograms. Each of the coupled joints has an equal part of it, which is the
    /// same for their common motion; but contacts of a light link that only a coupling holds would
    /// converge slowly. Unit: kilograms or kg·m².
    pub fn armature(&self, joint: usize, rotor_kg: f64) -> f64 {
        let follower = self
            .followers
            .iter()
            .find(|follower| follower.joint == joint);
        let leads = |leader: &&Leader| leader.joint == joint;
        let leader = follower
            .map(|own| own.leader)
            .or_else(|| self.leaders.iter().position(|leader| leads(&leader)));
        let Some((idx, leader)) = leader.and_then(|idx| Some((idx, self.leaders.get(idx)?))) else {
            return 0.0;
        };
        let carries =
            |follower: &&Follower| follower.leader == idx && follower.factor.abs() > LEAST_FACTOR;
        let n_coupled = 1 + self.followers.iter().filter(carries).count();
        let share = rotor_kg * leader.lever_m * leader.lever_m / n_coupled as f64;
        match follower {
            None => share,
            Some(follower) if carries(&follower) => share / (follower.factor * follower.factor),
            Some(_) => 0.0,
        }
    }

    /// Returns the joints with a motor, each with the motor's effort per newton of the grip's
    /// force.
    pub fn motors(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.leaders
            .iter()
            .map(|leader| (leader.joint, leader.effort_per_n()))
    }

    /// Returns the motor's effort per newton of the grip's force, for a joint with a motor.
    pub fn effort_per_n(&self, joint: usize) -> Option<f64> {
        self.motors()
            .find(|(own, _)| *own == joint)
            .map(|(_, effort_per_n)| effort_per_n)
    }

    /// Returns the lever of a joint with a motor: way of the fingertips per way of the joint.
    pub fn lever_m(&self, joint: usize) -> Option<f64> {
        self.leaders
            .iter()
            .find(|leader| leader.joint == joint)
            .map(|leader| leader.lever_m)
    }

    /// Returns the largest speed of a joint, given that of its URDF; fingers that were measured are
    /// slowed down.
    pub fn fastest(&self, joint: usize, velocity: f64) -> f64 {
        match self.lever_m(joint) {
            Some(lever_m) if !self.table.is_empty() => velocity.min(FASTEST_M_S / lever_m),
            _ => velocity,
        }
    }

    /// For the left and the right finger: the joint that moves it, and the motor's effort per
    /// newton of the grip's force, which is negative if the finger opens in the joint's negative
    /// direction. Returns `None` for a suction cup.
    pub fn sides(&self) -> Option<[(usize, f64); 2]> {
        let of = |side: usize| {
            let leader = self.leaders.get(side)?;
            Some((leader.joint, leader.effort_per_n() * leader.opens()))
        };
        let [left, right] = self.sides;
        Some([of(left)?, of(right)?])
    }

    /// Returns the speeds of the left and the right fingertip; 0 for a suction cup. Unit: m/s;
    /// positive opens.
    pub fn speeds(&self, velocities: &[f64]) -> [f64; 2] {
        let speed = |leader: &Leader| velocities[leader.joint] * leader.opens() * leader.lever_m;
        self.sides
            .map(|side| self.leaders.get(side).map_or(0.0, speed))
    }

    /// Returns the widest opening. Unit: metres.
    pub fn widest_m(&self) -> f64 {
        self.widest_m
    }

    /// Returns the difference between the widest and the smallest opening. Unit: metres.
    pub(crate) fn travel_m(&self) -> f64 {
        match self.table.first() {
            Some(closed) => self.widest_m - closed.gap.width_m().max(0.0),
            None => self.widest_m,
        }
    }

    /// Returns the gap between the fingers at these joint positions. Unit: metres.
    pub fn opening_m(&self, positions: &[f64]) -> f64 {
        let measured = &self.leaders[..self.n_measured];
        if self.table.is_empty() {
            return measured.iter().map(|leader| positions[leader.joint]).sum();
        }
        let shares = measured.iter().map(|leader| {
            let Leader {
                joint,
                closed,
                open,
                ..
            } = *leader;
            (positions[joint] - closed) / (open - closed)
        });
        let gaps: f64 = shares
            .map(|share| {
                interpolated(&self.table, |entry| entry.share, share)
                    .1
                    .width_m()
            })
            .sum();
        (gaps / measured.len() as f64).max(0.0)
    }

    /// Returns the position of one of its joints at an opening, or `None` for any other joint.
    pub fn target(&self, joint: usize, opening_m: f64) -> Option<f64> {
        if self.table.is_empty() {
            return self.contains(joint).then_some(opening_m / 2.0);
        }
        let share = self.share(opening_m);
        let at = |leader: &Leader| leader.closed + share * (leader.open - leader.closed);
        if let Some(leader) = self.leaders.iter().find(|leader| leader.joint == joint) {
            return Some(at(leader));
        }
        let Follower {
            leader,
            factor,
            offset,
            ..
        } = self.followers.iter().find(|own| own.joint == joint)?;
        Some(factor * at(&self.leaders[*leader]) + offset)
    }

    /// Sets the positions of its joints to an opening.
    pub fn set(&self, positions: &mut [f64], opening_m: f64) {
        for joint in self.joints() {
            if let (Some(position), Some(target)) =
                (positions.get_mut(joint), self.target(joint, opening_m))
            {
                *position = target;
            }
        }
    }

    /// Returns where the middle between the fingers is at an opening, along the y axis of the grasp
    /// frame: other than 0 if only one finger moves. Unit: metres.
    pub fn middle_m(&self, opening_m: f64) -> f64 {
        match self.table.is_empty() {
            true => 0.0,
            false => interpolated(&self.table, |entry| entry.share, self.share(opening_m))
                .1
                .middle_m(),
        }
    }

    /// Returns whether only one of its fingers moves.
    pub fn has_fixed_jaw(&self) -> bool {
        let travel = |side: fn(&Entry) -> f64| {
            let ends = self.table.iter().map(side);
            let (low, high) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| {
                (low.min(at), high.max(at))
            });
            high - low
        };
        !self.table.is_empty()
            && travel(|entry| entry.gap.left_m).min(travel(|entry| entry.gap.right_m)) < FIXED_M
    }

    /// The share of the way from closed to open at an opening. Nothing closes the fingers
    /// completely.
    fn share(&self, opening_m: f64) -> f64 {
        match opening_m > 0.0 {
            true => interpolated(&self.table, |entry| entry.gap.width_m(), opening_m).0,
            false => 0.0,
        }
    }
}
