//! Computes a digest of this program's sources, so that a replay detects a changed program of the
//! same version.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

/// The sources of the program. The embedded rules, ontology and models have their own digests.
const MADE_FROM: [&str; 3] = ["src", "Cargo.toml", "Cargo.lock"];

fn main() -> io::Result<()> {
    let mut digest = Sha256::new();
    for name in MADE_FROM {
        // Cargo watches folders recursively.
        println!("cargo::rerun-if-changed={name}");
        let mut files = Vec::new();
        collect(Path::new(name), &mut files)?;
        files.sort();
        for file in files {
            let text = fs::read(&file)?;
            digest.update(file.to_string_lossy().replace('\\', "/"));
            // Lengths separate the parts.
            digest.update((text.len() as u64).to_le_bytes());
            digest.update(&text);
        }
    }
    let hexadecimal: String = digest
        .finalize()
        .iter()
        .take(16)
        .map(|byte| format!("{byte:02x}"))
        .collect();
    println!("cargo::rustc-env=ACTCHECK_SOURCES_DIGEST={hexadecimal}");
    Ok(())
}

/// The file, or all files of the folder; empty if the path does not exist.
fn collect(path: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    if path.is_dir() {
        for entry in fs::read_dir(path)? {
            collect(&entry?.path(), files)?;
        }
    } else if path.is_file() {
        files.push(path.to_path_buf());
    }
    Ok(())
}
