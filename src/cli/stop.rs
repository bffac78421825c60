//! Ctrl-C: the first one asks, the second one insists.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::base::{Diagnostic, Diagnostics};
use crate::cli::output;

/// Exit code of a command that was interrupted.
pub const INTERRUPTED: u8 = 130;

/// What does not ask whether to stop (sorting millions of rows, opening a store) is ended after this time.
const GRACE: Duration = Duration::from_secs(1);

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

/// Ends the process, with word of why. For what has written nothing that is not whole.
pub fn end_now() -> ! {
    tell();
    std::process::exit(i32::from(INTERRUPTED));
}

/// Does a command's work so that Ctrl-C ends it at any moment: by the flag where the work looks at it, soon in any case.
/// Returns the exit code.
pub fn interruptible(work: impl FnOnce(&Arc<AtomicBool>) -> Result<(), Diagnostics>) -> Result<u8, Diagnostics> {
    let flag = on_interrupt(|| {
        std::thread::sleep(GRACE);
        end_now();
    });
    match work(&flag) {
        // Whatever fault came of it, the cause is the interrupt.
        Err(_) if flag.load(Ordering::Relaxed) => {
            tell();
            Ok(INTERRUPTED)
        }
        done => done.map(|()| 0),
    }
}

fn tell() {
    let help = "files and runs that were written are whole; what was being made is gone";
    output::print_diagnostics(&Diagnostic::error("X030", "interrupted").help(help).into());
}
