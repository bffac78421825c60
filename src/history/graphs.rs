//! Facts as named graphs, for users' queries.
//!
//! The graphs omit properties that follow from others, properties that never change during a run,
//! and all but the strongest contact of each pair. Nothing is lost: the states have everything, and
//! rules judge stored runs by facts that are extracted from them.

use std::collections::{BTreeMap, BTreeSet};

use oxigraph::model::{GraphName, NamedNode, NamedOrBlankNode, Quad, Term};

use crate::terms::to_store;
use actcheck_base::{RunFacts, TermId, Terms, Triple, names};

/// Properties of the world vocabulary that the graphs omit.
///
/// `w:minZ` and `w:maxZ` are kept, because queries ask for heights; mass, friction, restitution and
/// whether a body is fixed (a platform) are stored once, with the objects of the scene; joint
/// limits belong to the robot.
pub(super) const LEFT_OUT: [&str; 13] = [
    "minX",
    "minY",
    "maxX",
    "maxY",
    "mass",
    "friction",
    "restitution",
    "fixed",
    "velocity",
    "lower",
    "upper",
    "maxVelocity",
    "maxEffort",
];

/// Classes whose members are recognisable by their properties.
pub(super) const UNTYPED: [&str; 8] = [
    "Joint",
    "Contact",
    "Hold",
    "Motion",
    "ActionPhase",
    "Percept",
    "PerceivedPlane",
    "PerceivedObject",
];

/// The node of a part, whose IRI is below that of `node`.
pub(super) fn below(node: &NamedNode, part: &str) -> NamedNode {
    NamedNode::new_unchecked(format!("{}/{part}", node.as_str()))
}

/// Graph of a state between actions; states count from 0.
pub(super) fn state_graph(run: &NamedNode, state: usize) -> NamedNode {
    below(run, &format!("state/{state}"))
}

/// Graph of the events during an action. `step` counts from 0, the graph's name from 1.
pub(super) fn during_graph(run: &NamedNode, step: usize) -> NamedNode {
    below(run, &format!("{}/during", step + 1))
}

/// Writes the facts of a run that queries ask for into its graphs.
pub(super) fn write(facts: &RunFacts, run: &NamedNode, quads: &mut Vec<Quad>) {
    let kept = Kept::of(&facts.terms);
    let stored = |triples: &[Triple]| {
        let weak = weak_contacts(triples, &facts.terms);
        triples
            .iter()
            .filter(|triple| kept.keeps(triple) && !weak.contains(&triple[0]))
            .copied()
            .collect()
    };
    write_graphs(facts, run, stored, quads);
}

/// Returns all facts of a run in its graphs.
pub(super) fn complete(facts: &RunFacts, run: &NamedNode) -> Vec<Quad> {
    let mut quads = Vec::new();
    write_graphs(facts, run, <[Triple]>::to_vec, &mut quads);
    quads
}

/// Writes the triples of each state and action that `select` returns into the graph of that state
/// or action.
fn write_graphs(
    facts: &RunFacts,
    run: &NamedNode,
    select: impl Fn(&[Triple]) -> Vec<Triple>,
    quads: &mut Vec<Quad>,
) {
    let terms: Vec<Term> = (0u32..)
        .take(facts.terms.len())
        .map(|id| to_store(facts.terms.term(id)))
        .collect();
    let mut write = |triples: &[Triple], graph: NamedNode| {
        let graph = GraphName::NamedNode(graph);
        quads.extend(select(triples).into_iter().filter_map(|[s, p, o]| {
            let subject = NamedOrBlankNode::try_from(terms[s as usize].clone()).ok()?;
            let Term::NamedNode(property) = &terms[p as usize] else {
                return None;
            };
            Some(Quad::new(
                subject,
                property.clone(),
                terms[o as usize].clone(),
                graph.clone(),
            ))
        }));
    };
    for (state, triples) in facts.snapshots.iter().enumerate() {
        write(triples, state_graph(run, state));
    }
    for (step, triples) in facts.during.iter().enumerate() {
        write(triples, during_graph(run, step));
    }
}

/// Filter of the triples that the graphs keep, by term ids.
struct Kept {
    left_out: BTreeSet<TermId>,
    untyped: BTreeSet<TermId>,
}

impl Kept {
    fn of(terms: &Terms) -> Self {
        let ids = |names: &[&str]| names.iter().filter_map(|name| w(terms, name)).collect();
        Self {
            left_out: ids(&LEFT_OUT),
            untyped: ids(&UNTYPED),
        }
    }

    /// Whether to keep a triple. The property need not be checked for `untyped`: only `rdf:type`
    /// has these values.
    fn keeps(&self, [_, property, value]: &Triple) -> bool {
        !self.left_out.contains(property) && !self.untyped.contains(value)
    }
}

fn w(terms: &Terms, local: &str) -> Option<TermId> {
    terms.id(&actcheck_base::Term::iri(names::w(local)))
}

/// Contacts whose pair of bodies has a stronger contact, or an equal one with a smaller id.
fn weak_contacts(triples: &[Triple], terms: &Terms) -> BTreeSet<TermId> {
    let [Some(first), Some(second), Some(force)] =
        ["first", "second", "maxForce"].map(|name| w(terms, name))
    else {
        return BTreeSet::new();
    };
    let mut contacts: BTreeMap<TermId, [Option<TermId>; 3]> = BTreeMap::new();
    for [subject, property, value] in triples {
        if let Some(slot) = [first, second, force]
            .iter()
            .position(|known| known == property)
        {
            contacts.entry(*subject).or_default()[slot] = Some(*value);
        }
    }
    let force_of = |contact: &[Option<TermId>; 3]| {
        contact[2]
            .and_then(|id| terms.term(id).number())
            .unwrap_or(0.0)
    };
    let mut strongest: BTreeMap<[Option<TermId>; 2], (TermId, f64)> = BTreeMap::new();
    let mut weak = BTreeSet::new();
    for (subject, contact) in &contacts {
        let best = strongest
            .entry([contact[0], contact[1]])
            .or_insert((*subject, force_of(contact)));
        if best.0 != *subject {
            if force_of(contact) > best.1 {
                weak.insert(best.0);
                *best = (*subject, force_of(contact));
            } else {
                weak.insert(*subject);
            }
        }
    }
    weak
}
