//! Plans the content of the destination, and checks it for conflicts.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

use crate::campaign_state::CampaignState;
use crate::ids::campaign_id;
use crate::merge::conflict;
use crate::merge::survey::{Found, FoundRun, survey};
use crate::{CampaignEnd, History, RunStatus};
use actcheck_base::{Diagnostic, Diagnostics, Outcome, Shard, did_you_mean};
use actcheck_verdict::{Counts, mean};

/// Options of a merge.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct MergeOptions {
    /// Whether a campaign gets a new id if another one has its id. If `false`, the duplicate id is
    /// a fault.
    pub rename: bool,
    /// Campaigns to leave out: `ID`, or `DIR#ID`.
    pub leave_out: Vec<String>,
}

/// A merge without conflicts, ready to be written.
#[derive(Debug, Clone)]
pub struct MergePlan {
    /// Sorted by start, then by id.
    pub campaigns: Vec<PlannedMerge>,
    /// New ids of campaigns by history and old id, including unchanged ids.
    pub(super) ids: BTreeMap<(usize, String), String>,
}

impl MergePlan {
    /// The campaigns of a history, given by its position among the sources, that keep their ids.
    pub fn kept_ids(&self, source: usize) -> impl Iterator<Item = &str> {
        let is_kept =
            move |((of, old), new): &(&(usize, String), &String)| *of == source && old == *new;
        self.ids.iter().filter(is_kept).map(|(_, new)| new.as_str())
    }
}

/// One campaign of the destination.
#[derive(Debug, Clone)]
pub struct PlannedMerge {
    /// Its id in the destination.
    pub id: String,
    /// Name of its configuration.
    pub name: String,
    /// Its sources: `DIR#ID`.
    pub from: Vec<String>,
    /// Whether it consists of parts.
    pub joined: bool,
    /// Number of runs after the merge.
    pub runs: u64,
    /// Number of runs that the destination does not have yet.
    pub added: u64,
    /// Number of planned runs.
    pub planned: u64,
    /// Indices of the runs that no part has; empty if the campaign was run as a whole.
    pub missing: Vec<u64>,
    pub(super) work: Work,
}

/// The writes for one campaign.
#[derive(Debug, Clone)]
pub(super) struct Work {
    /// The campaign whose record is copied.
    pub(super) record: (Option<usize>, CampaignState),
    /// Parts that the campaign consists of.
    pub(super) shards: Vec<Shard>,
    /// Start of the first part.
    pub(super) started: String,
    /// Source history and campaign of each run to copy, by index.
    pub(super) runs: BTreeMap<u64, (usize, String)>,
    /// Source history and campaign of each run of which only later judgements are new, by index.
    pub(super) judgements: BTreeMap<u64, (usize, String)>,
    pub(super) end: PlannedEnd,
}

/// The end of a campaign.
#[derive(Debug, Clone)]
pub(super) enum PlannedEnd {
    /// Unchanged, or missing.
    Same,
    /// Copied, or computed from the parts.
    New(Option<Box<CampaignEnd>>),
}

/// Reads all histories and plans their merge into another one. Writes nothing.
///
/// # Errors
/// `H020` results differ, `H021` parts were made differently, `H022` an id is taken, `H023` parts
/// are in the destination, `H024` later judgements differ, `H025` a campaign to leave out does not
/// exist; all faults at once.
pub fn plan(
    sources: &[History],
    into: Option<&History>,
    options: &MergeOptions,
) -> Result<MergePlan, Diagnostics> {
    let mut found = Vec::new();
    for (number, source) in sources.iter().enumerate() {
        found.extend(survey(source, Some(number))?);
    }
    let found = without(found, &options.leave_out)?;
    let own = into
        .map(|history| survey(history, None))
        .transpose()?
        .unwrap_or_default();
    let all: Vec<Found> = own.into_iter().chain(found).collect();
    let mut faults = check_parts(&all);
    let groups = groups(&all);
    for group in &groups {
        check_group(group, &mut faults);
    }
    let ids = choose_ids(&groups, options.rename, &mut faults);
    faults.or(())?;
    let mut campaigns: Vec<(String, PlannedMerge)> = groups
        .iter()
        .zip(ids)
        .map(|(group, id)| (started(group), planned(group, id)))
        .collect();
    campaigns.sort_by(|a, b| (&a.0, &a.1.id).cmp(&(&b.0, &b.1.id)));
    let campaigns: Vec<PlannedMerge> = campaigns
        .into_iter()
        .map(|(_, campaign)| campaign)
        .collect();
    Ok(MergePlan {
        ids: new_ids(&groups, &campaigns),
        campaigns,
    })
}

