//! Converts terms of `oxrdf`, which the RDF parsers and oxigraph use, to [`Term`].

use oxrdf::Term as RdfTerm;

use crate::model::values;
use actcheck_base::Term;

/// Converts a term; literals get their canonical form.
pub(crate) fn from_rdf(term: &RdfTerm) -> Term {
    match term {
        RdfTerm::NamedNode(node) => Term::iri(node.as_str()),
        RdfTerm::BlankNode(node) => Term::Blank(node.as_str().into()),
        RdfTerm::Literal(literal) => match literal.language() {
            Some(tag) => Term::LangString(literal.value().into(), tag.into()),
            None => values::literal(literal.value(), literal.datatype().as_str()),
        },
    }
}
