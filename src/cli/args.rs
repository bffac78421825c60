//! The command line: commands and their options.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::export::ExportArgs;
use crate::recheck::RecheckArgs;
use crate::shrink::ShrinkArgs;
use actcheck_base::{Shard, did_you_mean};
use actcheck_config::duration_secs;
use actcheck_report::TableFormat;
use actcheck_search::Strategy;

/// QuickCheck for robot actions: generated scenes, physics simulation, verdicts by rules that you edit.
#[derive(Debug, Parser)]
#[command(name = "actcheck", version, max_term_width = 100, disable_help_subcommand = true)]
#[command(after_help = "Example:\n  actcheck run configs/pick.toml")]
pub struct Arguments {
    /// The command to run.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Find scene conditions, and combinations of them, that go with failures more often than by chance
    ///
    /// For each property: patterns of up to three conditions (object categories at any level of the ontology's
    /// hierarchy, ranges with bounds found in the runs), merged into the simplest ones, corrected for multiple testing,
    /// and confirmed on a held-out third of the runs; the distribution of margins; changes from campaign to campaign;
    /// flaky scenes. For all properties together: failure modes, and which failure leads to which later one. Only
    /// passed and failed outcomes count; the others are reported separately.
    ///
    /// Reads the tables beside the history, and updates them first.
    #[command(
        after_help = "Examples:\n  actcheck analyse    (after `actcheck run configs/pick.toml --runs 300`)\n  actcheck analyse --property ObjectInGripper --by target_category,target_turned_rad\n  actcheck analyse --picture patterns.png"
    )]
    Analyse(crate::analyse::AnalyseArgs),
    /// Run a campaign: generate scenes, perform the actions, judge the outcomes, store every run
    ///
    /// The campaign ends after the last planned run, or when a budget is spent: time, number of failures, or precision
    /// of the pass rates. To limit the wall-clock time of each run, set `run_secs` in the configuration's `[budget]`.
    ///
    /// A file from `actcheck export` (a case) runs its one scene, and reports whether it fails in the same way, in
    /// another way, or no longer. Cases in the folder `regressions`, beside the configuration or in the folder above,
    /// run before the campaign and are reported separately: they count for the exit code, but not for pass rates.
    ///
    /// Exit code: 0 everything passed, 1 a property failed, 2 the campaign could not run or no run could be judged,
    /// 130 interrupted by Ctrl-C (finished runs are kept).
    #[command(after_help = "Example:\n  actcheck run configs/pick.toml --runs 5 --history /tmp/try")]
    Run(RunArgs),
    /// Run stored runs again from their recorded choices, and check that every state is the same
    ///
    /// For a run that differs, prints the first time, body and quantity that differ, and which model, configuration,
    /// rule or program has changed since. Outcomes come from the current rules; they don't affect the exit code.
    ///
    /// Exit code: 0 every state is the same bit for bit, 1 a run differs, 2 a run could not be replayed.
    #[command(
        after_help = "Examples:\n  actcheck replay k7f3-3    (a run id from `actcheck list`; a prefix is enough)\n  actcheck replay --sample 100 --jobs 2    (a random sample, after `actcheck run configs/pick.toml`)"
    )]
    Replay(crate::replay::ReplayArgs),
    /// Check configuration, ontology, rules and models without simulating; reports all mistakes at once
    #[command(after_help = "Example:\n  actcheck check configs/pick.toml")]
    Check(CheckArgs),
    /// Compare two campaigns on the same scenes: which properties hold more or less often, and in which scenes outcomes
    /// flipped
    ///
    /// Runs with the same number and the same scene (test, world, poses of objects and robot) form a pair; other runs
    /// are counted and listed. A scene that is run several times passes if all its runs pass. For each property, and
    /// for whole runs (at least one property passed, none failed), prints both pass rates, their difference with a 95 %
    /// confidence interval (Tango's score interval for paired proportions), McNemar's exact test, and Holm's correction
    /// for the number of lines.
    ///
    /// Only passed and failed outcomes are compared: a scene in which either side is inapplicable, broken, timed out or
    /// untested is excluded from that line and counted. `--fail-if-worse` therefore does not detect a robot that hangs;
    /// the table shows the counts.
    ///
    /// Exit code: 0 done (B is not shown to be worse), 1 B is worse (only with --fail-if-worse), 2 the comparison
    /// failed.
    #[command(
        after_help = "Examples:\n  actcheck run configs/pick.toml --history /tmp/before\n  actcheck run configs/pick.toml --history /tmp/after    (with another skill, robot or physics)\n  actcheck compare /tmp/before /tmp/after --fail-if-worse 0.05\n  actcheck compare k7f3 k7f3@rechecked    (one campaign, before and after `actcheck recheck`)"
    )]
    Compare(crate::compare::CompareArgs),
    /// Test the properties themselves: inject faults into the world and the robot, and see which property detects them
    ///
    /// Runs every scene without a fault and once with each fault (a robot that does nothing, a gripper that opens in
    /// mid-air, a false report, …), from the same choices. A property detects a fault if it fails with the fault in
    /// scenes that it passes without, more often than by chance. Runs are not stored in a history.
    ///
    /// Exit code: 0 every fault is detected and every property detects one, 1 there is a gap, 2 the check failed,
    /// 130 interrupted by Ctrl-C.
    #[command(after_help = "Example:\n  actcheck check-oracles configs/pick.toml")]
    CheckOracles(crate::check_oracles::CheckOraclesArgs),
    /// Export a stored run as a configuration, or the history as tables or RDF
    ///
    /// A run becomes one readable file (a case) that recreates its scene. `actcheck run` accepts the file like any
    /// configuration, and reports whether it still fails in the same way. You can edit its values; an invalid value is
    /// rejected at its line. A file inside the project refers to the ontology and models by relative paths; a file
    /// elsewhere omits those that are the same as the shipped ones, so that it runs anywhere.
    ///
    /// Tables come from the mirror beside the history (its folder `tables`), which is updated first. They contain no
    /// shrunk runs.
    #[command(
        after_help = "Examples:\n  actcheck export k7f3-3 -o case.toml    (a run id from `actcheck list`; a prefix is enough)\n  actcheck export --parquet tables    (after `actcheck run configs/pick.toml`)\n  actcheck export --nquads history.nq --turtle history.ttl"
    )]
    Export(ExportArgs),
    /// Report a campaign's health: discarded and repeated scenes, values never tried, slow runs, inaccurate simulation
    ///
    /// Prints how much of each parameter's range the scenes cover, compared with the same number of random draws, and
    /// the same for pairs of parameters. Warns, with advice, where the results are less conclusive than they look.
    ///
    /// Exit code: 0 healthy, 1 there is a warning, 2 the campaign could not be examined.
    #[command(
        after_help = "Example:\n  actcheck health    (the newest campaign, after `actcheck run configs/pick.toml`)"
    )]
    Health(crate::health::HealthArgs),
    /// List the runs of a history
    #[command(after_help = "Example:\n  actcheck list --format csv")]
    List(ListArgs),
    /// Merge histories into one: parts of a campaign (`run --shard`) become one campaign, duplicates are kept once
    ///
    /// Copies everything: runs with their traces and facts, later judgements, shrunk runs. Parts with the same
    /// configuration, seed and number of runs belong to one campaign; they must be made with the same program,
    /// ontology, rules and models, and agree on every run that several of them contain. On a conflict, prints how to
    /// resolve it and writes nothing.
    ///
    /// Exit code: 0 merged, 1 merged, but a campaign of parts lacks runs (they are listed), 2 conflict or error, 130
    /// interrupted by Ctrl-C (written runs are complete; merge again to continue).
    #[command(
        after_help = "Example:\n  actcheck run configs/pick.toml --shard 1/2 --history /tmp/h1\n  actcheck run configs/pick.toml --shard 2/2 --history /tmp/h2\n  actcheck merge /tmp/h1 /tmp/h2 --into /tmp/all"
    )]
    Merge(crate::merge::MergeArgs),
    /// Serve a history over HTTP: a read-only SPARQL 1.1 endpoint, a query page, and the current report
    ///
    /// Each query runs in its own process, which is stopped if it exceeds its limit of time, memory or answer size.
    /// Updates, `SERVICE`, file access and requests from pages of other sites are refused. The history is open only
    /// during a query, so that other commands can use it in between; while one of them writes, the server answers 503
    /// with Retry-After.
    ///
    /// Exit code: 0 stopped by Ctrl-C, 2 the history could not be served.
    #[command(
        after_help = "Examples:\n  actcheck serve    (after `actcheck run configs/pick.toml`)\n  curl -H 'Accept: text/csv' --data-urlencode 'query=SELECT ?run { ?run a act:Run }' http://localhost:7878/sparql"
    )]
    Serve(crate::serve::ServeArgs),
    /// Answer one query of `actcheck serve`
    #[command(hide = true, after_help = "Example:\n  actcheck serve    (starts this for each query)")]
    ServeQuery(crate::serve::ServeQueryArgs),
    /// Show one run: its scene, and every property's outcome with margin and witness
    #[command(after_help = "Example:\n  actcheck show k7f3-3    (a run id from `actcheck list`; a prefix is enough)")]
    Show(ShowArgs),
    /// Find the smallest scene that still fails in the same way as a run, and report which of its values matter
    ///
    /// Removes objects and trailing actions, and resets noise, physics and poses to their nominal values, as long as
    /// the same properties fail. The shrunk run is stored in the history. Exit code: 0 done, 130 interrupted by Ctrl-C
    /// (the smallest run so far is stored and printed), 2 the run does not fail or can't be reproduced.
    #[command(
        after_help = "Example:\n  actcheck shrink k7f3-3 --picture small.svg    (a run id from `actcheck list`; a prefix is enough)"
    )]
    Shrink(ShrinkArgs),
    /// Query a history with SPARQL 1.1
    ///
    /// The prefixes act, w, obj, run, campaign, rdf, rdfs, owl, xsd, earl and prov are predefined. Facts about the
    /// world are in named graphs, one for each moment: `?execution act:before ?g . GRAPH ?g { … }`.
    #[command(
        after_help = "Examples:\n  actcheck query 'SELECT (COUNT(?r) AS ?n) WHERE { ?r a act:Run }'\n  actcheck query --list-named\n  actcheck query --named failure-rates"
    )]
    Query(QueryArgs),
    /// Judge stored runs by the current rules, without simulating
    ///
    /// Properties that are newer than the runs are judged too. New and changed outcomes are stored beside the old ones,
    /// with the digest of the rules and the time; `list`, `show` and the other commands still use the campaign's own
    /// outcomes. The newest outcomes are those in the graph act:rechecked that no other supersedes (see
    /// ontology/history.ttl).
    ///
    /// Exit code: 0 no property fails now, 1 a property fails now, 2 the recheck failed or nothing could be decided,
    /// 130 interrupted by Ctrl-C (judgements so far are kept).
    #[command(after_help = "Example:\n  actcheck recheck MovedObject    (after `actcheck run configs/pick.toml`)")]
    Recheck(RecheckArgs),
    /// Explain why a property holds in a run, or how close it came and which facts were missing
    ///
    /// Uses the current rules: those that the ontology links now.
    #[command(after_help = "Example:\n  actcheck why k7f3-3 MovedObject    (a run id from `actcheck list`)")]
    Why(WhyArgs),
    /// Write a report: one HTML page that works offline, or results for Allure, JUnit readers, EARL, …
    ///
    /// The page has an overview with counts, scores and intervals, properties, failure modes, patterns with plots,
    /// target positions, trends, and each run with witnesses, explanations and parameters. Failed runs have a 3D
    /// replay, up to the limit of `--replay-mb`, so that each failure mode and property has one; the others are listed
    /// with the command that shows them.
    ///
    /// Reads the tables beside the history, and updates them first. Exit code: 0 written, 2 the report could not be
    /// written.
    #[command(
        after_help = "Examples:\n  actcheck report --html report.html    (after `actcheck run configs/pick.toml`)\n  actcheck report --html picks.html --campaign k7f3 --property ObjectInGripper\n  actcheck report --rrd runs.rrd    (built with `--features rerun`; `rerun runs.rrd` shows it)\n  actcheck report --allure allure-results --junit junit.xml --markdown"
    )]
    Report(crate::report::ReportArgs),
    /// List all properties: label, language, rule file, actions, and how often each passed in the history
    #[command(after_help = "Example:\n  actcheck rules --format csv")]
    Rules(crate::rules::RulesArgs),
    /// Write a configuration or a property, ready to edit
    #[command(after_help = "Examples:\n  actcheck new campaign\n  actcheck new property StaysUpright --for Pick")]
    New(crate::new::NewArgs),
    /// Run a standalone Datalog program, with its imports and exports
    #[command(after_help = "Example:\n  actcheck datalog program.rls -D results")]
    Datalog(DatalogArgs),
    /// Print the JSON schema of configurations, for completion and validation in editors
    ///
    /// Editors that use taplo, such as VS Code with Even Better TOML, read it if a configuration begins with the line
    /// `#:schema campaign.schema.json`. Only `actcheck check` checks model names and relations between keys.
    #[command(after_help = "Example:\n  actcheck schema > campaign.schema.json")]
    Schema,
    /// Print a shell completion script for commands and options
    ///
    /// Save it where the shell finds it: `~/.local/share/bash-completion/completions/actcheck` for bash, `_actcheck` in
    /// a folder of `$fpath` for zsh, `~/.config/fish/completions/actcheck.fish` for fish.
    #[command(after_help = "Examples:\n  actcheck completions bash > actcheck.bash\n  . ./actcheck.bash")]
    Completions(crate::completions::CompletionsArgs),
    /// Print the manual as a man page, or write one page for each command
    #[command(after_help = "Examples:\n  actcheck man | man -l -\n  actcheck man --out man1")]
    Man(crate::man::ManArgs),
}

