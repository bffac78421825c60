//! `actcheck export`

use std::path::{Path, PathBuf};

use clap::{ArgGroup, Args};

use crate::chosen::{self, ChosenRuns};
use crate::export_sparql::{self, SparqlArgs};
use crate::export_tables;
use crate::trust::TrustArgs;
use crate::{output, output_file, restore, trust};
use actcheck_analysis::{
    Dataset, DatasetRuns, Mirror, export_csv, export_dataset, export_facts, export_parquet,
};
use actcheck_base::{Diagnostic, Diagnostics, ShellLine};
use actcheck_campaign as campaign;
use actcheck_campaign::Env;
use actcheck_history::History;

/// `actcheck export`
#[derive(Debug, Args)]
#[command(group(ArgGroup::new("with_facts").args(["parquet", "nquads", "sparql"]).multiple(true)))]
pub struct ExportArgs {
    /// Id of the run to write as a configuration, or a unique prefix
    #[arg(required_unless_present_any = ["parquet", "csv", "dataset", "nquads", "turtle", "sparql", "tables", "rebuild_mirror"])]
    pub run: Option<String>,
    /// The file to write (TOML); `-` prints it
    #[arg(
        short,
        long,
        value_name = "FILE.toml",
        conflicts_with = "regression",
        requires = "run"
    )]
    #[arg(required_unless_present_any = [
        "regression", "parquet", "csv", "dataset", "nquads", "turtle", "sparql", "tables", "rebuild_mirror",
    ])]
    pub output: Option<PathBuf>,
    /// Write it into the project's folder `regressions`, named after the run; every campaign runs
    /// these files first
    #[arg(long, requires = "run")]
    pub regression: bool,
    /// Take everything but the choices from this configuration instead of the one in the history
    #[arg(long, value_name = "FILE", requires = "run")]
    pub config: Option<PathBuf>,
    /// Write the table of outcomes, one row for each run, action and property with the scene's
    /// parameters, the errors drawn and the effects, into this folder: `outcomes.parquet`, and
    /// `schema.json`, which describes the columns
    #[arg(long, value_name = "DIR")]
    pub parquet: Option<PathBuf>,
    /// Copy the table of all outcomes, in many files by campaign, into this folder, or into a
    /// bucket of an object storage with the interface of S3 (s3://BUCKET/PREFIX, in builds with
    /// `--features object-storage`): `campaign=ID/….parquet`, which pandas, polars and DuckDB read
    /// as one table, and beside it DIR.tables.json, which lists them and describes the columns.
    /// Files that are there already are skipped, so the same command continues an interrupted copy
    /// and brings an earlier one up to date. Each history needs a folder of its own. Settings:
    /// AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY, AWS_SESSION_TOKEN, AWS_REGION, AWS_ENDPOINT_URL
    #[arg(long, value_name = "DIR|URL")]
    pub tables: Option<String>,
    /// Write the same table as CSV: `outcomes.csv` and `schema.json`
    #[arg(long, value_name = "DIR")]
    pub csv: Option<PathBuf>,
    /// Write runs as a learning dataset into this folder, in Parquet: `joints` and `robot`
    /// (observations and commands over time), `objects` (ground truth), all tables of
    /// `--parquet --complete`, and `schema.json`, which describes the columns
    #[arg(long, value_name = "DIR")]
    pub dataset: Option<PathBuf>,
    /// With `--dataset`: also the course of each action at the control rate (60 Hz), from which
    /// properties about time can be judged: `course_bodies` (poses, velocities, holds),
    /// `course_robot` (gripper and base), `course_joints`, `course_forces` (between pairs of
    /// bodies) and `phases`. The folder is then five to six times as large
    #[arg(long, requires = "dataset")]
    pub course: bool,
    /// Write the whole history as RDF, with facts in their named graphs (N-Quads)
    #[arg(long, value_name = "FILE.nq")]
    pub nquads: Option<PathBuf>,
    /// The store that the history is sent to.
    #[command(flatten)]
    pub sparql: SparqlArgs,
    /// With `--nquads` and `--sparql`: all facts from the traces, not only those in the history.
    /// With `--parquet`: also the tables from which outcomes follow: `actions`, `percepts`,
    /// `planes`, `states`, `bodies`, `links`, `contacts`, `self_contacts`, `extremes`, `intervals`,
    /// `joint_extremes`, `shapes` and `places`
    #[arg(long, requires = "with_facts")]
    pub complete: bool,
    /// Write campaigns, runs, scenes and outcomes as RDF, without the facts in named graphs
    /// (Turtle)
    #[arg(long, value_name = "FILE.ttl")]
    pub turtle: Option<PathBuf>,
    /// Rebuild the tables beside the history from its store
    #[arg(long)]
    pub rebuild_mirror: bool,
    /// The runs in the tables, and their history.
    #[command(flatten)]
    pub chosen: ChosenRuns,
    /// The consent to start programs.
    #[command(flatten)]
    pub trust: TrustArgs,
}

