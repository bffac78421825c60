//! Opening and closing a history.

use std::ops::Deref;
use std::path::Path;
use std::sync::atomic::AtomicUsize;
use std::sync::{Arc, Mutex, OnceLock, PoisonError, RwLock};
use std::thread::sleep;
use std::time::Duration;

use oxigraph::store::{StorageError, Store};

use crate::folder::Folder;
use crate::journal::{self, Journal};
use crate::outlines::LoadedFiles;
use crate::pending;
use crate::salvage::salvage;
use crate::seal::{Found, Seal};
use crate::snapshot::{MOST_COMPARED, Snapshot};
use crate::tail::Tail;
use crate::threads::cores;
use crate::wanted::Wanted;
use crate::{History, fault};
use actcheck_base::Diagnostics;

/// Time between two tries to read a history that another process is creating.
const PAUSE: Duration = Duration::from_millis(10);
/// Number of these tries. Creating takes some tenths of a second, because the store syncs each of
/// its parts to the disk.
const TRIES: usize = 300;

/// An open store. All clones use the same one.
#[derive(Clone)]
pub(super) struct OpenStore {
    store: Store,
    /// The files of a reader's store, which must outlive it.
    snapshot: Option<Arc<Snapshot>>,
}

impl OpenStore {
    /// Total size of the tables of a reader's store. Unit: bytes. `None` for the owner's.
    pub(super) fn size(&self) -> Option<u64> {
        Some(self.snapshot.as_ref()?.size)
    }
}

impl Deref for OpenStore {
    type Target = Store;

    fn deref(&self) -> &Store {
        &self.store
    }
}

/// The store of a history, and its state when it was opened.
pub(super) struct Opened {
    store: OpenStore,
    /// `None` for the owner, who sees each change.
    snapshot: Option<Arc<Snapshot>>,
    /// The statements of the snapshot's journal that are in the store.
    loaded: Mutex<Wanted>,
    /// Whether the store can be opened again from the snapshot: one that was salvaged is only in
    /// memory.
    can_rest: bool,
}

impl Opened {
    /// Whether the history has changed since a reader opened it.
    pub(super) fn is_stale(&self, folder: &Folder) -> bool {
        self.snapshot
            .as_ref()
            .is_some_and(|snapshot| snapshot.is_stale(folder))
    }

    /// A handle of the store.
    pub(super) fn handle(&self) -> OpenStore {
        self.store.clone()
    }

    /// Adds statements of the snapshot's journal to a reader's store, if they are not in it.
    pub(super) fn load(
        &self,
        dir: &Path,
        wanted: impl FnOnce() -> Wanted,
    ) -> Result<(), Diagnostics> {
        let Some(snapshot) = self
            .snapshot
            .as_ref()
            .filter(|snapshot| !snapshot.journal.is_empty())
        else {
            return Ok(());
        };
        let mut loaded = self.loaded.lock().unwrap_or_else(PoisonError::into_inner);
        let missing = wanted().beyond(&loaded);
        if missing.is_empty() {
            return Ok(());
        }
        let (part, is_whole) = journal::part(&snapshot.journal, &missing);
        if !is_whole {
            return Err(fault::damaged(dir, pending::DAMAGED));
        }
        pending::add(&self.store, part).map_err(|error| fault::unread(dir, &error))?;
        loaded.add(missing);
        Ok(())
    }
}

impl History {
    /// Opens the history in a folder, and creates it if missing.
    ///
    /// # Errors
    /// `H001` the folder can't be used, `H002` another process has it open, `H003` it holds other
    /// files, `H004` it has another format, `H005` the disk is full, `H006`, `H007` it is
    /// damaged.
    pub fn open(dir: &Path) -> Result<Self, Diagnostics> {
        Self::open_folder(Folder::lock_exclusive(dir, true)?, cores())
    }

    /// Opens the existing history in a folder.
    ///
    /// # Errors
    /// As [`History::open`]; also `H003` if the folder has no history.
    pub fn open_existing(dir: &Path) -> Result<Self, Diagnostics> {
        Self::open_existing_with(dir, cores())
    }

    /// Like [`History::open_existing`], with a number of threads instead of all cores: see
    /// [`History::use_threads`].
    ///
    /// # Errors
    /// As [`History::open_existing`].
    pub fn open_existing_with(dir: &Path, threads: usize) -> Result<Self, Diagnostics> {
        Self::open_folder(Folder::lock_exclusive(dir, false)?, threads)
    }

