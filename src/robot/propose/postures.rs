//! Postures of the arm: one for driving, and seeds for inverse kinematics.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::GraspFrame;
use super::beyond_body;
use super::body::FULL_ARM;
use crate::description::{JointKind, RobotModel};
use crate::ik::{self, IkRequest};
use crate::layout::Named;
use crate::{Kinematics, RobotError, SelfContact};
use actcheck_data::{Pose, RobotRoles, Stream};

/// Random postures from which home is chosen.
const N_SAMPLES: u64 = 300;
/// Random seeds tried for each target.
const N_SEEDS: u64 = 25;
/// Pairs of links that overlap in this share of all postures always do.
const ALWAYS: f64 = 0.8;
/// Downward pitches of the hand: level, slanted, straight down.
const PITCHES_RAD: [f64; 3] = [0.0, 0.95, std::f64::consts::FRAC_PI_2];
/// Heights of the hand above the floor, for a mobile robot. Unit: metres.
const HEIGHTS_M: [f64; 2] = [0.55, 0.8];
/// The same for a fixed robot whose arm begins higher than [`HIGH_M`].
const HIGH_TABLE_M: [f64; 2] = [0.9, 1.1];
const HIGH_M: f64 = 1.05;
/// Root of a fixed robot that is higher than this is on the floor: no table is so high. Unit:
/// metres.
const ROOT_ON_FLOOR_M: f64 = 0.6;
/// Heights of the hand above the root, for a fixed arm. Unit: metres.
const ABOVE_M: [f64; 2] = [0.15, 0.35];
/// Distances of the hand from the first joint, as shares of the arm's length.
const SHARES: [f64; 2] = [0.5, 0.75];
/// Direction of the hand at home, for a fixed arm: aside, out of the way. Unit: radians.
const ASIDE_RAD: f64 = -1.3;

/// Largest turn of the hand of such an arm from the direction to its place: any. The fingers may
/// slant to one side of it. Unit: radians.
const LARGEST_TURN_RAD: f64 = std::f64::consts::PI;

pub(super) type Postures = (Vec<f64>, Vec<Vec<f64>>);

/// The robot with its root above the floor.
pub(super) struct Standing {
    pub(super) kinematics: Kinematics,
    arm: Vec<usize>,
    base: Vec<usize>,
    start: Vec<f64>,
    /// Whether a joint lets the robot move freely.
    floats: bool,
}

impl Standing {
    pub(super) fn new(
        roles: RobotRoles<'_>,
        model: &Arc<RobotModel>,
        grasp: GraspFrame,
    ) -> Result<Self, RobotError> {
        let RobotRoles { core, hand, .. } = roles;
        let root =
            Pose::upright([0.0, 0.0, core.mount_height_m], core.mount_turned_rad).to_isometry();
        let named = Named::find(roles, model)?;
        let kinematics = Kinematics::new(Arc::clone(model), root, grasp, named.camera)
            .with_passing(named.passing(model), named.links_of_hand(model))
            .with_followers(&named.layout.gripper);
        let arm = named.layout.arm.clone();
        let base: Vec<usize> = named.layout.base.iter().flatten().copied().collect();
        let mut start: Vec<f64> = model
            .joints
            .iter()
            .map(|joint| 0.0_f64.clamp(joint.lower, joint.upper))
            .collect();
        named
            .layout
            .gripper
            .set(&mut start, hand.max_opening_m / 2.0);
        Ok(Self {
            kinematics,
            arm,
            base,
            start,
            floats: model.floats,
        })
    }

    /// A search for its postures, with random ones that it drew.
    pub(super) fn search(&self) -> (Search<'_>, Vec<Vec<f64>>) {
        let (start, arm, base) = (self.start.clone(), self.arm.clone(), self.base.clone());
        let kinematics = &self.kinematics;
        let root_m = kinematics.links(&start)[0].translation.vector.z;
        let on_floor = base.is_empty() && (self.floats || root_m > ROOT_ON_FLOOR_M);
        let mut search = Search {
            kinematics,
            start,
            arm,
            base,
            contact: None,
            on_floor,
            near: None,
            n_drawn: 0,
        };
        let samples: Vec<Vec<f64>> = (0..N_SAMPLES).map(|_| search.random()).collect();
        search.contact = Some(contact(kinematics, &samples));
        (search, samples)
    }
}

