//! Query answers in the formats of the SPARQL protocol.

use std::io;

use oxigraph::sparql::results::{QueryResultsFormat, QueryResultsSerializer};
use oxigraph::sparql::{
    PreparedSparqlQuery, QueryEvaluationError, QueryResults, QuerySolutionIter, QueryTripleIter,
    SparqlEvaluator,
};

use crate::light::light;
use crate::query::{evaluation_fault, prepare, refuse_excess, refuse_update};
use crate::rdf_text::serializer;
use crate::view::{Dataset, Demand};
use crate::{Cancel, History, RdfSyntax};
use actcheck_base::{Diagnostic, Diagnostics, Source, Span};

/// A format of an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WireSyntax {
    /// SPARQL 1.1 query results in JSON.
    Json,
    /// SPARQL query results in XML.
    Xml,
    /// SPARQL 1.1 query results in CSV.
    Csv,
    /// SPARQL 1.1 query results in TSV.
    Tsv,
    /// A graph in Turtle.
    Turtle,
    /// A graph in N-Triples.
    NTriples,
    /// A graph in RDF/XML.
    RdfXml,
}

impl WireSyntax {
    /// Formats for `SELECT` and `ASK`, the default first.
    pub const TABLES: [Self; 4] = [Self::Json, Self::Xml, Self::Csv, Self::Tsv];
    /// Formats for `CONSTRUCT` and `DESCRIBE`, the default first.
    pub const GRAPHS: [Self; 3] = [Self::Turtle, Self::NTriples, Self::RdfXml];

    /// Its media types: first the one for responses, then others that requests may use.
    pub fn media_types(self) -> &'static [&'static str] {
        match self {
            Self::Json => &["application/sparql-results+json", "application/json"],
            Self::Xml => &[
                "application/sparql-results+xml",
                "application/xml",
                "text/xml",
            ],
            Self::Csv => &["text/csv"],
            Self::Tsv => &["text/tab-separated-values"],
            Self::Turtle => &["text/turtle", "application/x-turtle"],
            Self::NTriples => &["application/n-triples", "text/plain"],
            Self::RdfXml => &["application/rdf+xml", "application/xml", "text/xml"],
        }
    }
}

/// The reason why a query has no answer.
#[derive(Debug, Clone)]
pub enum WireFault {
    /// The text is not a query.
    Malformed(Diagnostics),
    /// The query uses an unsupported feature or exceeds a limit.
    Refused(Diagnostics),
    /// The client accepts no format of the answer.
    NotAcceptable,
    /// The answer is larger than allowed.
    TooLarge,
    /// The evaluation failed.
    Failed(Diagnostics),
}

/// Limits on an answer.
#[derive(Debug, Clone, Copy)]
pub struct WireLimits {
    /// Maximum number of rows or triples.
    pub rows: u64,
    /// Maximum size. Unit: bytes.
    pub bytes: u64,
}

/// An answer and its format.
pub type WireAnswer = (WireSyntax, Vec<u8>);

impl History {
    /// Answers a query in the format that `choose` selects from those available. Can't be
    /// cancelled: to stop it early, end the process.
    ///
    /// # Errors
    /// See [`WireFault`].
    pub fn wire_answer(
        &self,
        text: &Source,
        choose: impl Fn(&[WireSyntax]) -> Option<WireSyntax>,
        limits: WireLimits,
    ) -> Result<WireAnswer, WireFault> {
        refuse_update(text).map_err(WireFault::Refused)?;
        refuse_excess(text).map_err(WireFault::Refused)?;
        if let Some(span) = service(&text.text) {
            let fault = Diagnostic::error(
                "H017",
                "`SERVICE` queries another endpoint, which is not supported",
            );
            return Err(WireFault::Refused(fault.at(text, span).into()));
        }
        let query = prepare(self, text, &Cancel::new()).map_err(WireFault::Malformed)?;
        let dataset = self
            .dataset(Demand::query(&text.text))
            .map_err(WireFault::Failed)?;
        let answer = evaluated(&dataset, query.prepared.clone(), text, choose, limits);
        query.check_texts(text).map_err(WireFault::Refused)?;
        answer
    }

