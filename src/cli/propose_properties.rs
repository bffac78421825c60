//! `actcheck propose-properties`

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget};
use serde_json::{Value, json};

use crate::labels::{self, Label};
use crate::new_files::NewFiles;
use crate::options::Format;
use crate::work::{all_cores, quietly};
use crate::{clock, compare, output, stop, trust, why};
use actcheck_analysis::{Beyond, MinedLimit, Notice, OracleTrial, oracle_matrix};
use actcheck_base::{Diagnostic, Diagnostics, Files, Outcome};
use actcheck_campaign::mining::{
    Candidate, Side, candidates, import_from, measure, phases, try_candidates,
};
use actcheck_campaign::oracles::{COURSE_FAULTS, FAULTS, Fault, Trial, TrialOptions};
use actcheck_campaign::{Env, RunContext};
use actcheck_history::{CampaignRecord, History, RunFilter, RunRow, RunStatus};
use actcheck_ontology::{self as ontology, Ontology};
use actcheck_report::Table;

/// Runs from which the names of phases are taken.
const RUNS_FOR_PHASES: usize = 30;
/// Most candidates that are tried with faults; those with the fewest false alarms come first.
const MOST_TRIED: usize = 400;
/// The ontology with the proposed properties, beside their rule files.
const ROOT: &str = "properties.ttl";
/// Help if the files exist.
const TAKEN: &str = "name another folder with `--output`, or remove the proposals of last time";
/// IRI of the ontology that is part of the program.
const SHIPPED: &str = "https://w3id.org/actcheck/ontology";

/// `actcheck propose-properties`
#[derive(Debug, Args)]
pub struct ProposePropertiesArgs {
    /// The folder of the history
    pub history: PathBuf,
    /// Id of the campaign whose passing runs are used [default: the newest]
    #[arg(long, value_name = "ID")]
    pub campaign: Option<String>,
    /// People's labels of its runs: a CSV file with the columns run, property and label. A run is
    /// good if none of its labels is `fail`
    #[arg(long, value_name = "FILE")]
    pub labels: Option<PathBuf>,
    /// Number of fresh scenes for each test in which faults are injected
    #[arg(long, value_name = "N", default_value_t = 15, value_parser = clap::value_parser!(u32).range(1..))]
    pub scenes: u32,
    /// Propose also properties whose faults the present properties notice, too
    #[arg(long)]
    pub all: bool,
    /// The folder for the rule files; it must not have them yet
    #[arg(short, long, value_name = "DIR", default_value = "proposed")]
    pub output: PathBuf,
    /// The ontology with the actions [default: that of the campaign's configuration]
    #[arg(long, value_name = "FILE")]
    pub ontology: Option<PathBuf>,
    /// Start the program that the history names; read it first
    #[arg(long)]
    pub trust: bool,
    /// Number of workers, each with one simulation; does not affect results [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
    /// How it is printed
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: Format,
}

/// A candidate with a limit that held-out runs confirm.
struct Confirmed {
    candidate: Candidate,
    found: MinedLimit,
    /// Values in runs that people labelled as bad.
    bad: BTreeMap<String, f64>,
    /// Values in runs that people labelled as good, without those that the limit is fitted to.
    good: BTreeMap<String, f64>,
}

/// A property to propose.
struct Proposed {
    confirmed: Confirmed,
    /// The faults that it notices, each with the number of scenes in which it does.
    faults: Vec<(String, u64)>,
    /// Number of trials with a fault in which it alone fails.
    alone: u64,
    /// Number of bad runs that it notices; `None` if not beyond chance.
    caught: Option<u64>,
}

