//! `actcheck import`

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;

use crate::convert::{self, Converted};
use crate::options::Format;
use crate::progress::Progress;
use crate::why::ontology_file;
use crate::work::all_cores;
use crate::{clock, output, stop};
use actcheck_base::{Diagnostic, Diagnostics, Files, Outcome, Source, names};
use actcheck_campaign::{
    Ending, EpisodeFile, ImportEnd, ImportOptions, RuleSet, import as import_all, name_of_import,
};
use actcheck_config::resolve_path;
use actcheck_episodes::{Episode, Mapping, propose};
use actcheck_history::History;
use actcheck_report::Table;
use actcheck_verdict::wilson;

/// Folder of the shipped mappings, below the repository's root.
const MAPPINGS: &str = "models/episodes";

/// Maximum number of faults that are reported; the rest are counted.
const MAX_LISTED: usize = 10;

/// `actcheck import`
#[derive(Debug, Args)]
pub struct ImportArgs {
    /// Episodes: files of `actcheck.record` (MCAP), HDF5 of robosuite, LIBERO, robomimic or Isaac
    /// Lab, LeRobot datasets, ROS bags, or folders of them
    #[arg(value_name = "FILE", required = true)]
    pub files: Vec<PathBuf>,
    /// Which body is the object, the gripper, the surface, and which action was performed [default:
    /// the shipped mapping for the environment]
    #[arg(long, value_name = "FILE")]
    pub mapping: Option<PathBuf>,
    /// Draft a mapping from the first episode instead, and print it
    #[arg(long, conflicts_with = "mapping")]
    pub propose: bool,
    /// The Python that reads files other than MCAP: one with h5py and, for HDF5 of robosuite or
    /// LIBERO, their MuJoCo
    #[arg(long, value_name = "PROGRAM", default_value = "python3")]
    pub python: PathBuf,
    /// Order of quaternions in HDF5 of Isaac Lab, if its file does not say
    #[arg(long, value_name = "ORDER", value_parser = ["wxyz", "xyzw"])]
    pub quaternions: Option<String>,
    /// The folder of the history.
    #[arg(long, value_name = "DIR", default_value = ".actcheck")]
    pub history: PathBuf,
    /// The ontology with the rules [default: that of the mapping, or ontology/actions.ttl here, or
    /// the shipped one]
    #[arg(long, value_name = "FILE")]
    pub ontology: Option<PathBuf>,
    /// Number of workers; does not affect results [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
    /// How it is printed
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: Format,
}

/// Imports episodes as runs of a new campaign, and prints their outcomes. Returns the exit code.
pub fn import(args: &ImportArgs) -> Result<u8, Diagnostics> {
    let files = found(&args.files)?;
    let jobs = args.jobs.map_or_else(all_cores, usize::from);
    let converted = convert::episodes(&files, &args.python, args.quaternions.as_deref())?;
    if args.propose {
        return proposed(&converted);
    }
    let mappings = Mappings::load(args.mapping.as_deref())?;
    let (files, mut faults) = mapped(&converted, &mappings)?;
    let rules = rules_for(args.ontology.as_deref(), args.mapping.as_deref(), &files)?;
    if files.is_empty() {
        return Err(first_of(faults));
    }
    let history = History::open(&args.history)?;
    let progress = Progress::new(files.len() as u64, None);
    let bar = progress.bar();
    let stop = stop::on_interrupt(move || {
        bar.println("stopping after these episodes; imported ones are kept")
    });
    let options = ImportOptions {
        jobs,
        name: name_of_import(&args.files),
        mapping: args
            .mapping
            .as_deref()
            .map(|path| path.display().to_string())
            .unwrap_or_default(),
    };
    let mut counts: BTreeMap<String, BTreeMap<Outcome, u64>> = BTreeMap::new();
    let end = import_all(
        &history,
        &rules,
        &files,
        &options,
        (clock::system().now, &stop),
        |run| {
            progress.judged(1, 0);
            for judgement in run.judgements.iter().flatten() {
                *counts
                    .entry(judgement.property.clone())
                    .or_default()
                    .entry(judgement.outcome)
                    .or_default() += 1;
            }
        },
    );
    progress.finish();
    let failed = counts
        .values()
        .any(|outcomes| outcomes.contains_key(&Outcome::Failed));
    print(&end, &counts, args);
    faults.extend(end.faults);
    let has_faults = !faults.is_empty();
    if has_faults {
        output::print_diagnostics(&first_of(faults));
    }
    match end.ending {
        Ending::Stopped(faults) => Err(faults),
        Ending::Interrupted => Ok(stop::INTERRUPTED),
        Ending::Finished | Ending::Budget(_) if has_faults => Ok(2),
        Ending::Finished | Ending::Budget(_) => Ok(u8::from(failed)),
    }
}

