//! Reads a damaged store: finds out whether all of it can be read, and collects the readable part.
//!
//! The store keeps each statement in several indexes, in different files, so that most damage to
//! one of them loses nothing. Its iterators repeat an error for ever; everything here ends after
//! errors.

use std::collections::{BTreeSet, HashSet};

use oxigraph::model::vocab::rdf;
use oxigraph::model::{GraphNameRef, NamedNode, NamedOrBlankNode, Quad, Term};
use oxigraph::store::{StorageError, Store};

use crate::merge::about;
use crate::read::short_id;
use crate::statements::iri;
use crate::write_campaign::{campaign_node, end_properties};
use crate::write_run::run_node;

/// Number of errors in a row after which an iterator is abandoned: more than statements with one
/// unreadable term follow each other, and few enough to take about a second.
const MOST_ERRORS: usize = 100_000;
/// The same for the statements about one subject, of which there are many.
const MOST_ERRORS_OF_ONE: usize = 100;

/// The readable part of a damaged store.
pub(super) struct Salvaged {
    /// A store in memory.
    pub(super) store: Store,
    /// Runs that are lost, because a part of them can't be read: their ids, sorted.
    pub(super) lost: Vec<String>,
}

/// Reads every statement by subject, by property and by object, to find damage.
///
/// # Errors
/// A part can't be read.
pub(super) fn scan(store: &Store) -> Result<(), StorageError> {
    let (mut properties, mut objects) = (HashSet::new(), HashSet::new());
    for quad in store.iter() {
        let quad = quad?;
        properties.insert(quad.predicate);
        objects.insert(quad.object);
    }
    for property in properties {
        store
            .quads_for_pattern(None, Some(property.as_ref()), None, None)
            .find_map(Result::err)
            .map_or(Ok(()), Err)?;
    }
    for object in objects {
        store
            .quads_for_pattern(None, None, Some(object.as_ref()), None)
            .find_map(Result::err)
            .map_or(Ok(()), Err)?;
    }
    Ok(())
}

/// Collects the readable statements of a store. Runs that may lack some are left out completely,
/// and their campaigns lose their end, so that they can be resumed. The statements of the journal
/// are added; `is_whole` says whether it could be read completely. `traces` are the ids of the runs
/// that have a trace.
///
/// # Errors
/// There is not enough memory.
pub(super) fn salvage(
    store: &Store,
    journal: Vec<Quad>,
    is_whole: bool,
    traces: &[String],
) -> Result<Salvaged, StorageError> {
    let mut found = Collected::default();
    let is_readable = found.add(store.iter(), MOST_ERRORS);
    let is_complete = (is_readable || found.add_other_indexes(store)) && is_whole;
    let memory = Store::new()?;
    memory.extend(found.quads)?;
    memory.extend(journal)?;
    let mut lost = Vec::new();
    if !is_complete {
        let known = runs(&memory);
        for run in known.iter().filter(|run| about(store, run).is_err()) {
            about(&memory, run)?
                .iter()
                .try_for_each(|quad| memory.remove(quad))?;
            lost.push(short_id(run.as_str()).to_owned());
        }
        lost.extend(
            traces
                .iter()
                .filter(|id| !known.contains(&run_node(id)))
                .cloned(),
        );
        let campaign_of = |run: &String| {
            run.rsplit_once('-')
                .map_or_else(String::new, |(campaign, _)| campaign.to_owned())
        };
        let campaigns: BTreeSet<String> = lost.iter().map(campaign_of).collect();
        campaigns
            .iter()
            .try_for_each(|campaign| remove_end(&memory, campaign))?;
    }
    lost.sort();
    Ok(Salvaged {
        store: memory,
        lost,
    })
}

/// Removes the end of a campaign.
fn remove_end(memory: &Store, campaign: &str) -> Result<(), StorageError> {
    let (node, ends) = (campaign_node(campaign), end_properties());
    let about: Result<Vec<Quad>, StorageError> = memory
        .quads_for_pattern(
            Some(node.as_ref().into()),
            None,
            None,
            Some(GraphNameRef::DefaultGraph),
        )
        .collect();
    about?
        .iter()
        .filter(|quad| ends.contains(&quad.predicate))
        .try_for_each(|quad| memory.remove(quad))
}

/// Statements found so far.
#[derive(Default)]
struct Collected {
    quads: HashSet<Quad>,
    properties: HashSet<NamedNode>,
    subjects: HashSet<NamedOrBlankNode>,
}

impl Collected {
    /// Adds readable statements, until there were more than `most` errors in a row. Returns whether
    /// everything could be.
    fn add(
        &mut self,
        quads: impl Iterator<Item = Result<Quad, StorageError>>,
        most: usize,
    ) -> bool {
        let (mut in_a_row, mut is_whole) = (0, true);
        for quad in quads {
            match quad {
                Ok(quad) => {
                    in_a_row = 0;
                    self.properties.insert(quad.predicate.clone());
                    self.subjects.insert(quad.subject.clone());
                    self.quads.insert(quad);
                }
                Err(_) => (in_a_row, is_whole) = (in_a_row + 1, false),
            }
            if in_a_row > most {
                return false;
            }
        }
        is_whole
    }

    /// Reads the indexes by property and by subject, until they name nothing new. Returns whether
    /// every property could be read completely: then nothing is lost.
    fn add_other_indexes(&mut self, store: &Store) -> bool {
        let (mut read, mut asked, mut is_whole) = (HashSet::new(), HashSet::new(), true);
        self.properties.insert(rdf::TYPE.into_owned());
        loop {
            let properties: Vec<NamedNode> = self.properties.difference(&read).cloned().collect();
            for property in properties {
                is_whole &= self.add(
                    store.quads_for_pattern(None, Some(property.as_ref()), None, None),
                    MOST_ERRORS,
                );
                read.insert(property);
            }
            let subjects: Vec<NamedOrBlankNode> =
                self.subjects.difference(&asked).cloned().collect();
            if subjects.is_empty() {
                return is_whole;
            }
            for subject in subjects {
                self.add(
                    store.quads_for_pattern(Some(subject.as_ref()), None, None, None),
                    MOST_ERRORS_OF_ONE,
                );
                asked.insert(subject);
            }
        }
    }
}

fn runs(store: &Store) -> Vec<NamedNode> {
    let class = Term::from(iri("act:Run"));
    let found = store.quads_for_pattern(
        None,
        Some(rdf::TYPE),
        Some(class.as_ref()),
        Some(GraphNameRef::DefaultGraph),
    );
    let runs = found.filter_map(|quad| match quad.ok()?.subject {
        NamedOrBlankNode::NamedNode(node) => Some(node),
        NamedOrBlankNode::BlankNode(_) => None,
    });
    runs.collect()
}
