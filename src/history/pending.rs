//! Takes the statements of the journal into the store.

use std::io;
use std::sync::PoisonError;

use oxigraph::model::{Quad, Term};
use oxigraph::store::{StorageError, Store};

use crate::journal::{self, Journal, Part, Record, Statements};
use crate::snapshot::Snapshot;
use crate::{History, fault};
use actcheck_base::Diagnostics;

/// Number of statements in the journal at which they are written to tables: about 600 runs. From
/// the second part on, the store merges tables and no longer compresses them; but readers take
/// longer with a long journal, up to some tenths of a second.
const MOST: usize = 450_000;
/// Number of statements from which they are written to tables directly. A few are cheaper as a
/// transaction, because tables are a dozen files.
const FEWEST_LOADED: usize = 4_000;
/// Number of statements from which they are written to tables directly although the owner only
/// wants to read them. Fewer make small tables, which the store soon merges.
const FEWEST_READ: usize = 100_000;
/// Number of statements in a transaction.
const TRANSACTION: usize = 20_000;
/// Largest store that may have no statements. Unit: bytes.
const MOST_EMPTY: u64 = 1 << 20;
/// Largest store that is copied into memory. Unit: bytes.
const MOST_COPIED: u64 = 4 << 20;
/// The reason why a journal can't be read.
pub(super) const DAMAGED: &str = "its journal has changed since it was written";

impl History {
    /// Makes each stored run survive a power cut, which costs a sync of the disk for each.
    pub fn sync_each_run(&self) {
        self.journal().synced = true;
    }

    /// Whether each run is on the disk before it is reported.
    pub(super) fn syncs_each_run(&self) -> bool {
        self.journal().synced
    }

    fn journal(&self) -> std::sync::MutexGuard<'_, Journal> {
        self.journal.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Stores statements: all of them or, on an error, none.
    pub(super) fn enter_quads(&self, quads: &[Quad], doing: &str) -> Result<(), Diagnostics> {
        let record = Record::of(quads).map_err(|error| fault::io(self.dir(), doing, &error))?;
        self.enter(&record, doing)
    }

    /// Stores the statements of a record: all of them or, on an error, none.
    pub(super) fn enter(&self, record: &Record, doing: &str) -> Result<(), Diagnostics> {
        let mut journal = self.journal();
        if journal.is_new() {
            self.folder.mark_journal(true)?;
        }
        journal
            .append(record)
            .map_err(|error| fault::io(self.dir(), doing, &error))
    }

    pub(super) fn sync_journal(&self) -> Result<(), Diagnostics> {
        self.journal()
            .sync()
            .map_err(|error| self.unwritten(&error))
    }

    /// Writes the statements of the journal into the store's tables, if there are many.
    pub(super) fn load_long_journal(&self) -> Result<(), Diagnostics> {
        if self.journal().statements >= MOST {
            self.load_journal()
        } else {
            Ok(())
        }
    }

    /// Writes the statements of the journal into the store's tables.
    pub(super) fn load_journal(&self) -> Result<(), Diagnostics> {
        let mut journal = self.journal();
        if journal.statements == 0 {
            return Ok(());
        }
        self.take_over(&mut journal, |store, statements, threads| {
            if statements.len() >= FEWEST_LOADED {
                return load(store, statements, threads);
            }
            store.extend(statements.into_quads())?;
            store.flush()
        })
    }

    /// Whether many statements wait in the journal for others, to be written to tables together. A
    /// read by the owner writes them at once, which makes the store larger.
    pub fn has_waiting(&self) -> bool {
        self.journal().statements >= FEWEST_LOADED
    }

    /// Adds the statements of the journal to the store, so that the owner can read them.
    pub(super) fn complete_store(&self) -> Result<(), Diagnostics> {
        let mut journal = self.journal();
        if journal.statements == 0 {
            return Ok(());
        }
        let synced = journal.synced;
        self.take_over(&mut journal, |store, statements, threads| {
            if statements.len() >= FEWEST_READ {
                return load(store, statements, threads);
            }
            // Transactions survive a kill, too.
            extend(store, statements.into_quads().collect())?;
            if synced { store.flush() } else { Ok(()) }
        })
    }