/// Prepares the rules: those of the named ontology, or of the mapping's, or the default ones.
pub(super) fn rules_for(
    ontology: Option<&Path>,
    mapping: Option<&Path>,
    files: &[EpisodeFile<'_>],
) -> Result<RuleSet, Diagnostics> {
    let chosen = files.first().map(|file| file.mapping);
    let written = chosen.and_then(|mapping| mapping.ontology.as_ref());
    let (rule_files, path) = match (ontology, written) {
        (None, Some(written)) => match mapping.and_then(Path::parent) {
            Some(folder) => (Files::Disk, resolve_path(folder, &written.value)),
            None => {
                let path = resolve_path(Path::new(MAPPINGS), &written.value);
                let files = if path.is_file() {
                    Files::Disk
                } else {
                    Files::Shipped
                };
                (files, path)
            }
        },
        (given, _) => ontology_file(given),
    };
    let rules = RuleSet::prepare(&rule_files, &path)?;
    output::print_diagnostics(rules.warnings());
    Ok(rules)
}

/// Returns the files, and those in the folders, sorted within each folder.
pub(super) fn found(given: &[PathBuf]) -> Result<Vec<PathBuf>, Diagnostics> {
    let mut files = Vec::new();
    let mut faults = Diagnostics::new();
    for path in given {
        if !path.exists() {
            faults.push(
                Diagnostic::error("E001", format!("{} does not exist", path.display()))
                    .help("give files of episodes, or folders with them"),
            );
        } else if path.is_dir() && !convert::is_dataset(path) {
            let entries = fs::read_dir(path).map(|entries| {
                let mut paths: Vec<PathBuf> = entries
                    .filter_map(|entry| Some(entry.ok()?.path()))
                    .filter(|path| path.is_dir() || convert::is_episode_name(path))
                    .filter(|path| !path.is_dir() || convert::is_dataset(path))
                    .collect();
                paths.sort();
                paths
            });
            match entries {
                Ok(paths) if paths.is_empty() => faults.push(
                    Diagnostic::error("E001", format!("{} has no episodes", path.display()))
                        .help("episodes are files with the endings mcap, hdf5, h5 and db3, LeRobot datasets and bags"),
                ),
                Ok(paths) => files.extend(paths),
                Err(error) => faults.push(Diagnostic::error(
                    "E001",
                    format!("can't read {}: {error}", path.display()),
                )),
            }
        } else {
            files.push(path.clone());
        }
    }
    faults.or(files)
}

/// The mappings to choose from.
pub(super) struct Mappings {
    list: Vec<Mapping>,
    /// Whether the only one was given by name: it is used for every environment.
    is_given: bool,
}

impl Mappings {
    pub(super) fn load(given: Option<&Path>) -> Result<Self, Diagnostics> {
        if let Some(path) = given {
            let source = Files::Disk.read(path).map_err(|fault| {
                Diagnostic::error(
                    "E005",
                    format!("can't read the mapping {}: {fault}", path.display()),
                )
                .help("`actcheck import --propose FILE > mapping.toml` drafts one")
            })?;
            return Ok(Self {
                list: vec![Mapping::parse(&source)?],
                is_given: true,
            });
        }
        let mut list = Vec::new();
        let mut faults = Diagnostics::new();
        let files = if Path::new(MAPPINGS).is_dir() {
            Files::Disk
        } else {
            Files::Shipped
        };
        for path in files.list(Path::new(MAPPINGS)) {
            if path.extension().is_some_and(|ending| ending == "toml")
                && let Ok(source) = files.read(&path)
            {
                match Mapping::parse(&source) {
                    Ok(mapping) => list.push(mapping),
                    Err(found) => faults.extend(found),
                }
            }
        }
        faults.or(Self {
            list,
            is_given: false,
        })
    }

    /// Returns the mapping for an environment, or `None`.
    fn of(&self, environment: &str) -> Option<&Mapping> {
        if self.is_given {
            return self.list.first();
        }
        self.list.iter().find(|mapping| mapping.is_for(environment))
    }
}

/// Chooses a mapping for each episode. Returns the faults of the other ones.
pub(super) fn mapped<'m>(
    converted: &Converted,
    mappings: &'m Mappings,
) -> Result<(Vec<EpisodeFile<'m>>, Diagnostics), Diagnostics> {
    let mut faults = converted.faults.clone();
    let mut files = Vec::new();
    for episode in &converted.episodes {
        let environment = if mappings.is_given {
            String::new()
        } else {
            match Episode::environment(&episode.path) {
                Ok(environment) => environment,
                Err(found) => {
                    faults.extend(found);
                    continue;
                }
            }
        };
        match mappings.of(&environment) {
            Some(mapping) => files.push(EpisodeFile {
                path: episode.path.clone(),
                named: episode.named.clone(),
                mapping,
            }),
            None => faults.push(
                Diagnostic::error(
                    "E006",
                    format!("{}: there is no mapping for the environment `{environment}`", episode.named),
                )
                .help("`actcheck import --propose FILE > mapping.toml` drafts one; then add `--mapping mapping.toml`"),
            ),
        }
    }
    Ok((files, faults))
}

