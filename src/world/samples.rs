//! Records the course of an action at the control rate, for rules about time.

use std::collections::BTreeMap;

use crate::World;
use crate::contacts::Touch;
use crate::convert::{from_pose, from_vector};
use crate::engine::Owner;
use crate::object::Object;
use actcheck_data::{Pose, Samples, Series};

/// Steps of positions, angles and components of quaternions in a metre, a radian, or one.
const POSE_STEPS: u32 = 50_000;
/// Steps of velocities in 1 m/s or 1 rad/s.
const VELOCITY_STEPS: u32 = 2_000;
/// Steps of forces and torques in 1 N or 1 N·m.
const FORCE_STEPS: u32 = 50;

const POSE: [&str; 7] = ["x", "y", "z", "qx", "qy", "qz", "qw"];
const VELOCITY: [&str; 6] = ["vx", "vy", "vz", "wx", "wy", "wz"];
const BASE: [&str; 6] = [
    "baseX",
    "baseY",
    "baseYaw",
    "believedX",
    "believedY",
    "believedYaw",
];

/// Records [`Samples`].
#[derive(Default)]
pub(super) struct SampleMeter {
    series: Vec<Series>,
    count: usize,
    /// Contact forces as numbers of steps, each with the number of its sample.
    contacts: BTreeMap<(Owner, Owner), Vec<(usize, i32)>>,
}

impl World {
    /// Starts new samples with the current state.
    pub(super) fn begin_samples(&mut self) {
        let mut series = Vec::new();
        for object in self.sampled() {
            series.extend(POSE.map(|quantity| Series::new(&object, "", quantity, POSE_STEPS)));
            series.extend(
                VELOCITY.map(|quantity| Series::new(&object, "", quantity, VELOCITY_STEPS)),
            );
            series.push(Series::new(&object, "", "held", 1));
        }
        series.extend(POSE.map(|quantity| Series::new("gripper", "", quantity, POSE_STEPS)));
        series.push(Series::new("gripper", "", "opening", POSE_STEPS));
        series.extend(BASE.map(|quantity| Series::new("robot", "", quantity, POSE_STEPS)));
        for joint in &self.robot.model.joints {
            let of = |quantity, steps| {
                Series::new(&format!("joint/{}", joint.name), "", quantity, steps)
            };
            series.extend([
                of("position", POSE_STEPS),
                of("velocity", VELOCITY_STEPS),
                of("effort", FORCE_STEPS),
            ]);
        }
        self.recorder.samples = SampleMeter {
            series,
            ..SampleMeter::default()
        };
        let touches = self.touches();
        self.record_samples(&touches);
    }

    /// Records the state after a tick.
    pub(super) fn record_samples(&mut self, touches: &BTreeMap<(Owner, Owner), Touch>) {
        let mut meter = std::mem::take(&mut self.recorder.samples);
        let mut series = meter.series.iter_mut();
        let mut put = |value: f64| {
            if let Some(series) = series.next() {
                series
                    .steps
                    .push(Series::steps_of(value, series.steps_per_unit));
            }
        };
        for (idx, object) in self
            .objects
            .iter()
            .enumerate()
            .filter(|(_, object)| can_move(object))
        {
            let Some(body) = self.engine.bodies.get(object.body) else {
                continue;
            };
            let pose = Pose::from_isometry(&from_pose(body.position()));
            pose.position
                .into_iter()
                .chain(pose.rotation)
                .for_each(&mut put);
            from_vector(body.velocity_at_point(body.translation()))
                .iter()
                .copied()
                .for_each(&mut put);
            from_vector(body.angvel())
                .iter()
                .copied()
                .for_each(&mut put);
            put(f64::from(u8::from(self.is_held(idx, touches))));
        }
        let (positions, velocities) = self.robot.state();
        let hand = Pose::from_isometry(&self.robot.kinematics.grasp(&positions));
        hand.position
            .into_iter()
            .chain(hand.rotation)
            .for_each(&mut put);
        put(self.opening_m(&positions));
        let base = self.base_true();
        base.into_iter()
            .chain(self.believed(base))
            .for_each(&mut put);
        let efforts = self.robot.loads();
        for idx in 0..self.robot.model.joints.len() {
            [&positions, &velocities, &efforts]
                .into_iter()
                .for_each(|of| put(of.get(idx).copied().unwrap_or(0.0)));
        }
        for (pair, touch) in touches {
            let force = Series::steps_of(touch.normal_n, FORCE_STEPS);
            meter
                .contacts
                .entry(*pair)
                .or_default()
                .push((meter.count, force));
        }
        meter.count += 1;
        self.recorder.samples = meter;
    }

    /// Returns the samples since the start.
    pub(super) fn end_samples(&mut self) -> Samples {
        let SampleMeter {
            mut series,
            count,
            contacts,
        } = std::mem::take(&mut self.recorder.samples);
        for ((first, second), forces) in contacts {
            let mut pair = [self.name_of(first), self.name_of(second)];
            pair.sort();
            let mut contact = Series::new(&pair[0], &pair[1], "contactForce", FORCE_STEPS);
            let mut steps = vec![0; count];
            forces.into_iter().for_each(|(at, force)| steps[at] = force);
            contact.steps = steps.into();
            series.push(contact);
        }
        Samples {
            period_secs: self.tick_secs(),
            count,
            series,
        }
    }

    /// Returns the ids of the objects that can move.
    fn sampled(&self) -> Vec<String> {
        let movable = self.objects.iter().filter(|object| can_move(object));
        movable
            .filter(|object| self.engine.bodies.get(object.body).is_some())
            .map(|object| object.id.clone())
            .collect()
    }
}

/// Returns whether an object can move in an action. Furniture can: it slides when it is pushed.
fn can_move(object: &Object) -> bool {
    !object.fixed || object.slides
}