/// Parses the name of a search strategy.
fn strategy(name: &str) -> Result<Strategy, String> {
    let names = Strategy::ALL.map(Strategy::name);
    Strategy::by_name(name).ok_or_else(|| did_you_mean(name, names))
}

/// `actcheck run`
#[derive(Debug, Args)]
pub struct RunArgs {
    /// The campaign's configuration (TOML)
    pub config: Option<PathBuf>,
    /// Resume the newest killed or interrupted campaign (of CONFIG, if given), or the campaign with this id, with its
    /// original options: the results are the same as without the interruption
    #[arg(long, value_name = "ID", num_args = 0..=1, require_equals = true, default_missing_value = "")]
    #[arg(conflicts_with_all = ["runs", "time", "until_width", "max_failures", "seed", "repeat", "strategy", "shard"])]
    pub resume: Option<String>,
    /// Scenes for each test, instead of the configuration's `test_count`; an upper limit if a budget ends the campaign
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub runs: Option<u32>,
    /// End after this time, such as 90s, 10m or 2h; runs in flight are completed and kept. Without `--runs`, as many
    /// runs as fit
    #[arg(long, value_name = "DURATION", value_parser = duration_secs)]
    pub time: Option<f64>,
    /// End when the 95 % confidence interval of every property's pass rate is at most this wide, such as 0.05. Without
    /// `--runs`, the limit is four times the number of runs that suffices for any rate: 6132 of each test for 0.05
    #[arg(long, value_name = "WIDTH", value_parser = width)]
    pub until_width: Option<f64>,
    /// End at the N-th failed run, which is the same for any number of workers
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub max_failures: Option<u64>,
    /// Seed of all randomness, instead of the configuration's `seed`
    #[arg(long, value_name = "S")]
    pub seed: Option<u64>,
    /// How scenes are chosen: random, halton, latin-hypercube, cross-entropy, bandit or boundary, instead of the
    /// configuration's `[search] strategy`; the last three search for failures, guided by the properties' margins
    #[arg(long, value_name = "NAME", value_parser = strategy)]
    pub strategy: Option<Strategy>,
    /// Runs of each scene, each with different noise, instead of the configuration's `repeat`
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub repeat: Option<u32>,
    /// Number of workers, each with one simulation; does not affect the results [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
    /// Run only part I of N: every N-th run, starting with the I-th; `actcheck merge` joins the parts. Budgets apply to
    /// each part
    #[arg(long, value_name = "I/N")]
    pub shard: Option<Shard>,
    /// Shrink one run of each failure mode afterwards, as `actcheck shrink` does
    #[arg(long)]
    pub shrink: bool,
    /// Folder of the history [default: `.actcheck` beside the configuration]
    #[arg(long, value_name = "DIR")]
    pub history: Option<PathBuf>,
    /// How results are printed
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: Format,
}

