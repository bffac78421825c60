//! Runs a program file and writes its exports.

use std::path::{Path, PathBuf};

use crate::engine::budget::Budget;
use crate::standalone::export::{exports, write};
use crate::standalone::program::{Engine, Loading, Program};
use crate::watch::Stop;
use actcheck_base::{Diagnostic, Diagnostics, Files, RuleFault, Source};

/// Results of running a program.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct Summary {
    /// Name and number of tuples of each predicate.
    pub tuples: Vec<(String, usize)>,
    /// Files written, with their numbers of rows.
    pub written: Vec<(PathBuf, usize)>,
    /// Warnings about the program.
    pub warnings: Diagnostics,
}

/// Runs a program: reads its imports (relative to its folder), evaluates it, and writes its exports
/// below `out_dir`.
///
/// # Errors
/// All errors of the program and its files; the budget was exceeded (`R090`); a sum does not fit
/// (`R065`); an export can't be written (`R073`); the budget's `stop` was set (`R091`).
pub fn run(path: &Path, out_dir: &Path, budget: &Budget) -> Result<Summary, Diagnostics> {
    run_as(path, out_dir, &Loading::within(budget))
}

/// Like [`run`], on request without the rows of imports that can't be read. The imports may take
/// the budget's time, and then the evaluation too.
///
/// # Errors
/// As [`run`].
pub fn run_as(path: &Path, out_dir: &Path, loading: &Loading) -> Result<Summary, Diagnostics> {
    let source = Files::Disk.read_program(path).map_err(|reason| {
        Diagnostic::error(
            "R072",
            format!("`{}` can't be read: {reason}", path.display()),
        )
    })?;
    let program = Program::load_as(&source, path.parent().unwrap_or(Path::new("")), loading)?;
    let mut diagnostics = Diagnostics::new();
    let exports = exports(&program, &mut diagnostics);
    if diagnostics.has_errors() {
        return Err(diagnostics);
    }
    let closure = program
        .closed(Engine::Fast, &loading.budget)
        .map_err(|(fault, stop)| stopped(&fault, stop, &program.endless, &source))?;
    let mut summary = Summary {
        warnings: program.warnings,
        ..Summary::default()
    };
    summary.tuples = closure
        .predicates()
        .map(|name| (name.to_owned(), closure.count(name)))
        .collect();
    for export in exports {
        let written = write(&export, out_dir, &closure, &loading.budget.stop).map_err(|error| {
            let reason = error.to_string().to_lowercase();
            let message = format!(
                "`{}` can't be written: {reason}",
                out_dir.join(&export.path).display()
            );
            Diagnostic::error("R073", message).in_source(&source)
        })?;
        if written.left_out > 0 {
            let count = written.left_out;
            let rows = if count == 1 {
                "1 row was".to_owned()
            } else {
                format!("{count} rows were")
            };
            let message = format!(
                "{rows} left out of the export of `{}`: not RDF statements",
                export.predicate
            );
            let help = "a subject is an IRI or a blank node, and a predicate an IRI";
            summary.warnings.push(
                Diagnostic::warning("R075", message)
                    .in_source(&source)
                    .help(help),
            );
        }
        summary
            .written
            .push((out_dir.join(&export.path), written.rows));
    }
    Ok(summary)
}

/// Returns the error of a stopped evaluation; if there were too many new things, after the warnings
/// `endless`, which say why.
fn stopped(fault: &RuleFault, stop: Stop, endless: &Diagnostics, source: &Source) -> Diagnostics {
    if *fault == RuleFault::Interrupted {
        return Diagnostic::error("R091", fault.to_string())
            .in_source(source)
            .into();
    }
    if let RuleFault::Value(reason) = fault {
        let help =
            "sum doubles, as in `#sum(?x)` with `?x = DOUBLE(?n)`, or fewer values in each group";
        return Diagnostic::error("R065", reason)
            .in_source(source)
            .help(help)
            .into();
    }
    let mut found = Diagnostics::new();
    let help = if stop == Stop::NewThings {
        found.extend(endless.clone());
        "a rule that makes new things for its own things may never terminate; `--max-new` sets the limit"
    } else {
        "a recursive rule that computes new values may never terminate; add a limit such as `?x < 100`"
    };
    found.push(
        Diagnostic::error("R090", fault.to_string())
            .in_source(source)
            .help(help),
    );
    found
}
