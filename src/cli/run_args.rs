//! The options of `actcheck run`.

use std::path::PathBuf;

use clap::Args;

use crate::option_fault::OptionFault;
use crate::options::Format;
use actcheck_base::{Shard, did_you_mean};
use actcheck_config::duration_secs;
use actcheck_search::Strategy;

/// `actcheck run`
#[derive(Debug, Args)]
pub struct RunArgs {
    /// The campaign's configuration (TOML)
    pub config: Option<PathBuf>,
    /// Resume the newest killed or interrupted campaign (of CONFIG, if given), or the campaign with
    /// this id, with its original options: the results are the same as without the interruption
    #[arg(long, value_name = "ID", num_args = 0..=1, require_equals = true, default_missing_value = "")]
    #[arg(conflicts_with_all = ["runs", "time", "until_width", "max_failures", "seed", "repeat", "strategy", "shard"])]
    pub resume: Option<String>,
    /// Run the failed runs of CONFIG's last campaign again, and nothing else: those in which a
    /// property failed, with their recorded choices, and the present configuration, rules, models
    /// and skills. They form a campaign of their own, which statistics leave out; the next
    /// `--last-failed` runs those of them that still fail
    #[arg(long)]
    #[arg(conflicts_with_all = ["resume", "runs", "time", "until_width", "max_failures", "seed", "repeat", "strategy", "shard", "shrink"])]
    pub last_failed: bool,
    /// Scenes for each test, instead of the configuration's `test_count`; an upper limit if a
    /// budget ends the campaign
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true)]
    pub runs: Option<u32>,
    /// End after this time, such as 90s, 10m or 2h; runs in flight are completed and kept. Without
    /// `--runs`, as many runs as fit
    #[arg(long, value_name = "DURATION", value_parser = duration_secs)]
    pub time: Option<f64>,
    /// End when the 95 % confidence interval of every property's pass rate is at most this wide,
    /// such as 0.05. Without `--runs`, the limit is four times the number of runs that suffices for
    /// any rate: 6132 of each test for 0.05
    #[arg(long, value_name = "WIDTH", value_parser = width)]
    pub until_width: Option<f64>,
    /// End at the N-th failed run, which is the same for any number of workers
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub max_failures: Option<u64>,
    /// Compare with this campaign, named as in `actcheck compare`, and print the comparison; the
    /// exit code is then 1 if this campaign is worse at level 0.05, however often it was looked at
    #[arg(long, value_name = "BASE", conflicts_with_all = ["last_failed", "shard"])]
    pub against: Option<String>,
    /// End when the comparison is decided: worse, better, or no difference of 5 points. It is
    /// looked at after every run
    #[arg(long, requires = "against")]
    pub until_decided: bool,
    /// Seed of all randomness, instead of the configuration's `seed`
    #[arg(long, value_name = "S")]
    pub seed: Option<u64>,
    /// How scenes are chosen: random, halton, latin-hypercube, cross-entropy, bandit or boundary,
    /// instead of the configuration's `[search] strategy`; the last three search for failures,
    /// guided by the properties' margins
    #[arg(long, value_name = "NAME", value_parser = strategy)]
    pub strategy: Option<Strategy>,
    /// Runs of each scene, each with different noise, instead of the configuration's `repeat`
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub repeat: Option<u32>,
    /// Number of workers, each with one simulation; does not affect the results [default: all
    /// cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
    /// Run only part I of N: every N-th run, starting with the I-th; `actcheck merge` joins the
    /// parts. Budgets apply to each part
    #[arg(long, value_name = "I/N")]
    pub shard: Option<Shard>,
    /// Shrink one run of each failure mode afterwards, as `actcheck shrink` does
    #[arg(long)]
    pub shrink: bool,
    /// Start the program that CONFIG names if it is a case; without it, a case runs only with the
    /// reference skills. Files of the folder `regressions` need no consent: the campaign's own
    /// skills perform them
    #[arg(long)]
    pub trust: bool,
    /// Folder of the history [default: `.actcheck` beside the configuration]
    #[arg(long, value_name = "DIR")]
    pub history: Option<PathBuf>,
    /// How results are printed
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: Format,
    /// Print only the result: scores and failures, without progress, tables and notes
    #[arg(long, short, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Print every failure when it happens, with all its failed properties, and each line that a
    /// program of your own prints; then a table of the runs
    #[arg(long, short)]
    pub verbose: bool,
}

/// The amount of text that a campaign prints.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verbosity {
    /// Only the result.
    Quiet,
    /// Also progress and tables.
    Usual,
    /// Also every failure and every line of a program when it happens, and a table of the runs.
    Verbose,
}

impl RunArgs {
    /// The requested amount of text.
    pub fn verbosity(&self) -> Verbosity {
        match (self.quiet, self.verbose) {
            (true, _) => Verbosity::Quiet,
            (_, true) => Verbosity::Verbose,
            _ => Verbosity::Usual,
        }
    }
}

/// Parses the name of a search strategy.
fn strategy(name: &str) -> Result<Strategy, OptionFault> {
    let names = Strategy::ALL.map(Strategy::name);
    Strategy::by_name(name).ok_or_else(|| did_you_mean(name, names).into())
}

fn width(text: &str) -> Result<f64, OptionFault> {
    match text.parse() {
        Ok(width) if width > 0.0 && width < 1.0 => Ok(width),
        _ => Err(format!("`{text}` must be a number between 0 and 1").into()),
    }
}
