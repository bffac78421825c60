//! `actcheck relate`, and the pairs at the end of `actcheck run`

use std::sync::atomic::{AtomicBool, Ordering};

use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget};

use crate::options::{Format, HistoryArgs};
use crate::run::program;
use crate::work::{all_cores, quietly};
use crate::{clock, history_dir, output, restore, stop, trust};
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_campaign::{Env, RelateOptions, RunContext, relate as make_pairs};
use actcheck_history::{History, RelatedRuns};
use actcheck_report::{RelationsSummary, relations_json, relations_table, relations_text};

/// `actcheck relate`
#[derive(Debug, Args)]
pub struct RelateArgs {
    /// Id of the campaign
    pub campaign: String,
    /// Number of its runs, the first ones [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub runs: Option<u32>,
    /// The configuration with the relations [default: the campaign's own, from the history]
    #[arg(long, value_name = "FILE")]
    pub config: Option<std::path::PathBuf>,
    /// Number of workers, each with one simulation; does not affect results [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
    /// Start the program that the history names, even if its configuration is not there or names
    /// another one
    #[arg(long)]
    pub trust: bool,
    /// The folder of the history.
    #[command(flatten)]
    pub history: HistoryArgs,
    /// How it is printed
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: Format,
}

/// Makes the missing pairs of a campaign and judges all. Returns the exit code.
pub fn relate(args: &RelateArgs) -> Result<u8, Diagnostics> {
    let history = history_dir::open(&args.history)?;
    let (env, record) = Env::from_history(&history, &args.campaign, args.config.as_deref())?;
    if env.campaign.relations.is_empty() {
        let message = format!("{} has no relations between runs", env.campaign.source.name);
        let help = "add `[relations]`, such as `mirrored = \"rules/relations/same_verdicts.rls\"`, and give the file with `--config`";
        return Err(Diagnostic::error("S055", message).help(help).into());
    }
    if args.config.is_none() && !args.trust {
        trust::check_stored(&env, &history, &record)?;
    }
    restore::allow(&history, true);
    let asked = stop::on_interrupt(|| eprintln!("stopping; the pairs so far follow"));
    let jobs = args.jobs.map_or_else(all_cores, usize::from);
    let related = pairs_of(&env, &history, (&record.id, args.runs), jobs, &asked)?;
    let summary = summary(&history, related);
    output::print(&match args.format {
        Format::Text => relations_text(&summary, output::page()),
        Format::Csv => relations_table(&summary).render(args.format.into(), output::page()),
        Format::Json => format!("{:#}\n", relations_json(&summary)),
    });
    Ok(if asked.load(Ordering::Relaxed) {
        stop::INTERRUPTED
    } else {
        summary.exit_code()
    })
}

/// The pairs, with the program and the history for suggested commands.
pub fn summary(history: &History, related: RelatedRuns) -> RelationsSummary {
    RelationsSummary {
        related,
        history: history.dir().display().to_string(),
        program: program(),
    }
}

/// Makes the missing pairs of the first runs of a campaign, until `asked` is set, and judges all.
pub fn pairs_of(
    env: &Env,
    history: &History,
    (campaign, runs): (&str, Option<u32>),
    jobs: usize,
    asked: &AtomicBool,
) -> Result<RelatedRuns, Diagnostics> {
    let options = RelateOptions {
        runs: runs.map(|runs| runs as usize),
        only: None,
        jobs,
        context: RunContext {
            clock: clock::system(),
            disturb: None,
        },
        stop: &|| asked.load(Ordering::Relaxed),
    };
    let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
    let related = quietly(|| make_pairs(env, history, campaign, &options, || bar.inc(1)));
    bar.finish_and_clear();
    related
}
