//! Entry point of the fuzz target `history`: a file of a history that another program wrote is
//! refused or read, quickly and without a panic.

use std::path::{Path, PathBuf};

use actcheck::analysis::Mirror;
use actcheck::base::{Diagnostics, Digest};
use actcheck::history::{CampaignRecord, History, RunFilter};

/// The files: summaries, seals, journals, traces, and tables with the list of them.
pub const PLACES: [&str; 8] = [
    "seal/SUMS",
    "journal",
    "outlines/k.000000000-000000005.outlines",
    "outlines/k-1.outline",
    "traces/k-1.trace",
    "tables/FILES",
    "tables/RECHECKED",
    "tables/parquet",
];
/// Size of a record's header in a journal, and of the table in a file of outlines after its magic
/// bytes. Unit: bytes.
const RECORD: usize = 16;
const OUTLINES: usize = 8 + 4 * 8 + 4;

/// A history with an empty campaign, in a folder that must not exist.
///
/// # Panics
/// The folder can't be written.
pub fn made(folder: &Path) {
    let history = History::open(folder).expect("the folder can be written");
    let record = CampaignRecord {
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
    drop(history);
    for name in ["outlines", "tables"] {
        std::fs::create_dir_all(folder.join(name)).expect("the folder can be written");
    }
    let version = "actcheck history 4\n";
    std::fs::write(folder.join("VERSION"), version).expect("the folder can be written");
}

/// Writes a file of a history, asks for everything that is read from it, and removes it. The first
/// byte of the data chooses the place, and whether checksums are corrected, so that the bytes
/// behind them are reached.
///
/// # Panics
/// The folder can't be written, or the library panics.
pub fn history(folder: &Path, data: &[u8]) -> Result<(), Diagnostics> {
    let Some((first, content)) = data.split_first() else {
        return Ok(());
    };
    let place = usize::from(*first) % PLACES.len();
    let mut bytes = content.to_vec();
    if (usize::from(*first) / PLACES.len()).is_multiple_of(2) {
        correct(PLACES[place], &mut bytes);
    }
    let file = path(folder, PLACES[place], &bytes);
    std::fs::write(&file, bytes).expect("the folder can be written");
    let asked = ask(folder);
    let _ = std::fs::remove_file(file);
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
    let history = History::open_to_read(folder)?;
    let _ = history.journal_warning();
    let _ = Mirror::damage(&history);
    let _ = Mirror::update(&history);
    for run in history.runs(&RunFilter::default())? {
        let _ = history.run(&run.run);
        let _ = history.trace(&run.run);
    }
    let _ = history.query("SELECT ?p (COUNT(*) AS ?n) WHERE { ?s ?p ?o } GROUP BY ?p");
    Ok(())
}

/// Makes the checksums of a file fit its content.
fn correct(place: &str, bytes: &mut Vec<u8>) {
    let word = |bytes: &[u8], at: usize| {
        u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
    };
    match place {
        "seal/SUMS" => {
            let sum = crc(bytes);
            bytes.extend(format!("{sum:08x}\n").into_bytes());
        }
        "journal" => {
            let mut at = 0;
            while at + RECORD <= bytes.len() {
                let rest = bytes.len() - at - RECORD;
                let size = (word(bytes, at) as usize).min(rest);
                bytes[at..at + 4].copy_from_slice(&(size as u32).to_le_bytes());
                let sum = crc(&bytes[at + RECORD..at + RECORD + size]);
                bytes[at + 8..at + 12].copy_from_slice(&sum.to_le_bytes());
                let header = crc(&bytes[at..at + 12]);
                bytes[at + 12..at + 16].copy_from_slice(&header.to_le_bytes());
                at += RECORD + size;
            }
        }
        _ if place.starts_with("outlines") && bytes.len() >= OUTLINES => {
            let mut from = OUTLINES;
            for part in 0..4 {
                let at = 8 + 8 * part;
                let size = (word(bytes, at) as usize).min(bytes.len() - from);
                let sum = crc(&bytes[from..from + size]);
                bytes[at..at + 4].copy_from_slice(&(size as u32).to_le_bytes());
                bytes[at + 4..at + 8].copy_from_slice(&sum.to_le_bytes());
                from += size;
            }
            let sum = crc(&bytes[..OUTLINES - 4]);
            bytes[OUTLINES - 4..OUTLINES].copy_from_slice(&sum.to_le_bytes());
        }
        _ => {}
    }
}

/// The checksum CRC-32.
fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |sum, byte| {
        (0..8).fold(sum ^ u32::from(*byte), |sum, _| {
            if sum & 1 == 1 {
                (sum >> 1) ^ 0xedb8_8320
            } else {
                sum >> 1
            }
        })
    })
}
