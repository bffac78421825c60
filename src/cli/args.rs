//! What can be typed.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::base::{Shard, did_you_mean};
use crate::cli::export::ExportArgs;
use crate::cli::recheck::RecheckArgs;
use crate::cli::shrink::ShrinkArgs;
use crate::config::duration_secs;
use crate::report::TableFormat;
use crate::search::Strategy;

/// QuickCheck for robot actions: generated scenes, physics simulation, verdicts by rules that you edit.
#[derive(Debug, Parser)]
#[command(name = "actcheck", version, max_term_width = 100, disable_help_subcommand = true)]
#[command(after_help = "Example:\n  actcheck run configs/pick.toml")]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Look for when and why things fail: conditions on scenes, and combinations of them, that go with failures beyond chance
    ///
    /// For each property: patterns of up to three conditions (kinds through the ontology's hierarchy, ranges with bounds found in the
    /// runs), folded into the simplest, corrected for everything that was tried, and confirmed on a third of the runs that took no part in
    /// finding them; how margins are spread; changes from campaign to campaign; flaky scenes. For all together: the ways in which
    /// runs fail, and which failure leads to which later one. Only passed and failed outcomes count; all others are told.
    ///
    /// Reads the tables beside the history, which are brought up to date first.
    #[command(
        after_help = "Examples:\n  actcheck analyse    (after `actcheck run configs/pick.toml --runs 300`)\n  actcheck analyse --property ObjectInGripper --by target_category,target_turned_rad\n  actcheck analyse --picture patterns.png"
    )]
    Analyse(crate::cli::analyse::AnalyseArgs),
    /// Run a campaign: generate scenes, perform the actions, judge them, keep every run
    ///
    /// It ends with the last planned run, or when a budget is spent: of time, of failures, or because every rate is
    /// known well enough. A limit on the clock for each run is `run_secs` in the configuration's `[budget]`.
    ///
    /// What `actcheck export` writes is run as the one scene that it is, and said to fail as it did, otherwise, or no longer.
    /// Such files in the folder `regressions`, beside the configuration or in the folder above, are run before the campaign
    /// and told apart from it: they count for the exit code, and for no rate.
    ///
    /// Exit code: 0 everything passed, 1 a property failed, 2 it could not run or nothing could be judged,
    /// 130 stopped by Ctrl-C (what was done is kept).
    #[command(after_help = "Example:\n  actcheck run configs/pick.toml --runs 5 --history /tmp/try")]
    Run(RunArgs),
    /// Run stored runs again from their recorded choices, and say whether they go the same way
    ///
    /// If not: the first moment, body and quantity that differ, and which model, configuration, rule or program changed
    /// since. Outcomes are those of today's rules; they don't count for the exit code.
    ///
    /// Exit code: 0 every bit of every state is the same, 1 a run differs, 2 one could not be run again.
    #[command(
        after_help = "Examples:\n  actcheck replay k7f3-3    (an id that `actcheck list` prints; its beginning is enough)\n  actcheck replay --sample 100 --jobs 2    (runs by chance, after `actcheck run configs/pick.toml`)"
    )]
    Replay(crate::cli::replay::ReplayArgs),
    /// Check configuration, ontology, rules and models without simulating; every mistake at once
    #[command(after_help = "Example:\n  actcheck check configs/pick.toml")]
    Check(CheckArgs),
    /// Compare two campaigns on the same scenes: which properties hold less or more often, and where it flipped
    ///
    /// Runs with the same number and the same scene (test, world, what stands where) make a pair; other runs are counted and named.
    /// Of a scene that is run more than once all runs have to pass. For each property, and for whole runs (some property passed, none failed), both rates, their difference with a 95 %
    /// interval (Tango's score interval for pairs), McNemar's exact test, and Holm's correction for the number of lines.
    ///
    /// Only passed and failed say something of the robot: a scene in which either side is inapplicable, broken, timed out or
    /// untested is left out of that line and counted, so that `--fail-if-worse` does not see a robot that hangs; the table says
    /// how many there are.
    ///
    /// Exit code: 0 done (B is not shown to be worse), 1 B is worse (only with --fail-if-worse), 2 it could not be done.
    #[command(
        after_help = "Examples:\n  actcheck run configs/pick.toml --history /tmp/before\n  actcheck run configs/pick.toml --history /tmp/after    (with another skill, robot or physics)\n  actcheck compare /tmp/before /tmp/after --fail-if-worse 0.05\n  actcheck compare k7f3 k7f3@rechecked    (one campaign by the rules of `actcheck recheck`)"
    )]
    Compare(crate::cli::compare::CompareArgs),
    /// Test the properties themselves: put faults into the world and the robot, and see which property notices
    ///
    /// Runs every scene without a fault and with each of them (a robot that does nothing, a hand that opens in mid-air, a
    /// report that lies, …) from the same choices. A property notices a fault when it fails beyond chance where it passed
    /// without. Nothing is kept in a history.
    ///
    /// Exit code: 0 every fault is noticed and every property notices one, 1 there is a gap, 2 it could not be done,
    /// 130 stopped by Ctrl-C.
    #[command(after_help = "Example:\n  actcheck check-oracles configs/pick.toml")]
    CheckOracles(crate::cli::check_oracles::CheckOraclesArgs),
    /// Write a stored run as a configuration of its own, or the history as tables or RDF
    ///
    /// A run becomes one readable file that makes its scene again. `actcheck run` takes the file like any other, and says whether it
    /// fails as it did. Values may be changed by hand: one that can't be is refused at its line. Inside the project it names ontology and
    /// models by paths from there; elsewhere it leaves them out where the program carries the same ones, and so runs anywhere.
    ///
    /// Tables come from the mirror beside the history (its folder `tables`), which is brought up to date first. Runs that shrinking
    /// made are not in them.
    #[command(
        after_help = "Examples:\n  actcheck export k7f3-3 -o case.toml    (an id that `actcheck list` prints; its beginning is enough)\n  actcheck export --parquet tables    (after `actcheck run configs/pick.toml`)\n  actcheck export --nquads history.nq --turtle history.ttl"
    )]
    Export(ExportArgs),
    /// Say how healthy a campaign is: what was discarded, repeated, never tried, slow, or badly simulated
    ///
    /// Prints how much of each parameter's range was tried, against what so many random draws would, and the same for pairs of
    /// parameters; and warns, with what to do, where the campaign says less than it seems to.
    ///
    /// Exit code: 0 healthy, 1 there is a warning, 2 it could not be done.
    #[command(
        after_help = "Example:\n  actcheck health    (the newest campaign, after `actcheck run configs/pick.toml`)"
    )]
    Health(crate::cli::health::HealthArgs),
    /// List the runs of a history
    #[command(after_help = "Example:\n  actcheck list --format csv")]
    List(ListArgs),
    /// Join histories into one: parts of a campaign (`run --shard`) become the campaign, what is met twice is kept once
    ///
    /// Everything comes along: runs with their traces and facts, later judgements, shrunk runs. Parts belong together that have the
    /// same configuration, seed and number of runs; they must have been made with the same program, ontology, rules and models, and
    /// agree on every run that several have. A conflict is told with its way out, and then nothing is written.
    ///
    /// Exit code: 0 done, 1 done, but a campaign of parts lacks runs (they are told), 2 conflict or fault, 130 stopped by Ctrl-C
    /// (what was written is whole; merging again goes on).
    #[command(
        after_help = "Example:\n  actcheck run configs/pick.toml --shard 1/2 --history /tmp/h1\n  actcheck run configs/pick.toml --shard 2/2 --history /tmp/h2\n  actcheck merge /tmp/h1 /tmp/h2 --into /tmp/all"
    )]
    Merge(crate::cli::merge::MergeArgs),
    /// Serve a history over HTTP: a read-only SPARQL 1.1 endpoint, a page to ask from, and the report as it is now
    ///
    /// Each query is answered by a process of its own and ended when its time, memory or room is spent. There are no updates, no
    /// `SERVICE`, no files, and no answers for pages of other sites. The history is held only while somebody asks: other commands can
    /// have it in between, and while one writes, the answer is to come back soon (503).
    ///
    /// Exit code: 0 ended by Ctrl-C, 2 it could not be served.
    #[command(
        after_help = "Examples:\n  actcheck serve    (after `actcheck run configs/pick.toml`)\n  curl -H 'Accept: text/csv' --data-urlencode 'query=SELECT ?run { ?run a act:Run }' http://localhost:7878/sparql"
    )]
    Serve(crate::cli::serve::ServeArgs),
    /// Answer one query of `actcheck serve`
    #[command(hide = true, after_help = "Example:\n  actcheck serve    (starts this for each query)")]
    ServeQuery(crate::cli::serve::ServeQueryArgs),
    /// Show one run: its scene, and every property's outcome with margin and witness
    #[command(
        after_help = "Example:\n  actcheck show k7f3-3    (an id that `actcheck list` prints; its beginning is enough)"
    )]
    Show(ShowArgs),
    /// Find the smallest scene that still fails as a run did, and say what of it matters
    ///
    /// Takes away objects and last actions, and brings noise, physics and poses back to nominal, as long as the same
    /// properties fail. The small run is kept in the history. Exit code: 0 done, 130 stopped by Ctrl-C (the smallest so
    /// far is kept and printed), 2 the run does not fail or can't be made again.
    #[command(
        after_help = "Example:\n  actcheck shrink k7f3-3 --picture small.svg    (an id that `actcheck list` prints; its beginning is enough)"
    )]
    Shrink(ShrinkArgs),
    /// Ask a history in SPARQL 1.1
    ///
    /// The prefixes act, w, obj, run, campaign, rdf, rdfs, owl, xsd, earl and prov are known. Facts about the world
    /// lie in named graphs, one for each moment: `?execution act:before ?g . GRAPH ?g { … }`.
    #[command(
        after_help = "Examples:\n  actcheck query 'SELECT (COUNT(?r) AS ?n) WHERE { ?r a act:Run }'\n  actcheck query --list-named\n  actcheck query --named failure-rates"
    )]
    Query(QueryArgs),
    /// Judge stored runs by today's rules, without simulating
    ///
    /// A property that is new since the runs is judged too. What is news is written beside the old outcomes, with the digest
    /// of the rules that made it and the time; `list`, `show` and the rest keep to the outcomes of the campaign itself. The
    /// newest ones are those in the graph act:rechecked that nothing supersedes (see ontology/history.ttl).
    ///
    /// Exit code: 0 nothing fails now, 1 a property fails now, 2 it could not be done or nothing could be decided,
    /// 130 stopped by Ctrl-C (what was judged is kept).
    #[command(after_help = "Example:\n  actcheck recheck MovedObject    (after `actcheck run configs/pick.toml`)")]
    Recheck(RecheckArgs),
    /// Say why a property holds in a run, or how near it came and what was missing
    ///
    /// Judges with the rules of today: those that the ontology links now.
    #[command(after_help = "Example:\n  actcheck why k7f3-3 MovedObject    (an id that `actcheck list` prints)")]
    Why(WhyArgs),
    /// Write what a history says as one page that opens anywhere, without a network, or as results for Allure, JUnit's readers, EARL, …
    ///
    /// The page has counts, patterns, every run, and failed ones in 3D.
    ///
    /// Overview with scores and intervals, properties, failure modes, patterns with plots, where targets stood, trends, and each run
    /// with witnesses, explanations and parameters. Failed runs are replayed as far as there is room for them, so that every failure
    /// mode and property has some; every other one is told with the command that shows it.
    ///
    /// Reads the tables beside the history, which are brought up to date first. Exit code: 0 written, 2 it could not be done.
    #[command(
        after_help = "Examples:\n  actcheck report --html report.html    (after `actcheck run configs/pick.toml`)\n  actcheck report --html picks.html --campaign k7f3 --property ObjectInGripper\n  actcheck report --rrd runs.rrd    (built with `--features rerun`; `rerun runs.rrd` shows it)\n  actcheck report --allure allure-results --junit junit.xml --markdown"
    )]
    Report(crate::cli::report::ReportArgs),
    /// List all properties: label, language, rule file, actions, and how often each passed in the history
    #[command(after_help = "Example:\n  actcheck rules --format csv")]
    Rules(crate::cli::rules::RulesArgs),
    /// Write a configuration or a property, ready to edit
    #[command(after_help = "Examples:\n  actcheck new campaign\n  actcheck new property StaysUpright --for Pick")]
    New(crate::cli::new::NewArgs),
    /// Run a Datalog program of its own, with its imports and exports
    #[command(after_help = "Example:\n  actcheck datalog program.rls -D results")]
    Datalog(DatalogArgs),
    /// Print the JSON schema of configurations, with which editors complete and check them
    ///
    /// Editors that use taplo, such as VS Code with Even Better TOML, read it if a configuration begins with the line
    /// `#:schema campaign.schema.json`. Names of models and relations between keys are checked by `actcheck check` alone.
    #[command(after_help = "Example:\n  actcheck schema > campaign.schema.json")]
    Schema,
    /// Print a script with which a shell completes commands and options
    ///
    /// Files that shells read at their start: `~/.local/share/bash-completion/completions/actcheck` for bash, `_actcheck` in a folder of
    /// `$fpath` for zsh, `~/.config/fish/completions/actcheck.fish` for fish.
    #[command(after_help = "Examples:\n  actcheck completions bash > actcheck.bash\n  . ./actcheck.bash")]
    Completions(crate::cli::completions::CompletionsArgs),
    /// Print the manual as a man page, or write one page for each command
    #[command(after_help = "Examples:\n  actcheck man | man -l -\n  actcheck man --out man1")]
    Man(crate::cli::man::ManArgs),
}

