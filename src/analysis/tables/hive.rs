//! The files of a mirror in the layout of Hive, `campaign=ID/….parquet`. Readers of such folders
//! make a column of the id in the path, so the files must not have it.

use std::io::Cursor;
use std::path::Path;

use polars::prelude::ParquetWriter;

use super::mirror::{read, unread};
use actcheck_base::Diagnostics;

/// The content of a mirror's file without the column `campaign`.
///
/// # Errors
/// `A002`: it can't be read.
pub fn without_campaign(file: &Path) -> Result<Vec<u8>, Diagnostics> {
    let written = || {
        let (mut frame, mut bytes) = (read(file, None)?.drop("campaign")?, Cursor::new(Vec::new()));
        ParquetWriter::new(&mut bytes).finish(&mut frame)?;
        Ok(bytes.into_inner())
    };
    written().map_err(|error| unread(file, &error))
}