    /// Answers a light query within the process of a server: one that stops soon after `cancel`,
    /// and that can't exhaust memory before. Returns `None` for any other text, valid or not.
    ///
    /// # Errors
    /// See [`WireFault`]. A cancelled query is [`WireFault::Failed`].
    pub fn light_answer(
        &self,
        text: &Source,
        choose: impl Fn(&[WireSyntax]) -> Option<WireSyntax>,
        limits: WireLimits,
        cancel: &Cancel,
    ) -> Option<Result<WireAnswer, WireFault>> {
        let query = light(&text.text)?;
        let dataset = self
            .dataset(Demand::parsed(&query))
            .map_err(WireFault::Failed);
        let prepared = SparqlEvaluator::new()
            .with_cancellation_token(cancel.token())
            .for_query(query);
        Some(dataset.and_then(|dataset| evaluated(&dataset, prepared, text, choose, limits)))
    }
}

/// Evaluates a query, and writes its answer.
fn evaluated(
    dataset: &Dataset,
    prepared: PreparedSparqlQuery,
    text: &Source,
    choose: impl Fn(&[WireSyntax]) -> Option<WireSyntax>,
    limits: WireLimits,
) -> Result<WireAnswer, WireFault> {
    let failed =
        |error: QueryEvaluationError| WireFault::Failed(evaluation_fault(text, &error).into());
    let bound = prepared.on_queryable_dataset(dataset);
    let written = match bound.execute().map_err(failed)? {
        QueryResults::Boolean(value) => {
            let syntax = choose(&WireSyntax::TABLES).ok_or(WireFault::NotAcceptable)?;
            let serializer = QueryResultsSerializer::from_format(table_format(syntax));
            serializer
                .serialize_boolean_to_writer(Vec::new(), value)
                .map(|body| (syntax, body))
                .map_err(Into::into)
        }
        QueryResults::Solutions(solutions) => {
            let syntax = choose(&WireSyntax::TABLES).ok_or(WireFault::NotAcceptable)?;
            table(solutions, syntax, limits).map(|body| (syntax, body))
        }
        QueryResults::Graph(triples) => {
            let syntax = choose(&WireSyntax::GRAPHS).ok_or(WireFault::NotAcceptable)?;
            graph(triples, syntax, limits).map(|body| (syntax, body))
        }
    };
    written.map_err(|stop| match stop {
        Stop::TooMany => {
            let message = format!("the answer has more than {} rows", limits.rows);
            let fault = Diagnostic::error("H018", message)
                .help("request less, or fetch it in parts with `LIMIT` and `OFFSET`");
            WireFault::Refused(fault.into())
        }
        Stop::TooLarge => WireFault::TooLarge,
        Stop::Evaluation(error) => failed(error),
        Stop::Writing(error) => {
            WireFault::Failed(Diagnostic::error("H012", error.to_string()).into())
        }
    })
}

/// The reason why an answer was not written completely.
enum Stop {
    TooMany,
    TooLarge,
    Evaluation(QueryEvaluationError),
    Writing(io::Error),
}

impl From<io::Error> for Stop {
    fn from(error: io::Error) -> Self {
        if error.kind() == io::ErrorKind::FileTooLarge {
            Self::TooLarge
        } else {
            Self::Writing(error)
        }
    }
}

/// Bytes up to a maximum size; writing more fails.
struct Bounded {
    bytes: Vec<u8>,
    most: u64,
}

impl Bounded {
    fn new(most: u64) -> Self {
        Self {
            bytes: Vec::new(),
            most,
        }
    }
}

