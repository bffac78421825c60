//! Another physics engine in the place of this one: it moves robot and objects, and reports where
//! they are. The robot's side stays: commands, motors' setpoints, sensors and beliefs.

use nalgebra::Vector3;

use crate::bodies::Bodies;
use crate::contacts::{Touch, Touches};
use crate::ownership::Ownership;
use crate::physics::Owner;
use crate::playback::{Playback, Setpoint};
use actcheck_data::Pose;
use actcheck_geometry::{to_pose, to_vector};

/// Another physics engine.
pub trait OtherEngine: Send {
    /// Loads the scene at the start of a run.
    ///
    /// # Errors
    /// Why it can't, in words.
    fn begin(&mut self, start: &Playback) -> Result<(), String>;

    /// Performs a control tick at whose end the motors have these setpoints.
    ///
    /// # Errors
    /// Why it can't, in words.
    fn tick(&mut self, setpoints: &[Setpoint]) -> Result<EngineState, String>;
}

/// The state of robot and objects after a control tick of another engine.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct EngineState {
    /// Position of each joint, in the order of
    /// [`Kinematics::joints`](crate::Kinematics::joints). Units: metres or radians.
    pub positions: Vec<f64>,
    /// Velocity of each joint.
    pub velocities: Vec<f64>,
    /// Effort of each motor, without gravity compensation. Units: newtons or newton metres.
    pub loads: Vec<f64>,
    /// The objects, in the order of the scene.
    pub objects: Vec<MovedObject>,
    /// All contacts.
    pub contacts: Vec<EngineContact>,
}

/// An object that another engine moved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MovedObject {
    /// Pose of the model's origin. Frame: world.
    pub pose: Pose,
    /// Velocity of its centre of mass. Unit: m/s. Frame: world.
    pub linear: [f64; 3],
    /// Unit: rad/s. Frame: world.
    pub angular: [f64; 3],
}

/// A contact in another engine.
#[derive(Debug, Clone, PartialEq)]
pub struct EngineContact {
    /// Names of both bodies as in traces: `floor`, ids of objects, `robot/LINK`.
    pub pair: [String; 2],
    /// Normal force. Unit: newtons.
    pub normal_n: f64,
    /// Force on the second of the pair. Unit: newtons. Frame: world.
    pub force_n: [f64; 3],
    /// Unit: metres. Frame: world.
    pub point_m: [f64; 3],
}

/// Another engine with its last contacts.
pub(super) struct Puppeteer {
    engine: Box<dyn OtherEngine>,
    touches: Touches,
}

impl Puppeteer {
    /// Hands a scene over to another engine.
    ///
    /// # Errors
    /// The engine's own.
    pub(super) fn begin(
        mut engine: Box<dyn OtherEngine>,
        bodies: &mut Bodies,
        start: &Playback,
    ) -> Result<Self, String> {
        engine.begin(start)?;
        let Bodies { physics, robot, .. } = bodies;
        robot.hand_over(physics, Ownership::Nothing);
        Ok(Self {
            engine,
            touches: Touches::new(),
        })
    }

    /// Returns the contacts of the last tick.
    pub(super) fn touches(&self) -> &Touches {
        &self.touches
    }

    /// Performs a control tick.
    ///
    /// # Errors
    /// The engine's own, or a state that is not one of this scene.
    pub(super) fn tick(&mut self, bodies: &mut Bodies) -> Result<(), String> {
        let tick_secs = bodies.tick_secs();
        let setpoints = bodies.robot.next_setpoints(tick_secs);
        let state = self.engine.tick(&setpoints)?;
        let n_joints = setpoints.len();
        let lists = [&state.positions, &state.velocities, &state.loads];
        let is_whole = lists.iter().all(|list| list.len() == n_joints)
            && state.objects.len() == bodies.objects.len();
        if !is_whole {
            return Err("the other engine has other joints or objects".to_owned());
        }
        self.touches = touches(bodies, &state.contacts);
        let Bodies {
            physics,
            robot,
            objects,
            clock,
            ..
        } = bodies;
        robot.follow(physics, &state);
        for (object, moved) in objects.iter().zip(&state.objects) {
            let Some(body) = physics.bodies.get_mut(object.body) else {
                continue;
            };
            if body.is_fixed() {
                continue;
            }
            let pose = to_pose(&moved.pose.to_isometry());
            body.set_position(pose, false);
            body.set_linvel(to_vector(&Vector3::from(moved.linear)), false);
            body.set_angvel(to_vector(&Vector3::from(moved.angular)), false);
            for handle in body.colliders().to_vec() {
                if let Some(collider) = physics.colliders.get_mut(handle)
                    && let Some(on_body) = collider.position_wrt_parent().copied()
                {
                    collider.set_position(pose * on_body);
                }
            }
        }
        clock.n_steps += u64::from(clock.steps_per_tick);
        Ok(())
    }
}

/// The contacts by the owners of both sides.
fn touches(bodies: &Bodies, contacts: &[EngineContact]) -> Touches {
    let objects = (0..bodies.objects.len()).map(Owner::Object);
    let links = (0..bodies.robot.model.links.len()).map(Owner::Link);
    let owners: Vec<(String, Owner)> = std::iter::once(Owner::Floor)
        .chain(objects)
        .chain(links)
        .map(|owner| (bodies.name_of(owner), owner))
        .collect();
    let owner_of = |name: &String| {
        let found = owners.iter().find(|(known, _)| known == name);
        found.map(|(_, owner)| *owner)
    };
    let mut touches = Touches::new();
    for contact in contacts {
        let [Some(first), Some(second)] = contact.pair.each_ref().map(owner_of) else {
            continue;
        };
        let force = Vector3::from(contact.force_n);
        let (pair, force) = if first <= second {
            ((first, second), force)
        } else {
            ((second, first), -force)
        };
        if pair.0 != pair.1 {
            let one = Touch::at(contact.normal_n, force, contact.point_m);
            touches
                .entry(pair)
                .and_modify(|known: &mut Touch| *known = known.with(&one))
                .or_insert(one);
        }
    }
    touches
}
