//! `actcheck cross-check`

use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufRead as _, BufReader, Read as _};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget};
use serde::Deserialize;
use serde_json::{Value, json};

use crate::convert::new_scratch;
use crate::options::{Format, HistoryArgs};
use crate::work::{all_cores, quietly};
use crate::{clock, history_dir, output, trust};
use actcheck_base::{Below, Diagnostic, Diagnostics, names};
use actcheck_campaign::{
    Env, EpisodeFile, ImportOptions, PlayableRun, RuleSet, RunContext, RunInBoth, decided, import,
    in_both, judge_played, mapping_of, on_workers, playable, rules_of,
};
use actcheck_episodes::Mapping;
use actcheck_history::{CrossCheck, History, RunDetail, RunFilter, RunRecord, RunStatus};
use actcheck_report::Table;
use actcheck_verdict::wilson;

/// The setting in which the engine has the parameters of the exported files.
const PLAIN: &str = "mujoco";
/// Number of disagreements that are explained in the text.
const MOST_EXPLAINED: usize = 10;

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
    mapping: Mapping,
    there: BTreeMap<String, RunRecord>,
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
    write(&runs, &scratch.path().join("runs"))?;
    let mut played = play(args, scratch.path())?;
    faults.extend(std::mem::take(&mut played.faults));
    let rules = rules_of(&recalled.0)?;
    let mut checked = judged(runs, &played, &rules, (jobs, &args.campaign), &mut faults)?;
    checked.retain(|run| run.there.contains_key(PLAIN));
    if checked.is_empty() {
        return Err(faults);
    }
    drop(history);
    let imported = stored(args, &checked, &played, &rules, jobs, &mut faults)?;
    let summary = Summary::of(args, &checked, &played, imported);
    let history = History::open(&history_dir::folder(&args.history)?)?;
    history.store_cross_check(&summary.record())?;
    output::print(&match args.format {
        Format::Text => summary.text(),
        Format::Csv => summary.table().render(args.format.into(), output::page()),
        Format::Json => format!("{:#}\n", summary.json()),
    });
    if faults.is_empty() {
        return Ok(u8::from(summary.agreeing() < summary.runs.len()));
    }
    output::print_diagnostics(&faults);
    Ok(2)
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
fn write(runs: &[PlayableRun], folder: &Path) -> Result<(), Diagnostics> {
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
    let python = &args.python;
    let not_started = |error: std::io::Error| {
        Diagnostic::error(
            "E008",
            format!("can't start `{}`: {error}", python.display()),
        )
        .help("name a Python with MuJoCo, numpy and mcap: `--python venv/bin/python`")
    };
    let mut child = Command::new(python)
        .args(["-m", "actcheck.cross_check"])
        .arg(scratch.join("runs"))
        .arg("--finger-friction")
        .arg(args.finger_friction.to_string())
        .env("PYTHONPATH", scratch.join("python"))
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(not_started)?;
    let stderr = child.stderr.take();
    // Read beside the output, so that a player with much to say can't block.
    let errors = std::thread::spawn(move || {
        let mut text = String::new();
        if let Some(stderr) = stderr {
            let _ = stderr.take(1 << 16).read_to_string(&mut text);
        }
        text
    });
    let mut played = Played::default();
    if let Some(stdout) = child.stdout.take() {
        for line in BufReader::new(stdout).lines() {
            let Ok(line) = line else { break };
            let Ok(line) = serde_json::from_str::<PlayerLine>(&line) else {
                continue;
            };
            played.add(line);
        }
    }
    let status = child.wait().map_err(not_started)?;
    let errors = errors.join().unwrap_or_default();
    if !matches!(status.code(), Some(0 | 1)) {
        let last = errors.lines().last().unwrap_or("it printed nothing");
        let help = format!(
            "`{} -m actcheck.cross_check` ended with {status}; it needs numpy, mcap and MuJoCo 3.3 or later: \
             pip install \"mujoco>=3.3\" mcap",
            python.display()
        );
        let message = format!("the runs can't be played: {last}");
        played
            .faults
            .push(Diagnostic::error("E009", message).help(help));
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
        let fault = Diagnostic::error("E009", format!("{of}{reason}")).help(
            "name a Python with MuJoCo 3.3 or later, numpy and mcap: `--python venv/bin/python`",
        );
        self.faults.push(fault);
    }
}