/// Writes a stored run as a configuration, or the history as tables or RDF, or sends it to a store.
/// Returns the exit code.
pub fn export(args: &ExportArgs) -> Result<u8, Diagnostics> {
    let history = args.chosen.open()?;
    restore::allow(&history, args.trust.trust);
    if let Some(run) = &args.run {
        export_run(args, &history, run)?;
    }
    if let Some(file) = &args.nquads {
        let contents = if args.complete {
            history.write_complete_nquads(file)?;
            "the whole history with all facts"
        } else {
            history.write_nquads(file)?;
            "the whole history"
        };
        output::print_prose(&format!("{} holds {contents}\n", file.display()));
    }
    if let Some(file) = &args.turtle {
        history.write_turtle(file)?;
        output::print_prose(&format!(
            "{} holds campaigns, runs, scenes and outcomes\n",
            file.display()
        ));
    }
    if args.parquet.is_some() || args.csv.is_some() || args.dataset.is_some() || args.rebuild_mirror
    {
        write_tables(args, &history)?;
    }
    if let Some(place) = &args.tables {
        let code = export_tables::copy(place, &args.sparql.remote, &history)?;
        if code != 0 {
            return Ok(code);
        }
    }
    match &args.sparql.sparql {
        Some(url) => export_sparql::send(&args.sparql, url, args.complete, &history),
        None => Ok(0),
    }
}

fn write_tables(args: &ExportArgs, history: &History) -> Result<(), Diagnostics> {
    let filter = args.chosen.filter(history)?;
    let hierarchy = chosen::hierarchy(&args.chosen.ontology()?);
    let (mirror, change) = if args.rebuild_mirror {
        Mirror::rebuild(history)
    } else {
        Mirror::update(history)
    }?;
    if args.rebuild_mirror {
        let runs = change.added;
        output::print_prose(&format!(
            "{} holds the outcomes of {runs} runs\n",
            mirror.folder().display()
        ));
    }
    let runs = DatasetRuns {
        history,
        mirror: &mirror,
        filter: &filter,
        hierarchy: &hierarchy,
    };
    if let (Some(folder), true) = (&args.parquet, args.complete) {
        print_dataset(&export_facts(&runs, folder)?);
    }
    let wanted = [
        (
            args.parquet.as_ref().filter(|_| !args.complete),
            export_parquet as fn(&_, &_, &_, &_) -> _,
        ),
        (args.csv.as_ref(), export_csv as fn(&_, &_, &_, &_) -> _),
    ];
    for (folder, write) in wanted {
        let Some(folder) = folder else { continue };
        let (files, rows): (Vec<PathBuf>, usize) =
            write(&mirror, &filter, &hierarchy, folder.as_path())?;
        let [table, schema] = files.as_slice() else {
            continue;
        };
        let told = format!(
            "{} holds {rows} rows, {} describes their columns\n",
            table.display(),
            schema.display()
        );
        output::print(&told);
    }
    if let Some(folder) = &args.dataset {
        print_dataset(&export_dataset(&runs, folder, args.course)?);
    }
    Ok(())
}

fn print_dataset(dataset: &Dataset) {
    for (table, rows) in &dataset.tables {
        output::print_prose(&format!("{} holds {rows} rows\n", table.display()));
    }
    let runs = dataset.runs;
    output::print_prose(&format!(
        "{} describes the columns of these tables of {runs} runs\n",
        dataset.schema.display()
    ));
    if dataset.withheld > 0 {
        output::print_prose(&format!(
            "{} of {runs} runs have no rows in the tables of motion\n",
            dataset.withheld
        ));
    }
}

/// Writes a stored run as a configuration.
fn export_run(args: &ExportArgs, history: &History, run: &str) -> Result<(), Diagnostics> {
    let run = history.run(run)?;
    if args.config.is_none() && !args.trust.trust {
        trust::check_expansion(
            &run.row.campaign,
            &Env::starts_from_history(history, &run.row.campaign)?,
        )?;
    }
    let recalled = Env::from_history(history, &run.row.campaign, args.config.as_deref())?;
    let file = match &args.output {
        Some(file) => file.clone(),
        None if args.regression => {
            let named = args.config.is_some() || args.trust.trust;
            new_regression(&recalled.0, &run.row.run, named)?
        }
        // The other options write only tables.
        None => {
            return Err(Diagnostic::error(
                "X043",
                format!("run {} needs an output file", run.row.run),
            )
            .help("name a file with `-o FILE.toml`, or use `--regression`")
            .into());
        }
    };
    let text = campaign::export(
        history,
        &recalled,
        &run,
        file.parent().unwrap_or(Path::new("")),
    )?;
    if file.as_os_str() == "-" {
        output::print(&text);
        return Ok(());
    }
    if args.output.is_some() {
        output_file::write(&file, text)
    } else {
        output_file::write_in_project(&file, text)
    }?;
    let again = ShellLine::default().fixed("actcheck run").file(&file);
    output::print_prose(&format!(
        "{} holds run {}: {again}\n",
        file.display(),
        run.row.run
    ));
    Ok(())
}

/// Returns the path of a new file in the folder of regressions, which is created if missing. Unless
/// the user named the configuration, the history chooses the folder, so it must be below the
/// present one.
fn new_regression(env: &Env, run: &str, named: bool) -> Result<PathBuf, Diagnostics> {
    let folder = campaign::regressions_folder(&env.campaign.source)?;
    if !named && !output_file::is_below_here(&folder) {
        let message = format!(
            "the history names the folder {}, which is outside the present one",
            folder.display()
        );
        let help = "change to the project's folder, or name the configuration with `--config`, or a file with `-o`";
        return Err(Diagnostic::error("X084", message).help(help).into());
    }
    let created = output_file::project(&folder).create_folder(&folder);
    created.map_err(|error| output_file::cannot_write(&folder, error))?;
    let file = folder.join(format!("{run}.toml"));
    if file.exists() {
        let fault = Diagnostic::error("X042", format!("{} already exists", file.display()));
        return Err(fault
            .help("it may have been edited: move it away, or name another file with `-o`")
            .into());
    }
    Ok(file)
}
