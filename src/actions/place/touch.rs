//! Arm force sensing: the weight of the held object, and contact with a surface that carries it.

use crate::operator::Operator;

/// Drop of the carried force that counts as contact. Unit: newtons. Ten times the effect of braking
/// and joint damping, and less than half of the force that makes an object slide between the
/// fingers.
const TOUCH_N: f64 = 2.5;
/// Weight of the current reading in the smoothed force: about three control ticks.
const SHARE: f64 = 0.35;

/// Force that holds up the hand's load beyond the hand's own weight. Unit: newtons.
///
/// Source: virtual work of the arm's joints for an upward movement, τ = Jᵀ·F; the least-squares F
/// over all joints.
pub fn carried_n(robot: &Operator<'_>) -> f64 {
    let observed = robot.observe();
    let (_, jacobian) = robot.kinematics().grasp_jacobian(&observed.positions);
    let arm = robot.layout().arm.iter();
    let (mut work, mut square) = (0.0, 1e-9);
    for idx in arm {
        let rise = jacobian[*idx].z;
        work += rise * observed.loads[*idx];
        square += rise * rise;
    }
    work / square
}

/// Detects when the held object is being set down.
#[derive(Debug, Clone)]
pub struct Touch {
    free_n: f64,
    felt_n: f64,
}

impl Touch {
    /// Starts with an object at rest that touches nothing else.
    pub fn new(robot: &Operator<'_>) -> Self {
        let free_n = carried_n(robot);
        Self {
            free_n,
            felt_n: free_n,
        }
    }

    /// Updates after a control tick. Returns `true` once something else carries the object.
    pub fn felt(&mut self, robot: &Operator<'_>) -> bool {
        self.felt_n += SHARE * (carried_n(robot) - self.felt_n);
        self.free_n - self.felt_n > TOUCH_N
    }
}
