//! `actcheck import`

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use serde_json::{Value, json};

use crate::convert::{self, Converted, ConvertedEpisode};
use crate::options::Format;
use crate::progress::Progress;
use crate::why::ontology_file;
use crate::work::all_cores;
use crate::{clock, output, stop};
use actcheck_base::{Diagnostic, Diagnostics, Files, Outcome, Source, names};
use actcheck_campaign::{
    Ending, EpisodeFile, ImportOptions, ImportedCampaign, RuleSet, import as import_all,
    name_of_import,
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
    let mappings = Mappings::load(args.mapping.as_deref(), args.ontology.as_deref())?;
    let (files, mut faults) = mappings.choose(&converted);
    if files.is_empty() {
        return Err(first_of_episodes(faults));
    }
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
    let end = import_all(
        || History::open(&args.history),
        &files,
        &options,
        (clock::system().now, &stop),
        || progress.judged(1, 0),
    );
    progress.finish();
    let failed = end
        .campaigns
        .iter()
        .flat_map(|campaign| campaign.properties.values())
        .any(|outcomes| outcomes.contains_key(&Outcome::Failed));
    print(&end.campaigns, args);
    faults.extend(end.faults);
    let has_faults = !faults.is_empty();
    if has_faults {
        output::print_diagnostics(&first_of_episodes(faults));
    }
    match end.ending {
        Ending::Stopped(faults) => Err(faults),
        Ending::Interrupted => Ok(stop::INTERRUPTED),
        Ending::Finished | Ending::Budget(_) if has_faults => Ok(2),
        Ending::Finished | Ending::Budget(_) => Ok(u8::from(failed)),
    }
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

/// The mappings to choose from, each with its rules.
pub(super) struct Mappings {
    list: Vec<(Mapping, Arc<RuleSet>)>,
    /// Whether the only one was given by name: it is used for every environment.
    is_given: bool,
}

impl Mappings {
    /// Reads the given mapping, or all shipped ones, and prepares their rules: those of the given
    /// ontology, or of the mapping's, or the default ones.
    pub(super) fn load(given: Option<&Path>, ontology: Option<&Path>) -> Result<Self, Diagnostics> {
        let (files, paths) = match given {
            Some(path) => (Files::Disk, vec![path.to_path_buf()]),
            None => {
                let folder = Path::new(MAPPINGS);
                let files = if folder.is_dir() {
                    Files::Disk
                } else {
                    Files::Shipped
                };
                let mut paths = files.list(folder);
                paths.retain(|path| path.extension().is_some_and(|ending| ending == "toml"));
                (files, paths)
            }
        };
        let mut faults = Diagnostics::new();
        let mut mappings = Vec::new();
        for path in paths {
            match read(&files, &path) {
                Ok(mapping) => mappings.push((path, mapping)),
                Err(found) => faults.extend(found),
            }
        }
        let mappings = faults.or(mappings)?;
        let mut prepared: BTreeMap<PathBuf, Arc<RuleSet>> = BTreeMap::new();
        let mut list = Vec::new();
        for (path, mapping) in mappings {
            let (files, ontology) = ontology_of(&mapping, &files, &path, ontology);
            let rules = match prepared.get(&ontology) {
                Some(rules) => Arc::clone(rules),
                None => {
                    let rules = Arc::new(RuleSet::prepare(&files, &ontology)?);
                    output::print_diagnostics(rules.warnings());
                    prepared.insert(ontology, Arc::clone(&rules));
                    rules
                }
            };
            list.push((mapping, rules));
        }
        Ok(Self {
            list,
            is_given: given.is_some(),
        })
    }

    /// Chooses a mapping for each episode. Returns the faults of the other ones.
    pub(super) fn choose(&self, converted: &Converted) -> (Vec<EpisodeFile<'_>>, Diagnostics) {
        let mut faults = converted.faults.clone();
        let mut files = Vec::new();
        for episode in &converted.episodes {
            match self.of(episode) {
                Ok((mapping, rules)) => files.push(EpisodeFile {
                    path: episode.path.clone(),
                    named: episode.named.clone(),
                    mapping,
                    rules,
                    repeats: None,
                }),
                Err(found) => faults.extend(found),
            }
        }
        (files, faults)
    }

    /// Returns the given mapping, or else the one for an episode's environment.
    fn of(&self, episode: &ConvertedEpisode) -> Result<&(Mapping, Arc<RuleSet>), Diagnostics> {
        if let (true, Some(given)) = (self.is_given, self.list.first()) {
            return Ok(given);
        }
        let environment = Episode::environment(&episode.path)?;
        let found = self
            .list
            .iter()
            .find(|(mapping, _)| mapping.is_for(&environment));
        found.ok_or_else(|| {
            let message = format!("{}: no mapping fits the environment `{environment}`", episode.named);
            Diagnostic::error("E006", message)
                .help("`actcheck import --propose FILE > mapping.toml` drafts one; then add `--mapping mapping.toml`")
                .into()
        })
    }
}

/// Reads a mapping.
fn read(files: &Files, path: &Path) -> Result<Mapping, Diagnostics> {
    let source = files.read(path).map_err(|fault| {
        Diagnostic::error(
            "E005",
            format!("can't read the mapping {}: {fault}", path.display()),
        )
        .help("`actcheck import --propose FILE > mapping.toml` drafts one")
    })?;
    Mapping::parse(&source)
}

/// The ontology that was given, or the one that a mapping names, or the default one.
fn ontology_of(
    mapping: &Mapping,
    files: &Files,
    path: &Path,
    given: Option<&Path>,
) -> (Files, PathBuf) {
    match (given, &mapping.ontology) {
        (None, Some(named)) => {
            let folder = path.parent().unwrap_or(Path::new(""));
            let ontology = resolve_path(folder, &named.value);
            let is_here = ontology.is_file();
            let files = if is_here { &Files::Disk } else { files };
            (files.clone(), ontology)
        }
        _ => ontology_file(given),
    }
}

/// Prints a draft of a mapping for the first episode.
fn proposed(converted: &Converted) -> Result<u8, Diagnostics> {
    let Some(first) = converted.episodes.first() else {
        return Err(first_of_episodes(converted.faults.clone()));
    };
    let (episode, _) = Episode::read(&first.path)?;
    let text = propose(&episode);
    // A draft that can't be read again would be a fault of ours.
    Mapping::parse(&Source::new("mapping.toml", text.as_str()))?;
    output::print(&text);
    Ok(0)
}

/// Prints a table for each campaign, or one table of all.
fn print(campaigns: &[ImportedCampaign], args: &ImportArgs) {
    if args.format == Format::Text {
        for (number, campaign) in campaigns.iter().enumerate() {
            let space = if number == 0 { "" } else { "\n" };
            let noun = if campaign.runs == 1 {
                "episode"
            } else {
                "episodes"
            };
            output::print(&format!(
                "{space}campaign {}: {} {noun} of {} imported into {}\n\n",
                campaign.id,
                campaign.runs,
                campaign.engine,
                args.history.display()
            ));
            let mut table = Table::new(COLUMNS);
            table.rows = rows(campaign);
            output::print(&table.render(args.format.into(), output::page()));
        }
    } else {
        let mut table = Table::new(std::iter::once("campaign").chain(COLUMNS));
        for campaign in campaigns {
            table.rows.extend(rows(campaign).into_iter().map(|mut row| {
                row.insert(0, json!(campaign.id));
                row
            }));
        }
        output::print(&table.render(args.format.into(), output::page()));
    }
}

/// Columns of a table of imported outcomes.
const COLUMNS: [&str; 5] = ["property", "passed", "failed", "inapplicable", "rate"];

/// A row for each property.
fn rows(campaign: &ImportedCampaign) -> Vec<Vec<Value>> {
    let row = |(property, outcomes): (&String, &BTreeMap<Outcome, u64>)| {
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
        vec![
            json!(names::local(property)),
            json!(passed),
            json!(failed),
            json!(count(Outcome::Inapplicable)),
            json!(rate),
        ]
    };
    campaign.properties.iter().map(row).collect()
}

/// The first faults of episodes, and the number of the others.
pub(super) fn first_of_episodes(faults: Diagnostics) -> Diagnostics {
    output::first_of(faults, MAX_LISTED, |more| {
        Diagnostic::error(
            "E007",
            format!("{more} more episodes could not be imported"),
        )
    })
}
