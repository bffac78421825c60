//! `actcheck replay`

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget};

use crate::options::{Format, HistoryArgs};
use crate::replay_text::{replay_json, replay_table, replay_text};
use crate::work::{all_cores, quietly};
use crate::{clock, history_dir, output, trust};
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_campaign::{Env, Fit, Replay, ReplayOptions, RunContext, StoredCampaign, replay_all};
use actcheck_data::Choices;
use actcheck_history::{History, RunDetail, RunFilter};

/// `actcheck replay`
#[derive(Debug, Args)]
pub struct ReplayArgs {
    /// Ids of runs, or unique prefixes
    #[arg(value_name = "RUN", required_unless_present_any = ["campaign", "sample"])]
    pub runs: Vec<String>,
    /// All runs of this campaign
    #[arg(long, value_name = "ID")]
    pub campaign: Option<String>,
    /// A random sample of N runs, of the campaign or of the whole history
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), conflicts_with = "runs")]
    pub sample: Option<u32>,
    /// Seed of the random sample
    #[arg(long, value_name = "S", default_value_t = 0, requires = "sample")]
    pub seed: u64,
    /// Fail if choices are missing, left over or made differently now, and list them; otherwise
    /// values are clamped to their bounds, and missing choices are nominal
    #[arg(long)]
    pub exact: bool,
    /// Run with this configuration instead of the one in the history
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Start the program that the history names, even if its configuration is not there or names
    /// another one
    #[arg(long)]
    pub trust: bool,
    /// Number of workers, each with one simulation; does not affect results [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
    /// The folder of the history.
    #[command(flatten)]
    pub history: HistoryArgs,
    /// How the answer is printed
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: Format,
}

/// Runs stored runs again and prints whether they are the same. Returns the exit code.
pub fn replay(args: &ReplayArgs) -> Result<u8, Diagnostics> {
    let history = history_dir::open_to_read(&args.history)?;
    let runs = runs(&history, args)?;
    let campaigns = recall(&history, &runs, args)?;
    let bar = ProgressBar::with_draw_target(Some(runs.len() as u64), ProgressDrawTarget::stderr());
    let fit = if args.exact { Fit::Exact } else { Fit::Nearest };
    let jobs = args.jobs.map_or_else(all_cores, usize::from);
    let options = ReplayOptions {
        fit,
        jobs,
        context: RunContext {
            clock: clock::system(),
            disturb: None,
        },
    };
    let replayed = quietly(|| replay_all(&history, &campaigns, &runs, &options, || bar.inc(1)));
    bar.finish_and_clear();
    let (mut done, mut faults) = (Vec::new(), Diagnostics::new());
    for one in replayed? {
        match one {
            Ok(replay) => done.push(replay),
            Err(found) => faults.extend(found),
        }
    }
    output::print(&match args.format {
        Format::Text => output::page().set(&replay_text(&done, faults.len())),
        Format::Json => format!("{:#}\n", replay_json(&done)),
        Format::Csv => replay_table(&done).render(Format::Csv.into(), output::page()),
    });
    if faults.has_errors() {
        Err(faults)
    } else {
        Ok(u8::from(done.iter().any(|replay: &Replay| !replay.same)))
    }
}

/// The requested runs, without duplicates, in the order in which they are named.
fn runs(history: &History, args: &ReplayArgs) -> Result<Vec<RunDetail>, Diagnostics> {
    let mut ids: Vec<String> = Vec::new();
    for name in &args.runs {
        ids.push(history.resolve(name)?);
    }
    if let Some(campaign) = &args.campaign {
        history.campaign(campaign)?;
    }
    if args.campaign.is_some() || args.sample.is_some() {
        let filter = RunFilter {
            campaign: args.campaign.clone(),
            ..RunFilter::default()
        };
        let all = history
            .runs(&filter)?
            .into_iter()
            .map(|row| row.run)
            .collect();
        ids.extend(match args.sample {
            Some(size) => sample(all, size as usize, args.seed),
            None => all,
        });
    }
    let mut runs: Vec<RunDetail> = Vec::new();
    for id in ids {
        if !runs.iter().any(|known| known.row.run == id) {
            runs.push(history.run(&id)?);
        }
    }
    if runs.is_empty() {
        return Err(Diagnostic::error("X036", "there is no run to replay")
            .help("the campaign has no runs; `actcheck list` shows those of all campaigns")
            .into());
    }
    Ok(runs)
}

/// Draws `size` runs uniformly at random, in their order.
fn sample(mut runs: Vec<String>, size: usize, seed: u64) -> Vec<String> {
    let mut choices = Choices::random(seed, 0);
    while runs.len() > size {
        runs.remove(choices.index("sample".into(), runs.len()));
    }
    runs
}

/// The campaigns of the runs, as they are now and as they were.
fn recall(
    history: &History,
    runs: &[RunDetail],
    args: &ReplayArgs,
) -> Result<BTreeMap<String, StoredCampaign>, Diagnostics> {
    let mut campaigns = BTreeMap::new();
    for run in runs {
        let id = &run.row.campaign;
        if !campaigns.contains_key(id) {
            let recalled = Env::from_history(history, id, args.config.as_deref())?;
            if args.config.is_none() && !args.trust {
                trust::check_stored(&recalled.0, history, &recalled.1)?;
            }
            campaigns.insert(id.clone(), recalled);
        }
    }
    Ok(campaigns)
}
