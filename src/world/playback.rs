//! The robot's part of a run for another physics engine, which knows the scene already: the
//! motors with their setpoints in each control tick, the masses that are simulated, and the links
//! that collide.

use rapier3d::prelude::RigidBodyHandle;

use crate::bodies::Bodies;
use crate::engine::Engine;
use crate::motor::Motor;
use crate::object::Object;
use crate::patches::{PAD_LEVER_M, ROLLING_LEVER_M};
use crate::physics::FLOOR_FRICTION;
use crate::robot::SimulatedRobot;
use actcheck_data::Pose;
use actcheck_geometry::from_vector;

/// The robot's part of a run for another engine.
#[derive(Debug, Clone, PartialEq)]
pub struct Playback {
    /// Length of a control tick. Unit: seconds.
    pub tick_secs: f64,
    /// The motor of each joint, in the order of [`Kinematics::joints`](crate::Kinematics::joints).
    pub motors: Vec<MotorGains>,
    /// Position of each joint at the start. Units: metres or radians.
    pub start: Vec<f64>,
    /// Pose of each link at the start. Frame: world.
    pub links: Vec<Pose>,
    /// The links that collide with each other, with the smaller index first.
    pub link_pairs: Vec<(usize, usize)>,
    /// Whether each link passes through the floor, as the wheels of a planar base do.
    pub off_floor: Vec<bool>,
    /// Friction coefficient of each link.
    pub link_friction: Vec<f64>,
    /// Whether each link is a finger, whose surface is a pad.
    pub pads: Vec<bool>,
    /// The surfaces that the scene does not state.
    pub surfaces: Surfaces,
    /// The objects, in the order of the scene.
    pub objects: Vec<PlayedObject>,
    /// The setpoints at the end of each control tick, one for each joint.
    pub ticks: Vec<Vec<Setpoint>>,
}

/// Surfaces that are the same in all scenes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surfaces {
    /// Friction coefficient of the floor. That of two surfaces is the geometric mean of theirs.
    pub floor_friction: f64,
    /// Mean lever of the friction of a pad about the normal of its contact. Unit: metres.
    pub pad_lever_m: f64,
    /// Lever of the force against which a thing rolls. Unit: metres.
    pub rolling_lever_m: f64,
}

/// The constants of a joint's motor: its effort is
/// `stiffness · (position − actual) + damping · (velocity − actual)` within its limit, in addition
/// to gravity compensation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotorGains {
    /// Units: N/m or N·m/rad.
    pub stiffness: f64,
    /// Units: N·s/m or N·m·s/rad.
    pub damping: f64,
    /// Inertia of its rotor, as the joint feels it. Units: kilograms or kg·m².
    pub armature: f64,
}

/// The demand on a motor at the end of a control tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setpoint {
    /// Position; it moves there evenly from that of the tick before. Frame of the base: the
    /// world's, whatever the robot believes. Units: metres or radians.
    pub position: f64,
    /// Velocity of the setpoint. Units: m/s or rad/s.
    pub velocity: f64,
    /// Largest effort. Units: newtons or newton metres.
    pub limit: f64,
    /// The effort that is commanded instead of a position. Units: newtons or newton metres.
    pub effort: Option<f64>,
}

/// An object as it is simulated at the start.
#[derive(Debug, Clone, PartialEq)]
pub struct PlayedObject {
    /// Pose of the model's origin. Frame: world. It is at rest.
    pub pose: Pose,
    /// Its masses; `None` if it can't move.
    pub inertia: Option<PrincipalInertia>,
    /// Position of the joint that moves it, if it is a part of another object. Units: metres or
    /// radians.
    pub joint_position: Option<f64>,
}

/// The mass distribution of a body, along its principal axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PrincipalInertia {
    /// Unit: kilograms.
    pub mass_kg: f64,
    /// Pose of the principal axes: the centre of mass and their orientation. Frame: the model's.
    pub frame: Pose,
    /// Moments of inertia about these axes. Unit: kg·m².
    pub moments: [f64; 3],
}

impl Motor {
    fn gains(&self) -> MotorGains {
        MotorGains {
            stiffness: self.stiffness,
            damping: self.damping,
            armature: self.armature,
        }
    }

    pub(super) fn setpoint(&self) -> Setpoint {
        Setpoint {
            position: self.setpoint,
            velocity: self.setpoint_velocity,
            limit: self.max_effort,
            effort: self.push,
        }
    }
}

impl Playback {
    /// Starts at the present state.
    pub(super) fn begin(engine: &Engine) -> Self {
        let bodies = engine.bodies();
        let robot = &bodies.robot;
        let poses = robot.kinematics.links(&robot.positions);
        Self {
            tick_secs: bodies.tick_secs(),
            motors: robot.motors.iter().map(Motor::gains).collect(),
            start: robot.positions.clone(),
            links: poses.iter().map(Pose::from_isometry).collect(),
            link_pairs: engine.link_pairs().iter().collect(),
            off_floor: robot.off_floor.clone(),
            link_friction: robot
                .bodies
                .iter()
                .map(|body| friction_of(bodies, *body))
                .collect(),
            pads: (0..robot.bodies.len())
                .map(|link| robot.is_pad(link))
                .collect(),
            surfaces: Surfaces {
                floor_friction: f64::from(FLOOR_FRICTION),
                pad_lever_m: PAD_LEVER_M,
                rolling_lever_m: ROLLING_LEVER_M,
            },
            objects: bodies
                .objects
                .iter()
                .map(|object| played(bodies, object))
                .collect(),
            ticks: Vec::new(),
        }
    }

    /// Adds the setpoints of the tick that ends.
    pub(super) fn record(&mut self, robot: &SimulatedRobot) {
        self.ticks
            .push(robot.motors.iter().map(Motor::setpoint).collect());
    }
}

/// The friction coefficient of a link's shapes; 0 without shapes.
fn friction_of(bodies: &Bodies, link: RigidBodyHandle) -> f64 {
    bodies
        .colliders_of(link)
        .next()
        .map_or(0.0, |collider| f64::from(collider.friction()))
}

fn played(bodies: &Bodies, object: &Object) -> PlayedObject {
    let body = bodies.physics.bodies.get(object.body);
    let moving = body.filter(|body| !body.is_fixed());
    let inertia = moving.map(|body| {
        let properties = &body.mass_properties().local_mprops;
        let turn = properties.principal_inertia_local_frame.to_array();
        PrincipalInertia {
            mass_kg: object.mass_kg,
            frame: Pose {
                position: from_vector(properties.local_com).into(),
                rotation: turn.map(f64::from),
            },
            moments: from_vector(properties.principal_inertia()).into(),
        }
    });
    PlayedObject {
        pose: Pose::from_isometry(&bodies.pose_of(object)),
        inertia,
        joint_position: bodies.part_position(object),
    }
}
