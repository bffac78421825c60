//! `actcheck export`

use std::path::{Path, PathBuf};

use clap::Args;

use crate::base::{Diagnostic, Diagnostics};
use crate::campaign::{self, Env};
use crate::cli::args::HistoryArgs;
use crate::cli::{history_dir, output};

/// `actcheck export`
#[derive(Debug, Args)]
pub struct ExportArgs {
    /// Id of the run, or its beginning
    pub run: String,
    /// The file to write (TOML); `-` prints it
    #[arg(
        short,
        long,
        value_name = "FILE.toml",
        required_unless_present = "regression",
        conflicts_with = "regression"
    )]
    pub output: Option<PathBuf>,
    /// Put it, under the run's id, into the project's folder `regressions`, which every campaign runs first
    #[arg(long)]
    pub regression: bool,
    /// Take everything but the choices from this configuration instead of the one that the history keeps
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Where the history lies.
    #[command(flatten)]
    pub history: HistoryArgs,
}

/// Writes a stored run as a configuration of its own.
pub fn export(args: &ExportArgs) -> Result<(), Diagnostics> {
    let history = history_dir::open(&args.history)?;
    let run = history.run(&args.run)?;
    let recalled = Env::recall(&history, &run.row.campaign, args.config.as_deref())?;
    let file = match &args.output {
        Some(file) => file.clone(),
        None => new_regression(&recalled.0, &run.row.run)?,
    };
    let text = campaign::export(&history, &recalled, &run, file.parent().unwrap_or(Path::new("")))?;
    if file.as_os_str() == "-" {
        output::print(&text);
        return Ok(());
    }
    std::fs::write(&file, text).map_err(|error| unwritten(&file, &error))?;
    let shown = file.display();
    output::print(&format!("{shown} holds run {}: actcheck run {shown}\n", run.row.run));
    Ok(())
}

/// A new file in the folder of regressions, which is there afterwards.
fn new_regression(env: &Env, run: &str) -> Result<PathBuf, Diagnostics> {
    let folder = campaign::regressions_folder(&env.campaign.source)?;
    std::fs::create_dir_all(&folder).map_err(|error| unwritten(&folder, &error))?;
    let file = folder.join(format!("{run}.toml"));
    if file.exists() {
        let fault = Diagnostic::error("X042", format!("{} is there already", file.display()));
        return Err(fault.help("it may have been edited: move it away, or name another file with `-o`").into());
    }
    Ok(file)
}

fn unwritten(file: &Path, error: &std::io::Error) -> Diagnostic {
    Diagnostic::error("X007", format!("{} can't be written: {error}", file.display()))
        .help("name a file in a folder that exists and may be written")
}
