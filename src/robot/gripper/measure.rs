//! Finds the gripper of a robot; measures its opening on the model unless that is known.

use std::f64::consts::{PI, TAU};

use nalgebra::Isometry3;

use crate::description::{Joint, JointKind, RobotModel};
use crate::gripper::coupling::{Follower, followers, leaders};
use crate::gripper::further::Further;
use crate::gripper::gap::{Gap, Probe};
use crate::gripper::opening::{Gripper, Leader};
use crate::gripper::sliding::sliding;
use crate::gripper::table::{Entry, longest_run, travel};
use crate::{GripperFault, RobotError};
use actcheck_data::Hand;

/// Intervals of the table. At this number, the error between entries is about 0.01 mm for a finger
/// of 10 cm.
const INTERVALS: usize = 60;
/// Intervals where candidates are compared.
const FEW_INTERVALS: usize = 15;
/// Least difference between the widest and the smallest opening. Unit: metres.
const LEAST_TRAVEL_M: f64 = 0.005;
/// Least lever of a motor: below it, its force would be a guess. Unit: metres per radian.
const LEAST_LEVER_M: f64 = 1e-4;

impl Gripper {
    /// Finds the gripper of a hand. `links` are the fingers, `grasp` is the grasp frame with its
    /// link.
    ///
    /// # Errors
    /// [`RobotError::Gripper`] if the opening can't be measured, [`RobotError::Missing`] for an
    /// unknown joint.
    pub(crate) fn of(
        hand: &Hand,
        model: &RobotModel,
        links: [usize; 2],
        grasp: (usize, Isometry3<f64>),
    ) -> Result<Self, RobotError> {
        if let Some(cup) = &hand.suction {
            return Ok(Self::cup(2.0 * cup.radius_m));
        }
        let named = hand.finger_joints.iter().map(|name| model.joint(name));
        let named = named.collect::<Result<Vec<_>, _>>()?;
        Self::find(&named, model, links, grasp)
    }

    /// Finds the gripper with these motors.
    ///
    /// # Errors
    /// [`RobotError::Gripper`] if the opening can't be measured.
    pub(crate) fn find(
        named: &[usize],
        model: &RobotModel,
        links: [usize; 2],
        grasp: (usize, Isometry3<f64>),
    ) -> Result<Self, RobotError> {
        Self::find_with(named, model, links, grasp, INTERVALS)
    }

    /// As [`Gripper::find`], with a coarse table: to compare candidates.
    pub(crate) fn find_coarse(
        named: &[usize],
        model: &RobotModel,
        links: [usize; 2],
        grasp: (usize, Isometry3<f64>),
    ) -> Result<Self, RobotError> {
        Self::find_with(named, model, links, grasp, FEW_INTERVALS)
    }

    fn find_with(
        named: &[usize],
        model: &RobotModel,
        links: [usize; 2],
        grasp: (usize, Isometry3<f64>),
        n_intervals: usize,
    ) -> Result<Self, RobotError> {
        let [left, right] = links;
        // Some robots name their fingers as seen from the front.
        let probes = [[left, right], [right, left]].map(|links| Probe::new(model, links, grasp));
        if let Some(sliding) = probes.iter().find_map(|probe| sliding(named, model, probe)) {
            return Ok(sliding);
        }
        let [usual, swapped] = probes.map(|probe| measured(named, model, &probe, n_intervals));
        let found = match (usual, swapped) {
            (Ok(usual), Ok(swapped)) if swapped.widest_m > usual.widest_m => {
                Ok(swapped.with_sides_swapped())
            }
            (Err(_), Ok(swapped)) => Ok(swapped.with_sides_swapped()),
            (usual, _) => usual,
        };
        found.map_err(|fault| RobotError::Gripper {
            name: model.name.clone(),
            fault,
        })
    }

    /// The same gripper with the fingers in the profile's order.
    fn with_sides_swapped(mut self) -> Self {
        self.sides.reverse();
        self
    }
}

/// Measures the opening on the model.
fn measured(
    named: &[usize],
    model: &RobotModel,
    probe: &Probe<'_>,
    n_intervals: usize,
) -> Result<Gripper, GripperFault> {
    let drive = FingerJoints::find(named, model, probe)?;
    let best = drive
        .ways()
        .into_iter()
        .filter_map(|ends| {
            let gap =
                |idx: usize| probe.gap(&drive.posture(&ends, idx as f64 / n_intervals as f64));
            Some((
                longest_run(&(0..=n_intervals).map(gap).collect::<Vec<_>>())?,
                ends,
            ))
        })
        .max_by(|a, b| travel(&a.0).total_cmp(&travel(&b.0)));
    let Some((table, ends)) = best.filter(|(table, _)| travel(table) > LEAST_TRAVEL_M) else {
        return Err(GripperFault::NoTravel);
    };
    Ok(drive.gripper(&table, &ends))
}

/// The joints that move the fingers.
struct FingerJoints<'a> {
    model: &'a RobotModel,
    /// Those that move the left or the right finger.
    leaders: Vec<usize>,
    /// Those of further fingers.
    further: Vec<Further>,
    /// Joints that follow a leader, or a further joint, which are counted after the leaders.
    followers: Vec<Follower>,
    /// Index of the leader that moves the left and the right finger.
    sides: [usize; 2],
}

