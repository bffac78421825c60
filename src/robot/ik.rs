//! Inverse kinematics of the grasp link, within the joint limits.

use nalgebra::{Isometry3, Matrix6, UnitQuaternion, Vector3, Vector6};

use crate::Kinematics;

/// A request to the solver.
#[derive(Debug, Clone)]
pub struct IkRequest {
    /// Target pose of the grasp link. Frame: that of the kinematics' root.
    pub target: Isometry3<f64>,
    /// Weight of each joint, from 0 (held fixed) to 1. Shape: one per joint.
    pub mobility: Vec<f64>,
}

/// Position error that counts as reached. Unit: metres. A tenth of the sensing errors.
const REACHED_M: f64 = 5e-4;
/// Angle error that counts as reached. Unit: radians.
const REACHED_RAD: f64 = 2e-3;
/// Damping of the least squares: keeps steps small near singular postures.
const DAMPING: f64 = 0.03;
const MOST_ITERATIONS: usize = 80;
/// Iterations in which an arm of few joints keeps the heading of its target if it can.
const HEADED_ITERATIONS: usize = 30;
/// Fewest of these, after which a heading that follows no further is let go.
const FEW_ITERATIONS: usize = 5;
/// A heading that changes by less in an iteration follows no further. Unit: radians.
const FOLLOWS_RAD: f64 = 2e-3;
/// The search ends without a solution if the error stays above this factor of the least one for so
/// many iterations.
const LEAST_PROGRESS: f64 = 0.99;
const MOST_WITHOUT_PROGRESS: usize = 12;
/// Weight of the heading in these.
const HEADING_WEIGHT: f64 = 0.2;
/// Largest change of a joint in one iteration. Units: metres or radians.
const LARGEST_STEP: f64 = 0.3;

/// Returns joint positions near `seed` that reach the target, or `None` if the solver does not
/// converge.
///
/// Uses damped least squares; a joint that reaches its limit is held there and the others are
/// solved again. Most targets that are tried are out of reach: the search ends when it gets no
/// nearer.
pub fn solve(kinematics: &Kinematics, seed: &[f64], reach: &IkRequest) -> Option<Vec<f64>> {
    let mut positions = started(kinematics, seed);
    let mut jacobian = vec![Vector6::zeros(); positions.len()];
    let mut joints = Mobile::new(&reach.mobility);
    let mut progress = Progress::default();
    for _ in 0..MOST_ITERATIONS {
        let grasp = kinematics.fill_jacobian(&positions, &mut jacobian);
        let error = pose_error(&grasp, &reach.target);
        if is_reached(&error) {
            return Some(positions);
        }
        if progress.has_ended(&error) {
            return None;
        }
        joints.step(kinematics, &mut positions, &jacobian, &error);
        kinematics.follow(&mut positions);
    }
    None
}

/// As [`solve`] for an arm with fewer than six joints, which moves its hand in a vertical plane:
/// the target may turn about the vertical, by at most `most_rad`. Returns the turn too. Unit:
/// radians.
pub fn solve_turned(
    kinematics: &Kinematics,
    seed: &[f64],
    reach: &IkRequest,
    most_rad: f64,
) -> Option<(Vec<f64>, f64)> {
    let mut positions = started(kinematics, seed);
    let mut jacobian = vec![Vector6::zeros(); positions.len()];
    let mut joints = Mobile::new(&reach.mobility);
    // At first the target pulls the heading along: a joint that turns the hand alone follows.
    let (mut pulls, mut last_turn) = (true, f64::INFINITY);
    let mut progress = Progress::default();
    for iteration in 0..MOST_ITERATIONS {
        let grasp = kinematics.fill_jacobian(&positions, &mut jacobian);
        let turn = heading_of(&(grasp.rotation * reach.target.rotation.inverse()));
        let target = turned(&reach.target, turn);
        let mut error = pose_error(&grasp, &target);
        if is_reached(&error) && (!pulls || turn.abs() < REACHED_RAD) {
            return (turn.abs() <= most_rad).then_some((positions, turn));
        }
        let follows = (turn - last_turn).abs() > FOLLOWS_RAD;
        pulls = pulls && iteration < HEADED_ITERATIONS && (follows || iteration < FEW_ITERATIONS);
        last_turn = turn;
        if !pulls && progress.has_ended(&error) {
            return None;
        }
        let weight = if pulls { HEADING_WEIGHT } else { 0.0 };
        error[5] = (error[5] - turn) * weight;
        jacobian.iter_mut().for_each(|column| column[5] *= weight);
        joints.step(kinematics, &mut positions, &jacobian, &error);
        kinematics.follow(&mut positions);
    }
    None
}

