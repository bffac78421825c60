//! The named graphs of one action.

use crate::engine::evaluate::Tables;
use crate::engine::load::Given;
use crate::model::universe::Universe;
use crate::sparql::dataset::{Graph, Snapshot, Statements};
use actcheck_base::{ActionFacts, TermId};

/// Returns the named graphs of an action: its facts and those that the libraries derive.
pub(crate) fn snapshot(
    given: &Given,
    statements: &Statements,
    facts: &ActionFacts<'_>,
    derived: &Tables,
    universe: &mut Universe<'_>,
) -> Snapshot {
    let mut graphs: Vec<(TermId, Vec<[TermId; 3]>)> = given
        .graphs(facts)
        .into_iter()
        .map(|(name, triples)| {
            (
                name,
                triples
                    .iter()
                    .map(|triple| triple.map(|id| universe.of_run(id)))
                    .collect(),
            )
        })
        .collect();
    let mut add = |phase: TermId, triple: [TermId; 3]| {
        if let Some((_, triples)) = graphs.iter_mut().find(|(name, _)| *name == phase) {
            triples.push(triple);
        }
    };
    for (property, predicate) in given.states() {
        for row in derived
            .get(predicate)
            .map_or(&[][..], |table| table.index(0))
            .chunks_exact(3)
        {
            add(row[0], [row[1], property, row[2]]);
        }
    }
    if let Some(predicate) = given.any_state() {
        for row in derived
            .get(predicate)
            .map_or(&[][..], |table| table.index(0))
            .chunks_exact(4)
        {
            add(row[0], [row[1], row[2], row[3]]);
        }
    }
    // A designator and its value become the statement `designator act:value value`.
    let parameters = facts
        .parameters
        .iter()
        .map(|[designator, value]| {
            let designator = universe.of_run(*designator);
            [designator, statements.value, universe.of_run(*value)]
        })
        .collect();
    graphs.push((statements.parameters, parameters));
    Snapshot {
        graphs: graphs
            .into_iter()
            .map(|(name, triples)| (name, Graph::new(triples)))
            .collect(),
    }
}
