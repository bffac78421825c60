//! The robot's measurements of itself and the commands of its controllers, over time.

use serde::{Deserialize, Serialize};

/// The robot's motion during one action, sampled as often as the bodies' poses; the first row is
/// the initial state.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    /// Names of the joints, in the robot's order.
    pub joints: Vec<String>,
    /// One row per moment; see [`MotionRow`]. Shape: moments × (12 + 4 · joints).
    pub rows: Vec<Vec<f32>>,
}

/// One moment of a [`Motion`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionRow<'a> {
    /// Time since the action began. Unit: seconds.
    pub time_secs: f32,
    /// Measured gap between the fingers. Unit: metres.
    pub opening_m: f32,
    /// Force of each finger's motor, left and right; positive closes. Unit: newtons.
    pub finger_efforts_n: [f32; 2],
    /// Commanded gap between the fingers. Unit: metres.
    pub commanded_opening_m: f32,
    /// Commanded largest force of a finger. Unit: newtons.
    pub commanded_force_n: f32,
    /// True base pose: x, y (metres), heading (radians). Frame: world.
    pub base_true: [f32; 3],
    /// Believed base pose, in the same order.
    pub base_believed: [f32; 3],
    joints: &'a [f32],
}

/// One joint at one moment. Units: metres or radians, and their efforts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointMoment {
    /// Measured position; for the base, by its own belief.
    pub position: f32,
    /// Measured velocity.
    pub velocity: f32,
    /// Effort of its motor, without gravity compensation.
    pub effort: f32,
    /// Commanded position in the control tick that ended at this moment.
    pub target: f32,
}

impl Motion {
    /// Returns its moments in order. Rows of the wrong length are skipped.
    pub fn moments(&self) -> impl Iterator<Item = MotionRow<'_>> {
        self.rows.iter().filter_map(|row| {
            let (head, joints) = row.split_first_chunk::<12>()?;
            let [
                time_secs,
                opening_m,
                left,
                right,
                commanded_opening_m,
                commanded_force_n,
                base @ ..,
            ] = *head;
            let [true_x, true_y, true_heading, x, y, heading] = base;
            (joints.len() == 4 * self.joints.len()).then_some(MotionRow {
                time_secs,
                opening_m,
                finger_efforts_n: [left, right],
                commanded_opening_m,
                commanded_force_n,
                base_true: [true_x, true_y, true_heading],
                base_believed: [x, y, heading],
                joints,
            })
        })
    }
}

impl<'a> MotionRow<'a> {
    /// Returns its joints, in the order of [`Motion::joints`].
    pub fn joints(&self) -> impl Iterator<Item = JointMoment> + 'a {
        self.joints.chunks_exact(4).map(|values| JointMoment {
            position: values[0],
            velocity: values[1],
            effort: values[2],
            target: values[3],
        })
    }
}
