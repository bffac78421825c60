//! Digest of this program's sources, so that a replay can name a changed program even where its version is the same.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

/// What the program is made from, beside the rules, ontology and models that it carries: these have digests of their own.
const MADE_FROM: [&str; 3] = ["src", "Cargo.toml", "Cargo.lock"];

fn main() -> io::Result<()> {
    let mut digest = Sha256::new();
    for name in MADE_FROM {
        // Cargo looks into folders by itself.
        println!("cargo::rerun-if-changed={name}");
        let mut files = Vec::new();
        collect(Path::new(name), &mut files)?;
        files.sort();
        for file in files {
            let text = fs::read(&file)?;
            digest.update(file.to_string_lossy().replace('\\', "/"));
            // Lengths keep parts from running into each other.
            digest.update((text.len() as u64).to_le_bytes());
            digest.update(&text);
        }
    }
    let hexadecimal: String = digest.finalize().iter().take(16).map(|byte| format!("{byte:02x}")).collect();
    println!("cargo::rustc-env=ACTCHECK_SOURCES_DIGEST={hexadecimal}");
    Ok(())
}

/// The file, or all files of the folder; none where it is not there.
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
