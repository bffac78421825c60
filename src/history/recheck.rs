//! Judgements made after the run, in a separate graph beside the campaign's own.
//!
//! The campaign's own outcomes are in the default graph and never change, so that queries there get
//! each outcome once. A later judgement is written only if it differs, and names the one that it
//! supersedes: the newest judgement is the one that no other supersedes.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{PoisonError, RwLock};

use oxigraph::model::{
    GraphNameRef, NamedNode, NamedNodeRef, NamedOrBlankNode, Quad, QuadRef, Term,
};
use oxigraph::store::{StorageError, Store};

use crate::detail::judgement;
use crate::graphs::below;
use crate::quad_source::QuadSource;
use crate::read::{Node, id_of, subjects_in};
use crate::statements::{Statements, iri, time};
use crate::wanted::Wanted;
use crate::write_run::{assertion_of, run_node, unique, write_assertion};
use crate::{History, RunDetail, lists};
use actcheck_base::{Diagnostics, Judgement};
use actcheck_verdict::{action_score, run_score};

/// The graph of judgements made after the run.
const GRAPH: &str = "act:rechecked";

/// A judgement in the history.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredJudgement {
    /// The judgement.
    pub judgement: Judgement,
    assertion: NamedOrBlankNode,
}

/// One property in one action of a stored run, judged again.
#[derive(Debug, Clone, PartialEq)]
pub struct Recheck {
    /// Id of the run.
    pub run: String,
    /// Position of the action in the test, from 1.
    pub step: u32,
    /// IRI of the action.
    pub action: String,
    /// The newest judgement in the history; `None` if the property was never judged there.
    pub before: Option<StoredJudgement>,
    /// The judgement by the current rules.
    pub now: Judgement,
}

/// Reader of the newest judgements of many runs, each of which it reads before its new judgements
/// are written.
///
/// It looks up once whether a property has been judged in any run, which takes longer than all else
/// for a new property. Judgements that the owner stores after that are not read: they stay in the
/// journal until the end.
pub struct NewestJudgements<'h> {
    history: &'h History,
    known: RwLock<BTreeMap<String, Judged>>,
}

/// Whether any run in the store has a judgement of a property.
#[derive(Debug, Clone, Copy)]
struct Judged {
    /// By its campaign.
    own: bool,
    /// After it was made.
    later: bool,
}

impl<'h> NewestJudgements<'h> {
    /// A reader that knows nothing yet.
    pub fn of(history: &'h History) -> Self {
        Self {
            history,
            known: RwLock::default(),
        }
    }

    /// Returns the newest judgements of properties (IRIs) in one action of a run, sorted by
    /// property. `step` counts from 1.
    ///
    /// # Errors
    /// The store can't be read.
    pub fn read(
        &self,
        run: &str,
        step: u32,
        properties: &[String],
    ) -> Result<Vec<StoredJudgement>, Diagnostics> {
        let execution = execution(run, step);
        let fault = |error| self.history.fault("reading a run's outcomes", &error);
        let (mut judged, mut later) = (Vec::new(), Vec::new());
        for property in properties {
            let is = self.is_judged(property)?;
            judged.extend(is.own.then(|| property.clone()));
            later.extend(is.later.then(|| property.clone()));
        }
        let store = self
            .history
            .loaded_store_with(|| Wanted::run(run_node(run).as_str()))?;
        let in_campaign = GraphNameRef::DefaultGraph;
        // Judgements of the campaign supersede nothing.
        let superseded = &mut BTreeSet::new();
        let own = match self.history.outlined_quads(run)? {
            Some(outline) => stored(&outline, in_campaign, &execution, properties, superseded),
            None if judged.is_empty() => Ok(Vec::new()),
            None => match self.history.own_judgements(run, step, &judged, &store) {
                Some(own) => Ok(own),
                None => stored(&*store, in_campaign, &execution, &judged, superseded),
            },
        };
        with_later(own.map_err(fault)?, &store, &execution, &later).map_err(fault)
    }

    fn is_judged(&self, property: &str) -> Result<Judged, Diagnostics> {
        if let Some(known) = self
            .known
            .read()
            .unwrap_or_else(PoisonError::into_inner)
            .get(property)
        {
            return Ok(*known);
        }
        // The store of a reader may lack the judgements of other runs until they are asked for.
        self.history.store_with(lists::of_outcomes)?;
        let store = self.history.store_with(lists::of_rechecked)?;
        let (test, later) = (iri("earl:test"), iri(GRAPH));
        let has = |graph| {
            store.has_value(
                test.as_ref(),
                NamedNodeRef::new_unchecked(property).into(),
                graph,
            )
        };
        let judged = has(GraphNameRef::DefaultGraph)
            .and_then(|own| {
                Ok(Judged {
                    own,
                    later: has(GraphNameRef::NamedNode(later.as_ref()))?,
                })
            })
            .map_err(|error| self.history.fault("reading outcomes", &error))?;
        self.known
            .write()
            .unwrap_or_else(PoisonError::into_inner)
            .insert(property.to_owned(), judged);
        Ok(judged)
    }
}

