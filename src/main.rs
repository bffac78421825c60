//! The `actcheck` command-line program.

use std::process::ExitCode;

fn main() -> ExitCode {
    actcheck::cli::run(env!("ACTCHECK_SOURCES_DIGEST"))
}
