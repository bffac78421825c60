//! `actcheck cross-check`

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget};
use serde::Deserialize;
use serde_json::{Value, json};

use crate::mujoco_link::MujocoPool;
use crate::options::{Format, HistoryArgs};
use crate::python::{PythonModule, new_scratch};
use crate::work::{all_cores, quietly};
use crate::{clock, history_dir, output, trust};
use actcheck_analysis::{EngineComparison, RunInEngines};
use actcheck_base::{Below, Diagnostic, Diagnostics};
use actcheck_campaign::{
    Env, EpisodeFile, ImportOptions, PlayableRun, RuleSet, RunContext, StoredCampaign, import,
    judge_played, mapping_of, on_workers, playable, played_in, rules_of,
};
use actcheck_episodes::Mapping;
use actcheck_history::{History, RunDetail, RunFilter, RunRecord, RunStatus};
use actcheck_report::{EngineSummary, engines_json, engines_table, engines_text};

/// The setting in which the engine has the parameters of the exported files.
const PLAIN: &str = "mujoco";
/// The packages that the player needs.
const NEEDS: &str = "MuJoCo 3.3 or later, numpy and mcap";

/// `actcheck cross-check`
#[derive(Debug, Args)]
pub struct CrossCheckArgs {
    /// Id of the campaign
    pub campaign: String,
    /// Number of its runs, the first ones
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..))]
    pub runs: u32,
    /// The Python with MuJoCo 3.3 or later, numpy and mcap
    #[arg(long, value_name = "PROGRAM", default_value = "python3")]
    pub python: PathBuf,
    /// Make the friction of the fingers wrong by this factor in MuJoCo, to see whether it is found
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = factor)]
    pub finger_friction: f64,
    /// Run the scenes in MuJoCo anew: the skill gets MuJoCo's observations and reacts to them
    #[arg(long, conflicts_with = "finger_friction")]
    pub closed_loop: bool,
    /// Number of workers; does not affect results [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
    /// Start the program that the history names; read it first
    #[arg(long)]
    pub trust: bool,
    /// The folder of the history.
    #[command(flatten)]
    pub history: HistoryArgs,
    /// How it is printed
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: Format,
}

/// Reads a factor.
fn factor(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("it must be a number above 0".to_owned()),
    }
}

/// A line of the player.
#[derive(Debug, Deserialize)]
struct PlayerLine {
    #[serde(default)]
    engine_version: Option<String>,
    #[serde(default)]
    run: Option<String>,
    #[serde(default)]
    setting: Option<String>,
    #[serde(default)]
    written: Option<PathBuf>,
    #[serde(default)]
    cpu_secs: Option<f64>,
    #[serde(default)]
    reason: Option<String>,
}

/// The recordings of an engine.
#[derive(Default)]
struct Played {
    version: String,
    /// By run and setting.
    files: BTreeMap<(String, String), PathBuf>,
    /// CPU time of the engine in the plain setting. Unit: seconds.
    plain_secs: f64,
    faults: Diagnostics,
}

/// A run with its mapping and its records, by setting.
struct Checked {
    here: PlayableRun,
    /// The run whose setpoints MuJoCo plays, if it is not the one here.
    made_there: Option<PlayableRun>,
    mapping: Mapping,
    there: BTreeMap<String, RunRecord>,
}

impl Checked {
    /// The run whose setpoints MuJoCo plays.
    fn played(&self) -> &PlayableRun {
        self.made_there.as_ref().unwrap_or(&self.here)
    }
}

