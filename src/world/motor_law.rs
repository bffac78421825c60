//! The drives of a joint: its motor's law, as a soft constraint on its velocity within bounds.

/// A soft constraint on the velocity of one joint: its impulse is `gain · (wanted − velocity)`,
/// within bounds.
#[derive(Debug, Clone, Copy)]
pub(super) struct VelocityConstraint {
    pub(super) joint: usize,
    pub(super) gain: f64,
    pub(super) wanted: f64,
    /// Smallest and largest impulse.
    pub(super) bounds: [f64; 2],
    /// The bound that it has reached, if any.
    pub(super) at: Option<usize>,
}

impl VelocityConstraint {
    /// Returns a drive without effect.
    pub(super) fn none(joint: usize) -> Self {
        Self {
            joint,
            gain: 0.0,
            wanted: 0.0,
            bounds: [0.0, 0.0],
            at: None,
        }
    }

    /// Updates whether the drive has reached a bound at this velocity. Returns whether that has
    /// changed.
    pub(super) fn update(&mut self, velocity: f64) -> bool {
        let impulse = self.gain * (self.wanted - velocity);
        let at = if impulse < self.bounds[0] {
            Some(0)
        } else if impulse > self.bounds[1] {
            Some(1)
        } else {
            None
        };
        std::mem::replace(&mut self.at, at) != at
    }
}

/// The state of a joint. Units: metres or radians, and per second.
#[derive(Debug, Clone, Copy)]
pub(super) struct State {
    pub(super) position: f64,
    pub(super) velocity: f64,
}

/// The law of a joint's motor in one step.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Law {
    /// Target position.
    pub(super) target: f64,
    /// Target velocity.
    pub(super) velocity: f64,
    pub(super) stiffness: f64,
    pub(super) damping: f64,
    /// Largest effort.
    pub(super) most: f64,
}

impl Law {
    /// Returns the effort that the law demands in this state, without its bounds.
    pub(super) fn effort(self, at: State) -> f64 {
        self.stiffness * (self.target - at.position) + self.damping * (self.velocity - at.velocity)
    }

    /// Returns the motor's drive for a substep of `secs`.
    pub(super) fn drive(
        self,
        joint: usize,
        position: f64,
        limits: [f64; 2],
        secs: f64,
    ) -> VelocityConstraint {
        let resistance = secs * self.stiffness + self.damping;
        let pull = if resistance > 0.0 {
            self.stiffness / resistance
        } else {
            0.0
        };
        let [slowest, fastest] = limits.map(|limit| (limit - position) / secs);
        let velocity = self.velocity.max(slowest).min(fastest);
        let most = self.most * secs;
        let wanted = velocity - (position - self.target) * pull;
        VelocityConstraint {
            joint,
            gain: secs * resistance,
            wanted,
            bounds: [-most, most],
            at: None,
        }
    }
}