/// A search strategy by its name.
fn strategy(name: &str) -> Result<Strategy, String> {
    let names = Strategy::ALL.map(Strategy::name);
    Strategy::by_name(name).ok_or_else(|| did_you_mean(name, names))
}

/// `actcheck run`
#[derive(Debug, Args)]
pub struct RunArgs {
    /// The campaign's configuration (TOML)
    pub config: Option<PathBuf>,
    /// Go on with the newest campaign that was killed or interrupted (of CONFIG, where one is named), or with the one
    /// with this id, as it was begun: what comes out is the same as without the interruption
    #[arg(long, value_name = "ID", num_args = 0..=1, require_equals = true, default_missing_value = "")]
    #[arg(conflicts_with_all = ["runs", "time", "until_width", "max_failures", "seed", "repeat", "strategy", "shard"])]
    pub resume: Option<String>,
    /// Scenes of each test, instead of the configuration's `test_count`; where a budget ends the campaign, at most so many
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub runs: Option<u32>,
    /// End after this time, such as 90s, 10m or 2h; runs in flight are kept. Without `--runs`, as many runs as fit
    #[arg(long, value_name = "DURATION", value_parser = duration_secs)]
    pub time: Option<f64>,
    /// End when the 95 % interval of every property's pass rate is at most so wide, such as 0.05. Without `--runs`, at
    /// most four times the runs that suffice whatever the rate: 6132 of each test for 0.05
    #[arg(long, value_name = "WIDTH", value_parser = width)]
    pub until_width: Option<f64>,
    /// End at the run with which so many have failed, the same one at any number of workers
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub max_failures: Option<u64>,
    /// Seed of all randomness, instead of the configuration's `seed`
    #[arg(long, value_name = "S")]
    pub seed: Option<u64>,
    /// How scenes are chosen: random, halton, latin-hypercube, cross-entropy, bandit or boundary, instead of the
    /// configuration's `[search] strategy`; the last three look for failures, with the properties' margins as a guide
    #[arg(long, value_name = "NAME", value_parser = strategy)]
    pub strategy: Option<Strategy>,
    /// Runs of each scene, each with other noise, instead of the configuration's `repeat`
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub repeat: Option<u32>,
    /// Workers, one simulation each; results don't depend on it [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
    /// Only part I of N: every N-th run, beginning with the I-th; `actcheck merge` joins the parts. Budgets count for the part alone
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
        _ => Err(format!("`{text}` is no number between 0 and 1")),
    }
}

