//! The statements that a history exports, in a store in memory: an oracle of the answers to
//! queries.

use std::collections::BTreeSet;
use std::sync::Arc;

use oxigraph::io::{RdfFormat, RdfParser};
use oxigraph::model::vocab::xsd;
use oxigraph::model::{Literal, NamedNode, Quad, Term as StoreTerm};
use oxigraph::sparql::{QueryResults, SparqlEvaluator};
use oxigraph::store::Store;

use actcheck::base::{Term, names};
use actcheck::history::{History, QueryAnswer};

/// All statements of a history as lines of N-Quads.
pub fn statements(history: &History) -> BTreeSet<String> {
    nquads(history).lines().map(str::to_owned).collect()
}

fn nquads(history: &History) -> String {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("all.nq");
    history.rdf().write_nquads(&file).unwrap();
    std::fs::read_to_string(file).unwrap()
}

pub struct Exported {
    store: Store,
    /// The runs for which `act:counts` is true.
    counted: Arc<BTreeSet<String>>,
}

impl Exported {
    pub fn of(history: &History) -> Self {
        let text = nquads(history);
        // Blank nodes keep their labels.
        let quads: Vec<Quad> = RdfParser::from_format(RdfFormat::NQuads)
            .for_slice(&text)
            .map(|quad| quad.unwrap())
            .collect();
        let store = Store::new().unwrap();
        store.extend(quads).unwrap();
        Self {
            store,
            counted: Arc::new(history.counted_runs().unwrap()),
        }
    }

    /// The answer to a query with the prefixes that every query has.
    pub fn query(&self, query: &str) -> QueryAnswer {
        let results = self
            .evaluator()
            .parse_query(query)
            .unwrap_or_else(|error| panic!("{query}: {error}"))
            .on_store(&self.store)
            .execute()
            .unwrap_or_else(|error| panic!("{query}: {error}"));
        match results {
            QueryResults::Boolean(value) => QueryAnswer::Boolean(value),
            QueryResults::Solutions(solutions) => {
                let variables = solutions.variables().iter();
                let columns = variables.map(|name| name.as_str().to_owned()).collect();
                let rows = solutions.map(|solution| {
                    let solution = solution.unwrap();
                    let values = solution.values().iter();
                    values.map(|value| value.as_ref().map(term)).collect()
                });
                QueryAnswer::Table {
                    columns,
                    rows: rows.collect(),
                }
            }
            QueryResults::Graph(triples) => {
                let triples = triples.map(|triple| {
                    let triple = triple.unwrap();
                    [
                        triple.subject.into(),
                        triple.predicate.into(),
                        triple.object,
                    ]
                    .map(|value: StoreTerm| term(&value))
                });
                let triples: BTreeSet<[Term; 3]> = triples.collect();
                QueryAnswer::Graph(triples.into_iter().collect())
            }
        }
    }

    fn evaluator(&self) -> SparqlEvaluator {
        let counted = Arc::clone(&self.counted);
        let evaluator = SparqlEvaluator::new().with_custom_function(
            NamedNode::new(names::act("counts")).unwrap(),
            move |args: &[StoreTerm]| match args {
                [StoreTerm::NamedNode(run)] => {
                    let run = run.as_str().strip_prefix(names::RUN)?;
                    Some(Literal::from(counted.contains(run)).into())
                }
                _ => None,
            },
        );
        names::PREFIXES
            .into_iter()
            .fold(evaluator, |evaluator, (prefix, namespace)| {
                evaluator.with_prefix(prefix, namespace).unwrap()
            })
    }
}

fn term(term: &StoreTerm) -> Term {
    let literal = match term {
        StoreTerm::NamedNode(node) => return Term::iri(node.as_str()),
        StoreTerm::BlankNode(node) => return Term::Blank(node.as_str().into()),
        StoreTerm::Literal(literal) => literal,
        #[expect(
            unreachable_patterns,
            reason = "other builds of the library have quoted triples"
        )]
        other => panic!("{other} is not a term of a history"),
    };
    let text = literal.value();
    if let Some(tag) = literal.language() {
        return Term::LangString(text.into(), tag.into());
    }
    match literal.datatype() {
        xsd::STRING => Term::string(text),
        xsd::INTEGER if text.parse::<i64>().is_ok() => Term::Integer(text.parse().unwrap()),
        xsd::DECIMAL => Term::Decimal(text.into()),
        xsd::DOUBLE => Term::Double(text.parse().unwrap()),
        xsd::BOOLEAN => Term::Boolean(text == "true"),
        other => Term::Literal(text.into(), other.as_str().into()),
    }
}
