//! How the head has to stand to look at a point.

use nalgebra::{Matrix2, Point3, Vector2};

use crate::world::{Kinematics, Layout};

/// Change of a joint by which its effect on the gaze is measured. Unit: radians.
const PROBE_RAD: f64 = 1e-4;
/// Damping of the least squares: where a joint does not turn the gaze, it stays.
const DAMPING: f64 = 1e-6;
const N_ROUNDS: usize = 12;
/// Largest change of a joint in a round. Unit: radians.
const LARGEST_RAD: f64 = 0.5;

/// The posture with the head turned so that a point is in the middle of the picture, or as near to it as the head's joints
/// allow. Without such joints, the posture as it is. Frame: world, by the base's belief.
pub fn towards(kinematics: &Kinematics, layout: &Layout, positions: &[f64], point: &Point3<f64>) -> Vec<f64> {
    let mut positions = positions.to_vec();
    for _ in 0..N_ROUNDS {
        let miss = off(kinematics, &positions, point);
        let effects: Vec<Vector2<f64>> = layout
            .head
            .iter()
            .map(|joint| {
                let mut probed = positions.clone();
                probed[*joint] += PROBE_RAD;
                (off(kinematics, &probed, point) - miss) / PROBE_RAD
            })
            .collect();
        let squared =
            effects.iter().fold(Matrix2::identity() * DAMPING, |sum, effect| sum + effect * effect.transpose());
        let Some(inverse) = squared.try_inverse() else { break };
        for (joint, effect) in layout.head.iter().zip(&effects) {
            let change = -effect.dot(&(inverse * miss));
            let limits = &kinematics.joints()[*joint];
            let wanted = positions[*joint] + change.clamp(-LARGEST_RAD, LARGEST_RAD);
            positions[*joint] = wanted.clamp(limits.lower, limits.upper);
        }
    }
    positions
}

/// Angles by which a point is left of the gaze and above it. Unit: radians.
fn off(kinematics: &Kinematics, positions: &[f64], point: &Point3<f64>) -> Vector2<f64> {
    let seen = kinematics.camera(positions).inverse() * point;
    let level = (seen.x * seen.x + seen.y * seen.y).sqrt();
    Vector2::new(libm::atan2(seen.y, seen.x), libm::atan2(seen.z, level))
}
