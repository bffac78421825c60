//! Reads `[relations]`: the changes with which each scene is run a second time, and the rules that
//! both runs must satisfy.

use std::path::Path;

use crate::{Located, Table, resolve_path};
use actcheck_base::{Diagnostics, Files, Source};

/// A change of a scene whose effect on the verdicts is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum SceneChange {
    /// Left and right are swapped: positions, headings and errors of sensing.
    Mirrored,
    /// The friction of the target is greater by a tenth.
    MoreFriction,
    /// The mass of the target is smaller by a tenth.
    LessMass,
    /// The other object that is farthest from the target is left out, if it is far away.
    WithoutFarObject,
    /// All objects have other ids, in another alphabetical order.
    Renamed,
}

impl SceneChange {
    /// All changes.
    pub const ALL: [Self; 5] = [
        Self::Mirrored,
        Self::MoreFriction,
        Self::LessMass,
        Self::WithoutFarObject,
        Self::Renamed,
    ];

    /// Returns its key in `[relations]`.
    pub fn word(self) -> &'static str {
        match self {
            Self::Mirrored => "mirrored",
            Self::MoreFriction => "more_friction",
            Self::LessMass => "less_mass",
            Self::WithoutFarObject => "without_far_object",
            Self::Renamed => "renamed",
        }
    }

    /// Returns the change with this key.
    pub fn by_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|change| change.word() == word)
    }
}

/// A relation between two runs: the difference of the second scene, and the rules for both.
#[derive(Debug, Clone, PartialEq)]
pub struct Relation {
    /// The difference between the scenes.
    pub change: SceneChange,
    /// The rules about the verdicts of both runs.
    pub rule: Source,
}

/// Reads `[relations]`.
pub(super) fn read(table: &mut Table, folder: &Path, found: &mut Diagnostics) -> Vec<Relation> {
    let Some(mut relations) = table.table("relations") else {
        return Vec::new();
    };
    let read = SceneChange::ALL.into_iter().filter_map(|change| {
        let written = relations.string(change.word())?;
        let rule = rule_file(&mut relations, "the relation's", folder, &written)?;
        Some(Relation { change, rule })
    });
    let read = read.collect();
    relations.finish(found);
    read
}

/// Reads a file of rules that a table names; `whose` rules it has is for the message.
pub(super) fn rule_file(
    table: &mut Table,
    whose: &str,
    folder: &Path,
    written: &Located<String>,
) -> Option<Source> {
    let path = resolve_path(folder, &written.value);
    let is_rules = path
        .extension()
        .is_some_and(|ending| ending == "rls" || ending == "rq");
    let read = if is_rules {
        Files::Disk.read(&path).map_err(|fault| fault.to_string())
    } else {
        Err("it ends neither in `.rls` nor in `.rq`".to_owned())
    };
    read.map_err(|reason| {
        let message = format!("cannot read {whose} rules {}: {reason}", path.display());
        table.fault(
            "C022",
            written.span.clone(),
            message,
            "the path is relative to the configuration",
        );
    })
    .ok()
}
