//! How good the simulation itself was.

use serde::{Deserialize, Serialize};

/// The worst errors of physics in a run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// Deepest penetration of two bodies in contact. Unit: metres.
    pub deepest_penetration_m: f64,
    /// Largest rise of the kinetic and potential energy of the objects that the robot could not
    /// have pushed: it touched neither them nor their neighbours. Unit: joules. Real objects only
    /// lose energy.
    pub energy_gain_j: f64,
}
