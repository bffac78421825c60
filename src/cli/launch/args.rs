//! The options of `actcheck launch`.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use crate::options::Format;
use crate::run_args::RunArgs;
use actcheck_config::Overrides;

/// Where the shards run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum On {
    /// Processes on this machine
    Local,
    /// An array of jobs
    Slurm,
    /// An Indexed Job
    Kubernetes,
    /// Tasks of a Ray cluster
    Ray,
}

impl On {
    /// The name in options and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Local => "local",
            Self::Slurm => "slurm",
            Self::Kubernetes => "kubernetes",
            Self::Ray => "ray",
        }
    }
}

/// `actcheck launch`
#[derive(Debug, Args)]
pub struct LaunchArgs {
    /// The campaign's configuration (TOML)
    pub config: PathBuf,
    /// Where the shards run
    #[arg(long, value_name = "WHERE", value_enum, default_value = "local")]
    pub on: On,
    /// Number of shards; a lost shard loses only its runs in flight, so more shards than processes
    /// are fine
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=10_000))]
    pub shards: u64,
    /// The needs of a shard, such as `cpus=2,memory=4G`. Everywhere: `cpus`. With a scheduler also
    /// `memory` and `program` (the path of actcheck there); `time` (not Ray); Slurm: `partition`,
    /// `account`; Kubernetes: `image`, `volume` (the claim of the shared volume), `mount`,
    /// `namespace`; Ray: `address`, `python`
    #[arg(long, value_name = "KEY=VALUE,…", value_delimiter = ',')]
    pub resources: Vec<String>,
    /// Shards that run at once [default: all cores; with a scheduler, as many as it starts]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
    /// Scenes for each test, instead of the configuration's `test_count`
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub runs: Option<u32>,
    /// Seed of all randomness, instead of the configuration's `seed`
    #[arg(long, value_name = "S")]
    pub seed: Option<u64>,
    /// Folder of the history [default: `.actcheck` beside the configuration]; the shards are beside
    /// it, in DIR.launch, until they are merged
    #[arg(long, value_name = "DIR")]
    pub history: Option<PathBuf>,
    /// Print the plan and the scheduler's files and commands, or those of the shards, and start
    /// nothing
    #[arg(long)]
    pub dry_run: bool,
    /// How results are printed
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: Format,
    /// Print only the result: scores and failures, without progress, tables and notes
    #[arg(long, short)]
    pub quiet: bool,
}

impl LaunchArgs {
    /// The options that replace values of the configuration.
    pub fn overrides(&self) -> Overrides {
        let Self {
            runs,
            seed,
            history,
            ..
        } = self;
        Overrides {
            runs: *runs,
            seed: *seed,
            history: history.clone(),
            ..Overrides::default()
        }
    }

    /// The options with which `actcheck run` prints the results of the whole campaign.
    pub fn of_whole(&self) -> RunArgs {
        let whole = Self::whole(&self.config, self.runs, self.seed);
        RunArgs {
            history: self.history.clone(),
            format: self.format,
            quiet: self.quiet,
            ..whole
        }
    }

    /// The options of `actcheck run` for a configuration.
    pub fn whole(config: &Path, runs: Option<u32>, seed: Option<u64>) -> RunArgs {
        RunArgs {
            config: Some(config.to_path_buf()),
            resume: None,
            last_failed: false,
            runs,
            time: None,
            until_width: None,
            max_failures: None,
            against: None,
            until_decided: false,
            seed,
            strategy: None,
            repeat: None,
            jobs: None,
            shard: None,
            shrink: false,
            trust: false,
            history: None,
            format: Format::default(),
            quiet: false,
            verbose: false,
        }
    }
}

/// `actcheck launch-task`
#[derive(Debug, Args)]
pub struct LaunchTaskArgs {
    /// The folder of the launch
    pub folder: PathBuf,
    /// Number of the shard, from 1
    pub number: u64,
    /// End when standard input is closed, as it is when the parent has ended
    #[arg(long)]
    pub with_parent: bool,
}
