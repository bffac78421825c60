//! `actcheck export run`

use std::path::{Path, PathBuf};

use clap::{ArgGroup, Args};

use crate::appearance::AppearanceReader;
use crate::options::HistoryArgs;
use crate::trust::TrustArgs;
use crate::work::quietly;
use crate::{clock, history_dir, output, output_file, restore, trust};
use actcheck_base::{Diagnostic, Diagnostics, ShellLine};
use actcheck_campaign as campaign;
use actcheck_campaign::{Env, RunContext, StoredCampaign};
use actcheck_history::{History, RunDetail};
use actcheck_report::{BagInput, bag};

/// `actcheck export run`
#[derive(Debug, Args)]
#[command(group(ArgGroup::new("written").args(["output", "regression", "mjcf", "mcap"]).required(true)))]
pub struct ExportRunArgs {
    /// Id of the run, or a unique prefix
    pub run: String,
    /// The file to write (TOML); `-` prints it
    #[arg(short, long, value_name = "FILE.toml")]
    pub output: Option<PathBuf>,
    /// Write it into the project's folder `regressions`, named after the run; every campaign runs
    /// these files first
    #[arg(long)]
    pub regression: bool,
    /// Write the run as a model for MuJoCo into this new folder: `scene.xml`, in the state of the
    /// first frame
    #[arg(long, value_name = "DIR")]
    pub mjcf: Option<PathBuf>,
    /// With the robot's setpoints, 60 per second: `setpoints.csv`
    #[arg(long, requires = "mjcf")]
    pub setpoints: bool,
    /// Write the run as a ROS 2 bag, for Foxglove, RViz and PlotJuggler: poses, joints, shapes,
    /// contacts, percepts and outcomes over simulated time; `-` prints it
    #[arg(long, value_name = "FILE.mcap", conflicts_with = "config")]
    pub mcap: Option<PathBuf>,
    /// Take everything but the choices from this configuration instead of the one in the history
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// The folder of the history.
    #[command(flatten)]
    pub history: HistoryArgs,
    /// The consent to start programs.
    #[command(flatten)]
    pub trust: TrustArgs,
}

/// Writes a stored run as a configuration.
pub fn run(args: &ExportRunArgs) -> Result<(), Diagnostics> {
    let history = history_dir::open_to_read(&args.history)?;
    if let Some(file) = &args.mcap {
        return export_bag(&history, args, file);
    }
    let run = history.run(&args.run)?;
    if args.config.is_none() && !args.trust.trust {
        trust::check_expansion(
            &run.row.campaign,
            &Env::starts_from_history(&history, &run.row.campaign)?,
        )?;
    }
    let recalled = Env::from_history(&history, &run.row.campaign, args.config.as_deref())?;
    if let Some(folder) = &args.mjcf {
        if args.config.is_none() && !args.trust.trust {
            trust::check_stored(&recalled.0, &history, &recalled.1)?;
        }
        return playable(&history, &recalled, &run, folder, args.setpoints);
    }
    let file = match &args.output {
        Some(file) => file.clone(),
        None => {
            let named = args.config.is_some() || args.trust.trust;
            new_regression(&recalled.0, &run.row.run, named)?
        }
    };
    let text = campaign::export(
        &history,
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

/// Writes a run as a ROS 2 bag.
fn export_bag(history: &History, args: &ExportRunArgs, file: &Path) -> Result<(), Diagnostics> {
    restore::allow(history, args.trust.trust);
    let run = history.newest_run(&args.run)?;
    let trace = history.traces().whole(&run.row.run)?;
    if trace.snapshots.is_empty() {
        let message = format!("run {} has no state to export", run.row.run);
        let help = "it broke before its first action; `actcheck show` shows the reason";
        return Err(Diagnostic::error("X006", message).help(help).into());
    }
    let mut reader = AppearanceReader::new(history, args.trust.trust);
    let robot = reader.robot(&run.row.campaign)?;
    let written = bag(&BagInput {
        run: &run,
        trace: &trace,
        robot: robot.as_ref(),
        appearances: &*reader.of(&run.row.campaign)?,
    });
    let bytes = written.map_err(|fault| {
        Diagnostic::error("X056", format!("a run can't be recorded: {fault}"))
            .help("report this as a bug in actcheck")
    })?;
    if file.as_os_str() == "-" {
        output::print_bytes(&bytes);
        return Ok(());
    }
    output_file::write(file, &bytes)?;
    let size = bytes.len() as f64 / 1e6;
    output::print_prose(&format!(
        "{} holds run {} ({size:.1} MB)\n",
        file.display(),
        run.row.run
    ));
    if robot.is_none() {
        output::print_prose("it lacks /robot_description: the model of its robot is not known\n");
    }
    Ok(())
}

/// Writes a run as a model for MuJoCo into a new folder.
fn playable(
    history: &History,
    recalled: &StoredCampaign,
    run: &RunDetail,
    folder: &Path,
    with_setpoints: bool,
) -> Result<(), Diagnostics> {
    if folder.exists() {
        let message = format!("{} already exists", folder.display());
        let fault = Diagnostic::error("X042", message).help("name a new folder");
        return Err(fault.into());
    }
    let context = RunContext {
        clock: clock::system(),
        disturb: None,
    };
    let played = quietly(|| campaign::playable(history, recalled, run, &context))?.files;
    let below = output_file::folder(folder)?;
    let write = |name: &str, text: &str| -> Result<(), Diagnostics> {
        let file = folder.join(name);
        let written = below.write_atomic(&file, text.as_bytes());
        written.map_err(|error| output_file::cannot_write(&file, error).into())
    };
    write("scene.xml", &played.mjcf)?;
    let mut written = "scene.xml holds".to_owned();
    if with_setpoints {
        write("setpoints.csv", &played.setpoints)?;
        written = "scene.xml and setpoints.csv hold".to_owned();
    }
    output::print_prose(&format!(
        "{}: {written} run {}\n",
        folder.display(),
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
