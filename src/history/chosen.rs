//! Which statements of a journal's record are wanted, by the numbers of their terms.

use crate::journal::Written;
use crate::wanted::{Fixed, InGraph, Pattern, Wanted};

/// The wanted statements of a record.
pub(super) struct Chosen {
    /// Whether all of them are.
    all: bool,
    patterns: Vec<Numbered>,
}

/// A pattern with numbers of terms.
struct Numbered {
    /// Subject, property and value: the numbers of the terms that fit, or `None` if all do.
    terms: [Option<Vec<u32>>; 3],
    graph: Graph,
}

/// The graph of a statement, with numbers as in a record.
enum Graph {
    Any,
    Named,
    Is(u32),
}

impl Chosen {
    pub(super) fn of(wanted: &Wanted, terms: &[Written<'_>]) -> Self {
        let is_named = |run: &String| {
            terms.iter().any(|term| match term {
                Written::Iri(iri) => iri
                    .strip_prefix(run.as_str())
                    .is_some_and(|rest| rest.is_empty() || rest.starts_with('/')),
                _ => false,
            })
        };
        Self {
            all: wanted.runs.iter().any(is_named),
            patterns: wanted
                .patterns
                .iter()
                .filter_map(|pattern| numbered(pattern, terms))
                .collect(),
        }
    }

    /// Whether a statement is wanted.
    pub(super) fn has(&self, row: &[u32; 4]) -> bool {
        let fits = |pattern: &Numbered| {
            let is_in = match pattern.graph {
                Graph::Any => true,
                Graph::Named => row[3] > 0,
                Graph::Is(graph) => row[3] == graph,
            };
            is_in
                && pattern
                    .terms
                    .iter()
                    .zip(row)
                    .all(|(fit, term)| fit.as_ref().is_none_or(|fit| fit.contains(term)))
        };
        self.all || self.patterns.iter().any(fits)
    }
}

/// Returns `None` if no statement of the record can fit.
fn numbered(pattern: &Pattern, terms: &[Written<'_>]) -> Option<Numbered> {
    let fitting = |fixed: &Option<Fixed>| match fixed {
        None => Some(None),
        Some(fixed) => {
            let found: Vec<u32> = (0u32..)
                .zip(terms)
                .filter(|(_, term)| fits(fixed, term))
                .map(|(at, _)| at)
                .collect();
            (!found.is_empty()).then_some(Some(found))
        }
    };
    let graph = match &pattern.graph {
        InGraph::Any => Graph::Any,
        InGraph::Named => Graph::Named,
        InGraph::Default => Graph::Is(0),
        InGraph::Is(iri) => {
            let at = (0u32..)
                .zip(terms)
                .find(|(_, term)| **term == Written::Iri(iri));
            Graph::Is(at?.0 + 1)
        }
    };
    Some(Numbered {
        terms: [
            fitting(&pattern.subject)?,
            fitting(&pattern.property)?,
            fitting(&pattern.value)?,
        ],
        graph,
    })
}

fn fits(fixed: &Fixed, term: &Written<'_>) -> bool {
    match (fixed, term) {
        (Fixed::Iri(wanted), Written::Iri(iri)) => wanted == iri,
        (Fixed::Below(wanted), Written::Iri(iri)) => iri.starts_with(wanted.as_str()),
        (Fixed::Text(wanted), Written::Text(text)) => wanted == text,
        _ => false,
    }
}
