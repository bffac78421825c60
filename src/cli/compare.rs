//! `actcheck compare`

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use clap::Args;

use crate::chosen::{engine_name, sampling};
use crate::options::{Format, HistoryArgs, level, megabytes};
use crate::trust::TrustArgs;
use crate::{history_dir, known_issues, output, review};
use actcheck_analysis::{ComparedRun, ComparedRuns, Comparison, Sampling, compare as compare_runs};
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_campaign::changes;
use actcheck_history::{CampaignRecord, History, Judgements, RunFilter, Wish};
use actcheck_report::{
    CompareSummary, ComparedSide, KnownIssueRuns, SideChange, compare_json, compare_table,
    compare_text,
};

/// Suffix of a campaign: use its newest judgements.
const RECHECKED: &str = "@rechecked";

/// `actcheck compare`
#[derive(Debug, Args)]
pub struct CompareArgs {
    /// The baseline campaign: ID, DIR#ID for one of another history, or DIR for the newest there;
    /// the suffix @rechecked selects its newest judgements (see `actcheck recheck`)
    #[arg(value_name = "A")]
    pub first: String,
    /// The campaign to compare with it, named the same way
    #[arg(value_name = "B")]
    pub second: String,
    /// Exit with 1 if B is worse than A: if, in any line, so many scenes that only A passes would
    /// occur with at most this probability if B were not worse. Broken runs and timeouts are a
    /// line, too. The probability of a false alarm is at most LEVEL (usually 0.05), over all lines
    /// together
    #[arg(long, value_name = "LEVEL", value_parser = level)]
    pub fail_if_worse: Option<f64>,
    /// Rates that differ by less count as equal, as a share
    #[arg(long, value_name = "SHARE", value_parser = level, default_value = "0.05")]
    pub margin: f64,
    /// Exit with the answer: 0 same or no difference, 1 worse, 3 better, 4 underpowered (too few scenes to
    /// decide); at the level of --fail-if-worse, or 0.05
    #[arg(long)]
    pub decide: bool,
    /// Tests and intervals that are valid however often you look, as after each run of a growing
    /// campaign; they need more scenes than those for a number that was fixed before
    #[arg(long)]
    pub sequential: bool,
    /// Compare also if the campaigns have different physics engines
    #[arg(long)]
    pub across_engines: bool,
    /// Accept the failure modes that this file names until its dates (TOML): their scenes are shown
    /// apart and not compared
    #[arg(long, value_name = "FILE.toml")]
    pub known_issues: Option<PathBuf>,
    /// Write the comparison as a page to review a change: properties that are better or worse, and the
    /// scenes that flipped, with both replays side by side
    #[arg(long, value_name = "FILE.html")]
    pub html: Option<PathBuf>,
    /// Write the comparison in Markdown, for the summary of a job; `-` prints it instead of the text
    #[arg(long, value_name = "FILE.md")]
    pub markdown: Option<PathBuf>,
    /// Maximum size of the replays in the page
    #[arg(long, value_name = "MB", default_value_t = 10.0, value_parser = megabytes, requires = "html")]
    pub replay_mb: f64,
    /// The folder of the history for an ID without DIR.
    #[command(flatten)]
    pub history: HistoryArgs,
    /// The consent to start programs.
    #[command(flatten)]
    pub trust: TrustArgs,
    /// How it is printed (csv: one line for each property; json: everything)
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: Format,
}

/// Compares two campaigns and prints the result. Returns the exit code.
pub fn compare(args: &CompareArgs) -> Result<u8, Diagnostics> {
    let mut histories = Histories::default();
    let mut first = Side::read(&args.first, &args.history, &mut histories)?;
    let mut second = Side::read(&args.second, &args.history, &mut histories)?;
    let engines = [&first, &second].map(|side| engine_name(side.record.imported_from.as_deref()));
    if engines[0] != engines[1] && !args.across_engines {
        let message = format!(
            "{} has runs of {}, and {} of {}",
            args.first, engines[0], args.second, engines[1]
        );
        return Err(Diagnostic::error("E019", message)
            .help("a difference may be the engine's; `--across-engines` compares them all the same")
            .into());
    }
    let asked = if args.sequential {
        Sampling::Stopped
    } else {
        Sampling::Fixed
    };
    let comparison_sampling = first.sampling.and(second.sampling).and(asked);
    let known = match &args.known_issues {
        Some(file) => known_issues::set_apart(file, [&mut first, &mut second])?,
        None => Vec::new(),
    };
    let comparison = compare_runs(&first.runs, &second.runs, comparison_sampling);
    let excuses = |issue: &KnownIssueRuns| {
        !issue.is_expired && issue.runs.iter().any(|runs| !runs.is_empty())
    };
    if comparison.pairs == 0 && !known.iter().any(excuses) {
        return Err(nothing_shared(&first, &second, &comparison).into());
    }
    let summary = CompareSummary {
        sides: [first.summary(), second.summary()],
        comparison,
        changes: side_changes(&first, &second),
        level: args.fail_if_worse,
        margin: args.margin,
        decide: args.decide,
        sequential: args.sequential,
        without_contested: without_contested(&first, &second, comparison_sampling),
        known,
    };
    let printed = review::write(args, &summary, [&first, &second], &histories)?;
    output::print(&printed.unwrap_or_else(|| match args.format {
        Format::Text => compare_text(&summary, output::page()),
        Format::Csv => compare_table(&summary).render(args.format.into(), output::page()),
        Format::Json => format!("{:#}\n", compare_json(&summary)),
    }));
    Ok(summary.exit_code())
}

