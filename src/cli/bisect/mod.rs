//! `actcheck bisect`

mod child;
mod ends;
mod judge;
mod repository;
mod scenes;
mod search;
mod stored;
mod text;
mod versions;

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::{Args, ValueEnum};

use crate::options::HistoryArgs;
use crate::{output, stop};
use actcheck_base::{Diagnostic, Diagnostics, ScratchFolder};

use ends::Ends;
use judge::{Judge, Unjudged};
use search::{Found, Step, search};
use versions::Versions;

/// `actcheck bisect`
#[derive(Debug, Args)]
pub struct BisectArgs {
    /// A configuration or a case to run at each version [default: none; the runs of the history are
    /// judged anew]
    #[arg(value_name = "CONFIG")]
    pub config: Option<PathBuf>,
    /// A revision of this git repository at which all was well
    #[arg(long, value_name = "REV", required_unless_present = "programs")]
    pub good: Option<String>,
    /// A revision with the change
    #[arg(long, value_name = "REV", default_value = "HEAD")]
    pub bad: String,
    /// Programs instead of revisions, from good to bad: two or more versions of actcheck
    #[arg(long, value_name = "PROGRAM", num_args = 2.., requires = "config", conflicts_with_all = ["good", "bad", "build", "program"])]
    pub programs: Vec<PathBuf>,
    /// Only this property, by its name in the ontology; may be given several times [default: all]
    #[arg(long = "property", value_name = "NAME")]
    pub properties: Vec<String>,
    /// Only this stored run; may be given several times [default: all]
    #[arg(long = "run", value_name = "RUN", conflicts_with = "config")]
    pub runs: Vec<String>,
    /// Decide by single outcomes, or by the rates that `actcheck compare` compares [default:
    /// outcomes of stored runs and cases, rates of campaigns]
    #[arg(long, value_name = "WHAT", value_enum)]
    pub by: Option<By>,
    /// Number of scenes at each version
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = clap::value_parser!(u64).range(1..))]
    pub scenes: u64,
    /// If these are too few to decide, run more, up to this number
    #[arg(long, value_name = "N", default_value_t = 400, value_parser = clap::value_parser!(u64).range(1..))]
    pub most_scenes: u64,
    /// A shell command that builds each revision, in its folder
    #[arg(long, value_name = "COMMAND", requires = "config")]
    pub build: Option<String>,
    /// The program that runs the scenes, relative to the revision's folder [default: this one]
    #[arg(long, value_name = "PATH", requires = "config")]
    pub program: Option<PathBuf>,
    /// The ontology with the rules that judge stored runs, in each revision
    #[arg(
        long,
        value_name = "FILE",
        default_value = "ontology/actions.ttl",
        conflicts_with = "config"
    )]
    pub ontology: PathBuf,
    /// Start the program that a case or a history names; only for those that you trust
    #[arg(long)]
    pub trust: bool,
    /// Number of workers; does not affect results [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
    /// The folder of the history.
    #[command(flatten)]
    pub history: HistoryArgs,
}

/// How outcomes decide.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum By {
    /// A version is bad if an outcome changed that also differs at the other end
    Outcome,
    /// A version is bad if it is worse, by the test of `compare`
    Rate,
}

/// Significance level of the comparisons.
const LEVEL: f64 = 0.05;
/// Rates that differ by less count as equal.
const MARGIN: f64 = 0.05;

/// Finds the first bad version and prints it. Returns the exit code: 0 found, 1 several versions
/// remain because they could not be judged.
pub fn bisect(args: &BisectArgs) -> Result<u8, Diagnostics> {
    let stop = stop::on_interrupt(|| {});
    match bisect_until(args, &stop) {
        // Any fault is a consequence of the interrupt. The temporary folder is gone by now.
        _ if stop.load(Ordering::Relaxed) => {
            stop::tell();
            Ok(stop::INTERRUPTED)
        }
        done => done,
    }
}

fn bisect_until(args: &BisectArgs, stop: &Arc<AtomicBool>) -> Result<u8, Diagnostics> {
    let scratch = ScratchFolder::create().map_err(|error| {
        Diagnostic::error(
            "X066",
            format!("no temporary folder can be created: {error}"),
        )
    })?;
    // Programs start in other folders.
    let folder = std::path::absolute(scratch.path()).unwrap_or_else(|_| scratch.path().to_owned());
    let versions = Versions::find(args, &folder)?;
    let mut judge = Judge::new(args, &versions, &folder, stop)?;
    let mut ends = Ends::judge(args, &versions, &mut judge)?;
    let mut steps = 0;
    let found = search(&versions, |version, left| {
        let step = ends.step(args, version, &mut judge)?;
        steps += 1;
        output::print(&text::step(version, &step, left));
        Ok::<Step, Unjudged>(step)
    })
    .map_err(Unjudged::into_faults)?;
    let code = u8::from(matches!(found, Found::OneOf(_)));
    output::print(&text::found(&versions, &ends, &found, steps, &mut judge)?);
    Ok(code)
}
