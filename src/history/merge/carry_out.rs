//! Carries out a plan: writes each campaign without its end, then its runs, then its end.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::campaign::CampaignRuns;
use crate::campaign_state::CampaignState;
use crate::ids::{place_of, run_id};
use crate::merge::plan::{MergePlan, PlannedEnd, PlannedMerge};
use crate::merge::survey::identity;
use crate::segment::{LaterJudgement, RunContent, Segment, SegmentColumn, copy_column};
use crate::writers::next_segment;
use crate::{FAILED_AGAIN, History, RELATED, RelatedPair, fault};
use actcheck_base::Diagnostics;

/// The result of a merge.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Merged {
    /// Number of added runs.
    pub runs: u64,
    /// Whether the merge was stopped before everything was written.
    pub interrupted: bool,
}

/// Writes a plan into a history, and calls `on_run` after each added run.
///
/// If it ends early, the destination is consistent: an incomplete campaign has no end yet, and
/// merging again completes it.
///
/// # Errors
/// A history can't be read, or the destination can't be written.
pub fn carry_out(
    plan: &MergePlan,
    sources: &[History],
    into: &History,
    stop: &AtomicBool,
    mut on_run: impl FnMut(),
) -> Result<Merged, Diagnostics> {
    let new_ids = (0..sources.len()).map(|source| {
        let of_source = plan.ids.iter().filter(|((of, _), _)| *of == source);
        NewIds(
            of_source
                .map(|((_, old), new)| (old.clone(), new.clone()))
                .collect(),
        )
    });
    let mut writer = Writer {
        sources,
        new_ids: new_ids.collect(),
        into,
        merged: Merged::default(),
    };
    for campaign in &plan.campaigns {
        writer.begin(campaign)?;
        if !writer.add_runs(campaign, stop, &mut on_run)? {
            writer.merged.interrupted = true;
            into.segments.close(&into.stored.folder, &campaign.id)?;
            return Ok(writer.merged);
        }
        writer.add_judgements(campaign)?;
        into.segments.close(&into.stored.folder, &campaign.id)?;
        writer.end(campaign)?;
    }
    writer.add_companions()?;
    Ok(writer.merged)
}

/// New ids of the campaigns of a history by their old ones, also unchanged ones.
struct NewIds(BTreeMap<String, String>);

impl NewIds {
    /// The new id of a run. Returns `None` if it does not change.
    fn of_run(&self, id: &str) -> Option<String> {
        let (campaign, index) = place_of(id)?;
        let new = self.0.get(campaign).filter(|new| *new != campaign)?;
        Some(run_id(new, index))
    }

    /// The new name of a campaign, which may end in the id of a shrunk run, or of a campaign whose
    /// failed runs were run again.
    fn of_name(&self, name: &str) -> String {
        for prefix in [FAILED_AGAIN, RELATED] {
            if let Some(new) = name.strip_prefix(prefix).and_then(|old| self.0.get(old)) {
                return format!("{prefix}{new}");
            }
        }
        let renamed = name
            .rsplit_once(' ')
            .and_then(|(words, run)| Some(format!("{words} {}", self.of_run(run)?)));
        renamed.unwrap_or_else(|| name.to_owned())
    }
}

struct Writer<'a> {
    sources: &'a [History],
    new_ids: Vec<NewIds>,
    into: &'a History,
    merged: Merged,
}

