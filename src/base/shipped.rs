//! The copy of this repository's ontology, rules and models that the program carries (feature `shipped`).

use std::path::PathBuf;

#[cfg(feature = "shipped")]
mod carried {
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

/// Bytes of a carried file, by its path from the repository's root. Returns `None` if there is no such file.
#[cfg(feature = "shipped")]
pub(crate) fn read(key: &str) -> Option<Vec<u8>> {
    use carried::{Models, Ontology, Rules};
    let file = Ontology::get(key).or_else(|| Rules::get(key)).or_else(|| Models::get(key))?;
    Some(file.data.into_owned())
}

/// Paths of all carried files.
#[cfg(feature = "shipped")]
pub(crate) fn paths() -> Vec<PathBuf> {
    use carried::{Models, Ontology, Rules};
    let names = Ontology::iter().chain(Rules::iter()).chain(Models::iter());
    names.map(|name| PathBuf::from(name.as_ref())).collect()
}

/// Returns `None`: without the feature nothing is carried.
#[cfg(not(feature = "shipped"))]
pub(crate) fn read(_key: &str) -> Option<Vec<u8>> {
    None
}

/// Returns no paths: without the feature nothing is carried.
#[cfg(not(feature = "shipped"))]
pub(crate) fn paths() -> Vec<PathBuf> {
    Vec::new()
}