fn width(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(width) if width > 0.0 && width < 1.0 => Ok(width),
        _ => Err(format!("`{text}` must be a number between 0 and 1")),
    }
}

/// `actcheck check`
#[derive(Debug, Args)]
pub struct CheckArgs {
    /// The campaign's configuration (TOML) [default: configs/pick.toml]
    pub config: Option<PathBuf>,
}

/// The folder of a history.
#[derive(Debug, Args)]
pub struct HistoryArgs {
    /// Folder of the history [default: `.actcheck` here, or the only one in a subfolder]
    #[arg(long, value_name = "DIR")]
    pub history: Option<PathBuf>,
}

/// `actcheck list`
#[derive(Debug, Args)]
pub struct ListArgs {
    /// The folder of the history.
    #[command(flatten)]
    pub history: HistoryArgs,
    /// Only the runs of this campaign
    #[arg(long, value_name = "ID")]
    pub campaign: Option<String>,
    /// How the table is printed
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: Format,
}

/// `actcheck show`
#[derive(Debug, Args)]
pub struct ShowArgs {
    /// Id of the run, or a unique prefix
    pub run: String,
    /// The folder of the history.
    #[command(flatten)]
    pub history: HistoryArgs,
    /// Draw the scene before and after the run into this file, as a raster (.png) or vector image (.svg)
    #[arg(long, value_name = "FILE.png")]
    pub picture: Option<PathBuf>,
    /// How it is printed
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: Format,
}

