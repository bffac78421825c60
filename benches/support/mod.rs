//! CPU time, which does not depend on other load of the machine, and wall time.

use std::sync::LazyLock;
use std::time::Instant;

static START: LazyLock<Instant> = LazyLock::new(Instant::now);

/// CPU time of this thread; wall time if the system does not report it (other than Linux). Unit:
/// seconds.
pub fn thread_secs() -> f64 {
    let stat = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = stat.and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok());
    nanoseconds.map_or_else(wall_secs, |nanoseconds| nanoseconds * 1e-9)
}

/// Wall time since the first call. Unit: seconds.
pub fn wall_secs() -> f64 {
    START.elapsed().as_secs_f64()
}