/// Removes the campaigns to leave out.
fn without(found: Vec<Found>, names: &[String]) -> Result<Vec<Found>, Diagnostics> {
    let known: Vec<String> = found
        .iter()
        .flat_map(|found| [found.record.id.clone(), found.name()])
        .collect();
    let mut faults = Diagnostics::new();
    for name in names.iter().filter(|name| !known.contains(name)) {
        let fault = Diagnostic::error(
            "H025",
            format!("none of the histories has a campaign `{name}` to leave out"),
        );
        faults.push(fault.help(did_you_mean(name, known.iter().map(String::as_str))));
    }
    let kept = found
        .into_iter()
        .filter(|found| !names.contains(&found.record.id) && !names.contains(&found.name()));
    faults.or(kept.collect())
}

/// Checks that parts with the same configuration, seed and number of runs were made with the same
/// program, ontology, rules and models.
fn check_parts(all: &[Found]) -> Diagnostics {
    let mut first_of: BTreeMap<(&str, u64, u64), &Found> = BTreeMap::new();
    let mut faults = Diagnostics::new();
    for found in all.iter().filter(|found| !found.record.shards.is_empty()) {
        let record = &found.record;
        let first = first_of
            .entry((&record.config_digest, record.seed, record.planned_runs))
            .or_insert(found);
        if first.inputs_digest() != found.inputs_digest() {
            faults.push(conflict::other_ingredients(first, found));
        }
    }
    faults
}

/// The identity of a campaign: equal for copies and parts of the same one.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
enum Identity {
    /// Part of the campaign with this digest.
    Parts(String),
    /// A whole campaign, or a regression of a project, which occurs in each of the project's
    /// histories.
    Whole {
        first_id: String,
        whole: String,
        /// The contents of its runs, if only they distinguish it.
        content: Option<String>,
    },
}

fn identity(found: &Found, all: &[Found]) -> Identity {
    if !found.record.shards.is_empty() {
        return Identity::Parts(found.inputs_digest());
    }
    Identity::Whole {
        first_id: found.first_id.clone(),
        whole: found.inputs_digest(),
        content: if found.shrunk {
            // Shrunk runs of several parts can have the same id.
            Some(content(found))
        } else if found.record.imported_from.is_some() {
            // So can imports of different episodes by one mapping.
            Some(content(complete_copy(found, all)))
        } else {
            None
        },
    }
}

/// The contents of all its runs.
fn content(found: &Found) -> String {
    let runs = found.runs.values();
    runs.map(|run| run.content.as_str()).collect()
}

/// The campaign with the most runs, of those that have all runs of an imported one.
fn complete_copy<'a>(found: &'a Found, all: &'a [Found]) -> &'a Found {
    let has_all = |other: &&Found| {
        let has = |(index, run): (&u64, &FoundRun)| {
            let other = other.runs.get(index);
            other.is_some_and(|other| other.content == run.content)
        };
        found.inputs_digest() == other.inputs_digest() && found.runs.iter().all(has)
    };
    all.iter()
        .filter(has_all)
        .max_by_key(|other| (other.runs.len(), content(other)))
        .unwrap_or(found)
}

/// Groups campaigns by identity; those of the destination first, then by start, id and folder.
fn groups(all: &[Found]) -> Vec<Vec<&Found>> {
    let mut groups: BTreeMap<Identity, Vec<&Found>> = BTreeMap::new();
    for found in all {
        groups.entry(identity(found, all)).or_default().push(found);
    }
    let mut groups: Vec<Vec<&Found>> = groups.into_values().collect();
    for group in &mut groups {
        group.sort_by(|a, b| order(a).cmp(&order(b)));
    }
    groups.sort_by(|a, b| order(a[0]).cmp(&order(b[0])));
    groups
}

fn order(found: &Found) -> (bool, &str, &str, &str) {
    (
        found.source.is_some(),
        &found.record.started,
        &found.record.id,
        &found.dir,
    )
}

