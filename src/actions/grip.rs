//! Grip sensing: whether the fingers hold something, and whether it slips.

use crate::operator::{Interrupt, Operator};
use actcheck_world::Observation;

/// A smaller gap means that the fingers met with nothing between them. Unit: metres. Three times
/// the usual noise.
pub const EMPTY_M: f64 = 0.006;
/// Longest time for the fingers to close. Unit: seconds.
const CLOSE_SECS: f64 = 2.5;
/// Fingers that close more slowly than this have stalled. Unit: m/s.
const STALLED: f64 = 0.003;
/// Share of the grip force that stalled fingers must exert.
const FELT_SHARE: f64 = 0.7;
/// Fingers that close further by this much have lost their hold. Unit: metres. A mug that turns
/// between the fingers until they lie flat gives way by less.
const GAVE_WAY_M: f64 = 0.012;
/// Share of the grip force below which nothing resists the fingers. Half of the share for stalled
/// fingers.
const WEAK_SHARE: f64 = 0.35;
/// Control ticks after which a weak hold counts as lost: braking weakens it for a shorter time. A
/// tenth of a second.
const WEAK_TICKS: u32 = 6;

/// Closes the fingers until they stall. Returns `true` if they stalled on something.
///
/// # Errors
/// [`Interrupt`] if the action has to end.
pub fn close(robot: &mut Operator<'_>) -> Result<bool, Interrupt> {
    robot.set_opening(0.0);
    let until = robot.elapsed_secs() + CLOSE_SECS;
    let mut still_ticks = 0;
    while robot.elapsed_secs() < until && still_ticks < 10 {
        robot.wait(1e-3)?;
        let speed = robot
            .layout()
            .gripper
            .speeds(&robot.observe().velocities)
            .map(f64::abs);
        still_ticks = if speed[0].max(speed[1]) < STALLED && feels(robot) {
            still_ticks + 1
        } else {
            0
        };
    }
    Ok(feels(robot))
}

/// Whether both fingers push with about the commanded force.
pub fn feels(robot: &Operator<'_>) -> bool {
    feels_in(&robot.observe(), robot.profile().hand.grip_force_n)
}

/// Whether both observed finger efforts are close to the commanded force.
pub fn feels_in(observed: &Observation, grip_force_n: f64) -> bool {
    observed
        .finger_efforts_n
        .iter()
        .all(|effort| *effort > FELT_SHARE * grip_force_n)
}

/// Checks at every tick whether a hand still holds the object it closed on.
#[derive(Debug, Clone)]
pub struct GripWatch {
    opening_m: f64,
    weak_n: f64,
    weak_ticks: u32,
    slipped: bool,
    load_n: f64,
}

impl GripWatch {
    /// Starts from the current observation, with fingers commanded to press with this force.
    pub fn new(observed: &Observation, grip_force_n: f64) -> Self {
        let weak_n = WEAK_SHARE * grip_force_n;
        Self {
            opening_m: observed.gripper_opening_m,
            weak_n,
            weak_ticks: 0,
            slipped: false,
            load_n: 0.0,
        }
    }

    /// The same for a wall of this thickness: a vessel that is held at its rim turns until its wall
    /// lies between the fingers.
    pub fn of_wall(self, wall_m: f64) -> Self {
        Self {
            opening_m: wall_m / 2.0 + GAVE_WAY_M,
            ..self
        }
    }

    /// Updates with the observation of the next control tick, and the force that the arm carries
    /// then. Unit: newtons.
    pub fn look(&mut self, observed: &Observation, load_n: f64) {
        let weak = observed
            .finger_efforts_n
            .iter()
            .any(|effort| *effort < self.weak_n);
        if !weak {
            self.load_n = if self.slipped { self.load_n } else { load_n };
        } else if self.weak_ticks == 0 && !self.slipped {
            // A hold that broke in this tick carried the load for a part of it.
            self.load_n = self.load_n.max(load_n);
        }
        self.weak_ticks = if weak { self.weak_ticks + 1 } else { 0 };
        let gave_way = observed.gripper_opening_m < self.opening_m - GAVE_WAY_M;
        self.slipped = self.slipped || gave_way || self.weak_ticks >= WEAK_TICKS;
    }

    /// The force that the arm carried when the hold was last felt. Unit: newtons.
    pub fn load_n(&self) -> f64 {
        self.load_n
    }

    /// Whether the hold was lost at any time.
    pub fn slipped(&self) -> bool {
        self.slipped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn felt(gripper_opening_m: f64, effort: f64) -> Observation {
        let (positions, velocities, loads) = (Vec::new(), Vec::new(), Vec::new());
        Observation {
            time_secs: 0.0,
            positions,
            velocities,
            gripper_opening_m,
            finger_efforts_n: [effort, 7.0],
            loads,
        }
    }

    #[test]
    fn a_grip_is_lost_if_the_fingers_close_further_or_feel_no_contact() {
        let held = GripWatch::new(&felt(0.08, 7.0), 7.0);
        let mut shaken = held.clone();
        for effort in [7.0, 1.0, 1.0, 7.0, 6.0] {
            shaken.look(&felt(0.078, effort), 2.0);
        }
        assert!(!shaken.slipped(), "brief shaking does not count as a slip");
        let mut closing = held.clone();
        closing.look(&felt(0.065, 7.0), 2.0);
        closing.look(&felt(0.08, 7.0), 3.0);
        assert!(closing.slipped(), "a lost hold is not regained");
        let mut weak = held;
        for _ in 0..WEAK_TICKS {
            assert!(!weak.slipped());
            weak.look(&felt(0.08, 0.5), 2.0);
        }
        assert!(weak.slipped());
    }
}
