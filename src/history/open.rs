//! Opening and closing a history.

use std::ops::Deref;
use std::path::Path;
use std::sync::atomic::AtomicUsize;
use std::sync::{Arc, PoisonError, RwLock};

use oxigraph::store::Store;

use crate::folder::Folder;
use crate::salvage::salvage;
use crate::seal::{Found, Seal};
use crate::snapshot::{MOST_COMPARED, Snapshot};
use crate::{History, fault};
use actcheck_base::Diagnostics;

/// An open store. All clones use the same one.
#[derive(Clone)]
pub(super) struct OpenStore {
    store: Store,
    /// The files of a reader's store, which must outlive it.
    _snapshot: Option<Arc<Snapshot>>,
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
}

impl History {
    /// Opens the history in a folder, and creates it if missing.
    ///
    /// # Errors
    /// `H001` the folder can't be used, `H002` another process has it open, `H003` it holds other files, `H004` a newer
    /// program wrote it, `H005` the disk is full, `H006`, `H007` it is damaged.
    pub fn open(dir: &Path) -> Result<Self, Diagnostics> {
        Self::open_folder(Folder::lock_exclusive(dir, true)?)
    }

    /// Opens the existing history in a folder.
    ///
    /// # Errors
    /// As [`History::open`]; also `H003` if the folder has no history.
    pub fn open_existing(dir: &Path) -> Result<Self, Diagnostics> {
        Self::open_folder(Folder::lock_exclusive(dir, false)?)
    }

    /// Opens the state of an existing history at this moment for reading. It needs no permission to write the folder,
    /// and other processes may read and write it at the same time, before and after.
    ///
    /// # Errors
    /// As [`History::open_existing`], but `H002` only while another process is creating it.
    pub fn open_to_read(dir: &Path) -> Result<Self, Diagnostics> {
        let folder = Folder::to_read(dir)?;
        let opened = read(&folder, Snapshot::take(&folder)?)?;
        Ok(Self { opened: RwLock::new(Some(opened)), folder, logged: AtomicUsize::new(0) })
    }

    /// Like [`History::open_to_read`], for a damaged history: reads everything that can be read into memory. Returns it
    /// with the ids of the runs that are lost, sorted.
    ///
    /// # Errors
    /// As [`History::open_to_read`], if nothing can be read.
    pub fn open_to_salvage(dir: &Path) -> Result<(Self, Vec<String>), Diagnostics> {
        let folder = Folder::to_read(dir)?;
        let opened = read(&folder, Snapshot::salvage(&folder)?)?;
        let salvaged =
            salvage(&opened.store, &folder.traced()).map_err(|error| fault::store(dir, "reading it", &error))?;
        let store = OpenStore { store: salvaged.store, _snapshot: opened.snapshot.clone() };
        let opened = Opened { store, snapshot: opened.snapshot };
        Ok((Self { opened: RwLock::new(Some(opened)), folder, logged: AtomicUsize::new(0) }, salvaged.lost))
    }

    /// Takes a new snapshot if the history has changed since the last one. Returns whether it has. Answers that are
    /// being read keep theirs. The owner's history is always up to date.
    ///
    /// # Errors
    /// As [`History::open_to_read`]; the earlier snapshot is then kept.
    pub fn refresh(&self) -> Result<bool, Diagnostics> {
        let is_stale = {
            let opened = self.opened.read().unwrap_or_else(PoisonError::into_inner);
            let snapshot = opened.as_ref().and_then(|opened| opened.snapshot.as_ref());
            snapshot.is_some_and(|snapshot| snapshot.is_stale(&self.folder))
        };
        if is_stale {
            let opened = read(&self.folder, Snapshot::take(&self.folder)?)?;
            *self.opened.write().unwrap_or_else(PoisonError::into_inner) = Some(opened);
        }
        Ok(is_stale)
    }

    fn open_folder(folder: Folder) -> Result<Self, Diagnostics> {
        // The library would drop unreadable parts.
        if let Found::Whole(seal) = Seal::read(&folder)
            && let Some(name) = seal.damage(&folder, MOST_COMPARED).first()
        {
            return Err(fault::damaged_file(folder.dir(), name));
        }
        let opened = own(&folder)?;
        Ok(Self { opened: RwLock::new(Some(opened)), folder, logged: AtomicUsize::new(0) })
    }

    /// Returns a handle of the store. (All clones use the same store.)
    pub(super) fn store(&self) -> Result<OpenStore, Diagnostics> {
        let opened = self.opened.read().unwrap_or_else(PoisonError::into_inner);
        let opened = opened.as_ref().ok_or_else(|| fault::damaged(self.dir(), "it could not be opened again"))?;
        Ok(opened.store.clone())
    }

    /// Closes and reopens the store. Only then does it delete logs whose content is already in its tables; they are as
    /// large as the tables of a hundred runs.
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
        let opened = self.opened.get_mut().unwrap_or_else(PoisonError::into_inner).take();
        if opened.is_some_and(|opened| opened.snapshot.is_none()) {
            // Without a new seal, the earlier one still covers its files.
            let _ = Seal::write(&self.folder);
        }
    }
}

fn read(folder: &Folder, snapshot: Snapshot) -> Result<Opened, Diagnostics> {
    let store = Store::open_read_only(snapshot.store());
    let store = store.map_err(|error| fault::damaged(folder.dir(), &error.to_string()))?;
    let snapshot = Some(Arc::new(snapshot));
    Ok(Opened { store: OpenStore { store, _snapshot: snapshot.clone() }, snapshot })
}

fn own(folder: &Folder) -> Result<Opened, Diagnostics> {
    let path = folder.store();
    let store = Store::open(&path).map_err(|error| fault::store(folder.dir(), "opening its store", &error))?;
    // Each opening leaves a log of over 100 kB, which is only useful to the store's developers.
    for entry in std::fs::read_dir(&path).into_iter().flatten().filter_map(Result::ok) {
        if entry.file_name().to_string_lossy().starts_with("LOG.old.") {
            // Harmless if it remains.
            let _ = std::fs::remove_file(entry.path());
        }
    }
    Ok(Opened { store: OpenStore { store, _snapshot: None }, snapshot: None })
}
