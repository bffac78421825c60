//! The clock that campaigns use.

use std::sync::OnceLock;
use std::time::{Instant, SystemTime};

use actcheck_campaign::Clock;

/// The machine's clock.
pub fn system() -> Clock {
    Clock { now, secs }
}

fn now() -> String {
    // Campaigns are sorted by start time, and a campaign can begin in the same second as its
    // regressions.
    format!("{:.3}", timestamp())
}

/// The time of the machine's clock, or the nearest one of the years −9999 to 9999.
pub(super) fn timestamp() -> jiff::Timestamp {
    let now = SystemTime::now();
    let nearest = if now < SystemTime::UNIX_EPOCH {
        jiff::Timestamp::MIN
    } else {
        jiff::Timestamp::MAX
    };
    jiff::Timestamp::try_from(now).unwrap_or(nearest)
}

fn secs() -> f64 {
    static START: OnceLock<Instant> = OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_secs_f64()
}