fn check_group(group: &[&Found], faults: &mut Diagnostics) {
    let own: Vec<&Found> = group
        .iter()
        .copied()
        .filter(|found| found.source.is_none())
        .collect();
    if own.len() > 1 {
        faults.push(conflict::parts_in_place(&own));
    }
    for (at, first) in group.iter().enumerate() {
        for second in &group[at + 1..] {
            let both = || {
                first
                    .runs
                    .iter()
                    .filter_map(|(index, run)| Some((*index, run, second.runs.get(index)?)))
            };
            let differing: Vec<u64> = both()
                .filter(|(_, a, b)| a.content != b.content)
                .map(|(index, ..)| index)
                .collect();
            if !differing.is_empty() {
                faults.push(conflict::other_results(first, second, &differing));
                continue;
            }
            let apart =
                |a: &BTreeSet<String>, b: &BTreeSet<String>| !a.is_subset(b) && !b.is_subset(a);
            let judged: Vec<u64> = both()
                .filter(|(_, a, b)| apart(&a.later, &b.later))
                .map(|(index, ..)| index)
                .collect();
            if !judged.is_empty() {
                faults.push(conflict::other_judgements(first, second, &judged));
            }
        }
    }
}

/// Chooses an id for each group: its own if that is free.
fn choose_ids(groups: &[Vec<&Found>], rename: bool, faults: &mut Diagnostics) -> Vec<String> {
    let everywhere: BTreeSet<&str> = groups
        .iter()
        .flatten()
        .map(|found| found.record.id.as_str())
        .collect();
    let mut taken: BTreeMap<String, &Found> = BTreeMap::new();
    let mut ids = Vec::new();
    for group in groups {
        let found = group[0];
        let id = match taken.get(&found.record.id) {
            None => found.record.id.clone(),
            Some(first) => {
                // Shrunk runs may be renamed freely: parts that were shrunk separately get the same
                // ids.
                if !rename && !found.shrunk && !asked_alike(first, found) {
                    faults.push(conflict::id_taken(first, found));
                }
                free_id(found, |id| {
                    everywhere.contains(id) || taken.contains_key(id)
                })
            }
        };
        taken.insert(id.clone(), found);
        ids.push(id);
    }
    ids
}

/// Whether two parts should be one campaign. If they are not, H021 has already been reported.
fn asked_alike(first: &Found, second: &Found) -> bool {
    let asked = |found: &Found| {
        (
            found.record.config_digest.clone(),
            found.record.seed,
            found.record.planned_runs,
        )
    };
    let parts = |found: &Found| !found.record.shards.is_empty();
    parts(first) && parts(second) && asked(first) == asked(second)
}

fn free_id(found: &Found, taken: impl Fn(&str) -> bool) -> String {
    let record = &found.record;
    let mut ids =
        (0..1_000_000).map(|counter| campaign_id(&record.config_digest, record.seed, counter));
    ids.find(|id| !taken(id))
        .unwrap_or_else(|| record.config_digest.clone())
}

fn new_ids(
    groups: &[Vec<&Found>],
    campaigns: &[PlannedMerge],
) -> BTreeMap<(usize, String), String> {
    let of_name: BTreeMap<&String, &String> = campaigns
        .iter()
        .flat_map(|campaign| campaign.from.iter().map(|name| (name, &campaign.id)))
        .collect();
    let ids = groups.iter().flatten().filter_map(|found| {
        Some((
            (found.source?, found.record.id.clone()),
            (*of_name.get(&found.name())?).clone(),
        ))
    });
    ids.collect()
}

fn started(group: &[&Found]) -> String {
    group
        .iter()
        .map(|found| found.record.started.clone())
        .min()
        .unwrap_or_default()
}

/// A run with its campaign.
type Copy<'a> = (&'a Found, &'a FoundRun);

