//! Copies all statements about one campaign or run.

use std::collections::BTreeSet;

use oxigraph::model::{GraphNameRef, NamedNode, NamedOrBlankNode, Quad, Term, TermRef};
use oxigraph::store::{StorageError, Store};

/// Returns every quad about a node, about the nodes below its IRI, about blank nodes connected to
/// either, and in the named graphs below its IRI.
///
/// The properties of a run are not listed anywhere, so that data added by later versions is copied
/// too.
pub(crate) fn about(store: &Store, root: &NamedNode) -> Result<Vec<Quad>, StorageError> {
    let below = format!("{}/", root.as_str());
    let belongs = |node: &NamedOrBlankNode| match node {
        NamedOrBlankNode::NamedNode(node) => node.as_str().starts_with(&below),
        NamedOrBlankNode::BlankNode(_) => true,
    };
    let (mut quads, mut seen) = (Vec::new(), BTreeSet::new());
    let mut next = vec![NamedOrBlankNode::from(root.clone())];
    while let Some(node) = next.pop() {
        if !seen.insert(node.to_string()) {
            continue;
        }
        for quad in store.quads_for_pattern(Some(node.as_ref()), None, None, None) {
            let quad = quad?;
            next.extend(as_subject(&quad.object).filter(belongs));
            quads.push(quad);
        }
        for quad in store.quads_for_pattern(None, None, Some(TermRef::from(node.as_ref())), None) {
            next.extend(Some(quad?.subject).filter(belongs));
        }
        if let NamedOrBlankNode::NamedNode(graph) = &node {
            for quad in
                store.quads_for_pattern(None, None, None, Some(GraphNameRef::from(graph.as_ref())))
            {
                quads.push(quad?);
            }
        }
    }
    Ok(quads)
}

fn as_subject(term: &Term) -> Option<NamedOrBlankNode> {
    NamedOrBlankNode::try_from(term.clone()).ok()
}
