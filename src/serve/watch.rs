//! Limits on the own process, enforced from a separate thread, whatever the evaluator does.

use std::time::{Duration, Instant};

/// Exit code if the time limit is exceeded.
pub(super) const TIME_SPENT: i32 = 124;
/// Exit code if the memory limit is exceeded.
pub(super) const MEMORY_SPENT: i32 = 125;

/// Interval between checks. A process that allocates 1 GB/s exceeds its limit by 20 MB.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// Exits this process after `secs`, or once it uses more than `memory`.
///
/// Units: seconds, bytes. The memory limit works only on systems that report memory in `/proc`, such as Linux.
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

/// Resident memory of this process; `None` if the system does not report it. Unit: bytes.
fn resident() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    Some(line.trim().trim_end_matches("kB").trim().parse::<u64>().ok()? * 1024)
}
