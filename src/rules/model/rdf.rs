//! Converts between [`Term`] and the terms of `oxrdf`, which the RDF parsers and oxigraph use.

use oxrdf::{BlankNode, Literal, NamedNode, Term as RdfTerm};

use crate::model::values;
use actcheck_base::{Term, names};

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

/// Converts a term to oxigraph's type.
pub(crate) fn to_rdf(term: &Term) -> RdfTerm {
    let iri = |iri: &str| NamedNode::new_unchecked(iri);
    match term {
        Term::Iri(text) => iri(text).into(),
        Term::Blank(label) => BlankNode::new_unchecked(label.as_ref()).into(),
        Term::String(text) => Literal::new_simple_literal(text.as_ref()).into(),
        Term::LangString(text, tag) => {
            Literal::new_language_tagged_literal_unchecked(text.as_ref(), tag.as_ref()).into()
        }
        Term::Integer(value) => Literal::from(*value).into(),
        Term::Double(value) => Literal::from(*value).into(),
        Term::Boolean(value) => Literal::from(*value).into(),
        Term::Decimal(text) => {
            Literal::new_typed_literal(text.as_ref(), iri(&format!("{}decimal", names::XSD))).into()
        }
        Term::Literal(text, datatype) => {
            Literal::new_typed_literal(text.as_ref(), iri(datatype)).into()
        }
    }
}