/// Plays runs of a campaign in MuJoCo and compares the verdicts. Returns the exit code.
pub fn cross_check(args: &CrossCheckArgs) -> Result<u8, Diagnostics> {
    let history = history_dir::open_to_read(&args.history)?;
    let jobs = args.jobs.map_or_else(all_cores, usize::from);
    let details = chosen(&history, args)?;
    let recalled = Env::from_history(&history, &args.campaign, None)?;
    if !args.trust {
        trust::check_stored(&recalled.0, &history, &recalled.1)?;
    }
    let context = RunContext {
        clock: clock::system(),
        disturb: None,
    };
    let bar =
        ProgressBar::with_draw_target(Some(details.len() as u64), ProgressDrawTarget::stderr());
    let made = quietly(|| {
        on_workers(jobs, &details, |detail| {
            let run = playable(&history, &recalled, detail, &context);
            bar.inc(1);
            run
        })
    })?;
    bar.finish_and_clear();
    let mut faults = Diagnostics::new();
    let mut runs = Vec::new();
    for (detail, one) in details.iter().zip(made) {
        match one {
            Ok(mut run) => {
                run.record.id.clone_from(&detail.row.run);
                runs.push(run);
            }
            Err(found) => faults.extend(found),
        }
    }
    if runs.is_empty() {
        return Err(faults);
    }
    let scratch = new_scratch()?;
    let again = if args.closed_loop {
        let pool = MujocoPool::new(&args.python, scratch.path(), NEEDS);
        let runs = (runs, details.as_slice());
        let made = made_in_mujoco(&history, &recalled, runs, &pool, jobs, &mut faults)?;
        if made.is_empty() {
            // The reason is the same for all.
            return Err(faults.into_iter().take(1).collect());
        }
        made
    } else {
        runs.into_iter().map(|run| (run, None)).collect()
    };
    let there: Vec<&PlayableRun> = again
        .iter()
        .map(|(here, there)| there.as_ref().unwrap_or(here))
        .collect();
    write(&there, &scratch.path().join("runs"))?;
    let mut played = play(args, scratch.path())?;
    faults.extend(std::mem::take(&mut played.faults));
    let rules = rules_of(&recalled.0)?;
    let mut checked = judged(again, &played, &rules, (jobs, &args.campaign), &mut faults)?;
    checked.retain(|run| run.there.contains_key(PLAIN));
    if checked.is_empty() {
        return Err(faults);
    }
    drop(history);
    let imported = stored(args, &checked, &played, &rules, jobs, &mut faults)?;
    let compared = checked.iter();
    let compared = compared.filter_map(|run| RunInEngines::of(&run.here.record, &run.there, PLAIN));
    let summary = EngineSummary {
        campaign: args.campaign.clone(),
        version: played.version,
        imported,
        closed_loop: args.closed_loop,
        finger_friction: args.finger_friction,
        comparison: EngineComparison {
            plain: PLAIN,
            runs: compared.collect(),
        },
        plain_secs: played.plain_secs,
    };
    let history = History::open(&history_dir::folder(&args.history)?)?;
    history.store_cross_check(&summary.record())?;
    output::print(&match args.format {
        Format::Text => engines_text(&summary, output::page()),
        Format::Csv => engines_table(&summary).render(args.format.into(), output::page()),
        Format::Json => format!("{:#}\n", engines_json(&summary)),
    });
    if faults.is_empty() {
        return Ok(summary.exit_code());
    }
    output::print_diagnostics(&faults);
    Ok(2)
}

/// Runs the scenes in MuJoCo. Each run comes with the one there; runs that can't be made there are
/// left out.
fn made_in_mujoco(
    history: &History,
    recalled: &StoredCampaign,
    (runs, details): (Vec<PlayableRun>, &[RunDetail]),
    pool: &Arc<MujocoPool>,
    jobs: usize,
    faults: &mut Diagnostics,
) -> Result<Vec<(PlayableRun, Option<PlayableRun>)>, Diagnostics> {
    let context = RunContext {
        clock: clock::system(),
        disturb: None,
    };
    let is_made = |detail: &&RunDetail| runs.iter().any(|run| run.record.id == detail.row.run);
    let details: Vec<&RunDetail> = details.iter().filter(is_made).collect();
    let made = quietly(|| {
        on_workers(jobs, &details, |detail| {
            played_in(history, recalled, detail, &context, pool.link())
        })
    })?;
    let mut again = Vec::new();
    for ((here, detail), there) in runs.into_iter().zip(&details).zip(made) {
        match there {
            Ok(mut there) => {
                there.record.id.clone_from(&detail.row.run);
                again.push((here, Some(there)));
            }
            Err(found) => faults.extend(found),
        }
    }
    Ok(again)
}

/// The first runs of the campaign that completed.
fn chosen(history: &History, args: &CrossCheckArgs) -> Result<Vec<RunDetail>, Diagnostics> {
    let record = history.campaign(&args.campaign)?;
    if let Some(engine) = &record.imported_from {
        let message = format!("campaign {} was imported from {engine}", record.id);
        return Err(Diagnostic::error("S054", message)
            .help("name a campaign of `actcheck run`: its runs are simulated again here and there")
            .into());
    }
    let filter = RunFilter {
        campaign: Some(record.id.clone()),
        status: Some(RunStatus::Completed),
        ..RunFilter::default()
    };
    let mut rows = history.runs(&filter)?;
    rows.sort_by_key(|row| row.index);
    let details = rows
        .iter()
        .take(args.runs as usize)
        .map(|row| history.run(&row.run));
    let details = details.collect::<Result<Vec<RunDetail>, Diagnostics>>()?;
    if details.is_empty() {
        return Err(Diagnostic::error(
            "X036",
            format!("campaign {} has no run that completed", record.id),
        )
        .help("`actcheck list` shows its runs")
        .into());
    }
    Ok(details)
}