    /// Opens the state of an existing history at this moment for reading. It needs no permission to
    /// write the folder, and other processes may read and write it at the same time, before and
    /// after.
    ///
    /// # Errors
    /// As [`History::open_existing`], but `H002` only if another process takes seconds to create
    /// it.
    pub fn open_to_read(dir: &Path) -> Result<Self, Diagnostics> {
        let folder = Folder::to_read(dir)?;
        let opened = read_present(&folder, TRIES)?;
        let tail = opened.snapshot.as_ref().map_or(Tail::Closed, |snapshot| {
            Tail::of(&folder, &snapshot.journal)
        });
        let mut history = Self::with(opened, folder);
        history.tail = tail;
        Ok(history)
    }

    /// Like [`History::open_to_read`], for a damaged history: reads everything that can be read
    /// into memory. Returns it with the ids of the runs that are lost, sorted.
    ///
    /// # Errors
    /// As [`History::open_to_read`], if nothing can be read.
    pub fn open_to_salvage(dir: &Path) -> Result<(Self, Vec<String>), Diagnostics> {
        let folder = Folder::to_read(dir)?;
        let snapshot = Snapshot::salvage(&folder)?;
        let (journal, is_whole) = journal::statements(&snapshot.journal, cores());
        let opened = read_tables(&folder, Arc::new(snapshot))?;
        let salvaged = salvage(
            &opened.store,
            journal.into_quads().collect(),
            is_whole,
            &folder.traced(),
        )
        .map_err(|error| fault::store(dir, "reading it", &error))?;
        let store = OpenStore {
            store: salvaged.store,
            snapshot: opened.snapshot.clone(),
        };
        let opened = Opened {
            store,
            snapshot: opened.snapshot,
            loaded: Mutex::new(Wanted::all()),
            can_rest: false,
        };
        Ok((Self::with(opened, folder), salvaged.lost))
    }

    /// Takes a new snapshot if the history has changed since the last one. Returns whether it has.
    /// Answers that are being read keep theirs. The owner's history is always up to date.
    ///
    /// # Errors
    /// As [`History::open_to_read`]; the earlier snapshot is then kept.
    pub fn refresh(&self) -> Result<bool, Diagnostics> {
        let is_stale = self.is_stale();
        if is_stale {
            let opened = read_present(&self.folder, TRIES)?;
            *self.opened.write().unwrap_or_else(PoisonError::into_inner) = Some(opened);
        }
        Ok(is_stale)
    }

    /// Whether the history has changed since the last snapshot was taken. Takes some microseconds.
    pub fn is_stale(&self) -> bool {
        let opened = self.opened.read().unwrap_or_else(PoisonError::into_inner);
        let snapshot = opened.as_ref().and_then(|opened| opened.snapshot.as_ref());
        snapshot.is_some_and(|snapshot| snapshot.is_stale(&self.folder))
    }

    /// Identifies the state of a reader's history: two that are equal have the same runs and
    /// judgements. `None` for the owner's, which changes.
    pub fn state(&self) -> Option<String> {
        let opened = self.opened.read().unwrap_or_else(PoisonError::into_inner);
        let resting = self.resting.lock().unwrap_or_else(PoisonError::into_inner);
        let snapshot = opened
            .as_ref()
            .map_or(resting.as_ref(), |opened| opened.snapshot.as_ref());
        snapshot.map(|snapshot| snapshot.state())
    }

    fn open_folder(folder: Folder, threads: usize) -> Result<Self, Diagnostics> {
        // The library would drop unreadable parts.
        if let Found::Whole(seal) = Seal::read(&folder)
            && let Some(name) = seal.damage(&folder, MOST_COMPARED, threads).first()
        {
            return Err(fault::damaged_file(folder.dir(), name));
        }
        let journal = journal::read(folder.dir())
            .map_err(|error| fault::io(folder.dir(), "reading its journal", &error))?;
        let (tail, opened) = (Tail::of(&folder, &journal), own(&folder)?);
        drop(journal);
        let mut history = Self::with(opened, folder);
        history.tail = tail;
        history.use_threads(threads);
        history.take_over_journal()?;
        Ok(history)
    }

    fn with(opened: Opened, folder: Folder) -> Self {
        let journal = Mutex::new(Journal::new(folder.dir()));
        Self {
            opened: RwLock::new(Some(opened)),
            resting: Mutex::default(),
            folder,
            journal,
            view: Mutex::default(),
            loaded: LoadedFiles::default(),
            single_outlines: AtomicUsize::new(0),
            threads: AtomicUsize::new(cores()),
            restore: OnceLock::new(),
            tail: Tail::Closed,
        }
    }

    /// Returns a handle of the store with every statement. (All clones use the same store.)
    pub(super) fn store(&self) -> Result<OpenStore, Diagnostics> {
        self.store_with(Wanted::all)
    }

