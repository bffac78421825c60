//! The content of a history, as far as merging needs it.

use std::collections::{BTreeMap, BTreeSet};

use crate::read::Node;
use crate::write_campaign::campaign_node;
use crate::write_run::run_node;
use crate::{CampaignRecord, CampaignRow, History, OutcomeRow, RunFilter, RunRow, lists};
use actcheck_base::{Diagnostics, Digest};
use actcheck_verdict::Counts;

/// A campaign of one of the histories.
#[derive(Debug, Clone)]
pub(super) struct Found {
    /// Index of its history among the sources; `None` if it is in the destination.
    pub(super) source: Option<usize>,
    /// The folder of its history, as the caller gave it.
    pub(super) dir: String,
    pub(super) record: CampaignRecord,
    pub(super) row: CampaignRow,
    /// Id that it had when it was run.
    pub(super) first_id: String,
    /// Whether its scenes were selected because they fail: it holds a shrunk run, or ran failed
    /// runs again.
    pub(super) shrunk: bool,
    /// Its runs by index.
    pub(super) runs: BTreeMap<u64, FoundRun>,
}

/// A run of one of the histories.
#[derive(Debug, Clone)]
pub(super) struct FoundRun {
    pub(super) row: RunRow,
    /// Digest over everything that must be the same on every machine.
    pub(super) content: String,
    pub(super) counts: Counts,
    pub(super) discards: u64,
    /// The judgements made after the run.
    pub(super) later: BTreeSet<String>,
}

impl Found {
    /// Its name in messages: `DIR#ID`.
    pub(super) fn name(&self) -> String {
        format!("{}#{}", self.dir, self.record.id)
    }

    /// Digest over everything that its results depend on.
    pub(super) fn inputs_digest(&self) -> String {
        let record = &self.record;
        let mut digest = Digest::new();
        let program = [&record.program_version, &record.program_digest];
        for text in [
            &record.config_digest,
            &record.ontology_digest,
            &record.strategy,
        ]
        .into_iter()
        .chain(program)
        {
            digest.update(text.as_bytes());
        }
        for number in [record.seed, record.planned_runs, u64::from(record.repeat)] {
            digest.update(&number.to_le_bytes());
        }
        if let Some(skill) = &record.skill {
            digest.update(skill.command.as_bytes());
            digest.update(skill.digest.as_bytes());
            digest.update(&[u8::from(skill.privileged)]);
        }
        for (name, of) in record
            .rules
            .iter()
            .map(|(property, _, of)| (property, of))
            .chain(
                // Both are sorted.
                record.models.iter().map(|(name, of)| (name, of)),
            )
        {
            digest.update(name.as_bytes());
            digest.update(of.as_bytes());
        }
        digest.finish()
    }
}

/// All campaigns of a history.
///
/// # Errors
/// It can't be read.
pub(super) fn survey(history: &History, source: Option<usize>) -> Result<Vec<Found>, Diagnostics> {
    let shrunk = history.selected_campaigns()?;
    let store = history.store_with(lists::of_later_judgements)?;
    let mut later: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    let mut judgements =
        lists::later_judgements(&store).map_err(|error| history.query_fault(&error))?;
    if history.shelf().exists() {
        judgements.extend(
            lists::later_judgements_alone(&store).map_err(|error| history.query_fault(&error))?,
        );
    }
    for (run, judgement) in judgements {
        later.entry(run).or_default().insert(judgement);
    }
    let mut all = Vec::new();
    for row in history.campaigns()? {
        let node = Node::read(&*store, &campaign_node(&row.id))
            .map_err(|error| history.fault("reading a campaign", &error))?;
        let runs = runs(history, &row.id, &mut later)?;
        all.push(Found {
            source,
            dir: history.dir().display().to_string(),
            record: history.campaign(&row.id)?,
            first_id: node.text("act:firstId").unwrap_or_else(|| row.id.clone()),
            shrunk: shrunk.contains(&row.id),
            runs,
            row,
        });
    }
    Ok(all)
}

fn runs(
    history: &History,
    campaign: &str,
    later: &mut BTreeMap<String, BTreeSet<String>>,
) -> Result<BTreeMap<u64, FoundRun>, Diagnostics> {
    let filter = RunFilter {
        campaign: Some(campaign.to_owned()),
        ..RunFilter::default()
    };
    let mut outcomes: BTreeMap<String, Vec<OutcomeRow>> = BTreeMap::new();
    for row in history.outcomes(&filter)? {
        outcomes.entry(row.run.clone()).or_default().push(row);
    }
    let store = history.store()?;
    let mut runs = BTreeMap::new();
    let mut outlined: BTreeMap<String, u64> = BTreeMap::new();
    history.each_outlined(&filter, &mut |outline| {
        outlined.insert(outline.run(), outline.row.discards.len() as u64);
    })?;
    for row in history.runs(&filter)? {
        let discards = match outlined.get(&row.run) {
            Some(discards) => *discards,
            None => Node::read(&*store, &run_node(&row.run))
                .map_err(|error| history.fault("reading a run", &error))?
                .count("act:discards")
                .unwrap_or_default(),
        };
        let outcomes = outcomes.remove(&row.run).unwrap_or_default();
        let run = FoundRun {
            content: content(&row, &outcomes),
            counts: Counts::of(outcomes.iter().map(|outcome| outcome.outcome)),
            discards,
            later: later.remove(&row.run).unwrap_or_default(),
            row,
        };
        runs.insert(run.row.index, run);
    }
    Ok(runs)
}

/// Digest of a run and its outcomes, without times and ids.
fn content(row: &RunRow, outcomes: &[OutcomeRow]) -> String {
    let mut digest = Digest::new();
    for text in [&row.test, row.status.word(), &row.trace_hash] {
        digest.update(text.as_bytes());
    }
    digest.update(&row.score.to_bits().to_le_bytes());
    for outcome in outcomes {
        digest.update(&outcome.step.to_le_bytes());
        for text in [&outcome.action, &outcome.property, outcome.outcome.word()] {
            digest.update(text.as_bytes());
        }
        digest.update(&outcome.margin.map_or(0, f64::to_bits).to_le_bytes());
    }
    digest.finish()
}
