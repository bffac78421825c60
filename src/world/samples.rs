//! Records the course of an action at the control rate, for rules about time.

use std::collections::BTreeMap;

use crate::bodies::Bodies;
use crate::contacts::{Touches, is_held};
use crate::drive::Drive;
use crate::engine::Engine;
use crate::object::Object;
use crate::physics::Owner;
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

impl SampleMeter {
    /// Starts new samples with the current state.
    pub(super) fn begin(engine: &Engine, drive: &Drive, touches: &Touches) -> Self {
        let bodies = engine.bodies();
        let mut series = Vec::new();
        for object in sampled(bodies) {
            let of_object = POSE.into_iter().chain(VELOCITY).chain(["held"]);
            series.extend(of_object.map(|quantity| Series::recorded(&object, "", quantity)));
        }
        let of_gripper = POSE.into_iter().chain(["opening"]);
        series.extend(of_gripper.map(|quantity| Series::recorded("gripper", "", quantity)));
        series.extend(BASE.map(|quantity| Series::recorded("robot", "", quantity)));
        for joint in &bodies.robot.model.joints {
            let name = format!("joint/{}", joint.name);
            let of_joint = ["position", "velocity", "effort"];
            series.extend(of_joint.map(|quantity| Series::recorded(&name, "", quantity)));
        }
        let mut meter = Self {
            series,
            ..Self::default()
        };
        meter.record(engine, drive, touches);
        meter
    }

    /// Records the state after a tick.
    pub(super) fn record(&mut self, engine: &Engine, drive: &Drive, touches: &Touches) {
        let bodies = engine.bodies();
        let mut series = self.series.iter_mut();
        let mut put = |value: f64| {
            if let Some(series) = series.next() {
                series.push(value);
            }
        };
        for (idx, object) in bodies
            .objects
            .iter()
            .enumerate()
            .filter(|(_, object)| can_move(object))
        {
            let Some(body) = bodies.physics.bodies.get(object.body) else {
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
            put(f64::from(u8::from(is_held(&bodies.robot, idx, touches))));
        }
        let (positions, velocities) = bodies.robot.state();
        let hand = Pose::from_isometry(&bodies.robot.kinematics.grasp(&positions));
        hand.position
            .into_iter()
            .chain(hand.rotation)
            .for_each(&mut put);
        put(engine.opening_m(&positions));
        let base = bodies.base_true();
        base.into_iter()
            .chain(drive.believed(base))
            .for_each(&mut put);
        let efforts = bodies.robot.loads();
        for idx in 0..bodies.robot.model.joints.len() {
            [&positions, &velocities, &efforts]
                .into_iter()
                .for_each(|of| put(of.get(idx).copied().unwrap_or(0.0)));
        }
        for (pair, touch) in touches {
            let forces = self.contacts.entry(*pair).or_default();
            forces.push((self.count, touch.normal_n));
        }
        self.count += 1;
    }

    /// Returns the samples since the start.
    pub(super) fn end(&mut self, bodies: &Bodies) -> Samples {
        let SampleMeter {
            mut series,
            count,
            contacts,
        } = std::mem::take(self);
        for ((first, second), forces) in contacts {
            let mut pair = [bodies.name_of(first), bodies.name_of(second)];
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
            period_secs: bodies.tick_secs(),
            count,
            series,
        }
    }
}

/// Returns the ids of the objects that can move.
fn sampled(bodies: &Bodies) -> Vec<String> {
    let movable = bodies.objects.iter().filter(|object| can_move(object));
    movable
        .filter(|object| bodies.physics.bodies.get(object.body).is_some())
        .map(|object| object.id.clone())
        .collect()
}

/// Returns whether an object can move in an action. Furniture can: it slides when it is pushed.
fn can_move(object: &Object) -> bool {
    !object.fixed || object.slides
}
