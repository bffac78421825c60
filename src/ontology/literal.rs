//! Converts the parser's RDF terms to [`Term`].

use std::sync::Arc;

use oxrdf::vocab::xsd;
use oxrdf::{Literal, NamedOrBlankNode, Term as RdfTerm};

use actcheck_base::Term;

/// Converts a subject; `blank` names blank nodes.
pub(super) fn subject(node: &NamedOrBlankNode, blank: impl FnOnce(&str) -> Arc<str>) -> Term {
    match node {
        NamedOrBlankNode::NamedNode(iri) => Term::iri(iri.as_str()),
        NamedOrBlankNode::BlankNode(node) => Term::Blank(blank(node.as_str())),
    }
}

/// Converts an object; `blank` names blank nodes. Returns `None` for quoted triples, which
/// ontologies do not use.
pub(super) fn object(term: &RdfTerm, blank: impl FnOnce(&str) -> Arc<str>) -> Option<Term> {
    match term {
        RdfTerm::NamedNode(iri) => Some(Term::iri(iri.as_str())),
        RdfTerm::BlankNode(node) => Some(Term::Blank(blank(node.as_str()))),
        RdfTerm::Literal(literal) => Some(of_literal(literal)),
    }
}

fn of_literal(literal: &Literal) -> Term {
    let text = literal.value();
    if let Some(language) = literal.language() {
        return Term::LangString(text.into(), language.into());
    }
    let datatype = literal.datatype();
    let known = if datatype == xsd::STRING {
        Some(Term::string(text))
    } else if datatype == xsd::INTEGER {
        text.parse().ok().map(Term::Integer)
    } else if datatype == xsd::DECIMAL {
        canonical_decimal(text).map(|text| Term::Decimal(text.into()))
    } else if datatype == xsd::DOUBLE {
        double(text).map(Term::Double)
    } else if datatype == xsd::BOOLEAN {
        boolean(text).map(Term::Boolean)
    } else {
        None
    };
    known.unwrap_or_else(|| Term::Literal(text.into(), datatype.as_str().into()))
}

fn boolean(text: &str) -> Option<bool> {
    match text {
        "true" | "1" => Some(true),
        "false" | "0" => Some(false),
        _ => None,
    }
}

fn double(text: &str) -> Option<f64> {
    match text {
        "INF" | "+INF" => Some(f64::INFINITY),
        "-INF" => Some(f64::NEG_INFINITY),
        "NaN" => Some(f64::NAN),
        _ => text.parse().ok(),
    }
}

/// Normalises a decimal: `+01.50` becomes `1.5`, `2` and `2.` become `2.0`. Returns `None` if the
/// text is not a decimal.
fn canonical_decimal(text: &str) -> Option<String> {
    let (negative, digits) = match text.strip_prefix('-') {
        Some(rest) => (true, rest),
        None => (false, text.strip_prefix('+').unwrap_or(text)),
    };
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    if (whole.is_empty() && fraction.is_empty())
        || !(whole.bytes().chain(fraction.bytes())).all(|b| b.is_ascii_digit())
    {
        return None;
    }
    let (whole, fraction) = (
        whole.trim_start_matches('0'),
        fraction.trim_end_matches('0'),
    );
    let sign = if negative && !(whole.is_empty() && fraction.is_empty()) {
        "-"
    } else {
        ""
    };
    let or_zero = |part: &str| {
        if part.is_empty() {
            "0".to_owned()
        } else {
            part.to_owned()
        }
    };
    Some(format!("{sign}{}.{}", or_zero(whole), or_zero(fraction)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_keep_their_type() {
        let typed = |text: &str, datatype| of_literal(&Literal::new_typed_literal(text, datatype));
        assert_eq!(typed("7", xsd::INTEGER), Term::Integer(7));
        assert_eq!(typed("+07.50", xsd::DECIMAL), Term::Decimal("7.5".into()));
        assert_eq!(typed("-0", xsd::DECIMAL), Term::Decimal("0.0".into()));
        assert_eq!(typed("-INF", xsd::DOUBLE), Term::Double(f64::NEG_INFINITY));
        assert_eq!(
            typed("x", xsd::INTEGER),
            Term::Literal("x".into(), xsd::INTEGER.as_str().into())
        );
    }
}