/// Judges all recordings by the present rules.
fn judged(
    runs: Vec<PlayableRun>,
    played: &Played,
    rules: &Arc<RuleSet>,
    (jobs, campaign): (usize, &str),
    faults: &mut Diagnostics,
) -> Result<Vec<Checked>, Diagnostics> {
    let mut checked = Vec::new();
    for here in runs {
        let mapping = mapping_of(&here, campaign)?;
        checked.push(Checked {
            here,
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
        judge_played(path, &run.mapping, rules, &run.here.record)
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
                repeats: Some(&run.here.record.trace),
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

/// The comparison of all runs.
struct Summary {
    campaign: String,
    version: String,
    imported: Option<String>,
    finger_friction: f64,
    runs: Vec<SummarisedRun>,
    /// CPU time of MuJoCo in its plain setting. Unit: seconds.
    plain_secs: f64,
}

/// A run in both engines and in all settings.
struct SummarisedRun {
    run: String,
    both: RunInBoth,
    /// For each setting, the properties that it decides otherwise than actcheck.
    flips_here: BTreeMap<String, BTreeSet<String>>,
    /// For each setting but the plain one, the properties that it decides otherwise than that.
    flips_there: BTreeMap<String, BTreeSet<String>>,
    /// The properties that differ, each with its explanation here and there.
    words: Vec<(String, String, String)>,
}

/// How often something agrees.
#[derive(Clone, Copy, Default)]
struct Agreement {
    agree: u64,
    of: u64,
}

impl Agreement {
    fn add(&mut self, agrees: bool) {
        self.agree += u64::from(agrees);
        self.of += 1;
    }

    fn text(self) -> String {
        format!("{} of {}", self.agree, self.of)
    }

    /// The 95 % interval in words.
    fn interval(self) -> String {
        wilson(self.agree, self.of).map_or_else(String::new, |interval| {
            format!(
                "{:.0} to {:.0} %",
                100.0 * interval.low,
                100.0 * interval.high
            )
        })
    }

    fn json(self) -> Value {
        let interval = wilson(self.agree, self.of).map(|interval| [interval.low, interval.high]);
        json!({ "agree": self.agree, "of": self.of, "interval": interval })
    }
}

impl SummarisedRun {
    fn of(run: &Checked) -> Option<Self> {
        let (here, plain) = (&run.here.record, run.there.get(PLAIN)?);
        let names = |decided: BTreeMap<(usize, String), [bool; 2]>| -> BTreeSet<String> {
            let differing = decided.into_iter().filter(|(_, [one, other])| one != other);
            differing
                .map(|((_, property), _)| names::local(&property).to_owned())
                .collect()
        };
        let others = run.there.iter().filter(|(setting, _)| *setting != PLAIN);
        let both = in_both(here, plain);
        let words = both
            .flips()
            .map(|((step, property), _)| {
                let witness = |record: &RunRecord| {
                    record.judgements[*step]
                        .iter()
                        .find(|judgement| judgement.property == *property)
                        .map_or_else(String::new, |judgement| judgement.witness.clone())
                };
                (
                    names::local(property).to_owned(),
                    witness(here),
                    witness(plain),
                )
            })
            .collect();
        Some(Self {
            run: here.id.clone(),
            flips_here: run
                .there
                .iter()
                .map(|(setting, record)| (setting.clone(), names(decided(here, record))))
                .collect(),
            flips_there: others
                .map(|(setting, record)| (setting.clone(), names(decided(plain, record))))
                .collect(),
            both,
            words,
        })
    }

    /// The properties that any setting decides otherwise than actcheck, or than MuJoCo itself.
    fn contested(&self) -> BTreeSet<String> {
        self.flips_here
            .values()
            .chain(self.flips_there.values())
            .flatten()
            .cloned()
            .collect()
    }
}

impl Summary {
    fn of(
        args: &CrossCheckArgs,
        checked: &[Checked],
        played: &Played,
        imported: Option<String>,
    ) -> Self {
        Self {
            campaign: args.campaign.clone(),
            version: played.version.clone(),
            imported,
            finger_friction: args.finger_friction,
            runs: checked.iter().filter_map(SummarisedRun::of).collect(),
            plain_secs: played.plain_secs,
        }
    }

    /// Number of runs in which all properties agree.
    fn agreeing(&self) -> usize {
        self.runs
            .iter()
            .filter(|run| run.both.flips().next().is_none())
            .count()
    }

    fn settings(&self) -> Vec<&String> {
        let settings: BTreeSet<&String> = self
            .runs
            .iter()
            .flat_map(|run| run.flips_here.keys())
            .collect();
        settings.into_iter().collect()
    }

    /// How often all properties of a run agree in a setting: with actcheck, and with MuJoCo's plain
    /// setting.
    fn of_setting(&self, setting: &str) -> [Agreement; 2] {
        let mut both = [Agreement::default(); 2];
        for run in &self.runs {
            for (agreement, flips) in both.iter_mut().zip([&run.flips_here, &run.flips_there]) {
                if let Some(flips) = flips.get(setting) {
                    agreement.add(flips.is_empty());
                }
            }
        }
        both
    }

    /// How often each property agrees, with MuJoCo's lowest agreement with itself, and how often it
    /// passes only here and only there.
    fn of_properties(&self) -> Vec<(String, Agreement, Agreement, [u64; 2])> {
        let mut found: BTreeMap<String, (Agreement, [u64; 2])> = BTreeMap::new();
        for run in &self.runs {
            for ((_, property), [here, there]) in &run.both.decided {
                let (agreement, alone) =
                    found.entry(names::local(property).to_owned()).or_default();
                agreement.add(here == there);
                alone[0] += u64::from(*here && !there);
                alone[1] += u64::from(*there && !here);
            }
        }
        let lowest = |property: &String| {
            let of = |setting: &&String| {
                let mut agreement = Agreement::default();
                for run in &self.runs {
                    if let Some(flips) = run.flips_there.get(*setting) {
                        agreement.add(!flips.contains(property));
                    }
                }
                agreement
            };
            let settings = self.settings();
            let all = settings
                .iter()
                .filter(|setting| setting.as_str() != PLAIN)
                .map(of);
            all.min_by_key(|agreement| agreement.agree)
                .unwrap_or_default()
        };
        found
            .into_iter()
            .map(|(property, (agreement, alone))| {
                let itself = lowest(&property);
                (property, agreement, itself, alone)
            })
            .collect()
    }

    /// The setting that agrees with actcheck in clearly more runs than the plain one does: half of
    /// the disagreements and at least three vanish.
    fn suspect(&self) -> Option<(&String, u64)> {
        let [plain, _] = self.of_setting(PLAIN);
        let missing = plain.of - plain.agree;
        let better = self.settings().into_iter().filter_map(|setting| {
            let [agreement, _] = self.of_setting(setting);
            let gain = agreement.agree.checked_sub(plain.agree)?;
            (gain >= 3 && 2 * gain >= missing).then_some((setting, gain))
        });
        better.max_by_key(|(_, gain)| *gain)
    }

    fn text(&self) -> String {
        let n = self.runs.len() as u64;
        let all = Agreement {
            agree: self.agreeing() as u64,
            of: n,
        };
        let mut out = format!(
            "{n} runs of {} in MuJoCo {}, with the same setpoints: all properties agree in {} ({})\n\n",
            self.campaign,
            self.version,
            all.agree,
            all.interval()
        );
        out += &self.table().render(Format::Text.into(), output::page());
        out.push('\n');
        let mut table = Table::new([
            "setting of MuJoCo",
            "agrees with actcheck",
            "with MuJoCo as exported",
        ]);
        for setting in self.settings() {
            let [here, there] = self.of_setting(setting);
            let itself = if setting == PLAIN {
                String::new()
            } else {
                there.text()
            };
            table.rows.push(vec![
                json!(words_of(setting, self.finger_friction)),
                json!(here.text()),
                json!(itself),
            ]);
        }
        out += &table.render(Format::Text.into(), output::page());
        if let Some((setting, gain)) = self.suspect() {
            out += &format!(
                "\nwith {} MuJoCo agrees in {gain} more runs: this is the likely cause of the disagreements\n",
                words_of(setting, self.finger_friction)
            );
        }
        let contested = self.runs.iter().filter(|run| !run.contested().is_empty());
        let contested: Vec<&str> = contested.map(|run| run.run.as_str()).collect();
        out += &format!(
            "\n{} of {n} runs are contested: an engine or a setting decides a property otherwise\n",
            contested.len()
        );
        let differing = self
            .runs
            .iter()
            .filter(|run| run.both.flips().next().is_some());
        for run in differing.take(MOST_EXPLAINED) {
            out += &run.text();
        }
        if let Some(imported) = &self.imported {
            out += &format!(
                "\nMuJoCo's courses are the runs of campaign {imported}; CPU {:.1} s of MuJoCo\n",
                self.plain_secs
            );
        }
        output::page().set(&out)
    }

    fn table(&self) -> Table {
        let mut table = Table::new([
            "property",
            "agrees",
            "interval",
            "mujoco_with_itself",
            "passes_only_here",
            "passes_only_in_mujoco",
        ]);
        for (property, agreement, itself, [here, there]) in self.of_properties() {
            table.rows.push(vec![
                json!(property),
                json!(agreement.text()),
                json!(agreement.interval()),
                json!(itself.text()),
                json!(here),
                json!(there),
            ]);
        }
        table
    }

    fn json(&self) -> Value {
        let all = Agreement {
            agree: self.agreeing() as u64,
            of: self.runs.len() as u64,
        };
        let properties: Vec<Value> = self
            .of_properties()
            .into_iter()
            .map(|(property, agreement, itself, [here, there])| {
                json!({
                    "property": property,
                    "agreement": agreement.json(),
                    "mujoco_with_itself": itself.json(),
                    "passes_only_here": here,
                    "passes_only_in_mujoco": there,
                })
            })
            .collect();
        let settings: Vec<Value> = self
            .settings()
            .into_iter()
            .map(|setting| {
                let [here, there] = self.of_setting(setting);
                json!({ "setting": setting, "with_actcheck": here.json(), "with_mujoco": there.json() })
            })
            .collect();
        json!({
            "campaign": self.campaign,
            "mujoco": self.version,
            "imported": self.imported,
            "all_properties": all.json(),
            "properties": properties,
            "settings": settings,
            "likely_cause": self.suspect().map(|(setting, _)| setting),
            "mujoco_cpu_secs": self.plain_secs,
            "runs": self.runs.iter().map(SummarisedRun::json).collect::<Vec<_>>(),
        })
    }

    /// The part that the history keeps.
    fn record(&self) -> CrossCheck {
        CrossCheck {
            campaign: self.campaign.clone(),
            engine: format!("MuJoCo {}", self.version),
            imported: self.imported.clone(),
            runs: self
                .runs
                .iter()
                .map(|run| (run.run.clone(), run.contested()))
                .collect(),
        }
    }
}

/// A setting in words.
fn words_of(setting: &str, finger_friction: f64) -> String {
    match setting {
        PLAIN if finger_friction == 1.0 => "as exported".to_owned(),
        PLAIN => format!("finger friction × {finger_friction}, wrong on purpose"),
        "impratio" => "impratio 1 instead of 10".to_owned(),
        "cone" => "pyramidal friction cones".to_owned(),
        "noslip" => "5 steps of noslip".to_owned(),
        "finger-friction" if finger_friction == 1.0 => "finger friction × 1.1".to_owned(),
        "finger-friction" => format!("finger friction × {:.3}", 1.0 / finger_friction),
        other => other.to_owned(),
    }
}

impl SummarisedRun {
    fn text(&self) -> String {
        let mut out = format!("\nrun {}\n", self.run);
        for (property, here, there) in &self.words {
            out += &format!("  {property}: here {here}; in MuJoCo {there}\n");
        }
        if let Some(parting) = &self.both.parting {
            out += &format!(
                "  the courses part by more than 5 mm at {:.1} s: {}\n",
                parting.secs, parting.body
            );
        }
        if let Some(contact) = &self.both.contact {
            let [first, second] = &contact.pair;
            let place = if contact.is_here {
                "only here"
            } else {
                "only in MuJoCo"
            };
            out += &format!(
                "  first contact that differs: {first} and {second} at {:.2} s, {place}\n",
                contact.secs
            );
        }
        out
    }

    fn json(&self) -> Value {
        json!({
            "run": self.run,
            "contested": self.contested(),
            "flips": self.words.iter().map(|(property, here, there)| json!({ "property": property, "here": here, "in_mujoco": there })).collect::<Vec<_>>(),
            "flips_by_setting": self.flips_here,
            "parting": self.both.parting.as_ref().map(|parting| json!({ "secs": parting.secs, "body": parting.body })),
            "first_contact": self.both.contact.as_ref().map(|contact| json!({ "pair": contact.pair, "secs": contact.secs, "only_here": contact.is_here })),
        })
    }
}
