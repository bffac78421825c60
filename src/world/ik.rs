//! Inverse kinematics of the grasp link, within the joint limits.

use nalgebra::{Isometry3, Matrix6, Vector6};

use crate::Kinematics;

/// A request to the solver.
#[derive(Debug, Clone)]
pub struct Reach {
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
/// Largest change of a joint in one iteration. Units: metres or radians.
const LARGEST_STEP: f64 = 0.3;

/// Returns joint positions near `seed` that reach the target, or `None` if the solver does not converge.
///
/// Uses damped least squares; a joint that reaches its limit is held there and the others are solved again.
pub fn solve(kinematics: &Kinematics, seed: &[f64], reach: &Reach) -> Option<Vec<f64>> {
    approach(kinematics, seed, reach).ok()
}

/// Returns joint positions near `seed` that come as close to the target as the solver gets: for arms with fewer than six
/// joints, which reach few orientations.
pub fn nearest(kinematics: &Kinematics, seed: &[f64], reach: &Reach) -> Vec<f64> {
    approach(kinematics, seed, reach).unwrap_or_else(|nearest| nearest)
}

/// The error has the last positions of the solver, which do not reach the target.
fn approach(kinematics: &Kinematics, seed: &[f64], reach: &Reach) -> Result<Vec<f64>, Vec<f64>> {
    let mut positions = seed.to_vec();
    for (position, joint) in positions.iter_mut().zip(kinematics.joints()) {
        *position = position.clamp(joint.lower, joint.upper);
    }
    kinematics.follow(&mut positions);
    for _ in 0..MOST_ITERATIONS {
        let (grasp, jacobian) = kinematics.grasp_jacobian(&positions);
        let error = pose_error(&grasp, &reach.target);
        if error.fixed_rows::<3>(0).norm() < REACHED_M && error.fixed_rows::<3>(3).norm() < REACHED_RAD {
            return Ok(positions);
        }
        step(kinematics, &mut positions, &jacobian, &error, &reach.mobility);
        kinematics.follow(&mut positions);
    }
    Err(positions)
}

/// Performs one iteration. Joints that would pass a limit stop at it, and the others compensate.
fn step(
    kinematics: &Kinematics,
    positions: &mut [f64],
    jacobian: &[Vector6<f64>],
    error: &Vector6<f64>,
    mobility: &[f64],
) {
    let mut free = mobility.to_vec();
    for _ in 0..positions.len() {
        let change = least_squares(jacobian, error, &free);
        let mut held_one = false;
        for (idx, joint) in kinematics.joints().iter().enumerate() {
            let wanted = positions[idx] + change[idx];
            let outside = wanted < joint.lower - 1e-9 || wanted > joint.upper + 1e-9;
            if free[idx] > 0.0 && outside && at_limit(positions[idx], wanted, joint.lower, joint.upper) {
                free[idx] = 0.0;
                held_one = true;
            }
        }
        if !held_one {
            for (idx, joint) in kinematics.joints().iter().enumerate() {
                positions[idx] = (positions[idx] + change[idx]).clamp(joint.lower, joint.upper);
            }
            return;
        }
    }
}

/// Whether the joint is already at the limit that it would pass (to a millionth of a radian or metre).
fn at_limit(position: f64, wanted: f64, lower: f64, upper: f64) -> bool {
    (wanted < lower && position <= lower + 1e-6) || (wanted > upper && position >= upper - 1e-6)
}

/// Computes W·Jᵀ·(J·W·Jᵀ + λ²·I)⁻¹·e, scaled down so that no component exceeds the largest step. `jacobian`: its columns,
/// one for each joint.
///
/// Sums are in a fixed order: products of matrices whose size is only known at run time use other instructions, which round
/// differently, on other processors.
fn least_squares(jacobian: &[Vector6<f64>], error: &Vector6<f64>, mobility: &[f64]) -> Vec<f64> {
    let mut square = Matrix6::identity() * (DAMPING * DAMPING);
    for (column, weight) in jacobian.iter().zip(mobility).filter(|(_, weight)| **weight != 0.0) {
        square += column * (column * *weight).transpose();
    }
    let Some(factors) = square.cholesky() else { return vec![0.0; mobility.len()] };
    let solved = factors.solve(error);
    let mut change: Vec<f64> =
        jacobian.iter().zip(mobility).map(|(column, weight)| weight * column.dot(&solved)).collect();
    let largest = change.iter().fold(0.0, |largest: f64, change| largest.max(change.abs()));
    if largest > LARGEST_STEP {
        change.iter_mut().for_each(|change| *change *= LARGEST_STEP / largest);
    }
    change
}

/// Returns the difference between two poses: linear part (metres) above angular part (radians).
fn pose_error(from: &Isometry3<f64>, to: &Isometry3<f64>) -> Vector6<f64> {
    let linear = to.translation.vector - from.translation.vector;
    let angular = (to.rotation * from.rotation.inverse()).scaled_axis();
    Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z)
}
