//! Triples as text.

use oxigraph::io::{RdfFormat, RdfSerializer};
use oxigraph::model::{NamedOrBlankNode, Term as StoreTerm, Triple};

use crate::terms::to_store;
use actcheck_base::{Term, names};

/// A text format of a graph.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RdfSyntax {
    /// Turtle, with the known prefixes.
    Turtle,
    /// N-Triples.
    NTriples,
    /// RDF/XML.
    RdfXml,
}

/// Writes triples as text, in their order. Omits invalid triples (with a literal as subject, or a
/// property that is not an IRI).
pub fn rdf_text(triples: &[[Term; 3]], syntax: RdfSyntax) -> String {
    let mut writer = serializer(syntax).for_writer(Vec::new());
    for triple in triples.iter().filter_map(to_triple) {
        // Writing to memory can't fail, and RDF/XML rejects only properties that can't be XML
        // names.
        let _ = writer.serialize_triple(&triple);
    }
    let bytes = writer.finish().unwrap_or_default();
    let text = String::from_utf8_lossy(&bytes).into_owned();
    if syntax == RdfSyntax::Turtle {
        with_ordered_prefixes(&text)
    } else {
        text
    }
}

/// Sorts the prefixes, which the library writes in random order.
fn with_ordered_prefixes(text: &str) -> String {
    let is_prefix = |line: &&str| line.starts_with("@prefix ");
    let mut prefixes: Vec<&str> = text.split_inclusive('\n').take_while(is_prefix).collect();
    let length: usize = prefixes.iter().map(|line| line.len()).sum();
    prefixes.sort_unstable();
    prefixes.concat() + &text[length..]
}

/// The library's serializer; Turtle and RDF/XML get the known prefixes.
pub(super) fn serializer(syntax: RdfSyntax) -> RdfSerializer {
    let mut serializer = RdfSerializer::from_format(match syntax {
        RdfSyntax::Turtle => RdfFormat::Turtle,
        RdfSyntax::NTriples => RdfFormat::NTriples,
        RdfSyntax::RdfXml => RdfFormat::RdfXml,
    });
    for (prefix, namespace) in names::PREFIXES {
        // Our namespaces are valid IRIs, so none is omitted.
        serializer = match serializer.clone().with_prefix(prefix, namespace) {
            Ok(with) => with,
            Err(_) => serializer,
        };
    }
    serializer
}

fn to_triple([subject, property, object]: &[Term; 3]) -> Option<Triple> {
    let subject = NamedOrBlankNode::try_from(to_store(subject)).ok()?;
    let StoreTerm::NamedNode(property) = to_store(property) else {
        return None;
    };
    Some(Triple::new(subject, property, to_store(object)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triples_are_written_and_invalid_ones_omitted() {
        let (s, p) = (Term::iri("http://actions#a"), Term::iri("http://actions#b"));
        let triples = [
            [
                s.clone(),
                p.clone(),
                Term::string("line\n\"quoted\" \\ <tag>"),
            ],
            [Term::Integer(1), p.clone(), s.clone()],
            [s.clone(), Term::Blank("x".into()), s],
        ];
        let text = rdf_text(&triples, RdfSyntax::NTriples);
        assert_eq!(
            text,
            "<http://actions#a> <http://actions#b> \"line\\n\\\"quoted\\\" \\\\ <tag>\" .\n"
        );
        let turtle = rdf_text(&triples, RdfSyntax::Turtle);
        assert!(
            turtle.starts_with("@prefix act:") && turtle.contains("act:a act:b"),
            "{turtle}"
        );
        assert!(rdf_text(&triples, RdfSyntax::RdfXml).contains("&lt;tag&gt;"));
    }
}
