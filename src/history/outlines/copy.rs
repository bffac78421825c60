//! Copies files of outlines from one history to another.

use std::path::{Path, PathBuf};

use crate::outlines::file::Opened;
use crate::outlines::shelf::{Needed, Unread, read_parts, unread};
use crate::{History, fault, folder};
use actcheck_base::{Below, Diagnostics};

impl History {
    /// The files that have many outlines of a campaign, each with the indices of its runs.
    ///
    /// # Errors
    /// `H007` a file is damaged.
    pub(crate) fn outline_files(
        &self,
        campaign: &str,
    ) -> Result<Vec<(PathBuf, Vec<u64>)>, Diagnostics> {
        self.of_outlines(&mut |shelf| {
            let files = shelf
                .files(Some(campaign))
                .into_iter()
                .filter(|file| !file.is_single);
            let read = |file: crate::outlines::shelf::OutlineFile| {
                let bytes = read_parts(&file.path, Needed::Indices)
                    .map_err(|error| unread(&file.path, &error))?;
                let indices = Opened::new(&bytes).and_then(|opened| opened.indices());
                let indices = indices.map_err(|why| Unread::Damaged(file.path.clone(), why))?;
                Ok((file.path, indices))
            };
            files.map(read).collect()
        })
    }

    /// Adds a copy of a file of another history. Returns its path, or `None` if there is a file
    /// with its name. It survives a power cut after [`History::sync_outlines`].
    ///
    /// # Errors
    /// `H007` the file is damaged. Writing failed: `H005`, `H006`.
    pub(crate) fn copy_outlines(&self, file: &Path) -> Result<Option<PathBuf>, Diagnostics> {
        let Some(name) = file.file_name() else {
            return Ok(None);
        };
        self.folder.begin_outlines()?;
        let new = self.folder.outlines().join(name);
        if new.exists() {
            return Ok(None);
        }
        let fault = |error| fault::io(self.dir(), "copying outlines", &error);
        let bytes = folder::read(file).map_err(fault)?;
        let whole = Opened::new(&bytes).and_then(|opened| opened.check());
        whole.map_err(|why| fault::damaged(self.dir(), &format!("`{}`: {why}", file.display())))?;
        // A link takes no space. Files of outlines are never changed, only replaced.
        let from = Below::new(file.parent().unwrap_or(file));
        self.folder.below().link(&from, file, &new).map_err(fault)?;
        Ok(Some(new))
    }

    /// Flushes copied files to the disk.
    ///
    /// # Errors
    /// Writing failed: `H005`, `H006`.
    pub(crate) fn sync_outlines(&self, files: &[PathBuf]) -> Result<(), Diagnostics> {
        let sync = |path: &PathBuf| folder::open(path).and_then(|file| file.sync_all());
        let synced = files.iter().try_for_each(sync).and_then(|()| match files {
            [] => Ok(()),
            _ => self.folder.below().sync_folder(&self.folder.outlines()),
        });
        synced.map_err(|error| fault::io(self.dir(), "copying outlines", &error))
    }
}