/// `actcheck query`
#[derive(Debug, Args)]
pub struct QueryArgs {
    /// The query's text
    #[arg(value_name = "SPARQL", required_unless_present_any = ["file", "named", "list_named"])]
    #[arg(conflicts_with_all = ["file", "named", "list_named"])]
    pub text: Option<String>,
    /// A file with the query
    #[arg(short, long, value_name = "FILE", conflicts_with_all = ["named", "list_named"])]
    pub file: Option<PathBuf>,
    /// Name of a query: a shipped one, or `ontology/queries/NAME.rq` here
    #[arg(long, value_name = "NAME", conflicts_with = "list_named")]
    pub named: Option<String>,
    /// List the named queries with their descriptions
    #[arg(long)]
    pub list_named: bool,
    /// The folder of the history.
    #[command(flatten)]
    pub history: HistoryArgs,
    /// How the answer is printed (turtle: for CONSTRUCT and DESCRIBE)
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: QueryFormat,
}

/// `actcheck why`
#[derive(Debug, Args)]
pub struct WhyArgs {
    /// Id of the run, or a unique prefix
    pub run: String,
    /// Only this property, by its name in the ontology [default: all that were judged]
    pub property: Option<String>,
    /// The ontology with the rules [default: ontology/actions.ttl here, or the shipped one]
    #[arg(long, value_name = "FILE")]
    pub ontology: Option<PathBuf>,
    /// The folder of the history.
    #[command(flatten)]
    pub history: HistoryArgs,
    /// How explanations are printed
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: ProofFormat,
}