/// Plans the merge of a group.
fn planned(group: &[&Found], id: String) -> PlannedMerge {
    let own = group.iter().copied().find(|found| found.source.is_none());
    let first = group[0];
    let best = best_copies(group);
    let joined = !first.record.shards.is_empty();
    let missing: Vec<u64> = match joined {
        true => (0..first.record.planned_runs)
            .filter(|index| !best.contains_key(index))
            .collect(),
        false => Vec::new(),
    };
    let runs = copies(&best, |index, _| {
        own.is_none_or(|own| !own.runs.contains_key(&index))
    });
    let judgements = copies(&best, |index, run| {
        own.and_then(|own| own.runs.get(&index))
            .is_some_and(|known| known.later.len() < run.later.len())
    });
    let end = if joined {
        end_of_parts(group, &best, &missing, !runs.is_empty())
    } else {
        end_of_copies(group)
    };
    PlannedMerge {
        id,
        name: first.record.name.clone(),
        from: group.iter().map(|found| found.name()).collect(),
        joined,
        runs: best.len() as u64,
        added: runs.len() as u64,
        planned: first.record.planned_runs,
        missing,
        work: Work {
            record: (first.source, (*first.state).clone()),
            shards: all_shards(group),
            started: own.map_or_else(|| started(group), |own| own.record.started.clone()),
            runs,
            judgements,
            end,
        },
    }
}

/// Chooses a copy of each run: the one with the most later judgements, then the one that started
/// first. The order of histories does not matter.
fn best_copies<'a>(group: &[&'a Found]) -> BTreeMap<u64, Copy<'a>> {
    let mut best: BTreeMap<u64, Copy<'a>> = BTreeMap::new();
    // The destination's copy comes first, and is kept unless another is better.
    for found in group {
        for (index, run) in &found.runs {
            let rank = |run: &FoundRun| (Reverse(run.later.len()), run.started.clone());
            let better = best
                .get(index)
                .is_none_or(|(_, known)| rank(run) < rank(known));
            if better {
                best.insert(*index, (found, run));
            }
        }
    }
    best
}

/// Source history and campaign of each wanted run, by index. Excludes runs of the destination.
fn copies(
    best: &BTreeMap<u64, Copy<'_>>,
    wanted: impl Fn(u64, &FoundRun) -> bool,
) -> BTreeMap<u64, (usize, String)> {
    let wanted = best.iter().filter(|(index, (_, run))| wanted(**index, run));
    wanted
        .filter_map(|(index, (found, _))| Some((*index, (found.source?, found.record.id.clone()))))
        .collect()
}

/// The parts of which the group consists, sorted.
fn all_shards(group: &[&Found]) -> Vec<Shard> {
    let all: BTreeSet<Shard> = group
        .iter()
        .flat_map(|found| found.record.shards.iter().copied())
        .collect();
    all.into_iter().collect()
}

/// The end of the most complete copy.
fn end_of_copies(group: &[&Found]) -> PlannedEnd {
    let rank = |found: &&&Found| {
        (
            found.runs.len(),
            found.row.ended.is_some(),
            !found.row.interrupted,
            found.source.is_none(),
        )
    };
    // Among equals, the first wins.
    match group.iter().rev().max_by_key(rank) {
        Some(found) if found.source.is_some() => {
            PlannedEnd::New(found.state.end.clone().map(Box::new))
        }
        _ => PlannedEnd::Same,
    }
}

/// The end of all parts together, as a run of the whole campaign would have written it.
fn end_of_parts(
    group: &[&Found],
    best: &BTreeMap<u64, Copy<'_>>,
    missing: &[u64],
    more: bool,
) -> PlannedEnd {
    let own = group.iter().find(|found| found.source.is_none());
    let Some(ended) = group
        .iter()
        .filter_map(|found| found.row.ended.clone())
        .max()
    else {
        return PlannedEnd::Same;
    };
    if own.is_some_and(|own| own.row.ended.is_some()) && !more {
        return PlannedEnd::Same;
    }
    let runs = || best.values().map(|(_, run)| run);
    let mut counts = Counts::default();
    runs().for_each(|run| counts.add_all(run.counts));
    PlannedEnd::New(Some(Box::new(CampaignEnd {
        ended,
        score: mean(runs().map(|run| run.score)),
        score_without_broken: mean(
            runs()
                .filter(|run| run.status != RunStatus::Broken)
                .map(|run| run.score),
        ),
        outcomes: Outcome::ALL
            .into_iter()
            .map(|outcome| (outcome, counts.get(outcome)))
            .collect(),
        discards: runs().map(|run| run.discards).sum(),
        // A part that failures ended makes the number of all runs depend on outcomes.
        ended_by: group
            .iter()
            .filter_map(|found| found.row.ended_by.clone())
            .find(|budget| budget == "failures"),
        interrupted: !missing.is_empty(),
    })))
}
