//! Records the course of an action at the control rate, for rules about time.

use std::collections::BTreeMap;

use crate::World;
use crate::contacts::Touch;
use crate::engine::Owner;
use crate::object::Object;
use actcheck_data::{Pose, Samples, Series};
use actcheck_geometry::{from_pose, from_vector};

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
    /// Contact forces in newtons, each with the number of its sample.
    contacts: BTreeMap<(Owner, Owner), Vec<(usize, f64)>>,
}

impl World {
    /// Starts new samples with the current state.
    pub(super) fn begin_samples(&mut self) {
        let mut series = Vec::new();
        for object in self.sampled() {
            let of_object = POSE.into_iter().chain(VELOCITY).chain(["held"]);
            series.extend(of_object.map(|quantity| Series::recorded(&object, "", quantity)));
        }
        let of_gripper = POSE.into_iter().chain(["opening"]);
        series.extend(of_gripper.map(|quantity| Series::recorded("gripper", "", quantity)));
        series.extend(BASE.map(|quantity| Series::recorded("robot", "", quantity)));
        for joint in &self.robot.model.joints {
            let name = format!("joint/{}", joint.name);
            let of_joint = ["position", "velocity", "effort"];
            series.extend(of_joint.map(|quantity| Series::recorded(&name, "", quantity)));
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
                series.push(value);
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
            let forces = meter.contacts.entry(*pair).or_default();
            forces.push((meter.count, touch.normal_n));
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
            let mut contact = Series::recorded(&pair[0], &pair[1], "contactForce");
            let mut values = vec![0.0; count];
            forces
                .into_iter()
                .for_each(|(at, force)| values[at] = force);
            values.into_iter().for_each(|value| contact.push(value));
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
