//! From a program's file to its exports.

use std::path::{Path, PathBuf};

use crate::base::{Diagnostic, Diagnostics, Files};
use crate::rules::findings::{Budget, RuleFault, interrupted};
use crate::rules::standalone::export::{exports, write};
use crate::rules::standalone::program::{Engine, Program};

/// What a run of a program did.
#[derive(Debug, Clone, Default)]
pub struct Summary {
    /// Tuples of each predicate, by name.
    pub tuples: Vec<(String, usize)>,
    /// Files written, with the number of their rows.
    pub written: Vec<(PathBuf, usize)>,
    /// What is odd about the program but no fault.
    pub warnings: Diagnostics,
}

/// Runs a program: reads its imports (relative to its own folder), closes it, writes its exports below `out_dir`.
///
/// # Errors
/// All faults of the program and its files; the budget was spent (`R090`); an export can't be written (`R073`); somebody
/// set the budget's `stop` (`R091`).
pub fn run(path: &Path, out_dir: &Path, budget: &Budget) -> Result<Summary, Diagnostics> {
    let source = Files::Disk
        .read(path)
        .map_err(|reason| Diagnostic::error("R072", format!("`{}` can't be read: {reason}", path.display())))?;
    let program = Program::load_until(&source, path.parent().unwrap_or(Path::new("")), &budget.stop)?;
    let mut diagnostics = Diagnostics::new();
    let exports = exports(&program, &mut diagnostics);
    if diagnostics.has_errors() {
        return Err(diagnostics);
    }
    let closure = program.close(Engine::Fast, budget).map_err(|fault| {
        if fault == RuleFault::Interrupted {
            return interrupted().in_source(&source);
        }
        let help =
            "a rule that makes new values from its own results may never end; give it a limit such as `?x < 100`";
        Diagnostic::error("R090", fault.to_string()).in_source(&source).help(help)
    })?;
    let mut summary = Summary { warnings: program.warnings, ..Summary::default() };
    summary.tuples = closure.predicates().map(|name| (name.to_owned(), closure.count(name))).collect();
    for export in exports {
        let count = write(&export, out_dir, &closure, &budget.stop).map_err(|reason| {
            let message = format!("`{}` can't be written: {reason}", out_dir.join(&export.path).display());
            Diagnostic::error("R073", message).in_source(&source)
        })?;
        summary.written.push((out_dir.join(&export.path), count));
    }
    Ok(summary)
}
