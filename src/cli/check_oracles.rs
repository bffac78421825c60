//! `actcheck check-oracles`

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;

use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget};

use crate::audit::{Audit, audit};
use crate::options::Format;
use crate::work::{all_cores, quietly};
use crate::{clock, output, stop};
use actcheck_analysis::{OracleTrial, oracle_matrix};
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_campaign::oracles::{COURSE_FAULTS, FAULTS, Fault, Trial, TrialOptions, try_faults};
use actcheck_campaign::{Env, RunContext};
use actcheck_config::Overrides;
use actcheck_report::{OracleSummary, oracles_json, oracles_table, oracles_text};
use actcheck_rules::Budget;

/// `actcheck check-oracles`
#[derive(Debug, Args)]
pub struct CheckOraclesArgs {
    /// The campaign's configuration (TOML)
    #[arg(required_unless_present = "episodes")]
    pub config: Option<PathBuf>,
    /// Instead, audit the success check of another simulator: a suite whose faulty episodes are made
    /// now (`libero_spatial`, `robosuite/Stack`), or files of faulty episodes; may be given several
    /// times
    #[arg(long, value_name = "SUITE|FILE", conflicts_with_all = ["config", "runs", "seed", "jobs"])]
    pub episodes: Vec<String>,
    /// The mapping for these episodes [default: the shipped one for the environment]
    #[arg(long, value_name = "FILE", requires = "episodes")]
    pub mapping: Option<PathBuf>,
    /// The Python of that simulator
    #[arg(
        long,
        value_name = "PROGRAM",
        default_value = "python3",
        requires = "episodes"
    )]
    pub python: PathBuf,
    /// Scenes for each test, instead of the configuration's `test_count`; each runs once without a
    /// fault and once with each fault
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub runs: Option<u32>,
    /// Seed of all randomness, instead of the configuration's `seed`
    #[arg(long, value_name = "S")]
    pub seed: Option<u64>,
    /// Number of workers, each with one simulation; does not affect results [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
    /// How the matrix is printed
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: Format,
}

/// Runs every scene with every fault and prints which properties detect it. Returns the exit code.
pub fn check_oracles(args: &CheckOraclesArgs) -> Result<u8, Diagnostics> {
    let Some(config) = &args.config else {
        return audit(&Audit {
            episodes: &args.episodes,
            mapping: args.mapping.as_deref(),
            python: &args.python,
            format: args.format,
        });
    };
    let overrides = Overrides {
        runs: args.runs,
        seed: args.seed,
        ..Overrides::default()
    };
    // No runs are stored, so an interrupt needs no cleanup.
    let stop = stop::on_interrupt(|| {});
    let budget = Budget {
        stop: Arc::clone(&stop),
        ..Budget::default()
    };
    let env = Env::prepare_within(config, &overrides, budget)?;
    env.check_starts()?;
    let concerns = |fault: &Fault| {
        env.campaign
            .tests
            .iter()
            .any(|test| fault.concerns(test, &env.campaign.robot.core))
    };
    let faults: Vec<Fault> = FAULTS.into_iter().filter(concerns).collect();
    let steps = env.planned_runs() * (faults.len() as u64 + 1);
    let bar = ProgressBar::with_draw_target(Some(steps), ProgressDrawTarget::stderr());
    let context = RunContext {
        clock: clock::system(),
        disturb: None,
    };
    let options = TrialOptions {
        jobs: args.jobs.map_or_else(all_cores, usize::from),
        context,
    };
    let trials = quietly(|| try_faults(&env, &faults, &options, &stop, || bar.inc(1)))?;
    bar.finish_and_clear();
    if stop.load(Ordering::Relaxed) {
        return Ok(stop::INTERRUPTED);
    }
    if trials.iter().all(|trial| trial.outcomes.is_empty()) {
        return Err(Diagnostic::error(
            "V010",
            "no scene could be judged, so the properties could not be tested",
        )
        .help("`actcheck run` with the same configuration shows why")
        .into());
    }
    let summary = summarise(config, &env, &faults, &trials);
    output::print(&match args.format {
        Format::Text => oracles_text(&summary, output::page()),
        Format::Csv => oracles_table(&summary).render(Format::Csv.into(), output::page()),
        Format::Json => format!("{:#}\n", oracles_json(&summary)),
    });
    output::print_diagnostics(&summary.warnings());
    Ok(summary.exit_code())
}

fn summarise(config: &Path, env: &Env, faults: &[Fault], trials: &[Trial]) -> OracleSummary {
    let mut properties: Vec<String> = Vec::new();
    for action in env
        .campaign
        .tests
        .iter()
        .flatten()
        .filter_map(|step| env.ontology.actions.get(&step.action))
    {
        for iri in &action.success_properties {
            if !properties.contains(iri) {
                properties.push(iri.clone());
            }
        }
    }
    let plain: Vec<OracleTrial> = trials.iter().map(plain).collect();
    let tests = &env.campaign.tests;
    let of_course = COURSE_FAULTS
        .iter()
        .filter(|fault| tests.iter().any(|test| fault.concerns(test, env)));
    let tried: Vec<(&str, &str)> = faults
        .iter()
        .map(|fault| (fault.name, fault.description))
        .chain(of_course.map(|fault| (fault.name, fault.description)))
        .collect();
    let names: Vec<&str> = tried.iter().map(|(name, _)| *name).collect();
    let matrix = oracle_matrix(&names, &properties, &plain);
    let name = |iri: &String| {
        env.ontology
            .properties
            .get(iri)
            .map_or_else(|| iri.clone(), |p| p.name.clone())
    };
    OracleSummary {
        config: config.display().to_string(),
        seed: env.campaign.seed,
        planned: env.planned_runs(),
        faults: tried
            .iter()
            .map(|(name, what)| ((*name).to_owned(), (*what).to_owned()))
            .collect(),
        names: properties.iter().map(name).collect(),
        // The first fault is a robot that does nothing.
        gaps: matrix.gaps(FAULTS[0].name),
        matrix,
    }
}

fn plain(trial: &Trial) -> OracleTrial {
    OracleTrial {
        index: trial.index,
        fault: trial.fault.map(str::to_owned),
        came_about: trial.came_about,
        outcomes: trial.outcomes.clone(),
    }
}
