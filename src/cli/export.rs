//! `actcheck export`

use clap::{Args, Subcommand};

use crate::export_rdf::{self, ExportRdfArgs};
use crate::export_run::{self, ExportRunArgs};
use crate::export_store::{self, ExportStoreArgs};
use crate::export_tables::{self, ExportTablesArgs};
use actcheck_base::Diagnostics;

/// `actcheck export`
#[derive(Debug, Args)]
pub struct ExportArgs {
    /// The kind of thing to export.
    #[command(subcommand)]
    pub kind: ExportKind,
}

/// Things that can be exported.
#[derive(Debug, Subcommand)]
pub enum ExportKind {
    /// A stored run as one readable file (a case) that recreates its scene
    ///
    /// `actcheck run` accepts the file like any configuration, and reports whether it still fails
    /// in the same way. You can edit its values; an invalid value is rejected at its line. A file
    /// inside the project refers to the ontology and models by relative paths; a file elsewhere
    /// omits those that are the same as the shipped ones, so that it runs anywhere.
    #[command(
        after_help = "Examples:\n  actcheck export run k7f3-3 -o case.toml    (a run id from `actcheck list`; a prefix is enough)\n  actcheck export run @last-failed --regression\n  actcheck export k7f3-3 --mjcf model --setpoints    (for MuJoCo; short for `export run`)\n  actcheck export k7f3-3 --mcap run.mcap    (for Foxglove, RViz and PlotJuggler)"
    )]
    Run(ExportRunArgs),
    /// The outcomes, facts or motion of runs as tables, with a description of their columns
    ///
    /// Writes the table of outcomes, one row for each run, action and property with the scene's
    /// parameters, the errors drawn and the effects: `outcomes.parquet`. `DIR.schema.json`, beside
    /// the folder, describes its columns; a folder with more tables has a `schema.json` of its own.
    /// The table contains no shrunk runs, no cases, and no runs of `run --last-failed`. Its column
    /// `counts` is false for runs that are bit-identical to a later one.
    #[command(
        after_help = "Examples:\n  actcheck export tables columns    (after `actcheck run configs/pick.toml`)\n  actcheck export tables sheets --csv\n  actcheck export tables learn_from --dataset"
    )]
    Tables(ExportTablesArgs),
    /// The history as RDF: N-Quads with all facts, or Turtle without them
    ///
    /// FILE.nq holds the whole history, with facts in their named graphs (N-Quads). FILE.ttl holds
    /// campaigns, runs, scenes and outcomes (Turtle).
    #[command(
        after_help = "Examples:\n  actcheck export rdf history.nq    (after `actcheck run configs/pick.toml`)\n  actcheck export rdf history.ttl"
    )]
    Rdf(ExportRdfArgs),
    /// The history to a SPARQL 1.1 store of your own, such as Fuseki
    ///
    /// Sends everything, runs that are kept as outcomes too. If it ends early, the same command
    /// continues where it was; later it sends only new runs and judgements. The store then has the
    /// statements of `export rdf FILE.nq`, with IRIs in place of blank nodes. Credentials:
    /// ACTCHECK_SPARQL_USER and ACTCHECK_SPARQL_PASSWORD, or ACTCHECK_SPARQL_TOKEN.
    #[command(
        after_help = "Example:\n  actcheck export store http://localhost:3030/history/update    (then `actcheck query --endpoint`)"
    )]
    Store(ExportStoreArgs),
}

/// Exports a run, tables or RDF, or sends the history to a store. Returns the exit code.
pub fn export(args: &ExportArgs) -> Result<u8, Diagnostics> {
    match &args.kind {
        ExportKind::Run(args) => export_run::run(args).map(|()| 0),
        ExportKind::Tables(args) => export_tables::tables(args).map(|()| 0),
        ExportKind::Rdf(args) => export_rdf::rdf(args).map(|()| 0),
        ExportKind::Store(args) => export_store::store(args),
    }
}
