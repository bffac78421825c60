//! The history in parts, for other stores: a campaign or a run at a time, without blank nodes.

use std::collections::BTreeSet;

use oxigraph::model::{GraphName, NamedNode, NamedOrBlankNode, Quad, Term};

use crate::merge::about;
use crate::read::{short_id, subjects, text_of};
use crate::statements::iri;
use crate::write_campaign::campaign_node;
use crate::write_run::run_node;
use crate::{History, graphs, trace_file};
use actcheck_base::{Diagnostics, names};
use actcheck_facts::{extract, extract_complete};

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

impl History {
    /// Calls `each` with every part of the history: all statements of [`History::write_nquads`], or
    /// with `complete` those of [`History::write_complete_nquads`]. First the campaigns, then their
    /// runs.
    ///
    /// # Errors
    /// The history can't be read; those of `each`.
    pub fn each_part(
        &self,
        complete: bool,
        each: &mut dyn FnMut(HistoryPart) -> Result<(), Diagnostics>,
    ) -> Result<(), Diagnostics> {
        let store = self.store()?;
        let fault = |error| self.fault("reading it", &error);
        for campaign in self.ids("act:Campaign")? {
            let node = campaign_node(&campaign);
            each(part(&node, true, about(&store, &node).map_err(fault)?))?;
        }
        let class = iri("act:Run");
        let whole = subjects(&*store, "rdf:type", class.as_ref()).map_err(fault)?;
        let whole: BTreeSet<String> = whole
            .into_iter()
            .map(|node| short_id(&text_of(&node.into())).to_owned())
            .collect();
        self.check_ids("run", &whole)?;
        for run in &whole {
            let node = run_node(run);
            let mut quads = about(&store, &node).map_err(fault)?;
            if complete {
                quads.retain(|quad| !graphs::holds_facts(quad.graph_name.as_ref()));
                quads.extend(graphs::complete(
                    &extract_complete(&self.states(run)?),
                    &node,
                ));
            }
            each(part(&node, false, quads))?;
        }
        for run in self.outline_ids()? {
            let (node, Some(outline)) = (run_node(&run), self.outline(&run)?) else {
                continue;
            };
            let mut quads = outline.quads;
            quads.extend(self.later_about_outline(&run, &store)?);
            if complete {
                quads.extend(graphs::complete(
                    &extract_complete(&self.states(&run)?),
                    &node,
                ));
            } else {
                let (_, trace) = trace_file::decode_head(&outline.head)
                    .map_err(|why| crate::fault::damaged(self.dir(), &why))?;
                graphs::write(&extract(&trace), &node, &mut quads);
            }
            each(part(&node, false, quads))?;
        }
        Ok(())
    }

    /// Number of parts.
    ///
    /// # Errors
    /// The history can't be read.
    pub fn parts(&self) -> Result<usize, Diagnostics> {
        Ok(self.ids("act:Campaign")?.len() + self.ids("act:Run")?.len())
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