/// Finds the posture at home and the seeds.
pub(super) fn find(
    roles: RobotRoles<'_>,
    model: &Arc<RobotModel>,
    grasp: GraspFrame,
    notes: &mut BTreeMap<&'static str, String>,
) -> Result<Postures, RobotError> {
    let standing = Standing::new(roles, model, grasp)?;
    let (mut search, samples) = standing.search();
    let is_fixed = roles.core.base_joints.is_none();
    let aside = if is_fixed { search.aside() } else { None };
    search.near.clone_from(&aside);
    if let Some(note) = notes.get_mut("arm_joints") {
        let (shoulder, length) = search.arm_reach();
        let _ = write!(note, "; it reaches {length:.2} m");
        if search.on_floor {
            let _ = write!(
                note,
                " from its first joint, {:.2} m above the floor",
                shoulder.z
            );
        }
    }
    let targets = search.targets();
    let mut postures: Vec<Vec<f64>> = targets
        .iter()
        .filter_map(|target| search.reach(target))
        .collect();
    beyond_body::add(&mut search, &targets, &mut postures);
    let home = match is_fixed {
        false => search.compact(samples, &postures),
        true => aside.or_else(|| postures.first().cloned()),
    };
    let home = home.unwrap_or_else(|| search.start.clone());
    notes.insert(
        "home",
        match is_fixed {
            false => "the hand is near the body, and no links overlap".to_owned(),
            true => "the hand points down beside the base".to_owned(),
        },
    );
    notes.insert(
        "postures",
        "reaching level, at a slant and down, near and far".to_owned(),
    );
    let of_arm = |posture: &Vec<f64>| -> Vec<f64> {
        search
            .arm
            .iter()
            .map(|idx| (posture[*idx] * 1e3).round() / 1e3 + 0.0)
            .collect()
    };
    let mut seeds: Vec<Vec<f64>> = postures.iter().map(of_arm).collect();
    seeds.dedup();
    Ok((
        within(model, &search.arm, of_arm(&home)),
        seeds
            .into_iter()
            .map(|s| within(model, &search.arm, s))
            .collect(),
    ))
}

/// Rounding must not leave the limits.
fn within(model: &RobotModel, arm: &[usize], posture: Vec<f64>) -> Vec<f64> {
    let joints = arm.iter().map(|idx| &model.joints[*idx]);
    posture
        .into_iter()
        .zip(joints)
        .map(|(position, joint)| position.clamp(joint.lower, joint.upper))
        .collect()
}

/// The pairs of links that overlap in some postures, but not in most.
fn contact(kinematics: &Kinematics, samples: &[Vec<f64>]) -> SelfContact {
    let all = SelfContact::new(kinematics, &[]);
    let mut counts: BTreeMap<(usize, usize), usize> = BTreeMap::new();
    for sample in samples {
        for pair in all.overlaps(&kinematics.links(sample)) {
            *counts.entry(pair).or_default() += 1;
        }
    }
    let most = ALWAYS * samples.len() as f64;
    let always: Vec<(usize, usize)> = counts
        .into_iter()
        .filter(|(_, count)| *count as f64 > most)
        .map(|(pair, _)| pair)
        .collect();
    all.without(&always)
}

/// A search for postures.
pub(super) struct Search<'a> {
    pub(super) kinematics: &'a Kinematics,
    start: Vec<f64>,
    pub(super) arm: Vec<usize>,
    pub(super) base: Vec<usize>,
    contact: Option<SelfContact>,
    /// Whether it is a fixed robot on the floor, rather than an arm on a table.
    on_floor: bool,
    /// A posture that others should be close to.
    near: Option<Vec<f64>>,
    n_drawn: u64,
}