    /// Writes the journal of a killed process into the store.
    pub(super) fn take_over_journal(&self) -> Result<(), Diagnostics> {
        let mut journal = self.journal();
        self.take_over(
            &mut journal,
            |store, statements, threads| match statements.len() {
                0 => Ok(()),
                1..FEWEST_LOADED => {
                    extend(store, statements.into_quads().collect()).and_then(|()| store.flush())
                }
                _ => load(store, statements, threads),
            },
        )
    }

    fn take_over(
        &self,
        journal: &mut Journal,
        take: impl FnOnce(&Store, Statements, usize) -> Result<(), StorageError>,
    ) -> Result<(), Diagnostics> {
        let threads = self.threads();
        let bytes = journal::read(self.dir())
            .map_err(|error| fault::io(self.dir(), "reading its journal", &error))?;
        let (statements, is_whole) = journal::statements(&bytes, threads);
        if !is_whole {
            return Err(fault::damaged(self.dir(), DAMAGED));
        }
        take(&*self.bare_store()?, statements, threads)
            .map_err(|error| self.fault("writing its tables", &error))?;
        // Only then: a killed process leaves the statements in both.
        journal.remove().map_err(|error| self.unwritten(&error))
    }

    fn unwritten(&self, error: &io::Error) -> Diagnostics {
        fault::io(self.dir(), "writing its journal", error)
    }
}

/// Writes statements directly into tables.
fn load(store: &Store, statements: Statements, threads: usize) -> Result<(), StorageError> {
    // The library makes the tables of each batch in a thread. Default graph and named graphs have
    // indexes of their own, so that there is still one table for each index. The library counts a
    // thousand statements as a megabyte.
    let threads = threads.min(2);
    let megabytes = threads * (statements.len() / 1000 + 1);
    let mut loader = store
        .bulk_loader()
        .with_num_threads(threads)
        .with_max_memory_size_in_megabytes(megabytes);
    loader.load_quads(statements.of_named.into_iter().flatten())?;
    loader.load_quads(statements.of_default.into_iter().flatten())?;
    loader.commit()
}

fn extend(store: &Store, quads: Vec<Quad>) -> Result<(), StorageError> {
    quads
        .chunks(TRANSACTION)
        .try_for_each(|quads| store.extend(quads.iter().cloned()))
}

/// Opens a snapshot, so that statements of its journal can be added: it is the reader's own. As
/// long as its tables are empty, statements take a third of the time in memory.
pub(super) fn open(snapshot: &Snapshot) -> Result<Store, StorageError> {
    if snapshot.size <= MOST_EMPTY && Store::open_read_only(snapshot.store())?.is_empty()? {
        return Store::new();
    }
    Store::open(snapshot.store())
}

/// Opens a snapshot, so that the statements of many outlines can be added: in memory, where they
/// take a third of the time, unless it has many statements itself.
pub(super) fn open_for_outlines(snapshot: &Snapshot) -> Result<Store, StorageError> {
    if snapshot.size > MOST_COPIED {
        return Store::open(snapshot.store());
    }
    let (tables, memory) = (Store::open_read_only(snapshot.store())?, Store::new()?);
    let quads: Vec<Quad> = tables.iter().collect::<Result<_, _>>()?;
    extend(&memory, quads)?;
    Ok(memory)
}

/// Adds statements of a journal.
pub(super) fn add(store: &Store, part: Part) -> Result<(), StorageError> {
    extend(store, part.quads)?;
    let mut transaction = store.start_transaction()?;
    for graph in part.graphs {
        match graph {
            Term::NamedNode(node) => transaction.insert_named_graph(&node),
            Term::BlankNode(node) => transaction.insert_named_graph(&node),
            _ => {}
        }
    }
    transaction.commit()
}
