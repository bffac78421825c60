//! The Python client: its own tests and types, installed as a user installs it.

use std::path::Path;
use std::process::{Command, Output};

use crate::support::{foreign, root, stderr, stdout};

/// Runs Python in the client's folder, and leaves nothing behind there.
fn python(arguments: &[&str]) -> Output {
    Command::new(foreign::client_python())
        .args(arguments)
        .current_dir(root().join("clients/python"))
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .output()
        .unwrap()
}

#[test]
fn its_own_tests_pass_on_the_installed_package() {
    let place = stdout(&python(&["-c", "import actcheck; print(actcheck.__file__)"]));
    assert!(place.contains("site-packages"), "{place}");
    let output = python(&["-W", "error::DeprecationWarning", "-m", "unittest"]);
    let told = stderr(&output);
    assert!(output.status.success(), "{told}");
    let ran = told.lines().find_map(|line| line.strip_prefix("Ran ")?.split(' ').next()?.parse::<u32>().ok());
    assert!(ran.is_some_and(|ran| ran >= 40), "{told}");
}

#[test]
fn its_types_hold() {
    let cache = Path::new(env!("CARGO_TARGET_TMPDIR")).join("mypy");
    let output = python(&["-m", "mypy", "--strict", "--cache-dir", &cache.to_string_lossy()]);
    assert!(output.status.success(), "{}", stdout(&output));
}
