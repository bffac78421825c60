//! The robot's side of a world: its commands, its sensors' errors, and where it believes to be.
//!
//! Never: steps physics.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::Isometry3;

use crate::bodies::Bodies;
use crate::engine::Engine;
use crate::odometry::Tracker;
use crate::robot::SimulatedRobot;
use actcheck_data::{
    Camera, ChoiceName, Choices, KnownKind, Look, PlanarAxis, Pose, Scene, Sensing,
};
use actcheck_scenario::FloorPlan;

/// A command to the robot's controllers. Positions are clamped to the joint limits; the controllers
/// limit speeds.
#[derive(Debug, Clone, PartialEq)]
pub struct Command {
    /// Target position of each joint, in the order of
    /// [`Kinematics::joints`](crate::Kinematics::joints); for the base, by its own belief. Finger
    /// joints follow `gripper_opening_m` instead. Units: metres or radians.
    pub positions: Vec<f64>,
    /// Gap between the fingers; 0 switches the vacuum of a suction cup on. Unit: metres.
    pub gripper_opening_m: f64,
    /// Largest force of one finger, or greatest pull of a suction cup. Unit: newtons.
    pub grip_force_n: f64,
    /// Effort-controlled joints, by index, each with its effort in addition to gravity
    /// compensation. Joints stay within their largest speed. Not for fingers. Units: newtons or
    /// newton metres.
    pub efforts: Vec<(usize, f64)>,
}

/// The robot's own measurements.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation {
    /// Simulated time since the scene was built. Unit: seconds.
    pub time_secs: f64,
    /// Joint positions; for the base, by its own belief. Units: metres or radians.
    pub positions: Vec<f64>,
    /// Joint velocities.
    pub velocities: Vec<f64>,
    /// Gap between the fingers, measured by their encoders; for a suction cup, 0 while its vacuum
    /// is on, otherwise its diameter. Unit: metres.
    pub gripper_opening_m: f64,
    /// Force of each finger's motor, left and right; positive closes. For a suction cup, twice the
    /// force of its vacuum by its pressure sensor, 0 without a seal. Unit: newtons.
    pub finger_efforts_n: [f64; 2],
    /// Effort of each joint's motor, without gravity compensation. Units: newtons or newton metres.
    pub loads: Vec<f64>,
}

/// The robot's commands, sensors, knowledge and beliefs.
pub struct Drive {
    sensing: Sensing,
    /// Transform from the base's true pose to its believed pose. Frame: world.
    believed_from_true: Isometry3<f64>,
    tracker: Tracker,
    /// Poses at which sensors see objects, by their index, if they differ from the true poses.
    decoys: BTreeMap<usize, Isometry3<f64>>,
    knows: Arc<[KnownKind]>,
    /// Whether the robot has a map of the world's furniture.
    has_map: bool,
    plan: FloorPlan,
}

impl Drive {
    /// The robot of a scene, which believes to be where it is.
    pub(super) fn of(scene: &Scene) -> Self {
        Self {
            sensing: scene.sensing.clone(),
            believed_from_true: Isometry3::identity(),
            tracker: Tracker::default(),
            decoys: BTreeMap::new(),
            knows: Arc::clone(&scene.robot.knows),
            has_map: !scene.map.is_empty(),
            plan: FloorPlan::of(scene),
        }
    }

    /// Returns the kinds of objects that the robot can recognise.
    pub fn known_kinds(&self) -> &Arc<[KnownKind]> {
        &self.knows
    }

    /// Returns the robot's map of its world: walls, furniture and named locations.
    pub fn floor_plan(&self) -> &FloorPlan {
        &self.plan
    }

    /// Returns whether the robot has a map of the world's furniture.
    pub fn has_map(&self) -> bool {
        self.has_map
    }

    /// Returns the depth camera's settings.
    pub fn camera(&self) -> &Camera {
        &self.sensing.camera
    }

