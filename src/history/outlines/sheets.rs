//! The statements of files of outlines by property, without the rest of the files.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::PathBuf;

use crate::History;
use crate::folder;
use crate::outlines::file::{HEADER, Opened};
use crate::outlines::shelf::{Unread, unread};
use crate::vertical::{Sheet, Source, Stop};

/// A file of outlines with its statements by property.
#[derive(Debug, Clone)]
pub(crate) struct SheetFile {
    pub path: PathBuf,
    /// Indices of runs that another file has, too.
    pub there: BTreeSet<u64>,
}

/// Statements in a file.
struct InFile {
    file: File,
    start: usize,
    length: usize,
}

impl Source for InFile {
    fn bytes(&self, from: usize, to: usize) -> Result<Vec<u8>, String> {
        if from > to || to > self.length {
            return Err("it ends too early".to_owned());
        }
        let read = || {
            let mut file = &self.file;
            file.seek(SeekFrom::Start((self.start + from) as u64))?;
            let mut bytes = vec![0; to - from];
            file.read_exact(&mut bytes).map(|()| bytes)
        };
        read().map_err(|error: std::io::Error| error.to_string())
    }
}

impl SheetFile {
    /// Opens its statements.
    ///
    /// # Errors
    /// It is gone or damaged.
    pub(crate) fn open(&self) -> Result<Sheet<Box<dyn Source>>, Stop> {
        let read = || -> std::io::Result<([u8; HEADER], File)> {
            let (mut header, mut file) = ([0; HEADER], folder::open(&self.path)?);
            file.read_exact(&mut header).map(|()| (header, file))
        };
        let (header, file) = read().map_err(|error| stop(unread(&self.path, &error)))?;
        let damaged = |why| Stop::Damaged(self.path.clone(), why);
        let place = Opened::statements_at(&header).map_err(damaged)?;
        let length = place.len();
        if file
            .metadata()
            .is_ok_and(|found| found.len() < place.end as u64)
        {
            return Err(damaged("it ends too early".to_owned()));
        }
        let source = InFile {
            file,
            start: place.start,
            length,
        };
        Sheet::open(Box::new(source) as Box<dyn Source>, length).map_err(damaged)
    }
}

/// The reason why a file can't be used.
fn stop(unread: Unread) -> Stop {
    match unread {
        Unread::Gone => Stop::Gone,
        Unread::Damaged(path, why) => Stop::Damaged(path, why),
    }
}

impl History {
    /// The files that together have all outlines, sorted.
    ///
    /// # Errors
    /// A file is gone or damaged.
    pub(crate) fn sheet_files(&self) -> Result<Vec<SheetFile>, Stop> {
        let chosen = self.shelf().chosen(None).map_err(stop)?;
        Ok(chosen
            .into_iter()
            .map(|(file, there)| SheetFile {
                path: file.path,
                there,
            })
            .collect())
    }
}