impl<'a> FingerJoints<'a> {
    fn find(
        named: &[usize],
        model: &'a RobotModel,
        probe: &Probe<'_>,
    ) -> Result<Self, GripperFault> {
        let all = leaders(named, model);
        let coupled = followers(&all, model);
        let joints: Vec<usize> = all
            .iter()
            .copied()
            .chain(coupled.iter().map(|own| own.joint))
            .collect();
        let moving = probe.moving(&joints);
        if moving.grasp_frame {
            return Err(GripperFault::MovesGraspLink);
        }
        let leader_of = |joint: usize| {
            let followed = coupled
                .iter()
                .find(|own| own.joint == joint)
                .map(|own| all[own.leader]);
            followed.unwrap_or(joint)
        };
        let by_finger = moving
            .fingers
            .map(|joints| joints.into_iter().map(leader_of).collect::<Vec<_>>());
        let (leaders, others): (Vec<usize>, Vec<usize>) = all
            .iter()
            .partition(|joint| by_finger.iter().any(|of_finger| of_finger.contains(joint)));
        // The outermost joint of a finger.
        let side = |joints: &Vec<usize>| {
            joints
                .first()
                .and_then(|own| leaders.iter().position(|other| other == own))
        };
        let sides = match by_finger.each_ref().map(side) {
            [Some(left), Some(right)] => [left, right],
            [Some(only), None] | [None, Some(only)] => [only; 2],
            [None, None] => {
                return Err(GripperFault::MovesNoFinger);
            }
        };
        let unlimited = |joint: &&usize| !model.joints[**joint].upper.is_finite();
        if let Some(joint) = all.iter().find(unlimited) {
            let name = &model.joints[*joint].name;
            return Err(GripperFault::Unlimited(name.clone()));
        }
        let further = others
            .iter()
            .map(|joint| Further::find(*joint, model, probe))
            .collect();
        let followers = followers(&[leaders.clone(), others].concat(), model);
        Ok(Self {
            model,
            leaders,
            further,
            followers,
            sides,
        })
    }

    /// Returns the ways on which the gripper may open: the first and the last position of each
    /// leader, then of each further joint.
    fn ways(&self) -> Vec<Vec<(f64, f64)>> {
        let limits = |joint: &usize| {
            let Joint {
                kind, lower, upper, ..
            } = self.model.joints[*joint];
            match kind {
                // More than a turn repeats it, with fewer entries in each turn.
                JointKind::Revolute if upper - lower > TAU => (lower.max(-PI), upper.min(PI)),
                _ => (lower, upper),
            }
        };
        let turned =
            |(from, to): (f64, f64), falls: bool| if falls { (to, from) } else { (from, to) };
        // Joints may open in opposite directions. Bit n: the leader n falls.
        let all_fall = (1_usize << self.leaders.len()) - 1;
        let ways = [0, all_fall].into_iter().chain((1..all_fall).rev());
        let further = || {
            self.further
                .iter()
                .map(|own| turned(limits(&own.joint), own.falls))
        };
        let of = |way: usize| {
            let leaders = self
                .leaders
                .iter()
                .enumerate()
                .map(|(idx, joint)| turned(limits(joint), way >> idx & 1 == 1));
            leaders.chain(further()).collect()
        };
        ways.map(of).collect()
    }

    /// All joints with motors.
    fn motors(&self) -> Vec<usize> {
        self.leaders
            .iter()
            .copied()
            .chain(self.further.iter().map(|own| own.joint))
            .collect()
    }

    /// Returns the positions of all joints at a share of a way.
    fn posture(&self, ends: &[(f64, f64)], share: f64) -> Vec<f64> {
        let mut positions = vec![0.0; self.model.joints.len()];
        let motors = self.motors();
        for (motor, (from, to)) in motors.iter().zip(ends) {
            positions[*motor] = from + share * (to - from);
        }
        for Follower {
            joint,
            leader,
            factor,
            offset,
        } in &self.followers
        {
            positions[*joint] = factor * positions[motors[*leader]] + offset;
        }
        positions
    }

    /// The gripper with this table, on a way with these ends.
    fn gripper(self, table: &[Entry], ends: &[(f64, f64)]) -> Gripper {
        let first = table.first().map_or(0.0, |entry| entry.share);
        let last = table.last().map_or(1.0, |entry| entry.share);
        let gap_of = |entry: Option<&Entry>| entry.map_or(Gap::default(), |entry| entry.gap);
        let (closed, open) = (gap_of(table.first()), gap_of(table.last()));
        let travels = [open.left_m - closed.left_m, closed.right_m - open.right_m];
        let n_measured = self.leaders.len();
        // Fingers on the same side of an object share the force with which the other side presses.
        let n_on =
            [0, 1].map(|side| 1 + self.further.iter().filter(|own| own.side == side).count());
        let motors = self.motors();
        let leaders = motors
            .iter()
            .zip(ends)
            .enumerate()
            .map(|(idx, (joint, (from, to)))| {
                let side_of =
                    |idx: usize| self.further.get(idx - n_measured).map_or(0, |own| own.side);
                let sides: Vec<usize> = match idx < n_measured {
                    true => (0..2).filter(|side| self.sides[*side] == idx).collect(),
                    false => vec![side_of(idx)],
                };
                let moved: f64 = sides.iter().map(|side| travels[*side]).sum();
                let at = |share: f64| from + share * (to - from);
                let lever_m = (moved / (at(last) - at(first))).abs().max(LEAST_LEVER_M);
                let force_share = match sides[..] {
                    [side] => 1.0 / n_on[side] as f64,
                    _ => 1.0,
                };
                Leader {
                    joint: *joint,
                    closed: at(first),
                    open: at(last),
                    lever_m,
                    force_share,
                }
            });
        let leaders: Vec<Leader> = leaders.collect();
        let shared = |entry: &Entry| Entry {
            share: (entry.share - first) / (last - first),
            gap: entry.gap,
        };
        Gripper {
            leaders,
            n_measured,
            followers: self.followers,
            sides: self.sides,
            table: table.iter().map(shared).collect(),
            widest_m: open.width_m(),
        }
    }
}
