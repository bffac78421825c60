//! Targets from an external controller, and the ticks it requests: positions, velocities and
//! efforts per joint.
//!
//! A velocity is a moving setpoint that the position controllers follow, as on most robots.

use crate::memory;
use crate::operator::{Interrupt, Operator};
use actcheck_data::Camera;
use actcheck_world::Sighting;

/// How far a moving setpoint may run ahead of a blocked joint, as time at the joint's velocity
/// limit. Unit: seconds. A smaller value makes the joint feel weak, a larger one makes it jerk when
/// it comes free.
const AHEAD_SECS: f64 = 0.1;

/// New targets. Anything not named keeps its previous target.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Controls {
    /// Target positions by joint index. Units: metres or radians.
    pub positions: Vec<(usize, f64)>,
    /// Target velocities by joint index. Units: m/s or rad/s.
    pub velocities: Vec<(usize, f64)>,
    /// Motor efforts by joint index, on top of gravity compensation. Units: newtons or newton
    /// metres.
    pub efforts: Vec<(usize, f64)>,
    /// Base velocity: forwards, left, and turning left. Frame: the base's. Units: m/s, rad/s.
    pub base_velocity: Option<[f64; 3]>,
    /// Gap between the fingers. Unit: metres.
    pub opening_m: Option<f64>,
    /// Largest force of one finger. Unit: newtons.
    pub force_n: Option<f64>,
}

/// Setpoints that move from tick to tick.
#[derive(Debug, Clone, Default)]
pub(super) struct Drives {
    velocities: Vec<(usize, f64)>,
    base: Option<[f64; 3]>,
}

impl Operator<'_> {
    /// Sets new targets. Targets for the base's joints cancel a base velocity, and vice versa.
    pub fn steer(&mut self, controls: &Controls) {
        let named = |joint: usize| {
            let lists = [&controls.positions, &controls.velocities, &controls.efforts];
            lists
                .iter()
                .any(|list| list.iter().any(|(named, _)| *named == joint))
        };
        self.drives.velocities.retain(|(joint, _)| !named(*joint));
        self.command.efforts.retain(|(joint, _)| !named(*joint));
        if let Some(base) = self.layout().base {
            if base.into_iter().any(named) {
                self.drives.base = None;
            }
            if controls.base_velocity.is_some() {
                self.drives
                    .velocities
                    .retain(|(joint, _)| !base.contains(joint));
                self.command
                    .efforts
                    .retain(|(joint, _)| !base.contains(joint));
                self.drives.base = controls.base_velocity;
            }
        }
        for (joint, position) in &controls.positions {
            self.aim(&[*joint], &[*position]);
        }
        self.drives.velocities.extend(&controls.velocities);
        self.command.efforts.extend(&controls.efforts);
        if let Some(opening_m) = controls.opening_m {
            self.command.gripper_opening_m =
                opening_m.clamp(0.0, self.profile().hand.max_opening_m);
        }
        if let Some(force_n) = controls.force_n {
            self.command.grip_force_n = force_n.max(0.0);
        }
    }

    /// Simulated time since the scene was built. Unit: seconds.
    pub fn time_secs(&self) -> f64 {
        self.world.time_secs()
    }

    /// Advances the simulation by this number of control ticks.
    ///
    /// # Errors
    /// [`Interrupt`] if the action has to end.
    pub fn step(&mut self, ticks: u32) -> Result<(), Interrupt> {
        (0..ticks).try_for_each(|_| {
            self.drive();
            self.tick()
        })
    }

    /// Time left in the action's budget. Unit: seconds.
    pub fn budget_left_secs(&self) -> f64 {
        (self.budget_secs - self.elapsed_secs()).max(0.0)
    }

    /// Commanded grip force. Unit: newtons.
    pub fn grip_force_n(&self) -> f64 {
        self.command.grip_force_n
    }

    /// The object perceived earlier in this run that best matches this id. Returns `None` if
    /// nothing was perceived or nothing matches.
    pub fn recall(&self, id: &str) -> Option<Sighting> {
        let perceived = self.memory().perceived.as_ref()?;
        let kind = self.kind_of(id)?;
        memory::recall(perceived, id, &kind, &self.base().translation.vector)
            .ok()
            .map(|(thing, _)| thing)
    }

    /// The depth camera.
    pub fn camera(&self) -> &Camera {
        self.world.drive().camera()
    }

    /// True poses of all objects. For external programs that the campaign allows to see ground
    /// truth; reference skills must not use it.
    pub fn truth(&self) -> Vec<Sighting> {
        self.world.truth()
    }

    /// Advances the setpoints of all joints with a velocity by one tick.
    fn drive(&mut self) {
        if self.drives.velocities.is_empty()
            && self.drives.base.is_none()
            && self.command.efforts.is_empty()
        {
            return;
        }
        let tick = self.tick_secs();
        let observed = self.observe().positions;
        for (joint, speed) in &self.drives.velocities {
            let known = self.world.kinematics().joints().get(*joint);
            let (Some(known), Some(is)) = (known, observed.get(*joint)) else {
                continue;
            };
            let Some(setpoint) = self.command.positions.get_mut(*joint) else {
                continue;
            };
            let ahead = known.velocity * AHEAD_SECS;
            let speed = speed.clamp(-known.velocity, known.velocity);
            let moved = (*setpoint + speed * tick).clamp(is - ahead, is + ahead);
            *setpoint = moved.clamp(known.lower, known.upper);
        }
        // For effort-controlled joints, the position setpoint follows the observed position.
        for (joint, _) in &self.command.efforts {
            if let (Some(setpoint), Some(is)) =
                (self.command.positions.get_mut(*joint), observed.get(*joint))
            {
                *setpoint = *is;
            }
        }
        if let (Some([forward, left, turn]), Some(base), Some([x, y, heading])) = (
            self.drives.base,
            self.layout().base,
            self.world.aimed_base(),
        ) {
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
