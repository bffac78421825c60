//! The mass that a push on the hand meets.

use nalgebra::{Matrix3, Point3, Vector3};

use crate::robot::SimulatedRobot;
use actcheck_robot::{Twist, inertias};

/// Length of the push: a substep of the default physics. Unit: seconds.
const PUSH_SECS: f64 = 1.0 / 960.0;
/// An arm is light if a push meets less than this in some direction. Held objects have masses of
/// this order, and the hand then moves within a step as they push it. The lightest shipped arm has
/// 1.1 kg. Unit: kilograms.
pub(super) const LIGHT_KG: f64 = 0.8;
/// The engine moves the hand alone only while it touches less than this share of the least mass
/// that a push meets: the arm answers a push one step later, and swings with an object of nearly
/// its own mass, which then slips. With the shipped arm, that begins at 0.7 kg.
pub(super) const CARRIED_SHARE: f64 = 0.5;

/// Returns the least mass that a push at the grasp frame meets in any direction: the robot's
/// effective mass there, with the resistance of its motors during the push. Returns `None` if
/// the hand can't move alone.
///
/// Source: O. Khatib, "Inertial properties in robotic manipulation: an object-level framework", 1995.
pub(super) fn least_effective_mass_kg(robot: &SimulatedRobot) -> Option<f64> {
    let joints: Vec<usize> = robot.joints_to(robot.hand.as_ref()?.link).collect();
    let poses = robot.kinematics.links(&robot.positions);
    let at_rest = vec![0.0; robot.motors.len()];
    let resistances = robot
        .motors
        .iter()
        .zip(&robot.model.joints)
        .map(|(motor, joint)| {
            motor.armature
                + PUSH_SECS * (joint.damping + motor.damping + PUSH_SECS * motor.stiffness)
        });
    let inertias = inertias(&robot.model, &poses, &at_rest).with_rotors(resistances);
    let point = Point3::from(robot.kinematics.grasp(&robot.positions).translation.vector);
    let column = |axis: usize| {
        let change = inertias.answer(&joints, &Twist::by_force(&Vector3::ith(axis, 1.0), &point));
        change.shift + change.turn.cross(&point.coords)
    };
    let mobility = Matrix3::from_columns(&[column(0), column(1), column(2)]);
    Some(1.0 / mobility.symmetric_eigenvalues().max())
}

#[cfg(test)]
mod tests {
    use crate::gripper_tests::{hand, turning};
    use crate::robot::tests::alone;
    use crate::simulation::tests::bodies;
    use actcheck_base::Files;
    use std::path::Path;

    /// A hand on a vertical slide yields along the slide alone. Its mass there is that of the
    /// links, with the resistance of the motor.
    #[test]
    fn the_effective_mass_of_a_hand_on_a_slide_is_its_own() {
        let world = alone(hand(
            &turning(0.0, 0.6),
            &turning(-0.6, 0.0),
            &["left", "right"],
        ));
        let robot = &bodies(&world).robot;
        let secs = super::PUSH_SECS;
        let resistance = secs * (secs * robot.motors[0].stiffness + robot.motors[0].damping);
        // The palm and two fingers.
        let expected = 0.3 + resistance;
        let found = super::least_effective_mass_kg(robot).expect("it has a hand");
        assert!(
            (found / expected - 1.0).abs() < 1e-9,
            "{found} kg instead of {expected} kg"
        );
    }

    #[test]
    fn the_shipped_arms_are_not_light() {
        for name in ["mobile_manipulator", "fixed_arm"] {
            let path = format!("models/robots/{name}.toml");
            let profile = actcheck_config::robot::read(&Files::Shipped, Path::new(&path));
            let profile = profile.expect("the shipped robot is valid");
            let world = alone(profile.complete().expect("it states all roles"));
            let mass_kg =
                super::least_effective_mass_kg(&bodies(&world).robot).expect("it has a hand");
            assert!(
                mass_kg > super::LIGHT_KG && !bodies(&world).robot.is_light,
                "{name}: {mass_kg} kg"
            );
        }
    }
}
