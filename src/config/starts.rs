//! The programs that a configuration starts.

use std::ffi::OsString;
use std::path::Path;

use crate::{Launcher, Table, model_library, robot, skill};
use actcheck_base::{Diagnostics, Source};

/// The words of the commands that a configuration starts: a program and its arguments.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Starts {
    /// `xacro`, as soon as the configuration is loaded: its file may contain code.
    pub expansion: Option<Vec<OsString>>,
    /// The skill, when runs are simulated.
    pub skill: Option<Vec<OsString>>,
}

/// Finds the programs that a configuration starts, without starting any. Paths in the text are
/// relative to `folder`. Faults are left to [`crate::load_text`], which finds the same programs.
pub fn starts(source: &Source, folder: &Path) -> Starts {
    let mut found = Diagnostics::new();
    let Ok(mut table) = Table::parse(source) else {
        return Starts::default();
    };
    let skill = match skill::read(&mut table, folder, &mut found) {
        Launcher::Reference => None,
        Launcher::Program(skill) => Some(skill.words()),
    };
    let mut library = model_library::read(&mut table, folder, &mut found);
    let profile = library.locate_robot(&mut table, folder, &mut found);
    Starts {
        expansion: profile.and_then(|(files, path, _)| robot::expansion(&files, &path)),
        skill,
    }
}