/// The comparison without the runs that another engine contests; `None` if there are none.
fn without_contested(first: &Side, second: &Side, sampling: Sampling) -> Option<Comparison> {
    let confirmed = |side: &Side| -> Vec<ComparedRun> {
        let runs = side.runs.iter();
        runs.filter(|run| !side.contested.contains(&run.run))
            .cloned()
            .collect()
    };
    let (one, other) = (confirmed(first), confirmed(second));
    let is_smaller = one.len() < first.runs.len() || other.len() < second.runs.len();
    is_smaller.then(|| compare_runs(&one, &other, sampling))
}

/// The inputs that differ between two sides.
pub(super) fn side_changes(first: &Side, second: &Side) -> Vec<SideChange> {
    changes(&first.record, &second.record)
        .into_iter()
        .map(|change| SideChange {
            kind: change.kind.word().to_owned(),
            name: change.name,
            first: change.was,
            second: change.is,
        })
        .collect()
}

/// The open histories. Each is opened only once, so that both sides see the same state.
#[derive(Default)]
pub(super) struct Histories {
    open: BTreeMap<PathBuf, History>,
}

impl Histories {
    fn get(
        &mut self,
        dir: Option<&Path>,
        default: &HistoryArgs,
    ) -> Result<(&History, PathBuf), Diagnostics> {
        let dir = match dir {
            Some(dir) => dir.to_path_buf(),
            None => history_dir::folder(default)?,
        };
        let key = std::fs::canonicalize(&dir).unwrap_or_else(|_| dir.clone());
        if !self.open.contains_key(&key) {
            self.open.insert(key.clone(), History::open_to_read(&dir)?);
        }
        Ok((&self.open[&key], key))
    }

    /// The history of a side.
    pub(super) fn of(&self, side: &Side) -> Option<&History> {
        self.open.get(&side.dir)
    }
}

/// The argument for one side.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Name<'a> {
    dir: Option<&'a Path>,
    campaign: Option<&'a str>,
    rechecked: bool,
}

impl<'a> Name<'a> {
    fn read(text: &'a str) -> Self {
        let (place, rechecked) = match text.strip_suffix(RECHECKED) {
            Some(place) => (place, true),
            None => (text, false),
        };
        let (dir, campaign) = match place.rsplit_once('#') {
            Some((dir, "")) => (Some(Path::new(dir)), None),
            Some((dir, campaign)) => (Some(Path::new(dir)), Some(campaign)),
            // Ids have no `/`.
            None if place.contains('/') || Path::new(place).is_dir() => {
                (Some(Path::new(place)), None)
            }
            None => (None, Some(place)),
        };
        Self {
            dir,
            campaign,
            rechecked,
        }
    }
}

/// One side, read from its history.
pub(super) struct Side {
    pub(super) name: String,
    /// The folder of its history, by which the open one is found.
    dir: PathBuf,
    pub(super) record: CampaignRecord,
    pub(super) runs: Vec<ComparedRun>,
    /// Ids of the runs whose verdict another engine contests.
    contested: BTreeSet<String>,
    /// Number of runs, also of those without a known scene.
    count: u64,
    /// How this number was decided.
    sampling: Sampling,
}

