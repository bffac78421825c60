//! What an outside controller asks of the robot, and the ticks that it asks for: positions, speeds and efforts joint by joint.
//!
//! A speed is a setpoint that moves: the position controllers follow it, as those of most robots do.

use crate::actions::memory;
use crate::actions::operator::{Interrupt, Operator};
use crate::scenario::Camera;
use crate::world::Sighting;

/// How far a moving setpoint runs ahead of a joint that is held back, at most: so long at the joint's largest speed. Unit:
/// seconds. Less would be felt as weakness, more as a jerk once the joint is free.
const AHEAD_SECS: f64 = 0.1;

/// New targets. What is not named keeps the one that it has.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Controls {
    /// Where joints shall go, by index. Units: metres or radians.
    pub positions: Vec<(usize, f64)>,
    /// How fast joints shall move. Units: m/s or rad/s.
    pub velocities: Vec<(usize, f64)>,
    /// What joints' motors shall give, beyond what holds the robot's own weight. Units: newtons or newton metres.
    pub efforts: Vec<(usize, f64)>,
    /// How fast the base shall drive: forwards, to the left, and turning to the left. Frame: the base's. Units: m/s, rad/s.
    pub base_velocity: Option<[f64; 3]>,
    /// Gap between the fingers. Unit: metres.
    pub opening_m: Option<f64>,
    /// Largest force of one finger. Unit: newtons.
    pub force_n: Option<f64>,
}

/// What moves by itself from tick to tick.
#[derive(Debug, Clone, Default)]
pub(super) struct Drives {
    velocities: Vec<(usize, f64)>,
    base: Option<[f64; 3]>,
}

impl Operator<'_> {
    /// Takes new targets. Those of the base's joints end a base velocity, and the other way round.
    pub fn steer(&mut self, controls: &Controls) {
        let named = |joint: usize| {
            let lists = [&controls.positions, &controls.velocities, &controls.efforts];
            lists.iter().any(|list| list.iter().any(|(named, _)| *named == joint))
        };
        self.drives.velocities.retain(|(joint, _)| !named(*joint));
        self.command.efforts.retain(|(joint, _)| !named(*joint));
        if let Some(base) = self.layout().base {
            if base.into_iter().any(named) {
                self.drives.base = None;
            }
            if controls.base_velocity.is_some() {
                self.drives.velocities.retain(|(joint, _)| !base.contains(joint));
                self.command.efforts.retain(|(joint, _)| !base.contains(joint));
                self.drives.base = controls.base_velocity;
            }
        }
        for (joint, position) in &controls.positions {
            self.aim(&[*joint], &[*position]);
        }
        self.drives.velocities.extend(&controls.velocities);
        self.command.efforts.extend(&controls.efforts);
        if let Some(opening_m) = controls.opening_m {
            self.command.gripper_opening_m = opening_m.clamp(0.0, self.profile().max_opening_m);
        }
        if let Some(force_n) = controls.force_n {
            self.command.grip_force_n = force_n.max(0.0);
        }
    }

    /// Lets so many control ticks pass.
    ///
    /// # Errors
    /// [`Interrupt`] if the action has to end.
    pub fn step(&mut self, ticks: u32) -> Result<(), Interrupt> {
        (0..ticks).try_for_each(|_| {
            self.drive();
            self.tick()
        })
    }

    /// What is left of the action's budget. Unit: seconds.
    pub fn budget_left_secs(&self) -> f64 {
        (self.budget_secs - self.elapsed_secs()).max(0.0)
    }

    /// The force that the fingers are told to press with. Unit: newtons.
    pub fn grip_force_n(&self) -> f64 {
        self.command.grip_force_n
    }

    /// What an earlier look around of the run perceived that may be the thing of this id.
    pub fn recall(&self, id: &str) -> Option<Sighting> {
        let perceived = self.memory().perceived.as_ref()?;
        let kind = self.kind_of(id)?;
        memory::recall(perceived, id, &kind, &self.base().translation.vector).ok().map(|(thing, _)| thing)
    }

    /// The depth camera.
    pub fn camera(&self) -> &Camera {
        self.world.camera()
    }

    /// Where everything truly is. For programs that a campaign lets in on it, and for no skill of ours.
    pub fn truth(&self) -> Vec<Sighting> {
        self.world.truth()
    }

    /// Moves the setpoints of what has a speed on by one tick.
    fn drive(&mut self) {
        if self.drives.velocities.is_empty() && self.drives.base.is_none() && self.command.efforts.is_empty() {
            return;
        }
        let tick = self.tick_secs();
        let observed = self.observe().positions;
        for (joint, speed) in &self.drives.velocities {
            let known = self.world.kinematics().joints().get(*joint);
            let (Some(known), Some(is)) = (known, observed.get(*joint)) else { continue };
            let Some(setpoint) = self.command.positions.get_mut(*joint) else { continue };
            let ahead = known.velocity * AHEAD_SECS;
            let speed = speed.clamp(-known.velocity, known.velocity);
            let moved = (*setpoint + speed * tick).clamp(is - ahead, is + ahead);
            *setpoint = moved.clamp(known.lower, known.upper);
        }
        // Where effort is all that is asked for, the joint goes on from where it then is.
        for (joint, _) in &self.command.efforts {
            if let (Some(setpoint), Some(is)) = (self.command.positions.get_mut(*joint), observed.get(*joint)) {
                *setpoint = *is;
            }
        }
        if let (Some([forward, left, turn]), Some(base), Some([x, y, heading])) =
            (self.drives.base, self.layout().base, self.world.aimed_base())
        {
            let (sin, cos) = (libm::sin(heading), libm::cos(heading));
            let moved = [
                x + (forward * cos - left * sin) * tick,
                y + (forward * sin + left * cos) * tick,
                heading + turn * tick,
            ];
            self.aim(&base, &moved);
        }
    }
}
