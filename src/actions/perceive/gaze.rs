//! Computes the head's joint positions for looking at a point.

use nalgebra::{Matrix2, Point3, Vector2};

use crate::operator::Operator;
use actcheck_world::{Kinematics, Layout, SelfContact};

/// Joint displacement used to measure its effect on the gaze. Unit: radians.
const PROBE_RAD: f64 = 1e-4;
/// Damping of the least squares: joints that do not turn the gaze stay in place.
const DAMPING: f64 = 1e-6;
const N_ROUNDS: usize = 12;
/// Number of postures checked on the way.
const N_CHECKS: u32 = 8;
/// A point this close to the image centre counts as looked at. Unit: radians.
const SEEN_RAD: f64 = 0.05;
/// Largest change of a joint per round. Unit: radians.
const LARGEST_RAD: f64 = 0.5;

/// The posture with the head turned so that a point is at the centre of the picture, or as close to
/// it as the head's joints allow. Without head joints, the posture is returned unchanged. Frame:
/// world, by the base's belief.
pub fn towards(
    kinematics: &Kinematics,
    layout: &Layout,
    positions: &[f64],
    point: &Point3<f64>,
) -> Vec<f64> {
    let turned = self::turned(kinematics, layout, positions.to_vec(), point);
    if off(kinematics, &turned, point).norm() < SEEN_RAD {
        return turned;
    }
    // If the short way round hits a joint limit, the long way may not.
    let other = self::turned(
        kinematics,
        layout,
        ahead(kinematics, layout, positions),
        point,
    );
    let miss = |posture: &[f64]| off(kinematics, posture, point).norm();
    if miss(&other) < miss(&turned) {
        other
    } else {
        turned
    }
}

/// The posture with the head turned towards a point like [`towards`], but only as far as the head
/// does not collide with the arm.
pub fn safely_towards(robot: &Operator<'_>, point: &Point3<f64>) -> Vec<f64> {
    let (kinematics, start) = (robot.kinematics(), robot.commanded());
    let turned = towards(kinematics, robot.layout(), start, point);
    let itself = SelfContact::new(kinematics, &[start.to_vec()]);
    let free =
        legs(start, &turned).take_while(|posture| !itself.touches(&kinematics.links(posture)));
    free.last().unwrap_or_else(|| start.to_vec())
}

/// Postures that turn the head towards a point. Where the arm is in the way of the straight turn,
/// one joint of the head turns before the others, or the head looks ahead first; if that does not
/// help, it turns as [`safely_towards`] does.
pub fn way_towards(robot: &Operator<'_>, point: &Point3<f64>) -> Vec<Vec<f64>> {
    let (kinematics, layout, start) = (robot.kinematics(), robot.layout(), robot.commanded());
    let turned = towards(kinematics, layout, start, point);
    let itself = SelfContact::new(kinematics, &[start.to_vec()]);
    let is_free = |from: &[f64], to: &[f64]| {
        legs(from, to).all(|posture| !itself.touches(&kinematics.links(&posture)))
    };
    if is_free(start, &turned) {
        return vec![turned];
    }
    let one_first = layout.head.iter().map(|joint| {
        let mut first = start.to_vec();
        first[*joint] = turned[*joint];
        first
    });
    let ahead = ahead(kinematics, layout, start);
    let first = one_first
        .chain([ahead])
        .find(|first| is_free(start, first) && is_free(first, &turned));
    first.map_or_else(
        || vec![safely_towards(robot, point)],
        |first| vec![first, turned],
    )
}

/// A posture with the head turned ahead, as far as its joints allow.
fn ahead(kinematics: &Kinematics, layout: &Layout, positions: &[f64]) -> Vec<f64> {
    let mut ahead = positions.to_vec();
    for joint in &layout.head {
        let limits = &kinematics.joints()[*joint];
        ahead[*joint] = 0.0_f64.clamp(limits.lower, limits.upper);
    }
    ahead
}

/// Postures on the straight way from one to another.
fn legs(from: &[f64], to: &[f64]) -> impl Iterator<Item = Vec<f64>> {
    (1..=N_CHECKS).map(move |step| {
        let share = f64::from(step) / f64::from(N_CHECKS);
        from.iter()
            .zip(to)
            .map(|(from, to)| from + (to - from) * share)
            .collect()
    })
}

/// The result of turning the head towards a point from a given posture.
fn turned(
    kinematics: &Kinematics,
    layout: &Layout,
    mut positions: Vec<f64>,
    point: &Point3<f64>,
) -> Vec<f64> {
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
        let squared = effects
            .iter()
            .fold(Matrix2::identity() * DAMPING, |sum, effect| {
                sum + effect * effect.transpose()
            });
        let Some(inverse) = squared.try_inverse() else {
            break;
        };
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

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::Arc;

    use super::*;
    use actcheck_base::Files;
    use actcheck_data::RobotStart;
    use actcheck_world::geometry;

    /// Regression: a head turned far to the right could not look ahead again, because the short way
    /// crosses a joint limit of the neck.
    #[test]
    fn the_head_can_look_ahead_from_any_posture() {
        let path = Path::new("models/robots/mobile_manipulator.toml");
        let profile = actcheck_config::robot::read(&Files::Shipped, path)
            .expect("the shipped robot is valid")
            .complete()
            .expect("it states all roles");
        let start = RobotStart {
            profile: Arc::new(profile),
            base: [0.0; 3],
            root_height_m: 0.0,
            knows: Arc::new([]),
        };
        let (kinematics, layout, mut posture) =
            geometry(&start).expect("the shipped robot is valid");
        for pan in [-3.8, -3.0, -1.0, 0.0, 1.7] {
            posture[layout.head[0]] = pan;
            for point in [[1.0, 0.0, 0.7], [0.8, 0.6, 0.4], [0.3, -1.0, 0.0]].map(Point3::from) {
                let found = towards(&kinematics, &layout, &posture, &point);
                assert!(
                    off(&kinematics, &found, &point).norm() < SEEN_RAD,
                    "from {pan} to {point}: {found:?}"
                );
            }
        }
    }
}
