//! Holds and motions, which runs of earlier versions lack.

use crate::model::program::{Literal, Operand, Predicates, Rule};
use actcheck_base::{ActionFacts, Term, TermId, Terms, Triple, names};

/// Why a run can't be judged by a rule about holds or motions.
pub(crate) const NO_INTERVALS: &str = "the holds and motions of the action were not recorded: the run is of an earlier version; run the campaign again";

/// Local names of the terms that only holds and motions have.
const TERMS: [&str; 4] = ["heldObject", "movedObject", "Hold", "Motion"];

/// Recognises rules that read holds or motions.
#[derive(Debug)]
pub(crate) struct IntervalTerms(Vec<TermId>);

impl IntervalTerms {
    pub(crate) fn new(terms: &Terms) -> Self {
        Self(
            TERMS
                .iter()
                .filter_map(|local| terms.id(&Term::iri(names::w(local))))
                .collect(),
        )
    }

    /// Returns whether a rule names one of the terms.
    pub(crate) fn in_rule(&self, rule: &Rule, predicates: &Predicates) -> bool {
        rule.body.iter().filter_map(Literal::atom).any(|atom| {
            predicates
                .get(atom.predicate)
                .property
                .is_some_and(|property| self.0.contains(&property))
                || atom
                    .args
                    .iter()
                    .any(|arg| matches!(arg, Operand::Constant(term) if self.0.contains(term)))
        })
    }
}

/// Returns whether the text of a SPARQL query names one of the terms.
#[cfg(feature = "sparql")]
pub(crate) fn named_in(query: &str) -> bool {
    query.contains("heldObject") || query.contains("movedObject")
}

/// Returns whether an action was recorded without its holds and motions. Facts that don't come from
/// a run may lack both.
pub(crate) fn lacks_intervals(facts: &ActionFacts<'_>) -> bool {
    let id = |local: &str| facts.terms.id(&Term::iri(names::w(local)));
    let has = |property: Option<TermId>| {
        property
            .is_some_and(|property| facts.during.iter().any(|[_, p, _]: &Triple| *p == property))
    };
    has(id("robotMeasured")) && !has(id("intervalsRecorded"))
}
