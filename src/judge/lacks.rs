//! The facts that the caller did not give.

use std::collections::BTreeSet;

use actcheck_base::names;
use actcheck_data::Trace;

/// Names of missing facts, as [`Trace::lacks`] has them.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Lacks {
    names: BTreeSet<String>,
    /// Whether the class of an object is missing.
    pub(crate) classes: bool,
}

/// Facts that are given together, by the key that gives them.
pub(crate) const ROTATION: &[&str] = &["qx", "qy", "qz", "qw", "yaw", "tilt"];
pub(crate) const BOUNDS: &[&str] = &["minX", "minY", "minZ", "maxX", "maxY", "maxZ"];
pub(crate) const SIZE: &[&str] = &["sizeX", "sizeY", "sizeZ"];
pub(crate) const LINEAR: &[&str] = &["vx", "vy", "vz"];
pub(crate) const ANGULAR: &[&str] = &["wx", "wy", "wz"];
pub(crate) const BASE: &[&str] = &["baseX", "baseY", "baseYaw"];
pub(crate) const BELIEVED: &[&str] = &["believedX", "believedY", "believedYaw"];
pub(crate) const LIMITS: &[&str] = &["lower", "upper"];
pub(crate) const CONTACTS: &[&str] = &["first", "second", "maxForce"];
pub(crate) const SELF_CONTACTS: &[&str] = &[
    "firstLink",
    "secondLink",
    "seenAt",
    "maxDepth",
    "fingersMeet",
];
pub(crate) const LOOK: &[&str] = &[
    "takenAt",
    "takenBaseX",
    "takenBaseY",
    "takenBaseYaw",
    "takenBelievedX",
    "takenBelievedY",
    "takenBelievedYaw",
    "cameraX",
    "cameraY",
    "cameraZ",
];
pub(crate) const PERCEIVED: &[&str] = &["seenAs", "extentX", "extentY"];
pub(crate) const BASE_PATH: &[&str] = &["baseMinX", "baseMinY", "baseMaxX", "baseMaxY"];

impl Lacks {
    /// Notes missing facts.
    pub(crate) fn add(&mut self, names: &[&str]) {
        self.names
            .extend(names.iter().map(|name| (*name).to_owned()));
    }

    /// Notes a missing fact.
    pub(crate) fn add_one(&mut self, name: String) {
        self.names.insert(name);
    }

    /// Notes the missing facts of another.
    pub(crate) fn add_all(&mut self, other: &Self) {
        self.names.extend(other.names.iter().cloned());
        self.classes |= other.classes;
    }

    /// Writes them into a trace.
    pub(crate) fn note(self, trace: &mut Trace) {
        trace.lacks = self.names.into_iter().collect();
    }
}

/// IRI of the property that gives a thing its class.
pub(crate) fn class_iri() -> String {
    format!("{}type", names::RDF)
}
