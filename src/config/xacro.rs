//! Expands xacro to URDF with the external program `xacro`.

use std::path::Path;
use std::process::{Command, Stdio};

use actcheck_base::Source;

/// The program, as installed by ROS or by `pip install xacro`.
const PROGRAM: &str = "xacro";

/// A failed expansion.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Unexpanded {
    /// The error, in lower case.
    pub(super) message: String,
    /// How to fix it.
    pub(super) help: String,
}

/// Whether a file is xacro, by its extension.
pub(super) fn is_xacro(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending == "xacro")
}

/// Expands a xacro file to URDF with the program `xacro`.
///
/// # Errors
/// The program can't be started, reports an error in the file, or prints something other than UTF-8.
pub(super) fn expand(path: &Path) -> Result<Source, Unexpanded> {
    let shown = path.display();
    let output = Command::new(PROGRAM).arg(path).stdin(Stdio::null()).output().map_err(|error| Unexpanded {
        message: format!("cannot start the program `xacro` to expand {shown}: {error}"),
        help: format!("install it (`pip install xacro`), or expand the file elsewhere: `xacro {shown} > robot.urdf`"),
    })?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        let said: Vec<&str> = said.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
        return Err(Unexpanded {
            message: format!("xacro cannot expand {shown}: {}", plain(&said.join("; "))),
            help: format!("run `xacro {shown}` to see the error; the packages that it refers to must be installed"),
        });
    }
    let text = String::from_utf8(output.stdout).map_err(|_| Unexpanded {
        message: format!("the expansion of {shown} is not UTF-8 text"),
        help: "check the file's encoding".to_owned(),
    })?;
    Ok(Source::new(format!("{shown} (expanded)"), text))
}

/// Removes colours and other terminal codes.
fn plain(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    let mut rest = text.chars();
    while let Some(char) = rest.next() {
        match char {
            '\u{1b}' => _ = rest.find(char::is_ascii_alphabetic),
            char if char.is_control() => plain.push(' '),
            char => plain.push(char),
        }
    }
    plain
}
