//! Imports episodes of other simulators and robots as runs, judged by the same rules.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;

use crate::Ending;
use crate::episode::{EpisodeFile, run_of};
use crate::workers::workers;
use actcheck_base::{Diagnostics, Outcome, digest_of, names, program_digest};
use actcheck_history::{CampaignEnd, CampaignRecord, Entry, EpisodeRecord, History, RunRecord};
use actcheck_rules::Budget;
use actcheck_verdict::mean;
use actcheck_world::PHYSICS_VERSION;

/// Episodes that are imported together before they are written. Few enough that an interrupt ends
/// soon.
const BATCH: usize = 64;

/// Options of [`import`].
#[derive(Debug, Clone)]
pub struct ImportOptions {
    /// Workers; they do not change the result.
    pub jobs: usize,
    /// Name of the campaigns.
    pub name: String,
    /// Path of the mapping; empty for a shipped one.
    pub mapping: String,
}

/// The result of [`import`].
#[derive(Debug)]
pub struct ImportEnd {
    /// Why it ended.
    pub ending: Ending,
    /// The campaigns, in the order of their first episodes.
    pub campaigns: Vec<ImportedCampaign>,
    /// Faults of the other episodes, in the order of the files.
    pub faults: Diagnostics,
}

/// A campaign of imported runs.
#[derive(Debug)]
pub struct ImportedCampaign {
    /// Its id.
    pub id: String,
    /// The physics engine with its version, or `an unknown engine`.
    pub engine: String,
    /// Number of runs.
    pub runs: u64,
    /// Number of outcomes of each property.
    pub properties: BTreeMap<String, BTreeMap<Outcome, u64>>,
    /// The mapping's digest.
    mapping: String,
    scores: Vec<f64>,
}

