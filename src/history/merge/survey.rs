//! The content of a history, as far as merging needs it.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use crate::campaign::RunAt;
use crate::campaign_state::CampaignState;
use crate::segment::LaterJudgement;
use crate::{CampaignRecord, CampaignRow, History, RunStatus};
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
    pub(super) state: Arc<CampaignState>,
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
    /// RFC 3339.
    pub(super) started: String,
    pub(super) score: f64,
    pub(super) status: RunStatus,
    /// Digest over everything that must be the same on every machine.
    pub(super) content: String,
    pub(super) counts: Counts,
    pub(super) discards: u64,
    /// The judgements made after the run, each as one text.
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
            record.imported_from.as_ref().unwrap_or(&String::new()),
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
    let mut all = Vec::new();
    for state in history.stored.states()? {
        let id = state.record.id.clone();
        let of_campaign = history.stored.runs_of(&id)?;
        let mut later: BTreeMap<u64, BTreeSet<String>> = BTreeMap::new();
        for judgement in &of_campaign.later {
            let texts = later.entry(judgement.index).or_default();
            texts.insert(identity(judgement));
        }
        let run = |run: RunAt<'_>| {
            let row = run.row;
            let outcomes = row.outcomes.iter().map(|own| own.outcome);
            let found = FoundRun {
                started: row.started.as_ref().to_owned(),
                score: row.score,
                status: row.status,
                content: content(run),
                counts: Counts::of(outcomes),
                discards: row.discards.into(),
                later: later.remove(&row.index).unwrap_or_default(),
            };
            (row.index, found)
        };
        let runs: BTreeMap<u64, FoundRun> = of_campaign.iter().map(run).collect();
        all.push(Found {
            source,
            dir: history.dir().display().to_string(),
            record: state.record.clone(),
            row: CampaignRow::of(&state, runs.len() as u64),
            first_id: state.first_id.clone().unwrap_or_else(|| id.clone()),
            shrunk: shrunk.contains(&id),
            runs,
            state,
        });
    }
    Ok(all)
}

/// A later judgement as a text: equal for copies of the same one.
pub(super) fn identity(later: &LaterJudgement) -> String {
    let judgement = &later.judgement;
    let (property, outcome, rule) = (
        &judgement.property,
        judgement.outcome.word(),
        &judgement.rule_digest,
    );
    format!("{} {property} {} {outcome} {rule}", later.step, later.at)
}

/// Digest of a run and its outcomes, without times and ids.
fn content(run: RunAt<'_>) -> String {
    let RunAt { segment, row } = run;
    let mut digest = Digest::new();
    for text in [
        &*segment.text(row.test),
        row.status.word(),
        &row.trace_hash(),
    ] {
        digest.update(text.as_bytes());
    }
    digest.update(&row.score.to_bits().to_le_bytes());
    let mut outcomes: Vec<_> = row
        .outcomes
        .iter()
        .map(|own| (own.action, segment.text(own.property), own))
        .collect();
    outcomes.sort_by(|a, b| (a.0, &a.1).cmp(&(b.0, &b.1)));
    for (action, property, own) in outcomes {
        digest.update(&action.to_le_bytes());
        let number = row.actions.get(action as usize).copied().flatten();
        let action = number.map(|number| segment.text(number));
        for text in [
            action.as_deref().unwrap_or_default(),
            &*property,
            own.outcome.word(),
        ] {
            digest.update(text.as_bytes());
        }
        digest.update(&own.margin.map_or(0, f64::to_bits).to_le_bytes());
    }
    digest.finish()
}
