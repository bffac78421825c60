//! `actcheck datalog`

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::args::{DatalogArgs, ProofFormat};
use crate::output;
use actcheck_base::{Diagnostic, Diagnostics, Files};
use actcheck_report::Table;
use actcheck_rules::standalone::{self, Program};
use actcheck_rules::{Budget, explain::Explanation};

/// Runs a standalone program, or explains why one of its facts holds or does not.
pub fn datalog(args: &DatalogArgs, stop: &Arc<AtomicBool>) -> Result<(), Diagnostics> {
    let budget = Budget { tuples: args.max_tuples, secs: args.max_secs, stop: Arc::clone(stop) };
    if let Some(statement) = &args.trace {
        let source = Files::Disk.read(&args.file).map_err(|why| {
            Diagnostic::error("X005", format!("{}: {why}", args.file.display())).help("name a file with rules (.rls)")
        })?;
        let folder = args.file.parent().unwrap_or(Path::new("."));
        let program = Program::load_until(&source, folder, stop)?;
        let explained = program.explain(statement, &budget);
        let explained = explained.map_err(|fault| Diagnostic::error("X008", fault.to_string()).in_source(&source))?;
        output::print(&rendered(&explained, args.format));
        return Ok(());
    }
    let summary = standalone::run(&args.file, &args.output, &budget)?;
    output::print_diagnostics(&summary.warnings);
    let mut table = Table::new(["predicate", "tuples"]);
    for (predicate, tuples) in summary.tuples {
        table.rows.push(vec![predicate.into(), tuples.into()]);
    }
    output::print(&table.render(actcheck_report::TableFormat::Table));
    for (file, lines) in summary.written {
        output::print(&format!("{}: {lines} lines\n", file.display()));
    }
    Ok(())
}

/// Renders an explanation in a format.
pub(super) fn rendered(explanation: &Explanation, format: ProofFormat) -> String {
    match format {
        ProofFormat::Text => explanation.to_text(),
        ProofFormat::Json => format!("{:#}\n", explanation.to_json()),
        ProofFormat::Dot => explanation.to_dot(),
    }
}
