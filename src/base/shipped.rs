//! This repository's ontology, rules and models, embedded in the program (feature `shipped`).

use std::path::PathBuf;

#[cfg(feature = "shipped")]
mod embedded {
    #[derive(rust_embed::RustEmbed)]
    #[folder = "shipped/ontology/"]
    #[prefix = "ontology/"]
    pub(super) struct Ontology;

    #[derive(rust_embed::RustEmbed)]
    #[folder = "shipped/rules/"]
    #[prefix = "rules/"]
    pub(super) struct Rules;

    #[derive(rust_embed::RustEmbed)]
    #[folder = "shipped/models/"]
    #[prefix = "models/"]
    pub(super) struct Models;
}

/// Returns the bytes of an embedded file, by its path from the repository's root, or `None` if it
/// does not exist.
#[cfg(feature = "shipped")]
pub(crate) fn read(key: &str) -> Option<Vec<u8>> {
    use embedded::{Models, Ontology, Rules};
    let file = Ontology::get(key)
        .or_else(|| Rules::get(key))
        .or_else(|| Models::get(key))?;
    Some(file.data.into_owned())
}

/// Returns the paths of all embedded files.
#[cfg(feature = "shipped")]
pub(crate) fn paths() -> Vec<PathBuf> {
    use embedded::{Models, Ontology, Rules};
    let names = Ontology::iter().chain(Rules::iter()).chain(Models::iter());
    names.map(|name| PathBuf::from(name.as_ref())).collect()
}

/// Returns `None`: without the feature, no files are embedded.
#[cfg(not(feature = "shipped"))]
pub(crate) fn read(_key: &str) -> Option<Vec<u8>> {
    None
}

/// Returns no paths: without the feature, no files are embedded.
#[cfg(not(feature = "shipped"))]
pub(crate) fn paths() -> Vec<PathBuf> {
    Vec::new()
}
