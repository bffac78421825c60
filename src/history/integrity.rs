//! Compares the files of a history with their checksums and with each other.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::folder::{self, Folder};
use crate::salvage::scan;
use crate::seal::{Found, Seal};
use crate::tail::Tail;
use crate::threads::cores;
use crate::write_run::run_node;
use crate::{History, RunFilter, detail, fault, journal, pending, trace_file, trace_parts};
use actcheck_base::Diagnostics;

/// A damaged or missing part of a history.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Damage {
    /// The file, relative to the folder of the history.
    pub file: PathBuf,
    /// The run that it concerns; `None` if it concerns all.
    pub run: Option<String>,
    /// The kind of damage.
    pub reason: String,
}

/// The result of an examination.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Integrity {
    /// Damaged parts; empty if the history is intact.
    pub damage: Vec<Damage>,
    /// Number of runs.
    pub runs: usize,
    /// Number of tables of the store without a checksum, which only a killed process leaves: the
    /// next process that writes the history adds it. Their content was read.
    pub unlisted: usize,
    /// Trace files without a run, which only a killed process leaves: the campaign makes these runs
    /// again when it is resumed.
    pub unused: Vec<PathBuf>,
}

impl History {
    /// Examines a history, also a damaged one, without changing it: compares the store's files with
    /// their checksums, reads the whole store, and compares every trace with its run. Returns the
    /// result, and the history as far as it can be read.
    ///
    /// # Errors
    /// `H003` or `H004` if this program can't read the history; `H007` if the whole store is
    /// unreadable.
    pub fn examine(dir: &Path) -> Result<(Integrity, Self), Diagnostics> {
        let folder = Folder::to_read(dir)?;
        let mut found = Integrity::default();
        match Seal::read(&folder) {
            Found::Whole(seal) => {
                let reason = "it has changed since it was written";
                found
                    .damage
                    .extend(seal.damage(&folder, u64::MAX, cores()).into_iter().map(|name| of_store(&name, reason)));
                found.damage.extend(seal.damaged_copies(&folder).into_iter().map(|name| Damage {
                    file: Path::new("seal").join(name),
                    run: None,
                    reason: reason.to_owned(),
                }));
                found.unlisted = seal.unlisted(&folder);
            }
            Found::Missing => found.unlisted = Seal::default().unlisted(&folder),
            Found::Damaged => found.damage.push(Damage {
                file: PathBuf::from("seal/SUMS"),
                run: None,
                reason: "the list of checksums is damaged; the next process that writes the history replaces it"
                    .to_owned(),
            }),
        }
        if journal::read(dir).is_ok_and(|bytes| !journal::statements(&bytes, cores()).1) {
            let reason = pending::DAMAGED.to_owned();
            found.damage.push(Damage {
                file: PathBuf::from(journal::NAME),
                run: None,
                reason,
            });
        }
        let history = match Self::open_to_read(dir) {
            Ok(history) => match scan(&*history.store()?) {
                Ok(()) => history,
                Err(error) => salvaged(dir, &error.to_string(), &mut found)?,
            },
            Err(faults) => salvaged(dir, &faults.to_string(), &mut found)?,
        };
        history.compare_traces(&mut found)?;
        let lost = match history.tail {
            Tail::Cut => Some("it ends within a record, and no process writes it"),
            Tail::Missing if !found.unused.is_empty() => {
                Some("it is missing, and traces have no run")
            }
            Tail::Whole if found.unused.len() > 1 => {
                Some("its end is missing: several traces have no run")
            }
            Tail::Whole | Tail::Missing | Tail::Closed => None,
        };
        found.damage.extend(lost.map(|reason| Damage {
            file: PathBuf::from(journal::NAME),
            run: None,
            reason: reason.to_owned(),
        }));
        found
            .damage
            .sort_by(|one, other| (&one.file, &one.run).cmp(&(&other.file, &other.run)));
        Ok((found, history))
    }

    /// Compares the traces with the runs of the store.
    fn compare_traces(&self, found: &mut Integrity) -> Result<(), Diagnostics> {
        let mut runs = self
            .runs(&RunFilter::default())
            .or_else(|faults| self.whole_runs().map_err(|_| faults))?;
        let outlines: BTreeSet<String> = self
            .outlined_ids(None)
            .unwrap_or_default()
            .into_iter()
            .collect();
        runs.retain(|run| !outlines.contains(&run.run));
        found.runs = runs.len();
        let store = self.store()?;
        // The fault of the copy of a run's outcomes in its trace file.
        let fault_of_copy = |id: &str, bytes: &[u8]| match trace_file::after_trace(bytes) {
            Ok(after) => match (
                trace_parts::of_bytes(after),
                detail::parts(&*store, &run_node(id)),
            ) {
                (Ok((_, copied)), Ok(stored)) if copied != stored => {
                    Some("its copy of the outcomes differs from the store".to_owned())
                }
                (Err(why), _) => Some(why),
                // The damage of the store is listed.
                _ => None,
            },
            Err(why) => Some(why),
        };
        let mut known = BTreeSet::new();
        for run in &runs {
            let file = self.trace_path(&run.run);
            let reason = match folder::read(&file) {
                Ok(bytes) => match trace_file::decode(&bytes) {
                    Ok((_, trace)) if trace.hash == run.trace_hash => {
                        fault_of_copy(&run.run, &bytes)
                    }
                    Ok((_, trace)) => Some(format!(
                        "it is the trace {}, not {}",
                        trace.hash, run.trace_hash
                    )),
                    Err(why) => Some(why),
                },
                Err(error) => Some(error.to_string()),
            };
            let damage = |reason| Damage {
                file: relative(self.dir(), &file),
                run: Some(run.run.clone()),
                reason,
            };
            found.damage.extend(reason.map(damage));
            known.insert(file);
        }
        let (outlines, damaged) = self.examine_outlines();
        found.runs += outlines;
        found
            .damage
            .extend(damaged.into_iter().map(|(file, reason)| Damage {
                file: relative(self.dir(), &file),
                run: None,
                reason,
            }));
        let files = self.folder.below().files(&self.folder.traces()).into_iter();
        found.unused = files
            .filter(|file| !known.contains(file))
            .map(|file| relative(self.dir(), &file))
            .collect();
        found.unused.sort();
        Ok(())
    }
}

/// Opens the readable part of a history, and adds its faults.
fn salvaged(dir: &Path, why: &str, found: &mut Integrity) -> Result<History, Diagnostics> {
    let is_named = |damage: &Damage| {
        damage.file.starts_with("store") || damage.file.starts_with(journal::NAME)
    };
    if !found.damage.iter().any(is_named) {
        found.damage.push(Damage {
            file: PathBuf::from("store"),
            run: None,
            reason: why.trim().to_owned(),
        });
    }
    let (history, lost) =
        History::open_to_salvage(dir).map_err(|_| fault::damaged(dir, why.trim()))?;
    let reason = "its statements can't be read";
    found.damage.extend(lost.into_iter().map(|run| Damage {
        file: PathBuf::from("store"),
        run: Some(run),
        reason: reason.to_owned(),
    }));
    Ok(history)
}

fn of_store(name: &str, reason: &str) -> Damage {
    Damage {
        file: Path::new("store").join(name),
        run: None,
        reason: reason.to_owned(),
    }
}

fn relative(dir: &Path, file: &Path) -> PathBuf {
    file.strip_prefix(dir).unwrap_or(file).to_path_buf()
}
