//! Limits on the own process, enforced from a separate thread, whatever the evaluator does.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Exit code if the time limit is exceeded.
pub(super) const TIME_SPENT: i32 = 124;
/// Exit code if the memory limit is exceeded.
pub(super) const MEMORY_SPENT: i32 = 125;

/// Interval between checks. A process that allocates 1 GB/s exceeds its limit by 20 MB.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// Exits this process when a task exceeds its limits.
#[derive(Debug, Clone, Default)]
pub(super) struct Watch {
    task: Arc<Mutex<Option<Limits>>>,
}

#[derive(Debug, Clone, Copy)]
struct Limits {
    until: Option<Instant>,
    memory: u64,
}

impl Watch {
    /// Starts the thread, which waits for its first task.
    pub fn start() -> Self {
        let watch = Self::default();
        let task = Arc::clone(&watch.task);
        std::thread::spawn(move || {
            loop {
                let limits = *task.lock().unwrap_or_else(PoisonError::into_inner);
                if let Some(Limits { until, memory }) = limits {
                    if until.is_some_and(|until| Instant::now() >= until) {
                        std::process::exit(TIME_SPENT);
                    }
                    if resident().is_some_and(|bytes| bytes > memory) {
                        std::process::exit(MEMORY_SPENT);
                    }
                }
                std::thread::sleep(LOOK_EVERY);
            }
        });
        watch
    }

    /// Begins a task, which may take `secs` and as long as the process uses at most `memory`.
    ///
    /// Units: seconds, bytes. The memory limit works only on systems that report memory in `/proc`,
    /// such as Linux.
    pub fn begin(&self, secs: f64, memory: u64) {
        let until = Duration::try_from_secs_f64(secs)
            .ok()
            .and_then(|secs| Instant::now().checked_add(secs));
        *self.task.lock().unwrap_or_else(PoisonError::into_inner) = Some(Limits { until, memory });
    }

    /// Ends the task.
    pub fn end(&self) {
        *self.task.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }
}

/// Resident memory of this process; `None` if the system does not report it. Unit: bytes.
pub(super) fn resident() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmRSS:"))?;
    Some(
        line.trim()
            .trim_end_matches("kB")
            .trim()
            .parse::<u64>()
            .ok()?
            * 1024,
    )
}
