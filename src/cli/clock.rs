//! The clock that campaigns use.

use std::sync::OnceLock;
use std::time::Instant;

use actcheck_campaign::Clock;

/// The machine's clock.
pub fn system() -> Clock {
    Clock { now, secs }
}

fn now() -> String {
    // Campaigns are sorted by start time, and a campaign can begin in the same second as its regressions.
    format!("{:.3}", jiff::Timestamp::now())
}

fn secs() -> f64 {
    static START: OnceLock<Instant> = OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_secs_f64()
}
