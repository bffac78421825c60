//! `actcheck export rdf`

use std::path::PathBuf;

use clap::Args;

use crate::options::HistoryArgs;
use crate::{history_dir, output};
use actcheck_base::{Diagnostic, Diagnostics};

/// `actcheck export rdf`
#[derive(Debug, Args)]
pub struct ExportRdfArgs {
    /// The file to write; its extension names the format
    #[arg(value_name = "FILE.nq|FILE.ttl")]
    pub file: PathBuf,
    /// All facts from the traces, not only those in the history; needs FILE.nq
    #[arg(long)]
    pub complete: bool,
    /// The folder of the history.
    #[command(flatten)]
    pub history: HistoryArgs,
}

/// Writes the history as N-Quads or Turtle.
pub fn rdf(args: &ExportRdfArgs) -> Result<(), Diagnostics> {
    let file = &args.file;
    let extension = file.extension().and_then(|extension| extension.to_str());
    let is_turtle = match extension {
        Some("nq") => false,
        Some("ttl") if !args.complete => true,
        _ => return Err(other_format(args)),
    };
    let history = history_dir::open_to_read(&args.history)?;
    let contents = if is_turtle {
        history.rdf().write_turtle(file)?;
        "campaigns, runs, scenes and outcomes"
    } else if args.complete {
        history.rdf().write_complete_nquads(file)?;
        "the whole history with all facts"
    } else {
        history.rdf().write_nquads(file)?;
        "the whole history"
    };
    output::print_prose(&format!("{} holds {contents}\n", file.display()));
    Ok(())
}

fn other_format(args: &ExportRdfArgs) -> Diagnostics {
    let message = format!(
        "{} is not the name of an N-Quads {}file",
        args.file.display(),
        if args.complete { "" } else { "or Turtle " }
    );
    let help = if args.complete {
        "name a file FILE.nq: facts are in named graphs, which Turtle lacks"
    } else {
        "name FILE.nq for N-Quads, which hold facts in their named graphs, or FILE.ttl for Turtle without them"
    };
    Diagnostic::error("X043", message).help(help).into()
}