/// `actcheck check`
#[derive(Debug, Args)]
pub struct CheckArgs {
    /// The campaign's configuration (TOML) [default: configs/pick.toml]
    pub config: Option<PathBuf>,
}

/// Where a history lies.
#[derive(Debug, Args)]
pub struct HistoryArgs {
    /// Folder of the history [default: `.actcheck` here, or the only one in a folder of this folder]
    #[arg(long, value_name = "DIR")]
    pub history: Option<PathBuf>,
}

/// `actcheck list`
#[derive(Debug, Args)]
pub struct ListArgs {
    /// Where the history lies.
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
    /// Id of the run, or its beginning
    pub run: String,
    /// Where the history lies.
    #[command(flatten)]
    pub history: HistoryArgs,
    /// Draw the scene before and after into this file, as pixels (.png) or lines (.svg)
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
    /// A query by its name: one that the program carries, or `ontology/queries/NAME.rq` here
    #[arg(long, value_name = "NAME", conflicts_with = "list_named")]
    pub named: Option<String>,
    /// List the queries that have names, and what they answer
    #[arg(long)]
    pub list_named: bool,
    /// Where the history lies.
    #[command(flatten)]
    pub history: HistoryArgs,
    /// How the answer is printed (turtle: for CONSTRUCT and DESCRIBE)
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: QueryFormat,
}

