//! Converts our terms to oxigraph's and back.

use oxigraph::model::vocab::{rdf, xsd};
use oxigraph::model::{BlankNode, Literal, NamedNode, Term as StoreTerm};

use actcheck_base::Term;

/// Converts a term to oxigraph's type.
pub(super) fn to_store(term: &Term) -> StoreTerm {
    match term {
        Term::Iri(iri) => NamedNode::new_unchecked(iri.as_ref()).into(),
        Term::Blank(label) => BlankNode::new_unchecked(label.as_ref()).into(),
        Term::String(text) => Literal::new_simple_literal(text.as_ref()).into(),
        Term::LangString(text, tag) => {
            Literal::new_language_tagged_literal_unchecked(text.as_ref(), tag.as_ref()).into()
        }
        Term::Integer(value) => Literal::from(*value).into(),
        Term::Decimal(text) => Literal::new_typed_literal(text.as_ref(), xsd::DECIMAL).into(),
        Term::Double(value) => Literal::from(*value).into(),
        Term::Boolean(value) => Literal::from(*value).into(),
        Term::Literal(text, datatype) => {
            Literal::new_typed_literal(text.as_ref(), NamedNode::new_unchecked(datatype.as_ref()))
                .into()
        }
    }
}

/// Converts a term of oxigraph to ours. An invalid number, or one that is too large, remains a
/// literal with its datatype.
pub(super) fn from_store(term: &StoreTerm) -> Term {
    match term {
        StoreTerm::NamedNode(node) => Term::iri(node.as_str()),
        StoreTerm::BlankNode(node) => Term::Blank(node.as_str().into()),
        StoreTerm::Literal(literal) => from_literal(literal),
        #[expect(
            unreachable_patterns,
            reason = "other builds of the library have quoted triples, which we never write"
        )]
        other => Term::string(other.to_string()),
    }
}

fn from_literal(literal: &Literal) -> Term {
    let text = literal.value();
    if let Some(tag) = literal.language() {
        return Term::LangString(text.into(), tag.into());
    }
    let datatype = literal.datatype();
    let value = match datatype {
        xsd::STRING | rdf::LANG_STRING => Some(Term::string(text)),
        xsd::INTEGER => text.parse().ok().map(Term::Integer),
        xsd::DECIMAL => Some(Term::Decimal(text.into())),
        xsd::DOUBLE => text.parse().ok().map(Term::Double),
        xsd::BOOLEAN => match text {
            "true" | "1" => Some(Term::Boolean(true)),
            "false" | "0" => Some(Term::Boolean(false)),
            _ => None,
        },
        _ => None,
    };
    value.unwrap_or_else(|| Term::Literal(text.into(), datatype.as_str().into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_of_term_is_read_back() {
        let terms = [
            Term::iri("http://actions#Pick"),
            Term::Blank("b1".into()),
            Term::string("a \"b\"\n"),
            Term::LangString("Glas".into(), "de".into()),
            Term::Integer(i64::MIN),
            Term::Decimal("0.10".into()),
            Term::Double(0.1),
            Term::Double(1e300),
            Term::Double(f64::NAN),
            Term::Double(f64::NEG_INFINITY),
            Term::Boolean(false),
            Term::Literal(
                "2026-08-01".into(),
                "http://www.w3.org/2001/XMLSchema#date".into(),
            ),
            Term::Literal(
                "99999999999999999999".into(),
                "http://www.w3.org/2001/XMLSchema#integer".into(),
            ),
        ];
        for term in terms {
            assert_eq!(from_store(&to_store(&term)), term);
        }
    }
}
