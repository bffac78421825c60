//! How far the joints can move in a control tick: a bound from their speeds and their motors.

use crate::motor::Motor;
use crate::robot::SimulatedRobot;
use actcheck_robot::Joint;

/// Returns how far each joint can move in a control tick: at its speed now or at that of its
/// setpoint, and to its setpoint. Units: metres or radians.
///
/// Blocked fingers are far behind their setpoints. For a robot of many pieces, whose ticks take
/// long if the engine moves more of it than the hand, the bound is closer: joints approach
/// their setpoints only as fast as their damping lets them, and those without a motor move with
/// their leaders.
pub(super) fn spans(
    robot: &SimulatedRobot,
    positions: &[f64],
    velocities: &[f64],
    tick_secs: f64,
    overshoot: f64,
) -> Vec<f64> {
    bounds(
        robot,
        [positions, velocities],
        tick_secs,
        overshoot,
        robot.model.has_many_pieces(),
    )
}

fn bounds(
    robot: &SimulatedRobot,
    [positions, velocities]: [&[f64]; 2],
    tick_secs: f64,
    overshoot: f64,
    is_close: bool,
) -> Vec<f64> {
    let motors = || robot.motors.iter().zip(&robot.model.joints).enumerate();
    let of_joint = |(idx, (motor, joint)): (usize, (&Motor, &Joint))| {
        let lag = (motor.setpoint - positions[idx]).abs();
        let (told, lag) = match motor.push {
            Some(_) => (joint.velocity, 0.0),
            None if is_close && is_led(motor, joint) => (0.0, 0.0),
            None => {
                let told = (motor.target - motor.setpoint).abs() / tick_secs;
                (
                    told.min(joint.velocity),
                    if is_close {
                        motor.catches_up(lag, tick_secs)
                    } else {
                        lag
                    },
                )
            }
        };
        overshoot * velocities[idx].abs().max(told) * tick_secs + lag
    };
    let mut spans: Vec<f64> = motors().map(of_joint).collect();
    for (idx, _) in motors().filter(|(_, (motor, joint))| is_close && is_led(motor, joint)) {
        let (leader, factor, offset) = robot.model.leader_of(idx);
        let off = (positions[idx] - factor * positions[leader] - offset).abs();
        spans[idx] = spans[idx].max(factor.abs() * spans[leader]) + off;
    }
    spans
}

/// Returns whether only the coupling with another joint moves a joint.
fn is_led(motor: &Motor, joint: &Joint) -> bool {
    motor.max_effort == 0.0 && motor.push.is_none() && joint.mimic.is_some()
}

#[cfg(test)]
mod tests {
    use crate::robot::tests::lonely;
    use crate::simulation::tests::bodies;
    use actcheck_data::Choices;

    #[test]
    fn no_joint_moves_farther_than_said() {
        let (mut world, mut choices) = (lonely(), Choices::random(13, 0));
        let (mut close, mut wide) = (0.0, 0.0);
        for _ in 0..12 {
            let mut command = world.hold();
            // An arm that starts at once drags its fingers.
            for idx in world.layout().arm.clone() {
                command.positions[idx] += choices.real("way".into(), -0.02, 0.02, 0.0);
            }
            command.gripper_opening_m = choices.real("gap".into(), 0.01, 0.12, 0.05);
            // The first tick sets the targets.
            world.step(&command);
            for tick in 0..30 {
                let (before, velocities) = bodies(&world).robot.state();
                let bounds = |is_close| {
                    let robot = &bodies(&world).robot;
                    super::bounds(
                        robot,
                        [&before, &velocities],
                        world.tick_secs(),
                        1.25,
                        is_close,
                    )
                };
                let [closer, wider] = [bounds(true), bounds(false)];
                world.step(&command);
                for (idx, after) in bodies(&world).robot.state().0.into_iter().enumerate() {
                    let moved = (after - before[idx]).abs();
                    let name = &world.kinematics().joints()[idx].name;
                    assert!(
                        moved <= closer[idx] + 1e-3,
                        "{name}: {moved} instead of {} in tick {tick}",
                        closer[idx]
                    );
                    assert!(
                        closer[idx] <= wider[idx] + 1e-9,
                        "{name}: {} and {}",
                        closer[idx],
                        wider[idx]
                    );
                    (close, wide) = (close + closer[idx], wide + wider[idx]);
                }
            }
        }
        assert!(close < 0.99 * wide, "{close} of {wide}");
    }
}
