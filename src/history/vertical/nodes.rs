//! The subjects of the statements in a file of outlines, and which properties each has.
//!
//! Runs of a campaign are alike: most share their number of nodes, the order of their statements,
//! and the names of their nodes. These together are a profile, which is stored once.

use std::collections::HashMap;

use serde::{Deserialize, Serialize};

/// The runs of a file and their nodes.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Nodes {
    /// The IRI of each run without its number.
    pub base: String,
    /// The number of each run.
    pub numbers: Vec<u64>,
    /// Properties of consecutive statements about the same subject, by their numbers in the
    /// directory.
    pub shapes: Vec<Vec<u32>>,
    pub names: Vec<Name>,
    pub profiles: Vec<Profile>,
    /// The profile of each run.
    pub profile_of: Vec<u32>,
}

/// Maximum numbers of nodes and statements of a file: limit the memory that a corrupt one can
/// request. A file of this program has some hundred thousand.
const MOST_NODES: usize = 1 << 22;
const MOST_STATEMENTS: usize = 1 << 24;

/// The structure of a run.
#[derive(Debug, Clone, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub(super) struct Profile {
    /// The name of each node.
    pub names: Vec<u32>,
    /// Node (its position in `names`) and shape of consecutive statements.
    pub segments: Vec<(u32, u32)>,
}

/// How a node is named.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub(super) enum Name {
    /// The IRI of the run, with this text at its end.
    Below(String),
    /// A blank node whose label follows from the subject and the property of the assertion that it
    /// is.
    Assertion,
    /// A blank node whose label follows from the assertion of which it is the result.
    Outcome,
    Iri(String),
    Blank(String),
}

impl Nodes {
    /// Number of nodes in all runs. Returns `None` if the parts do not fit each other, so that the
    /// file is damaged.
    pub(super) fn count(&self, properties: usize) -> Option<u32> {
        let fits = self
            .shapes
            .iter()
            .flatten()
            .all(|property| (*property as usize) < properties)
            && self.profile_of.len() == self.numbers.len()
            && self.profiles.iter().all(|profile| {
                profile
                    .names
                    .iter()
                    .all(|name| (*name as usize) < self.names.len())
                    && profile.segments.iter().all(|(node, shape)| {
                        (*node as usize) < profile.names.len()
                            && (*shape as usize) < self.shapes.len()
                    })
            });
        if !fits {
            return None;
        }
        // A structure takes few bytes and belongs to any number of runs.
        let shape = |segment: &(u32, u32)| self.shapes.get(segment.1 as usize).map_or(0, Vec::len);
        let statements = |profile: &Profile| {
            profile
                .segments
                .iter()
                .map(shape)
                .fold(0, usize::saturating_add)
        };
        let sizes: Vec<(usize, usize)> = self
            .profiles
            .iter()
            .map(|profile| (profile.names.len(), statements(profile)))
            .collect();
        let (mut count, mut all) = (0usize, 0usize);
        for profile in &self.profile_of {
            let (nodes, statements) = sizes.get(*profile as usize)?;
            (count, all) = (count.checked_add(*nodes)?, all.checked_add(*statements)?);
            if count > MOST_NODES || all > MOST_STATEMENTS {
                return None;
            }
        }
        u32::try_from(count).ok()
    }

    /// The subjects of each chosen property, by their numbers in the file, in the order of the
    /// statements. `place`: the position of each property among the chosen ones.
    pub(super) fn subjects(&self, place: &[Option<usize>], chosen: usize) -> Vec<Vec<u32>> {
        let shapes: Vec<Vec<usize>> = self
            .shapes
            .iter()
            .map(|shape| {
                shape
                    .iter()
                    .filter_map(|property| place.get(*property as usize).copied().flatten())
                    .collect()
            })
            .collect();
        let mut subjects = vec![Vec::new(); chosen];
        let mut first = 0;
        for profile in self
            .profile_of
            .iter()
            .filter_map(|profile| self.profiles.get(*profile as usize))
        {
            for (node, shape) in &profile.segments {
                for place in shapes.get(*shape as usize).into_iter().flatten() {
                    subjects[*place].push(first + node);
                }
            }
            first += profile.names.len() as u32;
        }
        subjects
    }
}

/// Gives equal values equal numbers.
pub(super) struct Numbers<T> {
    pub all: Vec<T>,
    known: HashMap<T, u32>,
}

impl<T> Default for Numbers<T> {
    fn default() -> Self {
        Self {
            all: Vec::new(),
            known: HashMap::new(),
        }
    }
}

impl<T: Clone + Eq + std::hash::Hash> Numbers<T> {
    pub(super) fn of(&mut self, value: T) -> u32 {
        if let Some(number) = self.known.get(&value) {
            return *number;
        }
        let number = self.all.len() as u32;
        self.all.push(value.clone());
        self.known.insert(value, number);
        number
    }
}
