//! The `actcheck` command: parses its arguments, does what they ask, and exits.

use std::process::ExitCode;

fn main() -> ExitCode {
    actcheck::cli::run()
}