impl Search<'_> {
    /// A random posture of the arm.
    pub(super) fn random(&mut self) -> Vec<f64> {
        let mut posture = self.start.clone();
        for idx in &self.arm {
            let joint = &self.kinematics.joints()[*idx];
            let (lower, upper) = (
                joint.lower.max(-std::f64::consts::PI),
                joint.upper.min(std::f64::consts::PI),
            );
            posture[*idx] = lower + (upper - lower) * Stream::new(7).unit(self.n_drawn);
            self.n_drawn += 1;
        }
        posture
    }

    pub(super) fn is_free(&self, posture: &[f64]) -> bool {
        let poses = self.kinematics.links(posture);
        self.contact
            .as_ref()
            .is_none_or(|contact| contact.overlaps(&poses).is_empty())
    }

    /// Where the arm begins, and its length.
    pub(super) fn arm_reach(&self) -> (Point3<f64>, f64) {
        let poses = self.kinematics.links(&self.start);
        let turning = self
            .arm
            .iter()
            .filter(|idx| self.kinematics.joints()[**idx].kind == JointKind::Revolute);
        let mut at: Vec<Point3<f64>> = turning
            .map(|idx| Point3::from(poses[idx + 1].translation.vector))
            .collect();
        at.push(Point3::from(
            self.kinematics.grasp(&self.start).translation.vector,
        ));
        let slides = self.arm.iter().map(|idx| &self.kinematics.joints()[*idx]);
        let slides: f64 = slides
            .filter(|joint| joint.kind == JointKind::Prismatic)
            .map(|j| j.upper - j.lower)
            .sum();
        let length: f64 = at.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum();
        (at[0], length + slides.min(0.5))
    }

    /// Poses of the hand in front of the robot.
    fn targets(&self) -> Vec<Isometry3<f64>> {
        let (shoulder, length) = self.arm_reach();
        let root = self.kinematics.links(&self.start)[0].translation.vector.z;
        let heights = match (self.base.is_empty(), self.on_floor) {
            (true, false) => ABOVE_M.map(|above| root + above.min(0.5 * length)),
            (true, true) if shoulder.z > HIGH_M => HIGH_TABLE_M,
            _ => HEIGHTS_M,
        };
        let mut targets = Vec::new();
        for pitch in self.pitches() {
            for (share, height) in SHARES
                .into_iter()
                .zip(heights)
                .chain(SHARES.into_iter().rev().zip(heights))
            {
                let place = Point3::new(shoulder.x + share * length, shoulder.y, height);
                targets.push(hand(&place, 0.0, pitch));
            }
        }
        targets
    }

    /// Downward pitches of the hand that the arm could have: that at the start if no joint changes
    /// it.
    pub(super) fn pitches(&self) -> Vec<f64> {
        self.kinematics
            .only_pitch(&self.arm, &self.start)
            .map_or(PITCHES_RAD.to_vec(), |pitch| vec![pitch])
    }

    /// A free posture that reaches a target; with a base, one that does not turn it if there is
    /// any.
    fn reach(&mut self, target: &Isometry3<f64>) -> Option<Vec<f64>> {
        let n_slides = self.base.len().min(2);
        let with = |search: &mut Self, n_base: usize| {
            let mut mobility = vec![0.0; search.start.len()];
            search
                .arm
                .iter()
                .chain(&search.base[..n_base])
                .for_each(|idx| mobility[*idx] = 1.0);
            search.reach_with(target, &mobility)
        };
        with(self, n_slides).or_else(|| {
            if self.base.is_empty() {
                None
            } else {
                with(self, self.base.len())
            }
        })
    }

    /// As [`Search::reach`], with these joints free.
    fn reach_with(&mut self, target: &Isometry3<f64>, mobility: &[f64]) -> Option<Vec<f64>> {
        // The fingers are alike, so the hand may be turned over.
        let over = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
        let reaches = [*target, target * over].map(|target| IkRequest {
            target,
            mobility: mobility.to_vec(),
        });
        let mut best: Option<(f64, Vec<f64>)> = None;
        for number in 0..2 * N_SEEDS {
            let seed = if number < 2 {
                self.near.clone().unwrap_or(self.start.clone())
            } else {
                self.random()
            };
            let reach = &reaches[usize::from(number % 2 == 1)];
            let Some(found) = self.solve(&seed, reach) else {
                continue;
            };
            if !self.is_free(&found) {
                continue;
            }
            let cost = self.strain(&found);
            if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                best = Some((cost, found));
            }
        }
        best.map(|(_, found)| found)
    }

    /// Inverse kinematics; an arm of few joints may turn the hand.
    pub(super) fn solve(&self, seed: &[f64], reach: &IkRequest) -> Option<Vec<f64>> {
        if reach
            .mobility
            .iter()
            .filter(|weight| **weight > 0.0)
            .count()
            >= FULL_ARM
        {
            return ik::solve(self.kinematics, seed, reach);
        }
        ik::solve_turned(self.kinematics, seed, reach, LARGEST_TURN_RAD).map(|(found, _)| found)
    }

    /// The direction in which the hand is, on the average of postures with the first joint in the
    /// middle of its range. `None` if that joint is not vertical. Unit: radians.
    pub(super) fn bearing(&self, samples: &[Vec<f64>]) -> Option<f64> {
        let first = *self.arm.first()?;
        let joint = &self.kinematics.joints()[first];
        let root = self.kinematics.links(&self.start)[joint.parent].rotation;
        let axis = root * (joint.origin.rotation * joint.axis.into_inner());
        if joint.kind != JointKind::Revolute || axis.z.abs() < 0.99 {
            return None;
        }
        let shoulder = self.arm_reach().0.coords;
        let hand = |sample: &Vec<f64>| {
            let mut posture = sample.clone();
            posture[first] = f64::midpoint(joint.lower, joint.upper);
            self.kinematics.grasp(&posture).translation.vector - shoulder
        };
        let sum = samples
            .iter()
            .map(hand)
            .fold(Vector3::zeros(), |sum, hand| sum + hand);
        Some(libm::atan2(sum.y, sum.x))
    }

    /// The start with the arm in a posture of a profile.
    pub(super) fn with_arm(&self, posture: &[f64]) -> Vec<f64> {
        let mut positions = self.start.clone();
        for (idx, position) in self.arm.iter().zip(posture) {
            positions[*idx] = *position;
        }
        positions
    }

    /// The weights of joints if the arm alone moves.
    pub(super) fn mobility(&self) -> Vec<f64> {
        let mut mobility = vec![0.0; self.start.len()];
        self.arm.iter().for_each(|idx| mobility[*idx] = 1.0);
        mobility
    }

    /// How close the joints are to their limits, and how far the base has turned.
    fn strain(&self, posture: &[f64]) -> f64 {
        let of_joint = |idx: &usize| {
            let joint = &self.kinematics.joints()[*idx];
            let (lower, upper) = (joint.lower.max(-3.2), joint.upper.min(3.2));
            let middle = f64::midpoint(lower, upper);
            let off = ((posture[*idx] - middle) / (upper - middle).max(1e-6)).powi(2);
            match &self.near {
                // The first joint turns the arm towards objects anyway.
                Some(near) if self.arm.first() == Some(idx) => {
                    0.1 * (posture[*idx] - near[*idx]).powi(2)
                }
                Some(near) => (posture[*idx] - near[*idx]).powi(2) + 0.2 * off,
                None => 0.2 * off + posture[*idx].powi(2),
            }
        };
        self.arm.iter().map(of_joint).sum()
    }

    /// The free posture with the arm nearest to the body, not in front of it.
    fn compact(&self, samples: Vec<Vec<f64>>, postures: &[Vec<f64>]) -> Option<Vec<f64>> {
        let rest = |posture: &Vec<f64>| {
            let mut posture = posture.clone();
            self.base.iter().for_each(|idx| posture[*idx] = 0.0);
            posture
        };
        let all = std::iter::once(self.start.clone())
            .chain(samples)
            .chain(postures.iter().map(rest));
        let mut rated: Vec<(f64, Vec<f64>)> = all
            .map(|posture| (self.spread(&posture), posture))
            .collect();
        rated.sort_by(|a, b| a.0.total_cmp(&b.0));
        rated
            .into_iter()
            .map(|(_, posture)| posture)
            .find(|posture| self.is_free(posture))
    }

    /// How far the arm reaches beyond the body, and below 30 cm.
    fn spread(&self, posture: &[f64]) -> f64 {
        let poses = self.kinematics.links(posture);
        let hand = self.kinematics.grasp(posture).translation.vector;
        let arm = self
            .arm
            .iter()
            .map(|idx| poses[idx + 1].translation.vector)
            .chain([hand]);
        let of = |place: Vector3<f64>| {
            place.xy().norm() + (0.3 - place.z).max(0.0) * 3.0 + (place.z - 1.2).max(0.0)
        };
        let reach = arm.map(of).fold(0.0, f64::max);
        let still: f64 = self.arm.iter().map(|idx| posture[*idx].abs()).sum();
        reach + 0.01 * still
    }

    /// The hand pointing down, beside a fixed base.
    fn aside(&mut self) -> Option<Vec<f64>> {
        let (shoulder, length) = self.arm_reach();
        let root = self.kinematics.links(&self.start)[0].translation.vector.z;
        for pitch in self.pitches().into_iter().rev() {
            for share in [0.55, 0.4, 0.7] {
                let (sin, cos) = (libm::sin(ASIDE_RAD), libm::cos(ASIDE_RAD));
                let away = share * length;
                let height = root + 0.35_f64.min(0.6 * length);
                let place = Point3::new(shoulder.x + away * cos, shoulder.y + away * sin, height);
                if let Some(found) = self.reach(&hand(&place, ASIDE_RAD, pitch)) {
                    return Some(found);
                }
            }
        }
        None
    }
}

/// A pose of the hand with a heading and a downward pitch, its fingers closing horizontally.
pub(super) fn hand(place: &Point3<f64>, heading: f64, pitch: f64) -> Isometry3<f64> {
    let (sin, cos) = (libm::sin(heading), libm::cos(heading));
    let forward = Vector3::new(
        cos * libm::cos(pitch),
        sin * libm::cos(pitch),
        -libm::sin(pitch),
    );
    let left = Vector3::new(-sin, cos, 0.0);
    let axes = Matrix3::from_columns(&[forward, left, forward.cross(&left)]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    Isometry3::from_parts(Translation3::from(place.coords), rotation)
}
