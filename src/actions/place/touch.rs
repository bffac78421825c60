//! What an arm feels of what its hand holds: its weight, and when something else carries it.

use crate::actions::operator::Operator;

/// The arm has to carry so much less before that is a touch. Unit: newtons. Ten times what braking and the joints' own damping
/// make of it, and less than half of what makes a thing slide between the fingers.
const TOUCH_N: f64 = 2.5;
/// Share of what is felt now in what counts: three control ticks' worth.
const SHARE: f64 = 0.35;

/// Force with which the hand is held up beyond its own weight. Unit: newtons.
///
/// Source: the virtual work of the arm's joints for a movement straight up, τ = Jᵀ·F; the best F of all joints together.
pub fn carried_n(robot: &Operator<'_>) -> f64 {
    let observed = robot.observe();
    let (_, jacobian) = robot.kinematics().grasp_jacobian(&observed.positions);
    let arm = robot.layout().arm.iter();
    let (mut work, mut square) = (0.0, 1e-9);
    for idx in arm {
        let rise = jacobian[(2, *idx)];
        work += rise * observed.loads[*idx];
        square += rise * rise;
    }
    work / square
}

/// Feels whether what is held is being set down.
#[derive(Debug, Clone)]
pub struct Touch {
    free_n: f64,
    felt_n: f64,
}

impl Touch {
    /// Begins with a thing that hangs free, at rest.
    pub fn new(robot: &Operator<'_>) -> Self {
        let free_n = carried_n(robot);
        Self { free_n, felt_n: free_n }
    }

    /// One control tick later: whether something else carries the thing by now.
    pub fn felt(&mut self, robot: &Operator<'_>) -> bool {
        self.felt_n += SHARE * (carried_n(robot) - self.felt_n);
        self.free_n - self.felt_n > TOUCH_N
    }
}
