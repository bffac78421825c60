//! `actcheck shrink`, and shrinking at the end of `actcheck run`

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Args;

use crate::appearance::AppearanceReader;
use crate::option_fault::OptionFault;
use crate::options::{Format, HistoryArgs, duration};
use crate::picture::Picture;
use crate::work::{all_cores, quietly};
use crate::{clock, history_dir, output, restore, stop, trust};
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_campaign::shrink::{self, Id, Repeat, ShrinkOptions, Shrunk};
use actcheck_campaign::{Env, RelateOptions, RunContext, relate};
use actcheck_config::SceneChange;
use actcheck_data::Choice;
use actcheck_history::{History, RunRecord};
use actcheck_report::{PassingValue, ShrunkChoice, ShrunkSummary, Table, shrunk_json, shrunk_text};
use actcheck_rules::Budget;
use serde_json::Value;

/// `actcheck shrink`
#[derive(Debug, Args)]
pub struct ShrinkArgs {
    /// Id of the run, or a unique prefix
    pub run: String,
    /// The property that must still fail, by its name in the ontology, or the relation that must
    /// still be broken, by its key in `[relations]` [default: exactly the properties that failed]
    #[arg(long, value_name = "PROPERTY")]
    pub property: Option<String>,
    /// Maximum number of simulations, including those for the explanation
    #[arg(long, value_name = "N", default_value_t = TRIALS, value_parser = clap::value_parser!(u64).range(1..))]
    pub trials: u64,
    /// Time limit, such as 90s, 10m or 2h [default: no limit]
    #[arg(long, value_name = "DURATION", value_parser = duration)]
    pub time: Option<f64>,
    /// A scene must fail in K of N repetitions with fresh noise [default: once, with the recorded
    /// noise]
    #[arg(long, value_name = "K/N", value_parser = must_fail)]
    pub must_fail: Option<Repeat>,
    /// Number of workers, each with one simulation; does not affect results [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
    /// The configuration to run with [default: the campaign's own, from the history]
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Start the program that the history names, even if its configuration is not there or names
    /// another one
    #[arg(long)]
    pub trust: bool,
    /// The folder of the history.
    #[command(flatten)]
    pub history: HistoryArgs,
    /// Draw the shrunk scene before and after the run into this file, as a raster (.png) or vector
    /// image (.svg)
    #[arg(long, value_name = "FILE.png")]
    pub picture: Option<PathBuf>,
    /// How it is printed (csv: one line for each choice that remains special)
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: Format,
}

/// Default limit of simulations for one run: three times the number that most runs need.
pub const TRIALS: u64 = 200;

/// Finds the smallest scene that fails in the same way as a run, stores it and prints it. Returns
/// the exit code.
pub fn shrink(args: &ShrinkArgs) -> Result<u8, Diagnostics> {
    let picture = args.picture.as_deref().map(Picture::new).transpose()?;
    let history = history_dir::open(&args.history)?;
    let run = history.run(&args.run)?;
    let (env, record) = Env::from_history(&history, &run.row.campaign, args.config.as_deref())?;
    if args.config.is_none() && !args.trust {
        trust::check_stored(&env, &history, &record)?;
    }
    restore::allow(&history, true);
    let context = RunContext {
        clock: clock::system(),
        disturb: None,
    };
    let until = args.time.map(|secs| (context.clock.secs)() + secs);
    let asked = stop::on_interrupt(|| eprintln!("stopping; the smallest scene so far follows"));
    let stop = || {
        asked.load(Ordering::Relaxed) || until.is_some_and(|until| (context.clock.secs)() >= until)
    };
    let options = ShrinkOptions {
        property: args.property.as_deref(),
        trials: args.trials,
        jobs: args.jobs.map_or_else(all_cores, usize::from),
        repeat: args.must_fail,
        context,
        stop: &stop,
    };
    let recorded = history.traces().choices(&run.row.run)?;
    let index = env.index_of(&run.row.test, &recorded)?;
    let shrunk = shrink_one(&env, &history, (&run.row.run, index), &options)?;
    output::print(&match args.format {
        Format::Text => shrunk_text(&shrunk, output::page()),
        Format::Csv => choices_table(&shrunk).render(args.format.into(), output::page()),
        Format::Json => format!("{:#}\n", shrunk_json(&shrunk)),
    });
    if let Some(picture) = picture {
        // The robot's file was expanded to simulate the run.
        let looks = AppearanceReader::new(&history, true);
        picture.draw(&history, &shrunk.run, None, looks)?;
    }
    Ok(if asked.load(Ordering::Relaxed) {
        stop::INTERRUPTED
    } else {
        0
    })
}

/// Shrunk runs of a campaign, and the faults of those that could not be shrunk.
pub struct ShrunkModes {
    /// The shrunk runs.
    pub done: Vec<ShrunkSummary>,
    /// The faults of the others.
    pub faults: Diagnostics,
}

/// Shrinks one run of each failure mode of a campaign that has just ended, until `asked` is set.
pub fn shrink_modes(
    env: &Env,
    history: &History,
    examples: &[(String, u64)],
    jobs: usize,
    asked: &AtomicBool,
) -> ShrunkModes {
    let context = RunContext {
        clock: clock::system(),
        disturb: None,
    };
    let stop = || asked.load(Ordering::Relaxed);
    let options = ShrinkOptions {
        property: None,
        trials: TRIALS,
        jobs,
        repeat: None,
        context,
        stop: &stop,
    };
    let mut shrunk = ShrunkModes {
        done: Vec::new(),
        faults: Diagnostics::new(),
    };
    for (run, index) in examples.iter().take_while(|_| !stop()) {
        match shrink_one(env, history, (run, *index), &options) {
            Ok(one) => shrunk.done.push(one),
            // If a rule was interrupted, the properties don't fail as expected: that is not a
            // fault.
            Err(_) if stop() => {}
            Err(found) => shrunk.faults.extend(found),
        }
    }
    shrunk
}

