//! Tests that can't run on this machine.

use std::fs::OpenOptions;
use std::io::Write as _;

/// Says that a test, or the part of it that `part` names, can't run here, and why. `.ci/test` lists
/// these tests: it names the file of the environment variable `ACTCHECK_LEFT_OUT`.
pub fn left_out(part: &str, why: &str) {
    let thread = std::thread::current();
    // With one thread, tests run in the main one.
    let test = thread.name().filter(|name| *name != "main");
    let line = format!("{}\t{part}: {why}\n", test.unwrap_or_default()).replace('\r', "");
    // The test harness shows direct writes to the stream.
    let _ = write!(std::io::stderr(), "LEFT OUT {line}");
    if let Some(file) = std::env::var_os("ACTCHECK_LEFT_OUT") {
        let file = OpenOptions::new().append(true).create(true).open(file);
        // One write: lines of several tests don't mix.
        let _ = file.and_then(|mut file| file.write_all(line.as_bytes()));
    }
}