impl Recheck {
    /// Whether it differs from the newest judgement in the history.
    pub fn is_news(&self) -> bool {
        !self
            .before
            .as_ref()
            .is_some_and(|before| before.judgement.same_as(&self.now))
    }
}

impl History {
    /// Whether any run was judged after it was made.
    ///
    /// # Errors
    /// The store can't be read.
    pub(crate) fn has_later_judgements(&self) -> Result<bool, Diagnostics> {
        let graph = iri(GRAPH);
        let store = self.store()?;
        let mut quads = store.quads_for_pattern(
            None,
            None,
            None,
            Some(GraphNameRef::NamedNode(graph.as_ref())),
        );
        quads
            .next()
            .transpose()
            .map(|quad| quad.is_some())
            .map_err(|error| self.fault("reading later judgements", &error))
    }

    /// The campaign's own judgements of an action, from the copy in the run's trace file. Returns
    /// `None` if they must be read from the store.
    fn own_judgements(
        &self,
        run: &str,
        step: u32,
        wanted: &[String],
        store: &Store,
    ) -> Option<Vec<StoredJudgement>> {
        let (_, actions) = self.copied_parts(run, store)?;
        let (action, execution) = (
            actions.into_iter().find(|action| action.step == step)?,
            execution(run, step),
        );
        let judgements = action
            .judgements
            .into_iter()
            .filter(|judgement| wanted.contains(&judgement.property));
        let own: Vec<StoredJudgement> = judgements
            .map(|judgement| StoredJudgement {
                assertion: assertion_of(&execution, &judgement.property).into(),
                judgement,
            })
            .collect();
        // A merge that changed the run's id has kept the nodes.
        let subject = iri("earl:subject");
        let is_there = |stored: &StoredJudgement| {
            store.contains(QuadRef::new(
                &stored.assertion,
                &subject,
                &execution,
                GraphNameRef::DefaultGraph,
            ))
        };
        own.first()
            .is_none_or(|first| is_there(first).unwrap_or(false))
            .then_some(own)
    }

    /// Returns all details of a run as [`History::run`] does, with its newest judgements: later
    /// ones replace those of the campaign, and properties that were judged only later are added.
    /// Scores follow from these judgements.
    ///
    /// # Errors
    /// As [`History::run`].
    pub fn newest_run(&self, name: &str) -> Result<RunDetail, Diagnostics> {
        let mut run = self.run(name)?;
        let store = self.store_with(|| Wanted::run(run_node(&run.row.run).as_str()))?;
        let fault = |error| self.fault("reading a run's outcomes", &error);
        let mut is_judged_again = false;
        for action in &mut run.actions {
            let later = later(&store, &execution(&run.row.run, action.step)).map_err(fault)?;
            if later.is_empty() {
                continue;
            }
            action
                .judgements
                .retain(|own| later.iter().all(|later| later.property != own.property));
            action.judgements.extend(later);
            action
                .judgements
                .sort_by(|a, b| a.property.cmp(&b.property));
            action.score =
                action_score(action.judgements.iter().map(|judgement| judgement.outcome));
            is_judged_again = true;
        }
        if is_judged_again {
            let scores: Vec<f64> = run.actions.iter().map(|action| action.score).collect();
            run.row.score = run_score(&scores);
        }
        Ok(run)
    }

    /// Returns the number of judgements made after the runs of each campaign, by its id. A campaign
    /// without any is left out. As judgements are only ever added, an equal number means equal
    /// judgements.
    ///
    /// # Errors
    /// The store can't be read.
    pub fn later_counts(&self) -> Result<BTreeMap<String, u64>, Diagnostics> {
        let graph = iri(GRAPH);
        let store = self.store_with(|| Wanted::in_graph("earl:subject", GRAPH))?;
        let graph = GraphNameRef::NamedNode(graph.as_ref());
        let mut counts: BTreeMap<String, u64> = BTreeMap::new();
        for quad in
            store.quads_for_pattern(None, Some(iri("earl:subject").as_ref()), None, Some(graph))
        {
            let execution = quad
                .map_err(|error| self.fault("reading outcomes", &error))?
                .object;
            // The execution of run `k7f3-2` ends in `k7f3-2/1`.
            let run = id_of(&execution);
            if let Some((campaign, _)) = run.rsplit_once('-') {
                *counts.entry(campaign.to_owned()).or_default() += 1;
            }
        }
        Ok(counts)
    }