/// Proposes properties, and writes their rule files. Returns the exit code.
pub fn propose_properties(args: &ProposePropertiesArgs) -> Result<u8, Diagnostics> {
    let labels = args.labels.as_deref().map(read_labels).transpose()?;
    // Before minutes of simulation.
    NewFiles::check_absent(&args.output.join(ROOT), TAKEN)?;
    let history = History::open_to_read(&args.history)?;
    let id = match &args.campaign {
        Some(id) => id.clone(),
        None => compare::newest(&history)?,
    };
    let record = history.campaign(&id)?;
    let jobs = args.jobs.map_or_else(all_cores, usize::from);
    let stop = stop::on_interrupt(|| {});
    let env = simulated(args, &history, &record, labels.is_some())?;
    let (files, root) = match (&args.ontology, &env) {
        (None, Some(env)) => env.campaign.ontology.clone(),
        (path, _) => why::ontology_file(path.as_deref()),
    };
    let known = ontology::load(&files, &root)?;
    let runs = GoodAndBad::of(&history, &id, labels.as_deref())?;
    let confirmed = confirmed(&history, &known, &runs, (jobs, &stop))?;
    if stop.load(Ordering::Relaxed) {
        return Ok(stop::INTERRUPTED);
    }
    let trials = match env {
        Some(env) => trials(args, env, &confirmed, (jobs, &stop))?,
        None => Vec::new(),
    };
    if stop.load(Ordering::Relaxed) {
        return Ok(stop::INTERRUPTED);
    }
    let mut proposed = proposed(confirmed, &trials);
    let n_found = proposed.len();
    proposed.retain(|one| args.all || one.alone > 0 || one.caught.is_some());
    let n_left = n_found - proposed.len();
    if !proposed.is_empty() {
        write(args, &id, (&files, &root), &known, &proposed, &runs)?;
    }
    print(args, &id, &runs, &proposed, n_left);
    Ok(u8::from(proposed.is_empty()))
}

/// The prepared campaign, for faults; `None` if it was imported.
fn simulated(
    args: &ProposePropertiesArgs,
    history: &History,
    record: &CampaignRecord,
    has_labels: bool,
) -> Result<Option<Env>, Diagnostics> {
    if record.imported_from.is_some() {
        return match has_labels {
            true => Ok(None),
            false => {
                let message = format!(
                    "campaign {} was imported: no fault can be injected into its runs",
                    record.id
                );
                let help = "label its runs, good ones and bad ones: `--labels labels.csv`";
                Err(Diagnostic::error("S056", message).help(help).into())
            }
        };
    }
    let (env, record) = Env::from_history(history, &record.id, None)?;
    if !args.trust {
        trust::check_stored(&env, history, &record)?;
    }
    Ok(Some(env))
}

fn read_labels(path: &Path) -> Result<Vec<Label>, Diagnostics> {
    let (labels, faults) = labels::read(path)?;
    faults.or(labels)
}

/// The runs of the campaign.
struct GoodAndBad {
    /// Those that passed, and have no bad label.
    good: Vec<RunRow>,
    /// Those with a bad label.
    bad: Vec<RunRow>,
    /// Those with good labels only, whatever the verdicts about them are.
    labelled_good: Vec<RunRow>,
}

impl GoodAndBad {
    fn of(history: &History, id: &str, labels: Option<&[Label]>) -> Result<Self, Diagnostics> {
        let filter = RunFilter {
            campaign: Some(id.to_owned()),
            ..RunFilter::default()
        };
        let mut failed: BTreeSet<String> = BTreeSet::new();
        let mut passed: BTreeSet<String> = BTreeSet::new();
        for row in history.outcomes(&filter)? {
            match row.outcome {
                Outcome::Passed => passed.insert(row.run),
                Outcome::Inapplicable => false,
                _ => failed.insert(row.run),
            };
        }
        let labelled = |passes: bool| -> BTreeSet<&str> {
            let labels = labels.into_iter().flatten();
            let such = labels.filter(|label| label.passes == passes);
            such.map(|label| label.run.as_str()).collect()
        };
        let (bad, good) = (labelled(false), labelled(true));
        let rows = history.runs(&filter)?.into_iter();
        let rows = rows.filter(|row| row.status == RunStatus::Completed);
        let (bad, rest): (Vec<RunRow>, Vec<RunRow>) =
            rows.partition(|row| bad.contains(row.run.as_str()));
        let is_good = |row: &RunRow| passed.contains(&row.run) && !failed.contains(&row.run);
        let is_labelled = |row: &&RunRow| good.contains(row.run.as_str());
        Ok(Self {
            labelled_good: rest.iter().filter(is_labelled).cloned().collect(),
            good: rest.into_iter().filter(is_good).collect(),
            bad,
        })
    }
}