/// Prints a draft of a mapping for the first episode.
fn proposed(converted: &Converted) -> Result<u8, Diagnostics> {
    let Some(first) = converted.episodes.first() else {
        return Err(first_of(converted.faults.clone()));
    };
    let (episode, _) = Episode::read(&first.path)?;
    let text = propose(&episode);
    // A draft that can't be read again would be a fault of ours.
    Mapping::parse(&Source::new("mapping.toml", text.as_str()))?;
    output::print(&text);
    Ok(0)
}

fn print(end: &ImportEnd, counts: &BTreeMap<String, BTreeMap<Outcome, u64>>, args: &ImportArgs) {
    let Some(campaign) = &end.campaign else {
        return;
    };
    let mut table = Table::new(["property", "passed", "failed", "inapplicable", "rate"]);
    for (property, outcomes) in counts {
        let count = |outcome| outcomes.get(&outcome).copied().unwrap_or_default();
        let (passed, failed) = (count(Outcome::Passed), count(Outcome::Failed));
        let rate = wilson(passed, passed + failed).map_or_else(String::new, |interval| {
            format!(
                "{:.0} % [{:.0}, {:.0}]",
                100.0 * passed as f64 / (passed + failed) as f64,
                100.0 * interval.low,
                100.0 * interval.high
            )
        });
        table.rows.push(vec![
            json!(names::local(property)),
            json!(passed),
            json!(failed),
            json!(count(Outcome::Inapplicable)),
            json!(rate),
        ]);
    }
    if args.format == Format::Text {
        let noun = if end.imported == 1 {
            "episode"
        } else {
            "episodes"
        };
        output::print(&format!(
            "campaign {campaign}: {} {noun} imported into {}\n\n",
            end.imported,
            args.history.display()
        ));
    }
    output::print(&table.render(args.format.into(), output::page()));
}

pub(super) fn first_of(faults: Diagnostics) -> Diagnostics {
    let left_out = faults.len().saturating_sub(MAX_LISTED);
    let mut listed = Diagnostics::new();
    faults
        .into_iter()
        .take(MAX_LISTED)
        .for_each(|fault| listed.push(fault));
    if left_out > 0 {
        listed.push(Diagnostic::error(
            "E007",
            format!("{left_out} more episodes could not be imported"),
        ));
    }
    listed
}
