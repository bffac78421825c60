//! Links of many pieces: those whose mesh was split into convex hulls.
//!
//! A hand of such links has dozens of pairs of hulls near an object, most of which never touch it.
//! The simulation looks at them less often. Robots of few pieces gain nothing by that, and keep the
//! bits of their runs.

use crate::description::{Link, RobotModel};

/// Fewest collision shapes of a link of many pieces.
const MANY_PIECES: usize = 4;

impl Link {
    /// Returns whether it has many collision shapes.
    pub(crate) fn has_many_pieces(&self) -> bool {
        self.solids.len() >= MANY_PIECES
    }
}

impl RobotModel {
    /// Returns whether any of its links has.
    pub(crate) fn has_many_pieces(&self) -> bool {
        self.links.iter().any(Link::has_many_pieces)
    }
}