    /// Returns the errors of the sensors.
    pub(super) fn sensing(&self) -> &Sensing {
        &self.sensing
    }

    /// Passes a command to the robot's controllers.
    pub(super) fn take(&self, engine: &mut Engine, command: &Command) {
        let robot = &mut engine.bodies_mut().robot;
        let n_joints = robot.model.joints.len();
        for (idx, position) in command.positions.iter().enumerate().take(n_joints) {
            let of_base = robot.layout.base.is_some_and(|base| base.contains(&idx));
            if !of_base && !robot.layout.gripper.contains(idx) {
                robot.aim(idx, *position);
            }
        }
        if let Some(base) = robot.layout.base
            && base.iter().all(|idx| {
                command
                    .positions
                    .get(*idx)
                    .is_some_and(|value| value.is_finite())
            })
        {
            let truly = self.truly(base.map(|idx| command.positions[idx]));
            for (idx, value) in base.into_iter().zip(truly) {
                robot.aim(idx, value);
            }
        }
        for idx in 0..n_joints {
            if let Some(target) = robot.layout.gripper.target(idx, command.gripper_opening_m) {
                robot.aim(idx, target);
            }
        }
        robot.aim_followers();
        robot.limit_grip(command.grip_force_n);
        robot.push(&command.efforts);
        engine.switch_vacuum(command.gripper_opening_m, command.grip_force_n);
    }

    /// Returns the robot's current measurements.
    pub(super) fn observe(&self, engine: &Engine) -> Observation {
        let bodies = engine.bodies();
        let robot = &bodies.robot;
        let (mut positions, velocities) = robot.state();
        let gripper_opening_m = engine.opening_m(&positions);
        let loads = robot.loads();
        if let Some(base) = robot.layout.base {
            let believed = self.believed(base.map(|idx| positions[idx]));
            for (idx, value) in base.into_iter().zip(believed) {
                positions[idx] = value;
            }
        }
        Observation {
            time_secs: bodies.time_secs(),
            positions,
            velocities,
            gripper_opening_m,
            finger_efforts_n: engine.grip_forces_n(),
            loads,
        }
    }

    /// Returns the command that holds the current joint positions.
    pub(super) fn hold(&self, engine: &Engine) -> Command {
        let observed = self.observe(engine);
        Command {
            positions: observed.positions,
            gripper_opening_m: observed.gripper_opening_m,
            grip_force_n: engine.bodies().robot.profile.hand.grip_force_n,
            efforts: Vec::new(),
        }
    }

    /// Returns the base's target pose in terms of the robot's current belief, which changes with
    /// each correction of its pose estimate. Returns `None` if the base is fixed.
    pub(super) fn aimed_base(&self, robot: &SimulatedRobot) -> Option<[f64; 3]> {
        let base = robot.layout.base?;
        Some(self.believed(base.map(|idx| robot.target(idx))))
    }

    /// Converts a true base pose to the believed one. Headings continue beyond a full turn.
    pub(super) fn believed(&self, base: [f64; 3]) -> [f64; 3] {
        moved(&self.believed_from_true, base)
    }

    /// Converts a believed base pose to the true one.
    fn truly(&self, base: [f64; 3]) -> [f64; 3] {
        moved(&self.believed_from_true.inverse(), base)
    }

    /// Converts a true pose to the one that the robot believes.
    pub(super) fn believed_pose(&self, pose: &Isometry3<f64>) -> Isometry3<f64> {
        self.believed_from_true * pose
    }

    /// From now on, sensors see an object, by its index, at this pose.
    pub(super) fn show_at(&mut self, object: usize, pose: Isometry3<f64>) {
        self.decoys.insert(object, pose);
    }

    /// Returns the pose at which sensors see an object instead of the true one, if there is one.
    pub(super) fn decoy(&self, object: usize) -> Option<&Isometry3<f64>> {
        self.decoys.get(&object)
    }