/// Imports episodes into a history as runs: one campaign for each mapping and physics engine, so that
/// no rate mixes engines.
///
/// An episode with a fault is left out and does not stop the others. `open` opens the history, or
/// creates it, for the first episode without a fault: if all have faults, nothing is created or
/// changed. `now` returns the present time as RFC 3339, and `on_run` is called for each stored run.
pub fn import(
    open: impl Fn() -> Result<History, Diagnostics>,
    files: &[EpisodeFile<'_>],
    options: &ImportOptions,
    (now, stop): (fn() -> String, &AtomicBool),
    mut on_run: impl FnMut(),
) -> ImportEnd {
    let mut end = ImportEnd {
        ending: Ending::Finished,
        campaigns: Vec::new(),
        faults: Diagnostics::new(),
    };
    let mut history = Target { open, opened: None };
    let stopped = imported(
        &mut history,
        files,
        options,
        (now, stop),
        &mut on_run,
        &mut end,
    )
    .and_then(|()| finish(&history, &end, now));
    if let Err(faults) = stopped {
        end.ending = Ending::Stopped(faults);
    }
    end
}

/// A history that is opened when it is needed.
struct Target<F> {
    open: F,
    opened: Option<History>,
}

impl<F: Fn() -> Result<History, Diagnostics>> Target<F> {
    fn history(&mut self) -> Result<&History, Diagnostics> {
        match &mut self.opened {
            Some(history) => Ok(history),
            none => Ok(none.insert((self.open)()?)),
        }
    }
}

/// Imports episodes, batch by batch.
fn imported(
    history: &mut Target<impl Fn() -> Result<History, Diagnostics>>,
    files: &[EpisodeFile<'_>],
    options: &ImportOptions,
    (now, stop): (fn() -> String, &AtomicBool),
    on_run: &mut impl FnMut(),
    end: &mut ImportEnd,
) -> Result<(), Diagnostics> {
    let pool = workers(options.jobs)?;
    let budget = Budget::default();
    for batch in files.chunks(BATCH) {
        if stop.load(Ordering::Relaxed) {
            end.ending = Ending::Interrupted;
            break;
        }
        let made: Vec<Result<RunRecord, Diagnostics>> = pool.install(|| {
            batch
                .par_iter()
                .map(|file| run_of(file, &now(), &budget))
                .collect()
        });
        for (file, made) in batch.iter().zip(made) {
            let mut record = match made {
                Ok(record) => record,
                Err(faults) => {
                    end.faults.extend(faults);
                    continue;
                }
            };
            let engine = engine(record.episode.as_ref());
            let mapping = digest_of(&file.mapping.source.text);
            let known = end
                .campaigns
                .iter()
                .position(|campaign| campaign.engine == engine && campaign.mapping == mapping);
            let number = match known {
                Some(number) => number,
                None => {
                    let planned = files
                        .iter()
                        .filter(|other| other.mapping.source.text == file.mapping.source.text)
                        .count();
                    let begun = begin(history.history()?, file, planned, engine, options, now)?;
                    end.campaigns.push(begun);
                    end.campaigns.len() - 1
                }
            };
            let campaign = &mut end.campaigns[number];
            record.index = campaign.runs;
            record.id = format!("{}-{}", campaign.id, campaign.runs + 1);
            record.campaign.clone_from(&campaign.id);
            history.history()?.write(&Entry::whole(&record)?)?;
            campaign.add(&record);
            on_run();
        }
    }
    Ok(())
}

/// The physics engine of an episode, with its version.
fn engine(episode: Option<&EpisodeRecord>) -> String {
    let about = |name: &str| episode?.about.get(name).filter(|text| !text.is_empty());
    let stated: Vec<&str> = [about("engine"), about("engine_version")]
        .into_iter()
        .flatten()
        .map(String::as_str)
        .collect();
    if stated.is_empty() {
        "an unknown engine".to_owned()
    } else {
        stated.join(" ")
    }
}

/// Begins the campaign of an episode. `planned` is the number of episodes with its mapping, of all
/// engines: which engine an episode has is known when it is read.
fn begin(
    history: &History,
    file: &EpisodeFile<'_>,
    planned: usize,
    engine: String,
    options: &ImportOptions,
    now: fn() -> String,
) -> Result<ImportedCampaign, Diagnostics> {
    let text = &*file.mapping.source.text;
    let digest = digest_of(text);
    let id = history.next_campaign_id(&digest, 0)?;
    history.begin_campaign(&CampaignRecord {
        id: id.clone(),
        name: options.name.clone(),
        config_text: text.to_owned(),
        config_digest: digest.clone(),
        config_path: options.mapping.clone(),
        ontology_digest: file.rules.ontology.digest.clone(),
        rules: file.rules.recorded(),
        findings: Vec::new(),
        models: Vec::new(),
        skill: None,
        seed: 0,
        planned_runs: planned as u64,
        repeat: 1,
        time_secs: None,
        until_width: None,
        max_failures: None,
        shards: Vec::new(),
        strategy: "imported".to_owned(),
        started: now(),
        program_version: env!("CARGO_PKG_VERSION").to_owned(),
        program_digest: program_digest().to_owned(),
        physics: PHYSICS_VERSION,
        imported_from: Some(engine.clone()),
    })?;
    Ok(ImportedCampaign {
        id,
        engine,
        runs: 0,
        properties: BTreeMap::new(),
        mapping: digest,
        scores: Vec::new(),
    })
}

/// Stores the ends of all campaigns.
fn finish<F>(history: &Target<F>, end: &ImportEnd, now: fn() -> String) -> Result<(), Diagnostics> {
    let Some(history) = &history.opened else {
        return Ok(());
    };
    for campaign in &end.campaigns {
        let score = mean(campaign.scores.iter().copied());
        let mut outcomes: BTreeMap<Outcome, u64> = BTreeMap::new();
        for (outcome, count) in campaign.properties.values().flatten() {
            *outcomes.entry(*outcome).or_default() += count;
        }
        history.finish_campaign(
            &campaign.id,
            &CampaignEnd {
                ended: now(),
                score,
                score_without_broken: score,
                outcomes,
                discards: 0,
                ended_by: None,
                interrupted: matches!(end.ending, Ending::Interrupted),
            },
        )?;
    }
    Ok(())
}

impl ImportedCampaign {
    /// Counts a run.
    fn add(&mut self, record: &RunRecord) {
        self.runs += 1;
        self.scores.push(record.score);
        for judgement in record.judgements.iter().flatten() {
            let property = self.properties.entry(judgement.property.clone());
            *property.or_default().entry(judgement.outcome).or_default() += 1;
        }
    }
}

/// Returns a name for the campaigns of some files: that of the folder or of the only file.
pub fn name_of_import(files: &[PathBuf]) -> String {
    let name = match files {
        [only] => only.file_stem(),
        _ => files
            .first()
            .and_then(|first| first.parent())
            .and_then(Path::file_name),
    };
    name.map_or_else(
        || "episodes".to_owned(),
        |name| names::escaped(&name.to_string_lossy()),
    )
}