impl Side {
    /// Reads a side by its name on the command line.
    ///
    /// # Errors
    /// The history can't be read, or does not have the campaign.
    pub(super) fn read(
        text: &str,
        default: &HistoryArgs,
        histories: &mut Histories,
    ) -> Result<Self, Diagnostics> {
        let name = Name::read(text);
        let (history, dir) = histories.get(name.dir, default)?;
        let id = match name.campaign {
            Some(id) => id.to_owned(),
            None => newest(history)?,
        };
        let mut record = history.campaign(&id)?;
        let sampling = sampling(history, |campaign| campaign == id)?;
        let filter = RunFilter {
            campaign: Some(id),
            ..RunFilter::default()
        };
        let judgements = if name.rechecked {
            Judgements::Newest
        } else {
            Judgements::Campaign
        };
        let mut collected = ComparedRuns::default();
        let later = history.each_judged(
            &filter,
            Wish {
                judgements,
                scenes: true,
            },
            &mut |run| collected.add(run),
        )?;
        if name.rechecked {
            judged_by(&mut record, &later);
        }
        let count = collected.len() as u64;
        Ok(Self {
            name: text.to_owned(),
            dir,
            record,
            runs: collected.sorted(),
            contested: history.contested()?.into_keys().collect(),
            count,
            sampling,
        })
    }

    /// Its description.
    pub(super) fn summary(&self) -> ComparedSide {
        ComparedSide {
            name: self.name.clone(),
            campaign: self.record.id.clone(),
            config: self.record.name.clone(),
            runs: self.count,
            planned: self.record.planned_runs,
            started: self.record.started.clone(),
            config_text: self.record.config_text.clone(),
        }
    }
}

/// Returns the newest campaign of a history, except those that hold a shrunk run, ran failed runs
/// again, or ran a case.
///
/// # Errors
/// `X070` there is no such campaign.
pub(super) fn newest(history: &History) -> Result<String, Diagnostics> {
    let shrunk = history.selected_campaigns()?;
    let mut ids = history.campaigns()?.into_iter().map(|row| row.id).rev();
    ids.find(|id| !shrunk.contains(id)).ok_or_else(|| {
        Diagnostic::error(
            "X070",
            format!("the history `{}` has no campaign", history.dir().display()),
        )
        .help("`actcheck run CONFIG` creates one")
        .into()
    })
}

/// Replaces the campaign's own rules by those of later judgements.
fn judged_by(
    record: &mut CampaignRecord,
    rules: &BTreeMap<String, std::collections::BTreeSet<String>>,
) {
    for (property, digests) in rules {
        let digest = digests.iter().cloned().collect::<Vec<_>>().join(" and ");
        match record
            .rules
            .iter_mut()
            .find(|(known, ..)| known == property)
        {
            Some((_, _, known)) => *known = digest,
            None => record
                .rules
                .push((property.clone(), property.clone(), digest)),
        }
    }
}

fn nothing_shared(first: &Side, second: &Side, comparison: &Comparison) -> Diagnostic {
    let message = format!(
        "`{}` and `{}` have no scene in common",
        first.name, second.name
    );
    let fault = Diagnostic::error("X071", message);
    let [a, b] = [&first.record, &second.record];
    fault.help(if first.count == 0 || second.count == 0 {
        let empty = if first.count == 0 { first } else { second };
        format!("`{}` has no runs", empty.name)
    } else if a.seed != b.seed {
        format!("their seeds differ: {} and {}; run both with the same `--seed`", a.seed, b.seed)
    } else if comparison.other_scene.is_empty() {
        "they have no run numbers in common".to_owned()
    } else {
        "scenes are the same if seed, tests, objects and surfaces of the configurations are; sensing, skill, robot and rules may differ"
            .to_owned()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_side_is_named_by_history_campaign_and_judgements() {
        let name = |dir, campaign, rechecked| Name {
            dir,
            campaign,
            rechecked,
        };
        assert_eq!(Name::read("k7f3"), name(None, Some("k7f3"), false));
        assert_eq!(Name::read("k7f3@rechecked"), name(None, Some("k7f3"), true));
        assert_eq!(
            Name::read("old/.actcheck#k7f3"),
            name(Some(Path::new("old/.actcheck")), Some("k7f3"), false)
        );
        assert_eq!(
            Name::read("a#b#k7f3"),
            name(Some(Path::new("a#b")), Some("k7f3"), false)
        );
        // The tests run in the folder of the crate, which has a folder of this name.
        assert_eq!(
            Name::read("shipped@rechecked"),
            name(Some(Path::new("shipped")), None, true)
        );
        assert_eq!(
            Name::read("nowhere#"),
            name(Some(Path::new("nowhere")), None, false)
        );
    }
}