    /// Stores the new judgements: all of them or none. `at` is RFC 3339.
    ///
    /// # Errors
    /// Writing failed: `H005`, `H006`. Data stored before is complete.
    pub fn commit_rechecks(&self, rechecks: &[Recheck], at: &str) -> Result<(), Diagnostics> {
        let mut statements = Statements::default();
        for recheck in rechecks.iter().filter(|recheck| recheck.is_news()) {
            write(recheck, at, &mut statements);
        }
        if statements.quads.is_empty() {
            return Ok(());
        }
        let graph = iri(GRAPH);
        let quads = statements.quads.into_iter().map(|quad| Quad {
            graph_name: graph.clone().into(),
            ..quad
        });
        self.enter_quads(&quads.collect::<Vec<Quad>>(), "writing outcomes")?;
        self.load_long_journal()
    }

    /// Writes the judgements since the last call to tables, and flushes everything to the disk.
    ///
    /// # Errors
    /// Writing failed: `H005`, `H006`.
    pub fn finish_rechecks(&self) -> Result<(), Diagnostics> {
        self.load_journal()?;
        self.flush()
    }
}

fn execution(run: &str, step: u32) -> NamedNode {
    below(&run_node(run), &step.to_string())
}

/// Adds the judgements made after the run, and removes those that they supersede.
fn with_later(
    mut found: Vec<StoredJudgement>,
    later: &Store,
    execution: &NamedNode,
    properties: &[String],
) -> Result<Vec<StoredJudgement>, StorageError> {
    if properties.is_empty() {
        return Ok(found);
    }
    let graph = iri(GRAPH);
    let mut superseded = BTreeSet::new();
    found.extend(stored(
        later,
        GraphNameRef::NamedNode(graph.as_ref()),
        execution,
        properties,
        &mut superseded,
    )?);
    found.retain(|stored| !superseded.contains(&stored.assertion.to_string()));
    found.sort_by(|a, b| a.judgement.property.cmp(&b.judgement.property));
    Ok(found)
}

/// The judgements of properties in a graph. Adds the assertions that they supersede to
/// `superseded`.
fn stored(
    store: &impl QuadSource,
    graph: GraphNameRef<'_>,
    execution: &NamedNode,
    properties: &[String],
    superseded: &mut BTreeSet<String>,
) -> Result<Vec<StoredJudgement>, StorageError> {
    let mut found = Vec::new();
    let test = iri("earl:test");
    for node in subjects_in(store, "earl:subject", execution.as_ref(), graph)? {
        // Those of the campaign supersede nothing. A look-up takes a tenth of the time of reading a
        // node.
        if let ([property], GraphNameRef::DefaultGraph) = (properties, graph)
            && !store.has(QuadRef::new(
                &node,
                &test,
                NamedNodeRef::new_unchecked(property),
                graph,
            ))?
        {
            continue;
        }
        let assertion = Node::read_in(store, &node, graph)?;
        superseded.extend(assertion.all("act:supersedes").iter().map(Term::to_string));
        if assertion
            .text("earl:test")
            .is_some_and(|property| properties.contains(&property))
        {
            found.push(StoredJudgement {
                judgement: judgement(store, &assertion, graph)?,
                assertion: node,
            });
        }
    }
    Ok(found)
}

/// The judgements of an action that were made after the run and that no other supersedes, unsorted.
fn later(store: &Store, execution: &NamedNode) -> Result<Vec<Judgement>, StorageError> {
    let graph = iri(GRAPH);
    let graph = GraphNameRef::NamedNode(graph.as_ref());
    let (mut superseded, mut found) = (BTreeSet::new(), Vec::new());
    for node in subjects_in(store, "earl:subject", execution.as_ref(), graph)? {
        let assertion = Node::read_in(store, &node, graph)?;
        superseded.extend(assertion.all("act:supersedes").iter().map(Term::to_string));
        found.push((node.to_string(), judgement(store, &assertion, graph)?));
    }
    found.retain(|(node, _)| !superseded.contains(node));
    Ok(found.into_iter().map(|(_, judgement)| judgement).collect())
}

fn write(recheck: &Recheck, at: &str, statements: &mut Statements) {
    let execution = execution(&recheck.run, recheck.step);
    let supersedes = recheck
        .before
        .as_ref()
        .map(|before| before.assertion.clone());
    // Two rechecks within the same second have different predecessors, so they get different nodes.
    let predecessor = supersedes
        .as_ref()
        .map(ToString::to_string)
        .unwrap_or_default();
    let of = |part| {
        unique(&[
            execution.as_str(),
            &recheck.now.property,
            part,
            at,
            &predecessor,
        ])
    };
    let assertion = of("recheck");
    write_assertion(
        &recheck.now,
        &execution,
        [assertion.clone(), of("recheck result")],
        statements,
    );
    statements
        .about(assertion)
        .has("act:recheckedAt", time(at))
        .optional("act:supersedes", supersedes.map(Term::from));
}
