//! `actcheck datalog`

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::Args;

use crate::option_fault::OptionFault;
use crate::options::{ProofFormat, duration, memory};
use crate::{explanations, output};
use actcheck_base::{Diagnostic, Diagnostics, Files, Source};
use actcheck_report::{Table, TableFormat};
use actcheck_rules::Budget;
use actcheck_rules::explain::Explanation;
use actcheck_rules::standalone::{self, Loading, Program};

/// Maximum number of derived tuples: few fit into the usual limit of memory.
const MOST_TUPLES: usize = 100_000_000;

/// `actcheck datalog`
#[derive(Debug, Args)]
pub struct DatalogArgs {
    /// The program (.rls)
    pub file: PathBuf,
    /// Folder for the exported files
    #[arg(
        short = 'D',
        long = "export-dir",
        value_name = "DIR",
        default_value = "results"
    )]
    pub output: PathBuf,
    /// Explain why this fact holds or does not, such as 'p(1, _)', instead of exporting. Exit code:
    /// 0 it holds, 1 it does not
    #[arg(long, value_name = "FACT")]
    pub trace: Option<String>,
    /// How the number of tuples of each predicate is printed, or with --trace the explanation (dot:
    /// only explanations)
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: ProofFormat,
    /// Stop after this many new things of rules that may make them without end
    #[arg(long, value_name = "N", default_value_t = 1_000_000)]
    pub max_new: usize,
    /// Stop at this memory of tuples and texts, approximately, such as 512MiB or 4GiB
    #[arg(long, value_name = "SIZE", default_value = "4GiB", value_parser = memory)]
    pub max_memory: usize,
    /// Stop after this time, such as 90s, 10m or 2h
    #[arg(long, value_name = "DURATION", default_value = "10m", value_parser = duration)]
    pub max_time: f64,
    /// Leave out rows and statements of imported files that can't be read, with a warning
    #[arg(long)]
    pub lenient: bool,
    /// Value of a parameter instead of that in the program, such as limit=1 or 'name="cup"'; may be
    /// repeated
    #[arg(long = "param", value_name = "NAME=VALUE", value_parser = parameter)]
    pub parameters: Vec<(String, String)>,
}

/// Parses the name and value of a parameter.
fn parameter(text: &str) -> Result<(String, String), OptionFault> {
    let (name, value) = text
        .split_once('=')
        .ok_or("write the name, `=` and the value, such as `limit=1`")?;
    Ok((
        name.trim().trim_start_matches('$').to_owned(),
        value.trim().to_owned(),
    ))
}

/// Runs a standalone program, or explains why one of its facts holds or does not. Returns the exit
/// code: 1 if the fact to explain does not hold.
pub fn datalog(args: &DatalogArgs, stop: &Arc<AtomicBool>) -> Result<u8, Diagnostics> {
    let (tuples, bytes, secs) = (MOST_TUPLES, args.max_memory, args.max_time);
    let budget = Budget {
        tuples,
        bytes,
        secs,
        new_things: args.max_new,
        stop: Arc::clone(stop),
    };
    let parameters = args.parameters.iter().cloned().collect();
    let loading = Loading {
        budget: budget.clone(),
        lenient: args.lenient,
        parameters,
    };
    if let Some(statement) = &args.trace {
        let source = Files::Disk.read_program(&args.file).map_err(|why| {
            Diagnostic::error("X005", format!("{}: {why}", args.file.display()))
                .help("name a file with rules (.rls)")
        })?;
        let folder = args.file.parent().unwrap_or(Path::new("."));
        let program = Program::load_as(&source, folder, &loading)?;
        output::print_diagnostics(&program.warnings);
        program.check_goal(statement)?;
        let explained = program.explain(statement, &budget);
        let explained = explained
            .map_err(|fault| Diagnostic::error("X008", fault.to_string()).in_source(&source))?;
        output::print_diagnostics(&unknown_terms(statement, &explained));
        output::print(&match args.format {
            ProofFormat::Text => output::page().set(&explained.to_text()),
            ProofFormat::Csv => {
                let mut table = Table::new(["fact", "holds", "margin", "explanation"]);
                table.rows.push(explanations::row(&[statement], &explained));
                table.render(TableFormat::Csv, output::page())
            }
            ProofFormat::Json => format!("{:#}\n", explained.to_json()),
            ProofFormat::Dot => explained.to_dot(),
        });
        return Ok(u8::from(!explained.holds()));
    }
    let format = match args.format {
        ProofFormat::Text => TableFormat::Table,
        ProofFormat::Csv => TableFormat::Csv,
        ProofFormat::Json => TableFormat::Json,
        ProofFormat::Dot => {
            return Err(Diagnostic::error("X004", "`--format dot` draws an explanation, but none was requested")
                .help("add the fact to explain, such as `--trace 'p(1, _)'`, or use `--format text`, `csv` or `json`")
                .into());
        }
    };
    let summary = standalone::run_as(&args.file, &args.output, &loading)?;
    output::print_diagnostics(&summary.warnings);
    let mut table = Table::new(["predicate", "tuples"]);
    for (predicate, tuples) in summary.tuples {
        table.rows.push(vec![predicate.into(), tuples.into()]);
    }
    output::print(&table.render(format, output::page()));
    let written: Vec<String> = summary
        .written
        .iter()
        .map(|(file, lines)| format!("{}: {lines} lines", file.display()))
        .collect();
    // CSV and JSON are one document.
    output::tell(&written, format != TableFormat::Table);
    Ok(0)
}

/// Warns about the constants of a goal that the program does not have.
fn unknown_terms(statement: &str, explained: &Explanation) -> Diagnostics {
    let source = Source::new("goal", statement.trim());
    let mut warnings = Diagnostics::new();
    for term in &explained.unknown {
        let help = term
            .similar
            .as_ref()
            .map(|similar| format!("did you mean `{similar}`?"));
        let help = help.unwrap_or_else(|| {
            "a constant of the goal is usually a constant of some fact".to_owned()
        });
        let message = format!(
            "`{}` occurs neither in the rules nor in any tuple",
            term.text
        );
        warnings.push(
            Diagnostic::warning("R093", message)
                .at(&source, term.span.clone())
                .help(help),
        );
    }
    warnings
}