impl Writer<'_> {
    /// Adds the files about the campaigns: cross-checks and pairs of runs. Those of the destination
    /// stay.
    fn add_companions(&self) -> Result<(), Diagnostics> {
        for (source, ids) in self.sources.iter().zip(&self.new_ids) {
            let of_run = |run: &str| ids.of_run(run).unwrap_or_else(|| run.to_owned());
            for (old, new) in &ids.0 {
                if let Some(mut check) = source.cross_check(old)? {
                    check.campaign.clone_from(new);
                    check.imported = check
                        .imported
                        .map(|id| ids.0.get(&id).cloned().unwrap_or(id));
                    let runs = std::mem::take(&mut check.runs).into_iter();
                    check.runs = runs.map(|(run, flips)| (of_run(&run), flips)).collect();
                    if let Some(known) = self.into.cross_check(new)? {
                        check.runs.extend(known.runs);
                    }
                    self.into.store_cross_check(&check)?;
                }
                if let Some(mut related) = source.related(old)? {
                    related.campaign.clone_from(new);
                    for pair in &mut related.pairs {
                        pair.run = of_run(&pair.run);
                        pair.second = pair.second.as_deref().map(of_run);
                    }
                    if let Some(known) = self.into.related(new)? {
                        let is_known = |pair: &RelatedPair| {
                            let mut pairs = known.pairs.iter();
                            pairs.any(|other| {
                                (&other.run, &other.relation) == (&pair.run, &pair.relation)
                            })
                        };
                        related.pairs.retain(|pair| !is_known(pair));
                        related.pairs.extend(known.pairs);
                    }
                    self.into.store_related(&related)?;
                }
            }
        }
        Ok(())
    }

    /// Writes a campaign without its end, so that readers see it as unfinished.
    fn begin(&self, campaign: &PlannedMerge) -> Result<(), Diagnostics> {
        let work = &campaign.work;
        let (source, copied) = &work.record;
        let mut state = match self.into.stored.state_of(&campaign.id)? {
            Some(known) => (*known).clone(),
            None => CampaignState {
                number: self.into.stored.ids()?.len() as u64,
                segments: BTreeMap::new(),
                ..copied.clone()
            },
        };
        if let Some(source) = source {
            let record = &mut state.record;
            record.clone_from(&copied.record);
            record.id.clone_from(&campaign.id);
            record.name = self.new_ids[*source].of_name(&record.name);
            record.config_path = relative_path_from(
                &record.config_path,
                self.sources[*source].dir(),
                self.into.dir(),
            );
            let is_renamed = copied.record.id != campaign.id && !campaign.joined;
            state.first_id = copied
                .first_id
                .clone()
                .or_else(|| is_renamed.then(|| copied.record.id.clone()));
        }
        state.record.shards.clone_from(&work.shards);
        state.record.started.clone_from(&work.started);
        if !matches!(work.end, PlannedEnd::Same) || source.is_some() {
            state.end = None;
        }
        self.into.write_state(&state)
    }

    /// Adds the runs of a campaign. Returns whether it was not stopped.
    fn add_runs(
        &mut self,
        campaign: &PlannedMerge,
        stop: &AtomicBool,
        on_run: &mut impl FnMut(),
    ) -> Result<bool, Diagnostics> {
        let wanted = &campaign.work.runs;
        let origins: BTreeSet<&(usize, String)> = wanted.values().collect();
        for origin in origins {
            let (source, id) = (origin.0, &origin.1);
            let runs = self.sources[source].stored.runs_of(id)?;
            let is_wanted = |index: u64| wanted.get(&index) == Some(origin);
            for segment in &runs.segments {
                if stop.load(Ordering::Relaxed) {
                    return Ok(false);
                }
                let mut rows = segment.rows().iter();
                if rows.all(|row| is_wanted(row.index))
                    && self.copy_segment(source, campaign, &runs, segment)?
                {
                    self.merged.runs += segment.rows().len() as u64;
                    segment.rows().iter().for_each(|_| on_run());
                    continue;
                }
                let is_first = |index: u64| {
                    let first = runs.find(index);
                    first.is_some_and(|run| run.segment.number() == segment.number())
                };
                for row in segment.rows() {
                    if !(is_wanted(row.index) && is_first(row.index)) {
                        continue;
                    }
                    if stop.load(Ordering::Relaxed) {
                        return Ok(false);
                    }
                    self.add_run(source, campaign, &runs, row.index)?;
                    on_run();
                }
            }
        }
        Ok(true)
    }

    /// Copies the files of a segment, if that is possible: its runs need no new values.
    fn copy_segment(
        &self,
        source: usize,
        campaign: &PlannedMerge,
        runs: &CampaignRuns,
        segment: &Segment,
    ) -> Result<bool, Diagnostics> {
        let history = &self.sources[source];
        let has_twice = || {
            let mut rows = segment.rows().iter();
            rows.any(|row| {
                let first = runs.find(row.index);
                first.is_none_or(|run| !std::ptr::eq(run.row, row))
            })
        };
        let is_shrunk = || segment.rows().iter().any(|row| row.is_shrunk);
        if history.stored.is_salvaged() || segment.rows().is_empty() || is_shrunk() || has_twice() {
            return Ok(false);
        }
        let (from, to) = (
            history.stored.folder.below(),
            self.into.stored.folder.below(),
        );
        let folder = self.into.stored.folder.campaign(&campaign.id);
        let number = next_segment(&self.into.stored.folder, &campaign.id)?;
        let unwritten = |error| fault::io(self.into.dir(), "writing merged data", &error);
        let mut files = Vec::new();
        for column in SegmentColumn::OF_RUNS {
            let Some(end) = segment.end_of(column) else {
                continue;
            };
            let old = segment.file(column);
            let new = folder.join(format!("{number:04}.{}", column.extension()));
            let new = to.new_file(&new).map_err(unwritten)?;
            let writer = new.writer().map_err(unwritten)?;
            copy_column(&from, &old, column, end, writer)
                .map_err(|why| fault::segment(history.dir(), &old, &why))?
                .map_err(unwritten)?;
            files.push(new);
        }
        // The column of runs comes last. A kill while these were written would leave many runs
        // without a row.
        for file in files {
            file.finish().map_err(unwritten)?;
        }
        Ok(true)
    }

    fn add_run(
        &mut self,
        source: usize,
        campaign: &PlannedMerge,
        runs: &CampaignRuns,
        index: u64,
    ) -> Result<(), Diagnostics> {
        let Some(run) = runs.find(index) else {
            return Ok(());
        };
        let history = &self.sources[source];
        let id = run_id(&runs.id, index);
        let unread =
            |column| move |why| fault::run(history.dir(), &id, &run.segment.file(column), &why);
        let mut stored = run
            .segment
            .run(run.row)
            .map_err(unread.clone()(SegmentColumn::Details))?;
        if let Some(from) = &mut stored.shrunk_from
            && let Some(new) = self.new_ids[source].of_run(from)
        {
            *from = new;
        }
        let states = run
            .segment
            .states(run.row)
            .map_err(unread.clone()(SegmentColumn::States))?;
        let motion = run
            .segment
            .packed_motion(run.row)
            .map_err(unread(SegmentColumn::Motion))?;
        let doing = format!("writing run {}", run_id(&campaign.id, index));
        let into = &self.into.stored.folder;
        self.into
            .segments
            .with_segment(into, &campaign.id, &doing, |segment| {
                segment.append(&RunContent {
                    run: &stored,
                    states: &states,
                    motion: motion.as_deref(),
                })
            })?;
        self.merged.runs += 1;
        Ok(())
    }

    /// Adds the later judgements of runs that the destination lacks, in the order in which they
    /// were made.
    fn add_judgements(&self, campaign: &PlannedMerge) -> Result<(), Diagnostics> {
        let known = self.into.stored.runs_of(&campaign.id)?;
        let known: BTreeSet<(u64, String)> = known
            .later
            .iter()
            .map(|later| (later.index, identity(later)))
            .collect();
        let work = &campaign.work;
        let origins: BTreeSet<&(usize, String)> =
            work.runs.values().chain(work.judgements.values()).collect();
        for origin in origins {
            let runs = self.sources[origin.0].stored.runs_of(&origin.1)?;
            let is_new = |later: &&LaterJudgement| {
                let of_run = [&work.runs, &work.judgements];
                of_run
                    .iter()
                    .any(|runs| runs.get(&later.index) == Some(origin))
                    && !known.contains(&(later.index, identity(later)))
            };
            let new: Vec<LaterJudgement> = runs.later.iter().filter(is_new).cloned().collect();
            if !new.is_empty() {
                let into = &self.into.stored.folder;
                self.into
                    .segments
                    .with_judgements(into, &campaign.id, |column| column.append(&new))?;
            }
        }
        Ok(())
    }

    fn end(&self, campaign: &PlannedMerge) -> Result<(), Diagnostics> {
        self.into.change_state(&campaign.id, |state| {
            if let PlannedEnd::New(end) = &campaign.work.end {
                state.end = end.as_deref().cloned();
            }
        })
    }
}

/// Converts a path relative to one folder into a path relative to another. Returns it unchanged if
/// the file does not exist.
fn relative_path_from(path: &str, from: &Path, to: &Path) -> String {
    let absolute = std::fs::canonicalize(from.join(path)).ok();
    let seen = absolute
        .zip(std::fs::canonicalize(to).ok())
        .and_then(|(path, to)| pathdiff::diff_paths(path, to));
    seen.map_or_else(|| path.to_owned(), |path| path.display().to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_campaign_with_the_id_is_renamed() {
        let ids = NewIds(BTreeMap::from([
            ("k".to_owned(), "m".to_owned()),
            ("a".to_owned(), "a".to_owned()),
        ]));
        assert_eq!(ids.of_run("k-12"), Some("m-12".to_owned()));
        assert_eq!(ids.of_run("kk-1"), None);
        assert_eq!(ids.of_run("a-1"), None);
        assert_eq!(ids.of_name("shrunk k-3"), "shrunk m-3");
        assert_eq!(ids.of_name("failed runs of k"), "failed runs of m");
        assert_eq!(ids.of_name("pick"), "pick");
    }
}