/// Fits a limit to each candidate, and keeps those that held-out runs confirm.
fn confirmed(
    history: &History,
    known: &Ontology,
    runs: &GoodAndBad,
    (jobs, stop): (usize, &AtomicBool),
) -> Result<Vec<Confirmed>, Diagnostics> {
    let some: Vec<RunRow> = runs.good.iter().take(RUNS_FOR_PHASES).cloned().collect();
    let phases = phases(history, &some)?;
    let all: Vec<Candidate> = phases
        .iter()
        .filter_map(|(name, phases)| Some(candidates(known.actions.get(name)?, phases)))
        .flatten()
        .filter(|candidate| !known.properties.contains_key(&candidate.iri()))
        .collect();
    let good = measure(history, &runs.good, known, &all, (jobs, stop))?;
    let bad = measure(history, &runs.bad, known, &all, (jobs, stop))?;
    let labelled = measure(history, &runs.labelled_good, known, &all, (jobs, stop))?;
    let labels = bad.into_iter().zip(labelled);
    let found = all.into_iter().zip(good).zip(labels);
    let mut confirmed: Vec<Confirmed> = found
        .filter_map(|((candidate, values), (bad, mut good))| {
            let found = MinedLimit::of(&values, beyond(candidate.side))?;
            let fitted = MinedLimit::fitted_runs(&values);
            good.retain(|run, _| !fitted.contains(run.as_str()));
            found.is_confirmed().then_some(Confirmed {
                candidate,
                found,
                bad,
                good,
            })
        })
        .collect();
    confirmed.sort_by_key(|one| one.found.false_alarms);
    confirmed.truncate(MOST_TRIED);
    Ok(confirmed)
}

fn beyond(side: Side) -> Beyond {
    match side {
        Side::Most => Beyond::Above,
        Side::Least => Beyond::Below,
        Side::Before => Beyond::BelowFixed,
    }
}

/// Injects faults into fresh scenes, judged by the candidates too.
fn trials(
    args: &ProposePropertiesArgs,
    env: Env,
    confirmed: &[Confirmed],
    (jobs, stop): (usize, &AtomicBool),
) -> Result<Vec<Trial>, Diagnostics> {
    let tests = &env.campaign.tests;
    let concerns = |fault: &Fault| {
        let mut tests = tests.iter();
        tests.any(|test| fault.concerns(test, &env.campaign.robot.core))
    };
    let faults: Vec<Fault> = FAULTS.into_iter().filter(concerns).collect();
    let scenes = u64::from(args.scenes) * tests.len() as u64;
    let steps = scenes * (faults.len() as u64 + 1);
    let bar = ProgressBar::with_draw_target(Some(steps), ProgressDrawTarget::stderr());
    let options = TrialOptions {
        jobs,
        context: RunContext {
            clock: clock::system(),
            disturb: None,
        },
    };
    let limited: Vec<(Candidate, f64)> = confirmed
        .iter()
        .map(|one| (one.candidate.clone(), one.found.limit))
        .collect();
    let scenes = (args.scenes, faults.as_slice());
    let trials = quietly(|| try_candidates(env, &limited, scenes, &options, stop, || bar.inc(1)))?;
    bar.finish_and_clear();
    Ok(trials)
}

