//! A process that ends itself: nothing that a query makes the evaluator do can keep it from that.

use std::time::{Duration, Instant};

/// Exit code of a process whose time is spent.
pub(super) const TIME_SPENT: i32 = 124;
/// Exit code of a process whose memory is spent.
pub(super) const MEMORY_SPENT: i32 = 125;

/// Between two looks: at a gigabyte a second that is 20 MB more than allowed.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// Ends this process when so much time has passed, or it has so much memory.
///
/// Units: seconds, bytes. Where the system does not tell memory (Linux does), only time counts.
pub(super) fn limit(secs: f64, memory: u64) {
    let until = Duration::try_from_secs_f64(secs).ok().and_then(|secs| Instant::now().checked_add(secs));
    std::thread::spawn(move || {
        loop {
            if until.is_some_and(|until| Instant::now() >= until) {
                std::process::exit(TIME_SPENT);
            }
            if resident().is_some_and(|bytes| bytes > memory) {
                std::process::exit(MEMORY_SPENT);
            }
            std::thread::sleep(LOOK_EVERY);
        }
    });
}

/// Memory that this process has. Unit: bytes.
fn resident() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    Some(line.trim().trim_end_matches("kB").trim().parse::<u64>().ok()? * 1024)
}
