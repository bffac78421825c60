//! Atomic writing of files.

use std::fs::{self, File};
use std::io::Write as _;
use std::path::Path;

/// Writes a file atomically, also across a power cut. The file has the suffix `.tmp` until it is complete.
///
/// # Errors
/// Returns an error if the file can't be written. An existing file is then unchanged.
pub fn write_atomic(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(".tmp");
    let temporary = path.with_file_name(name);
    let written = File::create(&temporary).and_then(|mut file| {
        file.write_all(bytes)?;
        file.sync_all()
    });
    if let Err(error) = written.and_then(|()| fs::rename(&temporary, path)) {
        // A partial file is useless. If its removal fails too, its suffix marks it as temporary.
        let _ = fs::remove_file(&temporary);
        return Err(error);
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    File::open(folder)?.sync_all()
}
