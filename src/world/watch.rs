//! Measures the wall time of the simulation, with a clock supplied by the caller.

use std::cell::Cell;

/// The wall times of the engine's steps and of camera images since the start.
#[derive(Debug, Default)]
pub(super) struct Watch {
    /// Returns the time in seconds. `None`: nothing is measured.
    clock_secs: Option<fn() -> f64>,
    engine_secs: f64,
    /// In a cell, because taking an image does not change the world.
    camera_secs: Cell<f64>,
}

impl Watch {
    /// Creates a watch with this clock, which measures from now on.
    pub(super) fn new(clock_secs: fn() -> f64) -> Self {
        Self {
            clock_secs: Some(clock_secs),
            ..Self::default()
        }
    }

    /// Returns the clock's time, or `None` without a clock. Unit: seconds.
    pub(super) fn now_secs(&self) -> Option<f64> {
        self.clock_secs.map(|clock_secs| clock_secs())
    }

    /// Returns the time since another one, or 0 without a clock. Unit: seconds.
    fn since(&self, began_secs: Option<f64>) -> f64 {
        match (self.now_secs(), began_secs) {
            (Some(now), Some(began)) => now - began,
            _ => 0.0,
        }
    }

    /// Adds the time of a step that was started at this time. Unit: seconds.
    pub(super) fn stepped(&mut self, began_secs: Option<f64>) {
        self.engine_secs += self.since(began_secs);
    }

    /// Adds the time of an image that was started at this time. Unit: seconds.
    pub(super) fn looked(&self, began_secs: Option<f64>) {
        self.camera_secs
            .set(self.camera_secs.get() + self.since(began_secs));
    }

    /// Returns the time of all steps. Unit: seconds.
    pub(super) fn engine_secs(&self) -> f64 {
        self.engine_secs
    }

    /// Returns the time of all images. Unit: seconds.
    pub(super) fn camera_secs(&self) -> f64 {
        self.camera_secs.get()
    }
}