/// The least error so far, and since when.
#[derive(Default)]
struct Progress {
    least: Option<f64>,
    n_without: usize,
}

impl Progress {
    /// Whether the error has not become notably smaller for some iterations.
    fn has_ended(&mut self, error: &Vector6<f64>) -> bool {
        let now = error.norm();
        match self.least {
            Some(least) if now > least * LEAST_PROGRESS => self.n_without += 1,
            _ => (self.least, self.n_without) = (Some(now), 0),
        }
        self.n_without >= MOST_WITHOUT_PROGRESS
    }
}

/// A target that is turned about the vertical through its place.
pub fn turned(target: &Isometry3<f64>, turn: f64) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn);
    Isometry3::from_parts(target.translation, turn * target.rotation)
}

/// The angle of the part of a rotation that is about the vertical. Unit: radians.
fn heading_of(rotation: &UnitQuaternion<f64>) -> f64 {
    let angle = 2.0 * libm::atan2(rotation.k, rotation.w);
    libm::atan2(libm::sin(angle), libm::cos(angle))
}

/// The seed within the joint limits.
fn started(kinematics: &Kinematics, seed: &[f64]) -> Vec<f64> {
    let mut positions = seed.to_vec();
    for (position, joint) in positions.iter_mut().zip(kinematics.joints()) {
        *position = position.clamp(joint.lower, joint.upper);
    }
    kinematics.follow(&mut positions);
    positions
}

fn is_reached(error: &Vector6<f64>) -> bool {
    error.fixed_rows::<3>(0).norm() < REACHED_M && error.fixed_rows::<3>(3).norm() < REACHED_RAD
}

/// The joints that may move: few of a robot with many joints.
struct Mobile {
    /// Their indices and mobility.
    joints: Vec<(usize, f64)>,
    /// The same in the present iteration: 0 for those that are held at a limit.
    free: Vec<(usize, f64)>,
    /// Their changes. Units: metres or radians.
    change: Vec<f64>,
}

impl Mobile {
    fn new(mobility: &[f64]) -> Self {
        let weights = mobility.iter().copied().enumerate();
        let joints: Vec<(usize, f64)> = weights.filter(|(_, weight)| *weight != 0.0).collect();
        Self {
            free: Vec::with_capacity(joints.len()),
            change: Vec::with_capacity(joints.len()),
            joints,
        }
    }

    /// Performs one iteration. Joints that would pass a limit stop at it, and the others
    /// compensate.
    fn step(
        &mut self,
        kinematics: &Kinematics,
        positions: &mut [f64],
        jacobian: &[Vector6<f64>],
        error: &Vector6<f64>,
    ) {
        self.free.clone_from(&self.joints);
        loop {
            least_squares(jacobian, error, &self.free, &mut self.change);
            let mut held_one = false;
            for ((idx, weight), change) in self.free.iter_mut().zip(&self.change) {
                let (joint, wanted) = (&kinematics.joints()[*idx], positions[*idx] + change);
                let outside = wanted < joint.lower - 1e-9 || wanted > joint.upper + 1e-9;
                if *weight > 0.0
                    && outside
                    && at_limit(positions[*idx], wanted, joint.lower, joint.upper)
                {
                    *weight = 0.0;
                    held_one = true;
                }
            }
            if !held_one {
                for ((idx, _), change) in self.free.iter().zip(&self.change) {
                    let joint = &kinematics.joints()[*idx];
                    positions[*idx] = (positions[*idx] + change).clamp(joint.lower, joint.upper);
                }
                return;
            }
        }
    }
}

/// Whether the joint is already at the limit that it would pass (to a millionth of a radian or
/// metre).
fn at_limit(position: f64, wanted: f64, lower: f64, upper: f64) -> bool {
    (wanted < lower && position <= lower + 1e-6) || (wanted > upper && position >= upper - 1e-6)
}

