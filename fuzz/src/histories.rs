//! Entry point of the fuzz target `history`: a file of a history that another program wrote is
//! refused or read, quickly and without a panic.

use std::path::{Path, PathBuf};
use std::slice::from_ref;

use actcheck::analysis::Mirror;
use actcheck::base::{Diagnostics, Digest};
use actcheck::history::{CampaignRecord, History, NewestJudgements, Recheck, RunFilter, RunRecord};

use super::frames;

/// The files: those of a campaign, and tables with the list of them.
pub const PLACES: [&str; 9] = [
    "campaigns/k/campaign",
    RUNS,
    "campaigns/k/0001.details",
    "campaigns/k/0001.states",
    "campaigns/k/0001.motion",
    "campaigns/k/0002.judgements",
    "tables/FILES",
    "tables/RECHECKED",
    "tables/parquet",
];
/// The file whose frames have the places of those in other columns.
const RUNS: &str = "campaigns/k/0001.runs";
/// The ways in which a file is written: with right checksums, as it is, and so that other frames fit:
/// runs have the places of its frames, and the copies of a campaign are equal.
pub const WAYS: usize = 3;

/// A history with runs of the campaign `k`, in a folder that must not exist: every second one is
/// kept as outcomes. One judgement was made later.
///
/// # Panics
/// The folder can't be written, or there is no run.
pub fn made(folder: &Path, runs: &[RunRecord]) {
    let history = History::open(folder).expect("the folder can be written");
    let record = CampaignRecord {
        imported_from: None,
        id: "k".to_owned(),
        name: "pick".to_owned(),
        config_text: "seed = 7\n".to_owned(),
        config_digest: String::new(),
        config_path: "pick.toml".to_owned(),
        ontology_digest: String::new(),
        findings: Vec::new(),
        rules: Vec::new(),
        models: Vec::new(),
        skill: None,
        seed: 7,
        planned_runs: 6,
        repeat: 1,
        time_secs: None,
        until_width: None,
        max_failures: None,
        shards: Vec::new(),
        strategy: "random".to_owned(),
        started: "2026-08-01T12:00:00Z".to_owned(),
        program_version: "0.1.0".to_owned(),
        program_digest: String::new(),
        physics: 0,
    };
    history
        .begin_campaign(&record)
        .expect("the folder can be written");
    for (number, run) in runs.iter().enumerate() {
        let stored = if number % 2 == 0 {
            history.commit(run)
        } else {
            history.commit_outcomes(run)
        };
        stored.expect("the folder can be written");
    }
    drop(history);
    // Another process writes a segment of its own.
    let history = History::open(folder).expect("the folder can be written");
    judge_again(&history, runs.first().expect("there are runs"));
    drop(history);
    std::fs::create_dir_all(folder.join("tables")).expect("the folder can be written");
}

/// Stores another outcome of a run's first property.
fn judge_again(history: &History, run: &RunRecord) {
    let property = run.judgements[0][0].property.clone();
    let before = NewestJudgements::of(history)
        .read(&run.id, 1, from_ref(&property))
        .expect("it was just written")
        .remove(0);
    let mut now = before.judgement.clone();
    now.witness.push_str(", later");
    now.rule_digest.push('2');
    let recheck = Recheck {
        run: run.id.clone(),
        step: 1,
        action: run.actions[0].clone(),
        before: Some(before),
        now,
    };
    history
        .commit_rechecks(&[recheck], "2026-08-02T12:00:00Z")
        .and_then(|()| history.finish_rechecks())
        .expect("the folder can be written");
}

/// Writes a file of a history, asks for everything that is read from it, and restores it. The first
/// byte of the data chooses the place, and the way: see [`WAYS`].
///
/// # Panics
/// The folder can't be written, or the library panics.
pub fn history(folder: &Path, data: &[u8]) -> Result<(), Diagnostics> {
    let Some((first, content)) = data.split_first() else {
        return Ok(());
    };
    let (place, way) = (
        PLACES[usize::from(*first) % PLACES.len()],
        usize::from(*first) / PLACES.len() % WAYS,
    );
    let is_column = place.starts_with("campaigns");
    let mut contents = frames::contents(content);
    if way == 2 && place == PLACES[0] {
        // The two copies of a campaign are equal.
        contents = vec![contents.first().copied().unwrap_or_default(); 2];
    }
    let bytes = if is_column && way != 1 {
        frames::file(content, &contents)
    } else {
        content.to_vec()
    };
    let file = path(folder, place, &bytes);
    let before = std::fs::read(&file).ok();
    let runs = folder.join(RUNS);
    let runs_before = std::fs::read(&runs).expect("the history has runs");
    if way == 2 && is_column && place != RUNS {
        let old = before.as_deref().unwrap_or_default();
        let repointed = frames::repointed(&runs_before, old, &bytes);
        std::fs::write(&runs, repointed).expect("the folder can be written");
    }
    std::fs::write(&file, bytes).expect("the folder can be written");
    let asked = ask(folder);
    let _ = std::fs::remove_dir_all(folder.join("tables"));
    std::fs::create_dir_all(folder.join("tables")).expect("the folder can be written");
    if let Some(before) = before {
        std::fs::write(&file, before).expect("the folder can be written");
    }
    std::fs::write(&runs, runs_before).expect("the folder can be written");
    asked
}

fn path(folder: &Path, place: &str, bytes: &[u8]) -> PathBuf {
    if place != "tables/parquet" {
        return folder.join(place);
    }
    let mut digest = Digest::new();
    digest.update(bytes);
    folder.join(format!("tables/k.000000.{}.parquet", digest.finish()))
}

fn ask(folder: &Path) -> Result<(), Diagnostics> {
    let _ = History::examine(folder);
    let _ = History::count_runs(folder);
    if let Ok((salvaged, _)) = History::open_to_salvage(folder) {
        let _ = read(&salvaged);
    }
    let history = History::open_to_read(folder)?;
    let _ = history.tail_warning();
    let _ = Mirror::damage(&history);
    let _ = Mirror::update(&history);
    read(&history)
}

/// Reads all that a history has.
fn read(history: &History) -> Result<(), Diagnostics> {
    let _ = history.query("SELECT ?p (COUNT(*) AS ?n) WHERE { ?s ?p ?o } GROUP BY ?p");
    let _ = history.query("SELECT (COUNT(*) AS ?n) WHERE { GRAPH ?g { ?s ?p ?o } }");
    let _ = history.campaign("k");
    let _ = history.newest_outcomes(&RunFilter::default());
    for run in history.runs(&RunFilter::default())? {
        let _ = history.run(&run.run);
        let _ = history.newest_run(&run.run);
        let _ = history.traces().choices(&run.run);
        let _ = history.traces().recorded(&run.run);
        let _ = history.traces().whole(&run.run);
    }
    Ok(())
}