/// Keeps the candidates that notice a fault or bad runs, best first.
fn proposed(confirmed: Vec<Confirmed>, trials: &[Trial]) -> Vec<Proposed> {
    let plain: Vec<OracleTrial> = trials
        .iter()
        .map(|trial| OracleTrial {
            index: trial.index,
            fault: trial.fault.map(str::to_owned),
            came_about: trial.came_about,
            outcomes: trial.outcomes.clone(),
        })
        .collect();
    let names: Vec<&str> = FAULTS
        .iter()
        .map(|fault| fault.name)
        .chain(COURSE_FAULTS.iter().map(|fault| fault.name))
        .collect();
    let properties: Vec<String> = confirmed.iter().map(|one| one.candidate.iri()).collect();
    let matrix = oracle_matrix(&names, &properties, &plain);
    let mined: BTreeSet<&String> = properties.iter().collect();
    let others_pass = |trial: &&Trial| {
        let mut others = trial
            .outcomes
            .iter()
            .filter(|(iri, _)| !mined.contains(iri));
        trial.fault.is_some() && trial.came_about && others.all(|(_, it)| *it != Outcome::Failed)
    };
    let unnoticed: Vec<&Trial> = trials.iter().filter(others_pass).collect();
    let mut proposed: Vec<Proposed> = confirmed
        .into_iter()
        .enumerate()
        .map(|(idx, confirmed)| {
            let noticed = matrix.rows.iter().filter_map(|row| {
                let cell = &row.cells[idx];
                (cell.notice == Notice::Noticed).then(|| (row.fault.clone(), cell.newly_failed))
            });
            let iri = &properties[idx];
            let fails = |trial: &&&Trial| trial.outcomes.get(iri) == Some(&Outcome::Failed);
            let side = beyond(confirmed.candidate.side);
            Proposed {
                faults: noticed.collect(),
                alone: unnoticed.iter().filter(fails).count() as u64,
                caught: confirmed
                    .found
                    .caught(&confirmed.bad, &confirmed.good, side),
                confirmed,
            }
        })
        .filter(|one| !one.faults.is_empty() || one.caught.is_some())
        .collect();
    proposed.sort_by_key(|one| {
        let caught = one.caught.unwrap_or_default();
        std::cmp::Reverse((one.alone, caught, one.faults.len()))
    });
    proposed
}

/// Writes the rule files, and an ontology that links them and imports the campaign's.
fn write(
    args: &ProposePropertiesArgs,
    id: &str,
    (files, root): (&Files, &Path),
    known: &Ontology,
    proposed: &[Proposed],
    runs: &GoodAndBad,
) -> Result<(), Diagnostics> {
    let import = match files {
        Files::Shipped => SHIPPED.to_owned(),
        Files::Disk => import_from(&args.output, root).map_err(|error| {
            let message = format!("can't find the way to {}: {error}", root.display());
            Diagnostic::error("X007", message).help("name another folder with `--output`")
        })?,
    };
    let mut text = format!(
        "# Properties that `actcheck propose-properties` proposes from the passing runs of campaign {id}. Read each rule file, and\n\
         # remove unwanted ones. `ontology = \"{ROOT}\"` in a configuration beside this file uses them.\n\n\
         @prefix act: <http://actions#> .\n@prefix owl: <http://www.w3.org/2002/07/owl#> .\n\
         @prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .\n\n\
         <> a owl:Ontology ; owl:imports <{import}> .\n"
    );
    let mut new = NewFiles::default();
    for one in proposed {
        let (candidate, limit) = (&one.confirmed.candidate, one.confirmed.found.limit);
        let file = format!("{}.rls", candidate.name);
        new.add(
            args.output.join(&file),
            candidate.rule(limit, &evidence(one, id, runs)),
        );
        let needs = known
            .actions
            .get(&candidate.action)
            .map(|action| &action.parameters);
        let reads_pick = candidate.reads("pickObject") && needs.is_some();
        let needs = if reads_pick {
            " act:needsParameter act:pickObject ;"
        } else {
            ""
        };
        let unit = match candidate.unit {
            "" => String::new(),
            unit => format!(" act:unit \"{unit}\" ;"),
        };
        let _ = write!(
            text,
            "\nact:{} a act:Property ; rdfs:label \"{}\" ;{needs}{unit}\n    act:verifiedBy <{file}> .\nact:{} act:successProperty act:{} .\n",
            candidate.name,
            candidate.sentence(limit),
            candidate.action,
            candidate.name
        );
    }
    new.add(args.output.join(ROOT), text);
    new.write(TAKEN)
}

