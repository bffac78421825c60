//! The versions between which a bisection searches.

use std::path::{Path, PathBuf};

use super::BisectArgs;
use super::repository::Repository;
use actcheck_base::{Diagnostic, Diagnostics};

/// A revision or a program.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Version {
    /// The full hash of a revision, or the position of a program.
    pub id: String,
    /// A revision's short hash and subject, or a program's path.
    pub name: String,
}

impl Version {
    /// The full hash of a revision, or the path of a program.
    pub fn id_or_name(&self) -> &str {
        if self.id.len() >= 40 {
            &self.id
        } else {
            &self.name
        }
    }
}

/// The versions from the old to the new end.
pub struct Versions {
    /// The old end.
    pub old: Version,
    /// The new end: a descendant of the old one.
    pub new: Version,
    /// Whether the old end is the bad one, so that the first good version is searched.
    pub finds_fix: bool,
    source: Source,
}

enum Source {
    Git(Repository),
    Programs(Vec<PathBuf>),
}

impl Versions {
    /// Finds both ends.
    ///
    /// # Errors
    /// `X060` git can't be started, `X061` this is not a repository, `X062` an unknown revision,
    /// `X063` no way leads from one end to the other.
    pub fn find(args: &BisectArgs, scratch: &Path) -> Result<Self, Diagnostics> {
        let Some(good) = &args.good else {
            let version = |(at, path): (usize, &PathBuf)| Version {
                id: at.to_string(),
                name: path.display().to_string(),
            };
            let all: Vec<Version> = args.programs.iter().enumerate().map(version).collect();
            let [old, .., new] = all.as_slice() else {
                return Err(
                    Diagnostic::error("X063", "`--programs` needs two or more programs").into(),
                );
            };
            let source = Source::Programs(args.programs.clone());
            return Ok(Self {
                old: old.clone(),
                new: new.clone(),
                finds_fix: false,
                source,
            });
        };
        let repository = Repository::find(scratch)?;
        let [good, bad] = [(good, "--good"), (&args.bad, "--bad")]
            .map(|(name, option)| repository.revision(name, option));
        let (good, bad) = (good?, bad?);
        if good == bad {
            let fault = format!(
                "`{}` and `{}` are the same revision, {}",
                args.good.as_deref().unwrap_or_default(),
                args.bad,
                good.name
            );
            return Err(Diagnostic::error("X063", fault)
                .help("name an older revision with `--good`; uncommitted changes don't belong to any revision")
                .into());
        }
        let (old, new, finds_fix) = match (
            repository.is_ancestor(&good, &bad)?,
            repository.is_ancestor(&bad, &good)?,
        ) {
            (true, _) => (good, bad, false),
            (false, true) => (bad, good, true),
            (false, false) => return Err(repository.unrelated(&good, &bad).into()),
        };
        Ok(Self {
            old,
            new,
            finds_fix,
            source: Source::Git(repository),
        })
    }

    /// The good and the bad end.
    pub fn ends(&self) -> [&Version; 2] {
        if self.finds_fix {
            [&self.new, &self.old]
        } else {
            [&self.old, &self.new]
        }
    }

    /// Returns the versions after all `olds` and before `new`, those that halve the rest first.
    pub fn between(&self, olds: &[Version], new: &Version) -> Result<Vec<Version>, Diagnostics> {
        match &self.source {
            Source::Git(repository) => repository.between(olds, new),
            Source::Programs(paths) => Ok(between(paths, olds, new)),
        }
    }

    /// The repository, if versions are revisions.
    pub fn repository(&self) -> Option<&Repository> {
        match &self.source {
            Source::Git(repository) => Some(repository),
            Source::Programs(_) => None,
        }
    }

    /// A word for one version.
    pub fn word(&self) -> &'static str {
        if self.repository().is_some() {
            "revision"
        } else {
            "program"
        }
    }
}

/// The programs after the last old one and before the new one, from the middle outwards.
fn between(paths: &[PathBuf], olds: &[Version], new: &Version) -> Vec<Version> {
    let position = |version: &Version| version.id.parse::<usize>().unwrap_or_default();
    let first = olds.iter().map(position).max().map_or(0, |at| at + 1);
    let after = position(new);
    let middle = (first + after.saturating_sub(1)) / 2;
    let mut places: Vec<usize> = (first..after).collect();
    places.sort_by_key(|place| (place.abs_diff(middle), *place));
    places
        .into_iter()
        .map(|at| Version {
            id: at.to_string(),
            name: paths[at].display().to_string(),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn programs_in_the_middle_come_first() {
        let paths: Vec<PathBuf> = (0..8).map(|n| PathBuf::from(format!("p{n}"))).collect();
        let version = |at: usize| Version {
            id: at.to_string(),
            name: format!("p{at}"),
        };
        let names = |olds: &[Version], new| -> Vec<String> {
            between(&paths, olds, &version(new))
                .into_iter()
                .map(|version| version.name)
                .collect()
        };
        assert_eq!(
            names(&[version(0)], 7),
            ["p3", "p2", "p4", "p1", "p5", "p6"]
        );
        assert_eq!(names(&[version(0), version(3)], 7), ["p5", "p4", "p6"]);
        assert!(names(&[version(6)], 7).is_empty());
    }
}
