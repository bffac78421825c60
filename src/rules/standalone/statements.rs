//! Reads the statements of RDF files as facts.

use std::collections::HashMap;
use std::io::Read;

use oxrdf::{BlankNode, GraphName, NamedOrBlankNode, Term as RdfTerm};
use oxrdfio::{RdfFormat, RdfParseError, RdfParser};

use crate::model::rdf::from_rdf;
use crate::standalone::faults::{Faults, Place};
use crate::standalone::sink::ImportSink;
use actcheck_base::{Term, TermId, Terms, TurtleGuard, XmlGuard, XmlProgress};

/// Nemo's name for the default graph.
pub(super) const DEFAULT_GRAPH: &str = "tag:nemo:defaultgraph";

/// Minimum length of the labels that the parser draws: 128 bits in hexadecimal digits, without
/// zeros at the beginning.
const RANDOM_LABEL: usize = 24;

/// Reads the statements of a file, at most `limit`. A statement that can't be parsed is a fault and
/// left out.
///
/// # Errors
/// Reading failed, or the base IRI is invalid.
pub(super) fn read_rdf(
    reader: impl Read,
    format: RdfFormat,
    base: Option<&str>,
    limit: usize,
    sink: &mut ImportSink<'_>,
    faults: &mut Faults,
) -> std::io::Result<()> {
    let mut parser = RdfParser::from_format(format);
    if let Some(base) = base {
        parser = parser.with_base_iri(base).map_err(std::io::Error::other)?;
    }
    let quads = format.supports_datasets();
    let mut blanks = Blanks::default();
    let (reader, progress): (Box<dyn Read + '_>, _) = match format {
        RdfFormat::RdfXml => {
            let (guard, progress) = XmlGuard::new(reader);
            (Box::new(guard), Some(progress))
        }
        RdfFormat::Turtle | RdfFormat::TriG => (Box::new(TurtleGuard::new(reader)), None),
        _ => (Box::new(reader), None),
    };
    for (count, quad) in parser.for_reader(reader).enumerate() {
        if count >= limit {
            break;
        }
        sink.other_bytes += std::mem::take(&mut blanks.bytes);
        let quad = match quad {
            Ok(quad) => quad,
            Err(error) => {
                if fault(error, format, progress.as_ref(), faults)? {
                    sink.check()?;
                    continue;
                }
                break;
            }
        };
        sink.row(|terms, row| {
            if quads {
                row.push(match &quad.graph_name {
                    GraphName::NamedNode(node) => terms.intern_iri(node.as_str()),
                    GraphName::BlankNode(node) => blanks.intern(node, terms),
                    GraphName::DefaultGraph => terms.intern_iri(DEFAULT_GRAPH),
                });
            }
            row.push(match &quad.subject {
                NamedOrBlankNode::NamedNode(node) => terms.intern_iri(node.as_str()),
                NamedOrBlankNode::BlankNode(node) => blanks.intern(node, terms),
            });
            row.push(terms.intern_iri(quad.predicate.as_str()));
            row.push(match &quad.object {
                RdfTerm::NamedNode(node) => terms.intern_iri(node.as_str()),
                RdfTerm::BlankNode(node) => blanks.intern(node, terms),
                literal => terms.intern(from_rdf(literal)),
            });
            true
        })?;
    }
    Ok(())
}

/// Adds a parse error to the faults. Returns whether the rest of the file can be read.
///
/// # Errors
/// It was an error of reading.
fn fault(
    error: RdfParseError,
    format: RdfFormat,
    progress: Option<&XmlProgress>,
    faults: &mut Faults,
) -> std::io::Result<bool> {
    if let Some(progress) = progress {
        let why = match (progress.fault(), error) {
            (Some(why), _) => why,
            (None, RdfParseError::Io(error)) => return Err(error),
            (None, RdfParseError::Syntax(error)) => error.to_string(),
        };
        let (line, column) = progress.line_and_column();
        faults.add_last(Place { line, column }, || why);
        return Ok(false);
    }
    let error = match error {
        RdfParseError::Io(error) => return Err(error),
        RdfParseError::Syntax(error) => error,
    };
    let place = match error.location() {
        Some(location) => Place {
            line: location.start.line + 1,
            column: location.start.column + 1,
        },
        None => Place { line: 1, column: 1 },
    };
    // A statement of a graph in TriG would be read as one of the default graph.
    if format == RdfFormat::TriG {
        faults.add_last(place, || message(&error.to_string()));
        return Ok(false);
    }
    faults.add(place, || message(&error.to_string()));
    Ok(true)
}

/// Removes the parser's own place from a message.
fn message(text: &str) -> String {
    match text.split_once(": ") {
        Some((place, message)) if place.starts_with("Parser error ") => message.to_owned(),
        _ => text.to_owned(),
    }
}

/// The blank nodes of one file. Equal labels of two files are two nodes.
#[derive(Default)]
struct Blanks {
    known: HashMap<BlankNode, TermId>,
    /// Number of nodes without a label.
    unnamed: usize,
    /// Memory of the nodes that are not accounted for. Unit: bytes.
    bytes: usize,
}

impl Blanks {
    /// Returns the node's term. Its label is that of the file, with a number if another file has
    /// it; a node without a label gets one, because those of the parser are random.
    fn intern(&mut self, node: &BlankNode, terms: &mut Terms) -> TermId {
        if let Some(id) = self.known.get(node) {
            return *id;
        }
        let random = node.as_ref().unique_id().is_some() && node.as_str().len() >= RANDOM_LABEL;
        let label = if random {
            self.unnamed += 1;
            format!("b{}", self.unnamed)
        } else {
            node.as_str().to_owned()
        };
        let mut candidate = Term::Blank(label.as_str().into());
        let mut number = 1;
        while terms.id(&candidate).is_some() {
            number += 1;
            candidate = Term::Blank(format!("{label}_{number}").into());
        }
        let id = terms.intern(candidate);
        self.bytes += size_of::<(BlankNode, TermId)>() * 2 + node.as_str().len();
        self.known.insert(node.clone(), id);
        id
    }
}