/// Writes the files for the player, a folder for each run.
fn write(runs: &[&PlayableRun], folder: &Path) -> Result<(), Diagnostics> {
    let below = Below::new(folder);
    for run in runs {
        let own = folder.join(&run.record.id);
        let actions: Vec<Value> = run
            .actions
            .iter()
            .map(|action| {
                json!({
                    "action": action.action,
                    "parameters": action.parameters,
                    "begin_tick": action.ticks[0],
                    "end_tick": action.ticks[1],
                    "reported": action.report.as_ref().map(|(succeeded, _)| succeeded),
                    "message": action.report.as_ref().map(|(_, message)| message),
                    "holds": action.holds,
                })
            })
            .collect();
        let told = json!({
            "actions": actions,
            "fingers": run.fingers,
            "about": { "environment": format!("actcheck/{}", run.record.scene.world), "source_run": run.record.id },
        });
        let written = below
            .create_folder(&own)
            .and_then(|()| below.write_quickly(&own.join("scene.xml"), run.files.mjcf.as_bytes()))
            .and_then(|()| {
                below.write_quickly(&own.join("setpoints.csv"), run.files.setpoints.as_bytes())
            })
            .and_then(|()| {
                below.write_quickly(&own.join("play.json"), told.to_string().as_bytes())
            });
        written.map_err(|error| {
            Diagnostic::error("E008", format!("can't write {}: {error}", own.display()))
                .help("free some space, or name another folder in TMPDIR")
        })?;
    }
    Ok(())
}

/// Plays the runs in the other engine.
fn play(args: &CrossCheckArgs, scratch: &Path) -> Result<Played, Diagnostics> {
    let module = PythonModule {
        python: &args.python,
        name: "actcheck.cross_check",
        needs: NEEDS,
        scratch,
    };
    let (runs, friction) = (scratch.join("runs"), args.finger_friction.to_string());
    let mut arguments = vec![
        runs.as_os_str(),
        "--finger-friction".as_ref(),
        friction.as_ref(),
    ];
    if args.closed_loop {
        // The setpoints are the skill's answers to MuJoCo as it is.
        arguments.push("--plain".as_ref());
    }
    let mut played = Played::default();
    let end = module.run(&arguments, |line| played.add(line))?;
    if end.is_crash() {
        let fault = module.crash(&end, "the runs can't be played");
        played.faults.push(fault);
    }
    if played.files.is_empty() {
        return Err(played.faults);
    }
    Ok(played)
}

impl Played {
    fn add(&mut self, line: PlayerLine) {
        if let Some(version) = line.engine_version {
            self.version = version;
            return;
        }
        let named = line.run.clone().zip(line.setting.clone());
        if let (Some((run, setting)), Some(path)) = (named, line.written) {
            if setting == PLAIN {
                self.plain_secs += line.cpu_secs.unwrap_or(0.0);
            }
            self.files.insert((run, setting), path);
            return;
        }
        let reason = line
            .reason
            .unwrap_or_else(|| "it can't be played".to_owned());
        let of = line
            .run
            .map_or_else(String::new, |run| format!("run {run}: "));
        let fault = Diagnostic::error("E009", format!("{of}{reason}")).help(format!(
            "name a Python with {NEEDS}: `--python venv/bin/python`"
        ));
        self.faults.push(fault);
    }
}

/// Judges all recordings by the present rules.
fn judged(
    runs: Vec<(PlayableRun, Option<PlayableRun>)>,
    played: &Played,
    rules: &RuleSet,
    (jobs, campaign): (usize, &str),
    faults: &mut Diagnostics,
) -> Result<Vec<Checked>, Diagnostics> {
    let mut checked = Vec::new();
    for (here, made_there) in runs {
        let mapping = mapping_of(&here, campaign)?;
        checked.push(Checked {
            here,
            made_there,
            mapping,
            there: BTreeMap::new(),
        });
    }
    let all: Vec<(usize, &String, &PathBuf)> = played
        .files
        .iter()
        .filter_map(|((run, setting), path)| {
            let number = checked
                .iter()
                .position(|known| known.here.record.id == *run)?;
            Some((number, setting, path))
        })
        .collect();
    let records = on_workers(jobs, &all, |(number, _, path)| {
        let run = &checked[*number];
        judge_played(path, &run.mapping, rules, &run.played().record)
    })?;
    for ((number, setting, _), record) in all.into_iter().zip(records) {
        match record {
            Ok(record) => _ = checked[number].there.insert(setting.clone(), record),
            Err(found) => faults.extend(found),
        }
    }
    Ok(checked)
}

/// Stores the recordings of the plain setting as runs of a new campaign, and returns its id.
fn stored(
    args: &CrossCheckArgs,
    checked: &[Checked],
    played: &Played,
    rules: &RuleSet,
    jobs: usize,
    faults: &mut Diagnostics,
) -> Result<Option<String>, Diagnostics> {
    let files: Vec<EpisodeFile<'_>> = checked
        .iter()
        .filter_map(|run| {
            let id = &run.here.record.id;
            Some(EpisodeFile {
                path: played.files.get(&(id.clone(), PLAIN.to_owned()))?.clone(),
                named: format!("{id} in MuJoCo {}", played.version),
                mapping: &run.mapping,
                rules,
                repeats: Some(&run.played().record.trace),
            })
        })
        .collect();
    let options = ImportOptions {
        jobs,
        name: format!("{}-in-mujoco", args.campaign),
        mapping: String::new(),
    };
    let folder = history_dir::folder(&args.history)?;
    let end = import(
        || History::open(&folder),
        &files,
        &options,
        (clock::system().now, &AtomicBool::new(false)),
        || {},
    );
    faults.extend(end.faults);
    Ok(end.campaigns.into_iter().next().map(|campaign| campaign.id))
}
