//! The robot's measurements and commands over time, as data for policy learning.

use crate::bodies::Bodies;
use crate::drive::{Command, Drive};
use crate::engine::Engine;
use actcheck_data::Motion;

/// Positions, velocities and targets are rounded to multiples of this, for compression. Units:
/// metres or radians (per second).
const GRAIN: f64 = 1e-4;
/// As [`GRAIN`], for efforts. Units: newtons or newton metres.
const EFFORT_GRAIN: f64 = 0.01;

pub(super) fn grain(value: f64, grain: f64) -> f32 {
    ((value / grain).round() * grain) as f32
}

/// Records a [`Motion`].
#[derive(Default)]
pub(super) struct MotionMeter {
    told: Option<Command>,
    rows: Vec<Vec<f32>>,
}

impl MotionMeter {
    /// Stores the command.
    pub(super) fn tell(&mut self, command: &Command) {
        match &mut self.told {
            Some(told) => told.clone_from(command),
            None => self.told = Some(command.clone()),
        }
    }

    /// Starts a new recording, with a command to hold the current state.
    pub(super) fn begin(&mut self, engine: &Engine, drive: &Drive, secs: f64) {
        self.rows.clear();
        self.told = Some(drive.hold(engine));
        self.record(engine, drive, secs);
    }

    /// Records this moment, at a time since the record began. Unit: seconds.
    pub(super) fn record(&mut self, engine: &Engine, drive: &Drive, secs: f64) {
        let Some(told) = &self.told else {
            return;
        };
        let observed = drive.observe(engine);
        let bodies = engine.bodies();
        let base = bodies.base_true();
        let mut row = vec![grain(secs, GRAIN), grain(observed.gripper_opening_m, GRAIN)];
        row.extend(
            observed
                .finger_efforts_n
                .map(|effort| grain(effort, EFFORT_GRAIN)),
        );
        row.extend([
            grain(told.gripper_opening_m, GRAIN),
            grain(told.grip_force_n, EFFORT_GRAIN),
        ]);
        row.extend(
            base.into_iter()
                .chain(drive.believed(base))
                .map(|value| grain(value, GRAIN)),
        );
        let gripper = &bodies.robot.layout.gripper;
        for (idx, position) in observed.positions.iter().enumerate() {
            let of = |values: &[f64]| values.get(idx).copied().unwrap_or(f64::NAN);
            let velocity = of(&observed.velocities);
            // The gap between the fingers is commanded, not their positions.
            let target = gripper
                .target(idx, told.gripper_opening_m)
                .unwrap_or_else(|| of(&told.positions));
            row.extend([*position, velocity].map(|value| grain(value, GRAIN)));
            row.extend([
                grain(of(&observed.loads), EFFORT_GRAIN),
                grain(target, GRAIN),
            ]);
        }
        self.rows.push(row);
    }

    /// Returns the motion recorded since the start.
    pub(super) fn end(&mut self, bodies: &Bodies) -> Motion {
        let joints = bodies
            .robot
            .model
            .joints
            .iter()
            .map(|joint| joint.name.clone())
            .collect();
        Motion {
            joints,
            rows: std::mem::take(&mut self.rows),
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::robot::tests::lonely;

    #[test]
    fn measurements_and_targets_are_read_back() {
        let mut world = lonely();
        world.begin_record();
        let mut command = world.hold();
        let lift = world.layout().arm[0];
        command.positions[lift] = 0.2;
        command.gripper_opening_m = 0.1;
        for _ in 0..60 {
            world.step(&command);
        }
        let observed = world.observe();
        let motion = world.end_record().robot.motion;
        let moments: Vec<_> = motion.moments().collect();
        assert_eq!(moments.len(), 11, "ten per second and the first state");
        assert_eq!(motion.joints.len(), world.kinematics().joints().len());
        let (first, last) = (moments[0], moments[10]);
        assert_eq!((first.time_secs, last.time_secs), (0.0, 1.0));
        assert!((f64::from(last.opening_m) - observed.gripper_opening_m).abs() < 1e-4);
        assert!((last.commanded_opening_m - 0.1).abs() < 1e-6);
        let joint = last
            .joints()
            .nth(lift)
            .expect("it has as many joints as the robot");
        assert!((joint.target - 0.2).abs() < 1e-6);
        assert!((f64::from(joint.position) - observed.positions[lift]).abs() < 1e-4);
        assert!((f64::from(joint.velocity) - observed.velocities[lift]).abs() < 1e-4);
        let began = first
            .joints()
            .nth(lift)
            .expect("it has as many joints as the robot");
        assert!((began.target - began.position).abs() < 1e-6 && began.position < 0.1);
    }
}
