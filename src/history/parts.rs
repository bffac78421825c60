//! The history in parts, for other stores: a campaign or a run at a time, without blank nodes.

use oxigraph::model::{GraphName, NamedNode, NamedOrBlankNode, Quad, Term};

use crate::RdfExport;
use crate::ids::run_id;
use crate::statements::Statements;
use crate::view::{Demand, StatementMaker, WithFacts};
use crate::write_campaign::{self, campaign_node};
use crate::write_run::run_node;
use actcheck_base::{Diagnostics, names};

/// The statements about one campaign or run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HistoryPart {
    /// IRI of the campaign or run.
    pub node: String,
    /// Whether an earlier state of it may have had statements that it lacks now: the end of a
    /// campaign that was continued.
    pub is_replaced: bool,
    /// Graph (`None` is the default graph) and triple in N-Triples, without the full stop; sorted,
    /// without duplicates. Blank nodes are IRIs below [`names::NODE`].
    pub statements: Vec<(Option<String>, String)>,
}

impl RdfExport<'_> {
    /// Calls `each` with every part of the history: all statements of [`RdfExport::write_nquads`], or
    /// with `complete` those of [`RdfExport::write_complete_nquads`]. First the campaigns, then their
    /// runs.
    ///
    /// # Errors
    /// The history can't be read; those of `each`.
    pub fn each_part(
        &self,
        complete: bool,
        each: &mut dyn FnMut(HistoryPart) -> Result<(), Diagnostics>,
    ) -> Result<(), Diagnostics> {
        let demand = Demand::all();
        let facts = if complete {
            WithFacts::Complete
        } else {
            WithFacts::Lean
        };
        let states = self.history.stored.states()?;
        for state in &states {
            let mut statements = Statements::new(&demand);
            write_campaign::write(state, &mut statements);
            let node = campaign_node(&state.record.id);
            each(part(&node, true, statements.quads))?;
        }
        for state in &states {
            let runs = self.history.stored.runs_of(&state.record.id)?;
            let maker = StatementMaker::new(&self.history.stored, &runs.id);
            for run in runs.iter() {
                let later = runs.later_of(run.row.index);
                let quads = maker.statements(run, &later, &demand, facts)?.quads;
                let node = run_node(&run_id(&runs.id, run.row.index));
                each(part(&node, false, quads))?;
            }
        }
        Ok(())
    }

    /// Number of parts.
    ///
    /// # Errors
    /// The history can't be read.
    pub fn parts(&self) -> Result<usize, Diagnostics> {
        let ids = self.history.stored.ids()?;
        let mut count = ids.len();
        for id in &ids {
            count += self.history.stored.runs_of(id)?.len();
        }
        Ok(count)
    }
}

fn part(node: &NamedNode, is_replaced: bool, quads: Vec<Quad>) -> HistoryPart {
    let mut statements: Vec<(Option<String>, String)> = quads
        .iter()
        .map(|quad| {
            let graph = match &quad.graph_name {
                GraphName::DefaultGraph => None,
                GraphName::NamedNode(graph) => Some(graph.as_str().to_owned()),
                GraphName::BlankNode(graph) => Some(format!("{}{}", names::NODE, graph.as_str())),
            };
            let subject = match &quad.subject {
                NamedOrBlankNode::NamedNode(subject) => subject.to_string(),
                NamedOrBlankNode::BlankNode(subject) => named(subject.as_str()),
            };
            let object = match &quad.object {
                Term::BlankNode(object) => named(object.as_str()),
                object => object.to_string(),
            };
            (graph, format!("{subject} {} {object}", quad.predicate))
        })
        .collect();
    statements.sort_unstable();
    statements.dedup();
    HistoryPart {
        node: node.as_str().to_owned(),
        is_replaced,
        statements,
    }
}

/// A blank node as an IRI: each store gives blank nodes new identities whenever it receives them.
fn named(label: &str) -> String {
    format!("<{}{label}>", names::NODE)
}
