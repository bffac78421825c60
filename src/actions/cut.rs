//! Limits that cut a run off, regardless of its actions.

/// When a run is cut off. The action in progress then ends as [`actcheck_data::ActionEnd::Cut`].
#[derive(Debug, Clone, Copy, Default)]
pub enum Cut {
    /// Never.
    #[default]
    Never,
    /// When the caller's clock reaches this time, for runs that exceed their wall-clock limit.
    Clock {
        /// Seconds since any fixed moment.
        secs: fn() -> f64,
        /// The moment, by the same clock.
        at_secs: f64,
    },
    /// At this simulated time since the scene was built. This reproduces exactly a run that the
    /// clock cut off.
    Simulated {
        /// Unit: seconds.
        at_secs: f64,
    },
}

/// Reason reported for a run that was cut off.
pub(super) const REASON: &str = "the run exceeded its wall-clock limit, `[budget] run_secs`";

impl Cut {
    /// Whether the run ends at this simulated time.
    pub(super) fn is_due(&self, time_secs: f64) -> bool {
        match *self {
            Self::Never => false,
            Self::Clock { secs, at_secs } => secs() >= at_secs,
            Self::Simulated { at_secs } => time_secs >= at_secs,
        }
    }
}
