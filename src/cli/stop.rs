//! Ctrl-C: the first one asks, the second one insists.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Exit code of a command that was interrupted.
pub const INTERRUPTED: u8 = 130;

/// A flag that Ctrl-C (or a termination signal) sets, after which `asked` is called once. The second one ends the
/// process at once; what was committed stays.
pub fn on_interrupt(asked: impl Fn() + Send + 'static) -> Arc<AtomicBool> {
    let flag = Arc::new(AtomicBool::new(false));
    let seen = Arc::clone(&flag);
    // Without a handler Ctrl-C ends the process at once, which loses nothing that was committed either.
    let _ = ctrlc::set_handler(move || {
        if seen.swap(true, Ordering::Relaxed) {
            std::process::exit(i32::from(INTERRUPTED));
        }
        asked();
    });
    flag
}
