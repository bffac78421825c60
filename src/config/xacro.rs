//! xacro, which other programs expand to URDF.

use std::path::Path;
use std::process::{Command, Stdio};

use crate::base::Source;

/// The program, as ROS installs it and `pip install xacro` does.
const PROGRAM: &str = "xacro";

/// Why a xacro file is of no use.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Unexpanded {
    /// A lower-case sentence.
    pub(super) message: String,
    /// What to do.
    pub(super) help: String,
}

/// Whether a file is xacro, by its name.
pub(super) fn is_xacro(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending == "xacro")
}

/// The URDF that a xacro file stands for, by the program `xacro`.
///
/// # Errors
/// The program is not there, or refuses the file in its own words.
pub(super) fn expand(path: &Path) -> Result<Source, Unexpanded> {
    let shown = path.display();
    let output = Command::new(PROGRAM).arg(path).stdin(Stdio::null()).output().map_err(|error| Unexpanded {
        message: format!("{shown} is xacro, which the program `xacro` expands, and that can't be started: {error}"),
        help: format!("install it (`pip install xacro`), or expand the file elsewhere: `xacro {shown} > robot.urdf`"),
    })?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        let said: Vec<&str> = said.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
        return Err(Unexpanded {
            message: format!("xacro refuses {shown}: {}", plain(&said.join("; "))),
            help: format!("see what `xacro {shown}` says; packages that it looks for have to be installed"),
        });
    }
    let text = String::from_utf8(output.stdout).map_err(|_| Unexpanded {
        message: format!("xacro makes of {shown} what is not UTF-8 text"),
        help: "see what stands in the file".to_owned(),
    })?;
    Ok(Source::new(format!("{shown} (expanded)"), text))
}

/// Without colours and other codes for terminals.
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
