//! Ctrl-C: the first asks the program to stop, the second ends it at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::output;
use actcheck_base::{Diagnostic, Diagnostics};

/// Exit code of a command that was interrupted.
pub const INTERRUPTED: u8 = 130;

/// Work that does not check the flag (sorting millions of rows, opening a store) is ended after
/// this time.
const GRACE: Duration = Duration::from_secs(1);

/// Returns a flag that Ctrl-C (or a termination signal) sets; then `asked` is called once. A second
/// signal ends the process at once; committed data is kept.
pub fn on_interrupt(asked: impl Fn() + Send + 'static) -> Arc<AtomicBool> {
    let flag = Arc::new(AtomicBool::new(false));
    let seen = Arc::clone(&flag);
    // Without a handler Ctrl-C ends the process at once, which loses no committed data either.
    let _ = ctrlc::set_handler(move || {
        if seen.swap(true, Ordering::Relaxed) {
            std::process::exit(i32::from(INTERRUPTED));
        }
        asked();
    });
    flag
}

/// Reports the interrupt and ends the process. Call it only while no file is partly written.
pub fn end_now() -> ! {
    tell();
    std::process::exit(i32::from(INTERRUPTED));
}

/// Does a command's work so that Ctrl-C can end it at any moment: through the flag if the work
/// checks it, else after one second. Returns the exit code.
pub fn interruptible(
    work: impl FnOnce(&Arc<AtomicBool>) -> Result<u8, Diagnostics>,
) -> Result<u8, Diagnostics> {
    let flag = on_interrupt(|| {
        std::thread::sleep(GRACE);
        end_now();
    });
    match work(&flag) {
        // Any fault is a consequence of the interrupt.
        Err(_) if flag.load(Ordering::Relaxed) => {
            tell();
            Ok(INTERRUPTED)
        }
        done => done,
    }
}

/// Reports the interrupt.
pub fn tell() {
    let help = "written files and runs are complete; work in progress is lost";
    output::print_diagnostics(&Diagnostic::error("X030", "interrupted").help(help).into());
}
