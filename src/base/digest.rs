//! Content hashes, for provenance and for the comparison of traces.

use std::sync::OnceLock;

use sha2::{Digest as _, Sha256};

static PROGRAM_DIGEST: OnceLock<&'static str> = OnceLock::new();

/// Sets the digest of the sources that this program was built from, including its dependencies.
/// Only the first call has an effect.
pub fn set_program_digest(sources_digest: &'static str) {
    PROGRAM_DIGEST.get_or_init(|| sources_digest);
}

/// Returns the digest that [`set_program_digest`] set; empty if it was not called.
pub fn program_digest() -> &'static str {
    PROGRAM_DIGEST.get().copied().unwrap_or_default()
}

/// An incremental SHA-256 over parts. Each part is preceded by its length, so that different splits
/// give different digests.
#[derive(Debug, Clone, Default)]
pub struct Digest(Sha256);

impl Digest {
    /// An empty digest.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds one part.
    pub fn update(&mut self, part: &[u8]) {
        self.0.update((part.len() as u64).to_le_bytes());
        self.0.update(part);
    }

    /// Adds numbers by their bits: only identical bits give the same digest.
    pub fn update_bits(&mut self, values: &[f32]) {
        self.0.update((values.len() as u64).to_le_bytes());
        for value in values {
            self.0.update(value.to_bits().to_le_bytes());
        }
    }

    /// Returns the first 128 bits in hexadecimal.
    pub fn finish(self) -> String {
        self.0
            .finalize()
            .iter()
            .take(16)
            .map(|byte| format!("{byte:02x}"))
            .collect()
    }
}

/// Returns the digest of one text.
pub fn digest_of(text: &str) -> String {
    let mut digest = Digest::new();
    digest.update(text.as_bytes());
    digest.finish()
}
