//! The clock that the campaign is given.

use std::sync::OnceLock;
use std::time::Instant;

use crate::campaign::Clock;

/// The machine's clock.
pub fn system() -> Clock {
    Clock { now, secs }
}

fn now() -> String {
    // Campaigns are ordered by their starts, and a campaign may begin within the second in which its regressions ran.
    format!("{:.3}", jiff::Timestamp::now())
}

fn secs() -> f64 {
    static START: OnceLock<Instant> = OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_secs_f64()
}
