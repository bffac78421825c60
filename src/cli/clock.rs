//! The clock that campaigns use.

use std::sync::OnceLock;
use std::time::Instant;

use actcheck_campaign::Clock;

/// The machine's clock.
pub fn system() -> Clock {
    Clock { now, secs }
}

fn now() -> String {
    // Whole seconds are precise enough for readers, and shorter in the history.
    let now = jiff::Timestamp::now();
    now.round(jiff::Unit::Second).unwrap_or(now).to_string()
}

fn secs() -> f64 {
    static START: OnceLock<Instant> = OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_secs_f64()
}