    /// Returns a handle of the store with the wanted statements at least: a reader's store lacks
    /// others that are in the journal.
    pub(super) fn store_with(
        &self,
        wanted: impl FnOnce() -> Wanted,
    ) -> Result<OpenStore, Diagnostics> {
        self.complete_store()?;
        self.loaded_store_with(wanted)
    }

    /// Like [`History::store_with`], but without the statements that the owner has in the journal.
    pub(super) fn loaded_store_with(
        &self,
        wanted: impl FnOnce() -> Wanted,
    ) -> Result<OpenStore, Diagnostics> {
        if self.is_resting() {
            self.wake()?;
        }
        let opened = self.opened.read().unwrap_or_else(PoisonError::into_inner);
        if let Some(opened) = opened.as_ref() {
            opened.load(self.dir(), wanted)?;
        }
        drop(opened);
        self.bare_store()
    }

    /// Returns a handle of the store, which lacks the statements in the journal.
    pub(super) fn bare_store(&self) -> Result<OpenStore, Diagnostics> {
        if self.is_resting() {
            self.wake()?;
        }
        let opened = self.opened.read().unwrap_or_else(PoisonError::into_inner);
        let opened = opened
            .as_ref()
            .ok_or_else(|| fault::damaged(self.dir(), "it could not be opened again"))?;
        Ok(opened.store.clone())
    }

    /// Closes the store of a reader until it is needed again, with the same state: each open store
    /// takes some megabytes.
    pub fn rest(&self) {
        let mut opened = self.opened.write().unwrap_or_else(PoisonError::into_inner);
        let mut resting = self.resting.lock().unwrap_or_else(PoisonError::into_inner);
        *self.view.lock().unwrap_or_else(PoisonError::into_inner) = None;
        if opened.as_ref().is_some_and(|opened| opened.can_rest) {
            *resting = opened.take().and_then(|opened| opened.snapshot);
        }
    }

    /// Opens a store that rests.
    fn wake(&self) -> Result<(), Diagnostics> {
        let mut opened = self.opened.write().unwrap_or_else(PoisonError::into_inner);
        let snapshot = self
            .resting
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take();
        if let Some(snapshot) = snapshot {
            *opened = Some(read(&self.folder, snapshot)?);
        }
        Ok(())
    }

    fn is_resting(&self) -> bool {
        self.resting
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .is_some()
    }

    /// Closes and reopens the store. Only then does it delete logs whose content is already in its
    /// tables; they are as large as the tables of a hundred runs.
    pub(super) fn reopen(&self) -> Result<(), Diagnostics> {
        let mut opened = self.opened.write().unwrap_or_else(PoisonError::into_inner);
        *opened = None;
        *opened = Some(own(&self.folder)?);
        Ok(())
    }
}

impl Drop for History {
    /// Seals the store of an owner after closing it.
    fn drop(&mut self) {
        // The rest of the journal is taken over by the next owner.
        let _ = self.load_journal();
        let opened = self
            .opened
            .get_mut()
            .unwrap_or_else(PoisonError::into_inner)
            .take();
        if opened.is_some_and(|opened| opened.snapshot.is_none()) {
            // Without a new seal, the earlier one still covers its files.
            let _ = Seal::write(&self.folder);
            if !self.dir().join(journal::NAME).exists() {
                // If it remains marked, no file of a run lacks its statements.
                let _ = self.folder.mark_journal(false);
            }
        }
    }
}

/// Opens the present state of a store. A store that another process is creating lacks parts, as a
/// damaged one does, so it is tried again for a moment.
fn read_present(folder: &Folder, tries: usize) -> Result<Opened, Diagnostics> {
    let (mut left, mut was_locked) = (tries, true);
    loop {
        let faults =
            match Snapshot::take(folder).and_then(|snapshot| read(folder, Arc::new(snapshot))) {
                Ok(opened) => return Ok(opened),
                Err(faults) => faults,
            };
        // The first owner seals the store when it closes it.
        let is_new = matches!(Seal::read(folder), Found::Missing);
        if !is_new
            || faults
                .iter()
                .all(|fault| !["H002", "H007"].contains(&fault.code))
        {
            return Err(faults);
        }
        let is_locked = folder.is_locked();
        if is_locked && left == 0 {
            return Err(fault::being_created(folder.dir()));
        }
        if is_locked {
            left -= 1;
            sleep(PAUSE);
        } else if !was_locked {
            let is_empty = folder.traced().is_empty();
            return Err(if is_empty {
                fault::not_created(folder.dir())
            } else {
                faults
            });
        }
        // If the owner is gone now, it may have completed the store after it was read.
        was_locked = is_locked;
    }
}

