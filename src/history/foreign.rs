//! Reads answers of other stores, row by row.

use std::io::{self, BufReader, Read};

use oxigraph::io::{RdfFormat, RdfParseError, RdfParser};
use oxigraph::sparql::results::{
    QueryResultsFormat, QueryResultsParseError, QueryResultsParser, ReaderQueryResultsParserOutput,
};

use crate::light::parser;
use crate::query::refuse_update;
use crate::syntax_fault::syntax_fault;
use crate::terms::from_store;
use actcheck_base::{Diagnostic, Diagnostics, Source, Term};

/// Size of the pieces in which an answer is read. Unit: bytes.
const PIECE: usize = 1 << 16;

/// Rows of a table, each with one value for each column.
type Rows = Box<dyn Iterator<Item = Result<Vec<Option<Term>>, Diagnostics>>>;
/// Triples of a graph.
type Triples = Box<dyn Iterator<Item = Result<[Term; 3], Diagnostics>>>;

/// The answer of another store, which is read while it is used. Its rows are in the order of the
/// store. An iterator ends after an error (`H040`).
pub enum ForeignAnswer {
    /// Of `ASK`.
    Boolean(bool),
    /// Of `SELECT`.
    Table {
        /// Names of the variables, without `?`.
        columns: Vec<String>,
        /// Its rows.
        rows: Rows,
    },
    /// Of `CONSTRUCT` and `DESCRIBE`.
    Graph(Triples),
}

impl ForeignAnswer {
    /// Reads the beginning of an answer. `media_type` is in lower case and has no parameters.
    ///
    /// # Errors
    /// `H040` the format is unknown, or the answer is not in it.
    pub fn read(media_type: &str, body: impl Read + 'static) -> Result<Self, Diagnostics> {
        let body = BufReader::with_capacity(PIECE, body);
        let table = match media_type {
            "application/sparql-results+json" | "application/json" => QueryResultsFormat::Json,
            "text/tab-separated-values" => QueryResultsFormat::Tsv,
            "application/n-triples" | "text/plain" => return Ok(graph(RdfFormat::NTriples, body)),
            "text/turtle" | "application/x-turtle" => return Ok(graph(RdfFormat::Turtle, body)),
            other => {
                let named = if other.is_empty() {
                    "without a media type".to_owned()
                } else {
                    format!("as {other}")
                };
                return Err(Diagnostic::error("H040", format!("the server answered {named}, which is not supported"))
                    .help("answers must be SPARQL results in JSON or TSV, or N-Triples or Turtle; a page in HTML is often a sign of a wrong address")
                    .into());
            }
        };
        match QueryResultsParser::from_format(table)
            .for_reader(body)
            .map_err(|error| unreadable(&error))?
        {
            ReaderQueryResultsParserOutput::Boolean(value) => Ok(Self::Boolean(value)),
            ReaderQueryResultsParserOutput::Solutions(solutions) => {
                let columns = solutions
                    .variables()
                    .iter()
                    .map(|variable| variable.as_str().to_owned())
                    .collect();
                let rows = solutions.map(|solution| {
                    let solution = solution.map_err(|error| unreadable(&error))?;
                    Ok(solution
                        .values()
                        .iter()
                        .map(|value| value.as_ref().map(from_store))
                        .collect())
                });
                Ok(Self::Table {
                    columns,
                    rows: Box::new(until_error(rows)),
                })
            }
        }
    }
}

fn graph(format: RdfFormat, body: impl Read + 'static) -> ForeignAnswer {
    let triples = RdfParser::from_format(format).for_reader(body).map(|quad| {
        let quad = quad.map_err(|error| unparsed(&error))?;
        let property = Term::iri(quad.predicate.as_str());
        Ok([
            from_store(&quad.subject.into()),
            property,
            from_store(&quad.object),
        ])
    });
    ForeignAnswer::Graph(Box::new(until_error(triples)))
}

/// Ends an iterator after its first error: parsers may repeat one for ever.
fn until_error<T>(
    items: impl Iterator<Item = Result<T, Diagnostics>>,
) -> impl Iterator<Item = Result<T, Diagnostics>> {
    let mut has_failed = false;
    items.take_while(move |item| !std::mem::replace(&mut has_failed, item.is_err()))
}

fn unreadable(error: &QueryResultsParseError) -> Diagnostics {
    match error {
        QueryResultsParseError::Io(error) => ended(error),
        QueryResultsParseError::Syntax(error) => malformed(error),
    }
}

