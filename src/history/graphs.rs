//! Facts as named graphs: what questions of people are about.
//!
//! A quad in a named graph takes about 250 bytes on disk. So the graphs leave out what another property says as well, what
//! never changes during a run, and all but the strongest contact of each pair. Nothing is lost: the trace has everything, and
//! rules judge stored runs by facts that are extracted from it.

use std::collections::{BTreeMap, BTreeSet};

use oxigraph::model::{GraphName, NamedNode, NamedOrBlankNode, Quad, Term};

use crate::base::{TermId, Terms, names};
use crate::facts::{RunFacts, Triple};
use crate::history::terms::to_store;

/// Properties of the world vocabulary that the graphs leave out.
///
/// `w:minZ` and `w:maxZ` say how high a body reaches, which is what questions are about; mass, friction, restitution and what is
/// fixed (a platform) are said once, of the objects of the scene; the limits of joints belong to the robot.
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

/// Classes that the properties of their members give away.
pub(super) const UNTYPED: [&str; 5] = ["Joint", "Contact", "Percept", "PerceivedPlane", "PerceivedObject"];

/// A node below another.
pub(super) fn below(node: &NamedNode, part: &str) -> NamedNode {
    NamedNode::new_unchecked(format!("{}/{part}", node.as_str()))
}

/// Graph of a state between actions, counted from 0.
pub(super) fn state_graph(run: &NamedNode, state: usize) -> NamedNode {
    below(run, &format!("state/{state}"))
}

/// Graph of what happened during an action, counted from 0 (its name counts from 1).
pub(super) fn during_graph(run: &NamedNode, step: usize) -> NamedNode {
    below(run, &format!("{}/during", step + 1))
}

/// States the facts of a run in its graphs.
pub(super) fn write(facts: &RunFacts, run: &NamedNode, quads: &mut Vec<Quad>) {
    let terms: Vec<Term> = (0u32..).take(facts.terms.len()).map(|id| to_store(facts.terms.term(id))).collect();
    let kept = Kept::of(&facts.terms);
    let mut write = |triples: &[Triple], graph: NamedNode| {
        let weak = weak_contacts(triples, &facts.terms);
        let graph = GraphName::NamedNode(graph);
        quads.extend(triples.iter().filter(|triple| kept.keeps(triple) && !weak.contains(&triple[0])).filter_map(
            |[s, p, o]| {
                let subject = NamedOrBlankNode::try_from(terms[*s as usize].clone()).ok()?;
                let Term::NamedNode(property) = &terms[*p as usize] else { return None };
                Some(Quad::new(subject, property.clone(), terms[*o as usize].clone(), graph.clone()))
            },
        ));
    };
    for (state, triples) in facts.snapshots.iter().enumerate() {
        write(triples, state_graph(run, state));
    }
    for (step, triples) in facts.during.iter().enumerate() {
        write(triples, during_graph(run, step));
    }
}

/// What the graphs keep, by the numbers of the terms.
struct Kept {
    left_out: BTreeSet<TermId>,
    untyped: BTreeSet<TermId>,
}

impl Kept {
    fn of(terms: &Terms) -> Self {
        let ids = |names: &[&str]| names.iter().filter_map(|name| w(terms, name)).collect();
        Self { left_out: ids(&LEFT_OUT), untyped: ids(&UNTYPED) }
    }

    /// Only classes have these terms as values, so that the property needs no look.
    fn keeps(&self, [_, property, value]: &Triple) -> bool {
        !self.left_out.contains(property) && !self.untyped.contains(value)
    }
}

fn w(terms: &Terms, local: &str) -> Option<TermId> {
    terms.id(&crate::base::Term::iri(names::w(local)))
}

/// Contacts of a pair that has a stronger one (or an equal one that is named before it).
fn weak_contacts(triples: &[Triple], terms: &Terms) -> BTreeSet<TermId> {
    let [Some(first), Some(second), Some(force)] = ["first", "second", "maxForce"].map(|name| w(terms, name)) else {
        return BTreeSet::new();
    };
    let mut contacts: BTreeMap<TermId, [Option<TermId>; 3]> = BTreeMap::new();
    for [subject, property, value] in triples {
        if let Some(slot) = [first, second, force].iter().position(|known| known == property) {
            contacts.entry(*subject).or_default()[slot] = Some(*value);
        }
    }
    let force_of = |contact: &[Option<TermId>; 3]| contact[2].and_then(|id| terms.term(id).number()).unwrap_or(0.0);
    let mut strongest: BTreeMap<[Option<TermId>; 2], (TermId, f64)> = BTreeMap::new();
    let mut weak = BTreeSet::new();
    for (subject, contact) in &contacts {
        let best = strongest.entry([contact[0], contact[1]]).or_insert((*subject, force_of(contact)));
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