impl io::Write for Bounded {
    fn write(&mut self, more: &[u8]) -> io::Result<usize> {
        if (self.bytes.len() + more.len()) as u64 > self.most {
            return Err(io::ErrorKind::FileTooLarge.into());
        }
        self.bytes.extend_from_slice(more);
        Ok(more.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl From<QueryEvaluationError> for Stop {
    fn from(error: QueryEvaluationError) -> Self {
        Self::Evaluation(error)
    }
}

fn table_format(syntax: WireSyntax) -> QueryResultsFormat {
    match syntax {
        WireSyntax::Xml => QueryResultsFormat::Xml,
        WireSyntax::Csv => QueryResultsFormat::Csv,
        WireSyntax::Tsv => QueryResultsFormat::Tsv,
        _ => QueryResultsFormat::Json,
    }
}

fn table(
    solutions: QuerySolutionIter<'_>,
    syntax: WireSyntax,
    limits: WireLimits,
) -> Result<Vec<u8>, Stop> {
    let serializer = QueryResultsSerializer::from_format(table_format(syntax));
    let mut writer = serializer.serialize_solutions_to_writer(
        Bounded::new(limits.bytes),
        solutions.variables().to_vec(),
    )?;
    for (solution, number) in solutions.zip(1u64..) {
        if number > limits.rows {
            return Err(Stop::TooMany);
        }
        writer.serialize(&solution?)?;
    }
    Ok(writer.finish()?.bytes)
}

fn graph(
    triples: QueryTripleIter<'_>,
    syntax: WireSyntax,
    limits: WireLimits,
) -> Result<Vec<u8>, Stop> {
    let syntax = match syntax {
        WireSyntax::NTriples => RdfSyntax::NTriples,
        WireSyntax::RdfXml => RdfSyntax::RdfXml,
        _ => RdfSyntax::Turtle,
    };
    let mut writer = serializer(syntax).for_writer(Bounded::new(limits.bytes));
    for (triple, number) in triples.zip(1u64..) {
        if number > limits.rows {
            return Err(Stop::TooMany);
        }
        writer.serialize_triple(&triple?)?;
    }
    Ok(writer.finish()?.bytes)
}

/// Returns the span of the keyword `SERVICE` outside of strings, IRIs, names and comments, or
/// `None` if it does not occur.
///
/// It misses keywords written with escapes. They do no harm: the evaluator has no client for other
/// endpoints.
fn service(text: &str) -> Option<Span> {
    let bytes = text.as_bytes();
    let is_name =
        |byte: &u8| byte.is_ascii_alphanumeric() || *byte > 127 || b"_:-.?$@%".contains(byte);
    let mut at = 0;
    while at < bytes.len() {
        let rest = &bytes[at..];
        at += match rest[0] {
            b'#' => rest
                .iter()
                .position(|byte| *byte == b'\n')
                .unwrap_or(rest.len()),
            b'"' | b'\'' => quoted(rest),
            b'<' => iri(rest),
            byte if is_name(&byte) => {
                let length = rest
                    .iter()
                    .position(|byte| !is_name(byte))
                    .unwrap_or(rest.len());
                if rest[..length].eq_ignore_ascii_case(b"SERVICE") {
                    return Some(at..at + length);
                }
                length
            }
            _ => 1,
        };
    }
    None
}

/// Length of a string, including its quotation marks: one or three at each end.
fn quoted(rest: &[u8]) -> usize {
    let quote = rest[0];
    let long = rest.len() >= 3 && rest[1] == quote && rest[2] == quote;
    let width = if long { 3 } else { 1 };
    let mut at = width;
    while at < rest.len() {
        match rest[at] {
            b'\\' => at += 2,
            byte if byte == quote && (!long || rest[at..].starts_with(&[quote; 3])) => {
                return at + width;
            }
            _ => at += 1,
        }
    }
    rest.len()
}

/// Length of an IRI in angle brackets, or 1 if the bracket is a comparison.
fn iri(rest: &[u8]) -> usize {
    let end = rest[1..]
        .iter()
        .position(|byte| *byte <= b' ' || b"<>\"{}|^`".contains(byte));
    match end {
        Some(length) if rest[1 + length] == b'>' => length + 2,
        _ => 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_keyword_is_found_outside_of_strings_and_comments() {
        for text in [
            "SELECT * { SERVICE <http://a> {} }",
            "ASK{service silent ?x{}}",
            "ASK { FILTER(1<2) SERVICE<a>{} }",
        ] {
            assert!(service(text).is_some(), "{text}");
        }
        for text in [
            "# SERVICE\nSELECT ?service { ?s <http://SERVICE> 'SERVICE' , \"\"\"a\"SERVICE\"\"\" , 'it\\'s SERVICE' }",
            "PREFIX service: <a> SELECT * { ?a service:b service:SERVICE ; x:SERVICE 'a'@service }",
            "\"\"\"SERVICE",
            "'\\",
            "<",
            "",
        ] {
            assert_eq!(service(text), None, "{text}");
        }
    }
}