/// `actcheck why`
#[derive(Debug, Args)]
pub struct WhyArgs {
    /// Id of the run, or its beginning
    pub run: String,
    /// Only this property, by its name in the ontology [default: all that were judged]
    pub property: Option<String>,
    /// The ontology whose rules explain [default: ontology/actions.ttl here, or the one that the program carries]
    #[arg(long, value_name = "FILE")]
    pub ontology: Option<PathBuf>,
    /// Where the history lies.
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
    /// Folder for what it exports
    #[arg(short = 'D', long = "export-dir", value_name = "DIR", default_value = "results")]
    pub output: PathBuf,
    /// Say why this statement holds or does not, such as 'p(1, _)', instead of exporting
    #[arg(long, value_name = "FACT")]
    pub trace: Option<String>,
    /// How explanations are printed
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: ProofFormat,
    /// Stop after so many derived tuples
    #[arg(long, value_name = "N", default_value_t = 100_000_000)]
    pub max_tuples: usize,
    /// Stop after so many seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 600.0)]
    pub max_secs: f64,
}

/// Formats of an explanation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum ProofFormat {
    /// For people
    #[default]
    Text,
    /// For programs
    Json,
    /// For Graphviz
    Dot,
}

/// Formats of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum Format {
    /// For people
    #[default]
    Table,
    /// Comma-separated values
    Csv,
    /// For programs
    Json,
}

/// Formats of a query's answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum QueryFormat {
    /// For people
    #[default]
    Table,
    /// Comma-separated values
    Csv,
    /// For programs
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