/// Opens a snapshot. The statements of its journal are added when they are asked for.
fn read(folder: &Folder, snapshot: Arc<Snapshot>) -> Result<Opened, Diagnostics> {
    if !journal::is_whole(&snapshot.journal) {
        return Err(fault::damaged(folder.dir(), pending::DAMAGED));
    }
    if snapshot.journal.is_empty() {
        return read_tables(folder, snapshot);
    }
    let store = pending::open(&snapshot);
    opened(folder, store, snapshot)
}

/// Opens the present state of a store so that statements can be added: it is the reader's own.
pub(super) fn read_with_outlines(folder: &Folder) -> Result<Opened, Diagnostics> {
    let snapshot = Snapshot::take(folder)?;
    let store = pending::open_for_outlines(&snapshot);
    opened(folder, store, Arc::new(snapshot))
}

fn read_tables(folder: &Folder, snapshot: Arc<Snapshot>) -> Result<Opened, Diagnostics> {
    let store = Store::open_read_only(snapshot.store());
    opened(folder, store, snapshot)
}

fn opened(
    folder: &Folder,
    store: Result<Store, StorageError>,
    snapshot: Arc<Snapshot>,
) -> Result<Opened, Diagnostics> {
    let store = store.map_err(|error| fault::unread(folder.dir(), &error))?;
    let snapshot = Some(snapshot);
    let store = OpenStore {
        store,
        snapshot: snapshot.clone(),
    };
    Ok(Opened {
        store,
        snapshot,
        loaded: Mutex::default(),
        can_rest: true,
    })
}

fn own(folder: &Folder) -> Result<Opened, Diagnostics> {
    let path = folder.store();
    let store = Store::open(&path)
        .map_err(|error| fault::store(folder.dir(), "opening its store", &error))?;
    // Each opening leaves a log of over 100 kB, which is only useful to the store's developers; a
    // process that was killed while it wrote tables leaves them under names that the store does not
    // know.
    for file in folder.below().files(&path) {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        if name.starts_with("LOG.old.") || name.starts_with("bulk-") {
            // Harmless if it remains.
            let _ = folder.below().remove(&file);
        }
    }
    let store = OpenStore {
        store,
        snapshot: None,
    };
    Ok(Opened {
        store,
        snapshot: None,
        loaded: Mutex::default(),
        can_rest: false,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_base::ScratchFolder;
    use std::fs;

    fn codes(folder: &Folder) -> Vec<&'static str> {
        match read_present(folder, 0) {
            Ok(_) => Vec::new(),
            Err(faults) => faults.iter().map(|fault| fault.code).collect(),
        }
    }

    /// A reader met a store whose column families or version were not written yet, and called it
    /// damaged.
    #[test]
    fn a_history_that_is_being_created_is_not_reported_as_damaged() {
        let scratch = ScratchFolder::create().expect("it can be created");
        let dir = scratch.path().join("history");
        drop(History::open(&dir).expect("it can be created"));
        fs::remove_dir_all(dir.join("seal")).expect("it was sealed");
        let store = dir.join("store");
        let files = || {
            fs::read_dir(&store)
                .expect("it exists")
                .map(|entry| entry.expect("it can be read").path())
        };
        let named = |part: &str| {
            let is_named = |path: &std::path::PathBuf| {
                path.file_name()
                    .is_some_and(|name| name.to_string_lossy().starts_with(part))
            };
            files().find(is_named).expect("the store has it")
        };
        let (manifest, current) = (named("MANIFEST-"), named("CURRENT"));
        let written = fs::read(&manifest).expect("it can be read");
        let reader = Folder::to_read(&dir).expect("it is a history");
        let mut seen = [0, 0];
        // The manifest grows with each part that is created.
        for length in (0..written.len()).step_by(41) {
            fs::write(&manifest, &written[..length]).expect("it can be written");
            let owner = Folder::lock_exclusive(&dir, false).expect("it is not locked");
            let during = codes(&reader);
            drop(owner);
            let after = codes(&reader);
            assert!(
                during.is_empty() || during == ["H002"],
                "{length}: {during:?}"
            );
            assert!(after.is_empty() || after == ["H003"], "{length}: {after:?}");
            seen = [seen[0] + during.len(), seen[1] + after.len()];
        }
        assert!(seen.iter().all(|faults| *faults > 2), "{seen:?}");
        fs::remove_file(current).expect("it exists");
        assert_eq!(codes(&reader), ["H003"]);
        // With runs, the same is damage.
        fs::write(reader.trace("k7f3-0"), "").expect("it can be written");
        assert_eq!(codes(&reader), ["H007"]);
    }
}
