//! Judgements made after the run, in a separate graph beside the campaign's own.
//!
//! The campaign's own outcomes are in the default graph and never change, so that queries there get each outcome once.
//! A later judgement is written only if it differs, and names the one that it supersedes: the newest judgement is the
//! one that no other supersedes.

use std::collections::BTreeSet;

use oxigraph::model::{GraphNameRef, NamedNode, NamedOrBlankNode, Quad, Term};
use oxigraph::store::{StorageError, Store};

use crate::History;
use crate::detail::judgement;
use crate::graphs::below;
use crate::read::{Node, subjects_in};
use crate::statements::{Statements, iri, time};
use crate::write_run::{run_node, unique, write_assertion};
use actcheck_base::{Diagnostics, Judgement};

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

impl Recheck {
    /// Whether it differs from the newest judgement in the history.
    pub fn is_news(&self) -> bool {
        !self.before.as_ref().is_some_and(|before| before.judgement.same_as(&self.now))
    }
}

impl History {
    /// Returns the newest judgements of properties (IRIs) in one action of a run, sorted by property. `step` counts
    /// from 1.
    ///
    /// # Errors
    /// The store can't be read.
    pub fn newest(&self, run: &str, step: u32, properties: &[String]) -> Result<Vec<StoredJudgement>, Diagnostics> {
        let execution = execution(run, step);
        newest(&*self.store()?, &execution, properties).map_err(|error| self.fault("reading a run's outcomes", &error))
    }

    /// Stores the new judgements in one transaction: all of them or none. `at` is RFC 3339.
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
        let quads = statements.quads.into_iter().map(|quad| Quad { graph_name: graph.clone().into(), ..quad });
        self.store()?.extend(quads).map_err(|error| self.fault("writing outcomes", &error))
    }
}

fn execution(run: &str, step: u32) -> NamedNode {
    below(&run_node(run), &step.to_string())
}

fn newest(store: &Store, execution: &NamedNode, properties: &[String]) -> Result<Vec<StoredJudgement>, StorageError> {
    let graph = iri(GRAPH);
    let mut superseded = BTreeSet::new();
    let mut found = Vec::new();
    for graph in [GraphNameRef::DefaultGraph, GraphNameRef::NamedNode(graph.as_ref())] {
        for node in subjects_in(store, "earl:subject", execution.as_ref(), graph)? {
            let assertion = Node::read_in(store, &node, graph)?;
            superseded.extend(assertion.all("act:supersedes").iter().map(Term::to_string));
            if assertion.text("earl:test").is_some_and(|property| properties.contains(&property)) {
                found.push(StoredJudgement { judgement: judgement(store, &assertion, graph)?, assertion: node });
            }
        }
    }
    found.retain(|stored| !superseded.contains(&stored.assertion.to_string()));
    found.sort_by(|a, b| a.judgement.property.cmp(&b.judgement.property));
    Ok(found)
}

fn write(recheck: &Recheck, at: &str, statements: &mut Statements) {
    let execution = execution(&recheck.run, recheck.step);
    let supersedes = recheck.before.as_ref().map(|before| before.assertion.clone());
    // Two rechecks within the same second have different predecessors, so they get different nodes.
    let predecessor = supersedes.as_ref().map(ToString::to_string).unwrap_or_default();
    let of = |part| unique(&[execution.as_str(), &recheck.now.property, part, at, &predecessor]);
    let assertion = of("recheck");
    write_assertion(&recheck.now, &execution, [assertion.clone(), of("recheck result")], statements);
    statements.about(assertion).has("act:recheckedAt", time(at)).optional("act:supersedes", supersedes.map(Term::from));
}