/// The evidence for a property, as sentences for its rule file.
fn evidence(one: &Proposed, id: &str, runs: &GoodAndBad) -> Vec<String> {
    let found = &one.confirmed.found;
    let mut lines = vec![
        format!(
            "Proposed from {} of the {} passing runs of campaign {id}: the farthest value is {:.4}.",
            found.fitted,
            runs.good.len(),
            found.farthest
        ),
        format!(
            "Of {} other passing runs, {} are beyond the limit.",
            found.held_out, found.false_alarms
        ),
    ];
    if let Some(caught) = one.caught {
        lines.push(format!(
            "It notices {caught} of {} runs that people labelled as bad.",
            one.confirmed.bad.len()
        ));
    }
    if !one.faults.is_empty() {
        lines.push(format!(
            "Injected faults that it notices: {}.",
            faults_of(one)
        ));
        lines.push(format!(
            "In {} trials with a fault, it alone fails.",
            one.alone
        ));
    }
    lines
}

fn faults_of(one: &Proposed) -> String {
    let faults = one.faults.iter();
    let texts: Vec<String> = faults
        .map(|(fault, scenes)| format!("{fault} ({scenes})"))
        .collect();
    texts.join(", ")
}

fn print(
    args: &ProposePropertiesArgs,
    id: &str,
    runs: &GoodAndBad,
    proposed: &[Proposed],
    n_left: usize,
) {
    let left_out = match n_left {
        0 => String::new(),
        n_left => format!(
            "{n_left} more notice only faults that present properties notice: `--all` proposes them\n"
        ),
    };
    let of_held_out = |found: &MinedLimit| format!("{} of {}", found.false_alarms, found.held_out);
    match args.format {
        Format::Text if proposed.is_empty() => output::print_prose(&format!(
            "nothing to propose from {} passing runs of {id}: no limit is kept by held-out runs and notices a new fault\n{left_out}",
            runs.good.len()
        )),
        Format::Text | Format::Csv => {
            let columns = [
                "property",
                "statement",
                "false alarms",
                "faults",
                "alone",
                "labels",
            ];
            let mut table = Table::new(columns);
            for one in proposed {
                let found = &one.confirmed.found;
                table.rows.push(vec![
                    one.confirmed.candidate.name.clone().into(),
                    one.confirmed.candidate.sentence(found.limit).into(),
                    of_held_out(found).into(),
                    one.faults.len().into(),
                    one.alone.into(),
                    one.caught.into(),
                ]);
            }
            output::print(&table.render(args.format.into(), output::page()));
            if args.format == Format::Text {
                output::print_prose(&format!(
                    "\n{} properties in {}: read each file, then `ontology = \"{}\"` in a configuration uses them\n{left_out}",
                    proposed.len(),
                    args.output.display(),
                    args.output.join(ROOT).display()
                ));
            }
        }
        Format::Json => output::print(&format!("{:#}\n", as_json(id, runs, proposed))),
    }
}

fn as_json(id: &str, runs: &GoodAndBad, proposed: &[Proposed]) -> Value {
    let shown = |one: &Proposed| {
        let (candidate, found) = (&one.confirmed.candidate, &one.confirmed.found);
        json!({
            "property": candidate.name,
            "action": candidate.action,
            "statement": candidate.sentence(found.limit),
            "limit": found.limit,
            "unit": candidate.unit,
            "fitted_to": found.fitted,
            "held_out": found.held_out,
            "false_alarms": found.false_alarms,
            "faults": one.faults.iter().cloned().collect::<BTreeMap<String, u64>>(),
            "alone": one.alone,
            "bad_runs": one.caught,
        })
    };
    json!({
        "campaign": id,
        "passing_runs": runs.good.len(),
        "bad_runs": runs.bad.len(),
        "properties": proposed.iter().map(shown).collect::<Vec<Value>>(),
    })
}