fn unparsed(error: &RdfParseError) -> Diagnostics {
    match error {
        RdfParseError::Io(error) => ended(error),
        RdfParseError::Syntax(error) => malformed(error),
    }
}

fn ended(error: &io::Error) -> Diagnostics {
    Diagnostic::error("H040", format!("the answer ended early: {error}"))
        .help("ask again; for a large answer, raise its time limit, or fetch parts with `LIMIT` and `OFFSET`")
        .into()
}

fn malformed(error: &dyn std::fmt::Display) -> Diagnostics {
    Diagnostic::error("H040", format!("the answer is malformed: {error}"))
        .help("check that the address is that of the SPARQL query service; a server may also have ended its answer with a message")
        .into()
}

/// Checks a query that another store called malformed. The prefixes of
/// [`actcheck_base::names::PREFIXES`] need no declaration.
///
/// # Errors
/// `H010` it is not a query of SPARQL 1.1, `H011` it is an update.
pub fn check_query(text: &Source) -> Result<(), Diagnostics> {
    refuse_update(text)?;
    match parser().parse_query(&text.text) {
        Ok(_) => Ok(()),
        Err(error) => Err(syntax_fault(text, &error.to_string()).into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const JSON: &str = r#"{"head":{"vars":["a","b"]},"results":{"bindings":[
        {"a":{"type":"uri","value":"http://x"},"b":{"type":"literal","value":"1","datatype":"http://www.w3.org/2001/XMLSchema#integer"}},
        {"a":{"type":"bnode","value":"n"}}]}}"#;

    type Row = Vec<Option<Term>>;

    fn rows(media_type: &str, text: &'static str) -> Result<(Vec<String>, Vec<Row>), Diagnostics> {
        match ForeignAnswer::read(media_type, text.as_bytes())? {
            ForeignAnswer::Table { columns, rows } => {
                Ok((columns, rows.collect::<Result<_, _>>()?))
            }
            ForeignAnswer::Boolean(value) => Ok((vec![value.to_string()], Vec::new())),
            ForeignAnswer::Graph(triples) => {
                let rows = triples.map(|triple| triple.map(|triple| triple.map(Some).to_vec()));
                Ok((Vec::new(), rows.collect::<Result<_, _>>()?))
            }
        }
    }

    #[test]
    fn tables_and_graphs_are_read_in_all_formats() {
        let (columns, found) = rows("application/sparql-results+json", JSON).expect("it is valid");
        assert_eq!(columns, ["a", "b"]);
        assert_eq!(
            found[0],
            [Some(Term::iri("http://x")), Some(Term::Integer(1))]
        );
        assert_eq!(found[1], [Some(Term::Blank("n".into())), None]);
        let (_, tsv) =
            rows("text/tab-separated-values", "?a\t?b\n<http://x>\t1\n").expect("it is valid");
        assert_eq!(tsv, found[..1]);
        let boolean = r#"{"head":{},"boolean":true}"#;
        assert_eq!(
            rows("application/json", boolean).expect("it is valid").0,
            ["true"]
        );
        let (_, graph) =
            rows("text/turtle", "@prefix p: <http://x#> . p:a p:b 1 .").expect("it is valid");
        assert_eq!(
            graph,
            [[
                Some(Term::iri("http://x#a")),
                Some(Term::iri("http://x#b")),
                Some(Term::Integer(1))
            ]]
        );
    }

    #[test]
    fn malformed_and_incomplete_answers_are_errors() {
        for (media_type, text) in [
            ("text/html", "<html/>"),
            ("", JSON),
            ("application/json", &JSON[..JSON.len() - 3]),
            ("application/json", "[]"),
            ("application/n-triples", "<http://a> <http://b>"),
            ("text/tab-separated-values", "?a\n<http://x>\t1\n"),
        ] {
            let fault = rows(media_type, text).expect_err(text);
            assert!(fault.iter().all(|fault| fault.code == "H040"), "{text}");
        }
    }

    #[test]
    fn queries_are_checked_with_the_known_prefixes() {
        let check = |text: &str| {
            check_query(&Source::new("query", text))
                .map_err(|fault| fault.iter().next().map(|fault| fault.code))
        };
        assert_eq!(check("SELECT ?run { ?run a act:Run }"), Ok(()));
        assert_eq!(check("SELECT ?run { ?run a act:Run"), Err(Some("H010")));
        assert_eq!(check("INSERT DATA {}"), Err(Some("H011")));
    }
}