/// `actcheck datalog`
#[derive(Debug, Args)]
pub struct DatalogArgs {
    /// The program (.rls)
    pub file: PathBuf,
    /// Folder for the exported files
    #[arg(short = 'D', long = "export-dir", value_name = "DIR", default_value = "results")]
    pub output: PathBuf,
    /// Explain why this fact holds or does not, such as 'p(1, _)', instead of exporting
    #[arg(long, value_name = "FACT")]
    pub trace: Option<String>,
    /// How explanations are printed
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: ProofFormat,
    /// Stop after this many derived tuples
    #[arg(long, value_name = "N", default_value_t = 100_000_000)]
    pub max_tuples: usize,
    /// Stop after this many seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 600.0)]
    pub max_secs: f64,
}

/// Formats of an explanation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum ProofFormat {
    /// Human-readable text
    #[default]
    Text,
    /// Machine-readable
    Json,
    /// For Graphviz
    Dot,
}

/// Formats of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum Format {
    /// Human-readable text
    #[default]
    Table,
    /// Comma-separated values
    Csv,
    /// Machine-readable
    Json,
}

/// Formats of a query's answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum QueryFormat {
    /// Human-readable text
    #[default]
    Table,
    /// Comma-separated values
    Csv,
    /// Machine-readable
    Json,
    /// RDF, for queries whose answer is a graph
    Turtle,
}

impl From<Format> for TableFormat {
    fn from(format: Format) -> Self {
        match format {
            Format::Table => Self::Table,
            Format::Csv => Self::Csv,
            Format::Json => Self::Json,
        }
    }
}
