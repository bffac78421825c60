//! Time on the processor: what a program used of it, however many others share the machine.

use std::sync::LazyLock;
use std::time::Instant;

static START: LazyLock<Instant> = LazyLock::new(Instant::now);

/// Time that this thread was on a processor; where the system does not tell (it is not Linux), time on the clock.
/// Unit: seconds.
pub fn thread_secs() -> f64 {
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = told.and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok());
    nanoseconds.map_or_else(wall_secs, |nanoseconds| nanoseconds * 1e-9)
}

/// Time on the clock since the program's first look at it. Unit: seconds.
pub fn wall_secs() -> f64 {
    START.elapsed().as_secs_f64()
}
