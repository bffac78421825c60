//! The search for the first version of the new kind.

use super::judge::Unjudged;
use super::versions::{Version, Versions};

/// The answer for one version.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Step {
    /// Whether the version is like the new end. `None` if it can't be decided: the version is
    /// skipped.
    pub is_new: Option<bool>,
    /// The reason.
    pub reason: String,
    /// The word for the answer: `good`, `bad` or `skipped`.
    pub word: &'static str,
}

/// The result of a search.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Found {
    /// The first new version, and an old one before it.
    First {
        /// The version.
        version: Version,
        /// The newest old one that was judged.
        before: Version,
    },
    /// The first new version is one of these: all but the last were skipped.
    OneOf(Vec<Version>),
}

/// Halves the versions between the ends until one is left. `step` receives a version and the number
/// of versions that can still be the first new one.
pub fn search(
    versions: &Versions,
    mut step: impl FnMut(&Version, usize) -> Result<Step, Unjudged>,
) -> Result<Found, Unjudged> {
    let (mut olds, mut new) = (vec![versions.old.clone()], versions.new.clone());
    let mut skipped: Vec<Version> = Vec::new();
    loop {
        let between = versions.between(&olds, &new)?;
        let untried = between
            .iter()
            .find(|version| skipped.iter().all(|skipped| skipped.id != version.id));
        let Some(untried) = untried else {
            let mut left: Vec<Version> = skipped
                .into_iter()
                .filter(|skipped| between.iter().any(|version| version.id == skipped.id))
                .collect();
            if left.is_empty() {
                let before = olds.pop().unwrap_or_else(|| versions.old.clone());
                return Ok(Found::First {
                    version: new,
                    before,
                });
            }
            left.push(new);
            return Ok(Found::OneOf(left));
        };
        let version = match versions.repository() {
            Some(repository) => repository.named(untried)?,
            None => untried.clone(),
        };
        match step(&version, between.len() + 1)?.is_new {
            Some(true) => new = version,
            Some(false) => olds.push(version),
            None => skipped.push(version),
        }
    }
}