    /// Returns the pose at which sensors see an object: the true one, unless it has a decoy.
    pub(super) fn shown(&self, bodies: &Bodies, object: usize) -> Isometry3<f64> {
        self.decoys
            .get(&object)
            .copied()
            .unwrap_or_else(|| bodies.pose_of(&bodies.objects[object]))
    }

    /// Returns the data by which a percept of this moment can be compared with the truth.
    pub(super) fn current_look(&self, bodies: &Bodies) -> Look {
        let base_true = bodies.base_true();
        let robot = &bodies.robot;
        Look {
            time_secs: bodies.time_secs(),
            base_true,
            base_believed: self.believed(base_true),
            camera: Pose::from_isometry(&robot.kinematics.camera(&robot.state().0)),
        }
    }

    /// Samples the base's initial pose estimate. Its error stays constant while the base moves,
    /// unless the odometry drifts.
    pub(super) fn localise(&mut self, bodies: &Bodies, choices: &mut Choices) {
        let mut draw =
            |axis: PlanarAxis, sigma: f64| choices.normal(ChoiceName::Localisation(axis), sigma);
        let x = draw(PlanarAxis::X, self.sensing.localisation_noise_m);
        let y = draw(PlanarAxis::Y, self.sensing.localisation_noise_m);
        let turn = draw(PlanarAxis::Heading, self.sensing.heading_noise_rad);
        let [base_x, base_y, heading] = bodies.base_true();
        let truth = Pose::upright([base_x, base_y, 0.0], heading).to_isometry();
        let believed = Pose::upright([base_x + x, base_y + y, 0.0], heading + turn).to_isometry();
        self.believed_from_true = believed * truth.inverse();
        self.tracker = Tracker::begin(&self.sensing);
    }

    /// Returns the gap between the fingers, measured with noise. Unit: metres.
    pub(super) fn feel_opening(&self, engine: &Engine, choices: &mut Choices) -> f64 {
        self.observe(engine).gripper_opening_m
            + choices.normal(ChoiceName::Gripper, self.sensing.gripper_noise_m)
    }

    /// Updates the pose estimate with the base's motion since the last call.
    pub(super) fn track_base(&mut self, bodies: &Bodies, choices: &mut Choices) {
        if bodies.robot.layout.base.is_none() {
            return;
        }
        let now = bodies.base_true();
        let believed_from_true = self.believed_from_true;
        let believed = |base| moved(&believed_from_true, base);
        let tracked = self
            .tracker
            .track(&self.sensing, now, believed, bodies.tick_secs(), choices);
        if let Some([x, y, heading]) = tracked {
            let truth = Pose::upright([now[0], now[1], 0.0], now[2]).to_isometry();
            self.believed_from_true =
                Pose::upright([x, y, 0.0], heading).to_isometry() * truth.inverse();
        }
    }

    /// Moves the robot to another pose (x, y, heading) without changing its pose estimate. Returns
    /// `false` if its base is fixed.
    pub(super) fn kidnap(&mut self, bodies: &mut Bodies, to: [f64; 3]) -> bool {
        if bodies.robot.layout.base.is_none() {
            return false;
        }
        let from = bodies.base_true();
        let [x, y, heading] = self.believed(from);
        let Bodies { physics, robot, .. } = bodies;
        robot.shift_base(physics, [0, 1, 2].map(|axis| to[axis] - from[axis]));
        // The odometry does not register the move.
        let (believed, truth) = (
            Pose::upright([x, y, 0.0], heading),
            Pose::upright([to[0], to[1], 0.0], to[2]),
        );
        self.believed_from_true = believed.to_isometry() * truth.to_isometry().inverse();
        self.tracker.forget_way();
        true
    }
}

fn moved(by: &Isometry3<f64>, [x, y, heading]: [f64; 3]) -> [f64; 3] {
    let point = by * nalgebra::Point3::new(x, y, 0.0);
    [point.x, point.y, heading + Pose::from_isometry(by).yaw()]
}