/// Computes W·Jᵀ·(J·W·Jᵀ + λ²·I)⁻¹·e, scaled down so that no component exceeds the largest step.
/// `jacobian`: its columns, one for each joint. Writes the changes of the `free` joints.
///
/// Sums are in a fixed order: products of matrices whose size is only known at run time use other
/// instructions, which round differently, on other processors.
fn least_squares(
    jacobian: &[Vector6<f64>],
    error: &Vector6<f64>,
    free: &[(usize, f64)],
    change: &mut Vec<f64>,
) {
    change.clear();
    let mut square = Matrix6::identity() * (DAMPING * DAMPING);
    for (idx, weight) in free.iter().filter(|(_, weight)| *weight != 0.0) {
        let column = &jacobian[*idx];
        square += column * (column * *weight).transpose();
    }
    let Some(factors) = square.cholesky() else {
        change.resize(free.len(), 0.0);
        return;
    };
    let solved = factors.solve(error);
    let of_joint = |(idx, weight): &(usize, f64)| match *weight == 0.0 {
        true => 0.0,
        false => weight * jacobian[*idx].dot(&solved),
    };
    change.extend(free.iter().map(of_joint));
    let largest = change
        .iter()
        .fold(0.0, |largest: f64, change| largest.max(change.abs()));
    if largest > LARGEST_STEP {
        change
            .iter_mut()
            .for_each(|change| *change *= LARGEST_STEP / largest);
    }
}

/// Returns the difference between two poses: linear part (metres) above angular part (radians).
fn pose_error(from: &Isometry3<f64>, to: &Isometry3<f64>) -> Vector6<f64> {
    let linear = to.translation.vector - from.translation.vector;
    let angular = (to.rotation * from.rotation.inverse()).scaled_axis();
    Vector6::new(
        linear.x, linear.y, linear.z, angular.x, angular.y, angular.z,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::start::tests::lonely;

    /// With five of its joints, an arm reaches the places and slants of its own postures, whatever
    /// their heading: the hand turns by the angle that is returned, and nothing else about the
    /// target changes.
    #[test]
    fn an_arm_of_five_joints_reaches_targets_that_are_turned_by_an_unreachable_angle() {
        let (kinematics, layout, start) = lonely();
        let five = &layout.arm[..5];
        let mut mobility = vec![0.0; start.len()];
        five.iter().for_each(|idx| mobility[*idx] = 1.0);
        let (mut n_reached, mut n_exact) = (0, 0);
        for trial in 0..40 {
            let mut posture = start.clone();
            for (place, idx) in five.iter().enumerate() {
                let off = libm::sin(f64::from(trial) * 1.7 + place as f64 * 2.3) * 0.25;
                let joint = &kinematics.joints()[*idx];
                posture[*idx] = (posture[*idx] + off).clamp(joint.lower, joint.upper);
            }
            let target = turned(
                &kinematics.grasp(&posture),
                0.15 * libm::cos(f64::from(trial)),
            );
            let reach = IkRequest {
                target,
                mobility: mobility.clone(),
            };
            n_exact += u32::from(solve(&kinematics, &start, &reach).is_some());
            let Some((found, turn)) = solve_turned(&kinematics, &start, &reach, 0.3) else {
                continue;
            };
            n_reached += 1;
            let error = pose_error(&kinematics.grasp(&found), &turned(&target, turn));
            assert!(is_reached(&error), "{error}");
            assert!(turn.abs() <= 0.3, "{turn}");
            let moved = (0..start.len())
                .filter(|idx| !five.contains(idx))
                .all(|idx| found[idx] == start[idx]);
            assert!(moved, "only the five joints move");
        }
        assert!(
            n_reached >= 36 && n_exact < n_reached,
            "{n_reached} reached, {n_exact} without a turn"
        );
        // A larger turn than allowed is not a solution.
        let target = turned(&kinematics.grasp(&start), 1.0);
        let found = solve_turned(&kinematics, &start, &IkRequest { target, mobility }, 0.1);
        assert!(found.is_none_or(|(_, turn)| turn.abs() <= 0.1));
    }
}