fn shrink_one(
    env: &Env,
    history: &History,
    (run, index): (&str, u64),
    options: &ShrinkOptions<'_>,
) -> Result<ShrunkSummary, Diagnostics> {
    let recorded = history.traces().choices(run)?;
    let shrunk = quietly(|| shrink::shrink(env, index, &recorded, options, &mut |_| {}))?;
    let record = shrink::store(env, history, run, index, &shrunk, &options.context)?;
    summary(env, history, (run, options.property), shrunk, &record)
}

fn summary(
    env: &Env,
    history: &History,
    (original, property): (&str, Option<&str>),
    shrunk: Shrunk,
    record: &RunRecord,
) -> Result<ShrunkSummary, Diagnostics> {
    let influences = shrunk.explained.influences.iter();
    let shown = |id: &Id| match influences
        .clone()
        .filter(|other| other.id.name == id.name)
        .count()
    {
        0 | 1 => id.name.to_string(),
        _ => format!("{} ({})", id.name, id.nth + 1),
    };
    let choices = influences
        .clone()
        .map(|influence| shrunk_choice(shown(&influence.id), influence));
    Ok(ShrunkSummary {
        original: original.to_owned(),
        run: history.run(&record.id)?,
        choices: choices.collect(),
        property: property.map(str::to_owned),
        neighbour: shrunk
            .explained
            .neighbour
            .as_ref()
            .map(|near| (shown(&near.id), passing_value(&near.passing))),
        why: match shrunk.relation {
            Some(relation) => vec![pair_text(env, history, record, relation)?],
            None => why(env, record, &shrunk)?,
        },
        failed: shrunk.failed.into_iter().collect(),
        others_before: shrunk.others_before,
        special_before: shrunk.special_before,
        minimal: shrunk.minimal,
        simulations: shrunk.simulations,
        explaining: shrunk.explaining,
        fresh: shrunk.fresh,
        noise_kept: shrunk.noise_kept,
    })
}

/// One row for each choice that remains special.
fn choices_table(shrunk: &ShrunkSummary) -> Table {
    let columns = [
        "run",
        "name",
        "value",
        "nominal",
        "unit",
        "needed",
        "fails_from",
        "fails_to",
        "passes_below",
    ];
    let mut table = Table::new(columns.into_iter().chain(["passes_above"]));
    let row = |choice: &ShrunkChoice| {
        let fails = choice.fails;
        let passes = |side: &Option<PassingValue>| Value::from(side.as_ref().map(|at| at.value));
        vec![
            shrunk.run.row.run.clone().into(),
            choice.name.clone().into(),
            choice.value.into(),
            choice.nominal.into(),
            choice.unit.into(),
            choice.matters.into(),
            fails.0.into(),
            fails.1.into(),
            passes(&choice.passes.0),
            passes(&choice.passes.1),
        ]
    };
    table.rows = shrunk.choices.iter().map(row).collect();
    table
}

fn shrunk_choice(name: String, influence: &shrink::Influence) -> ShrunkChoice {
    let Choice {
        name: full,
        kind,
        value,
    } = &influence.choice;
    ShrunkChoice {
        name,
        value: *value,
        nominal: kind.nominal(),
        unit: full.unit(),
        matters: influence.matters,
        fails: influence.fails,
        passes: (
            influence.passes.0.as_ref().map(passing_value),
            influence.passes.1.as_ref().map(passing_value),
        ),
    }
}

fn passing_value(passing: &shrink::Passing) -> PassingValue {
    PassingValue {
        value: passing.value,
        others: passing.others.clone(),
    }
}

/// Makes the pair of a shrunk run, stores it, and says why its relation does not hold.
fn pair_text(
    env: &Env,
    history: &History,
    record: &RunRecord,
    relation: SceneChange,
) -> Result<String, Diagnostics> {
    let options = RelateOptions {
        runs: None,
        only: Some(relation.word()),
        jobs: 1,
        context: RunContext {
            clock: clock::system(),
            disturb: None,
        },
        stop: &|| false,
    };
    let related = relate(env, history, &record.campaign, &options, || {})?;
    let texts = related.pairs.iter().map(|pair| {
        let second = pair.second.as_deref().unwrap_or("no second run");
        format!("{} and {second}: {}", pair.run, pair.witness)
    });
    Ok(texts.collect::<Vec<_>>().join("\n"))
}

/// The explanation of each property that fails.
fn why(env: &Env, record: &RunRecord, shrunk: &Shrunk) -> Result<Vec<String>, Diagnostics> {
    let mut texts = Vec::new();
    for (step, judgements) in record.judgements.iter().enumerate() {
        let Some(facts) = record.facts.action(step) else {
            continue;
        };
        for judgement in judgements {
            if judgement.outcome == actcheck_base::Outcome::Failed
                && shrunk.failed.contains(&judgement.property)
            {
                let explained = env
                    .rules
                    .explain(&facts, &judgement.property, &Budget::default());
                let explained = explained.map_err(|fault| {
                    Diagnostic::error("X008", format!("{}: {fault}", judgement.property))
                })?;
                texts.push(explained.to_text());
            }
        }
    }
    Ok(texts)
}

fn must_fail(text: &str) -> Result<Repeat, OptionFault> {
    let parts = text
        .split_once('/')
        .and_then(|(least, of)| Some((least.parse().ok()?, of.parse().ok()?)));
    match parts {
        Some((least, of)) if 1 <= least && least <= of && of <= 1000 => Ok(Repeat { least, of }),
        _ => Err("must be K/N, such as 3/5: at least 3 failures in 5 repetitions".into()),
    }
}
