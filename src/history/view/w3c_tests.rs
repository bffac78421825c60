//! W3C's test suite of SPARQL queries: a [`Dataset`] gives the answers of oxigraph's store with the
//! same statements, and the store those that the suite expects.
//!
//! `tests/w3c` has a selection. The whole suite needs a checkout of w3c/rdf-tests:
//! `ACTCHECK_W3C=path/to/rdf-tests cargo test --release -p actcheck-history w3c -- --nocapture`.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::{Path, PathBuf};

use oxigraph::io::{RdfFormat, RdfParser};
use oxigraph::model::dataset::CanonicalizationAlgorithm;
use oxigraph::model::vocab::rdf;
use oxigraph::model::{
    BlankNode, Graph, GraphName, Literal, NamedNode, NamedNodeRef, NamedOrBlankNode,
    NamedOrBlankNodeRef, Quad, Term, TermRef, Triple,
};
use oxigraph::sparql::results::{QueryResultsFormat, QueryResultsParser};
use oxigraph::sparql::{QueryEvaluationError, QueryResults, SparqlEvaluator};
use oxigraph::store::Store;
use spargebra::{Query, SparqlParser};

use crate::Cancel;
use crate::query::{prepare_counting, refuse_excess, refuse_update};
use crate::view::{Dataset, Demand};
use actcheck_base::Source;
use left_out::left_out;

#[path = "../../../tests/support/left_out.rs"]
mod left_out;

/// Address of the suite's folder with the files of SPARQL.
const BASE: &str = "https://w3c.github.io/rdf-tests/sparql/";

/// Cases in which oxigraph's store deviates from the suite, with the reason.
const DEVIATIONS: [(&str, &str); 27] = {
    const VALUES: &str = "a store keeps the value of a literal, not its text";
    const INSIDE: &str = "GRAPH binds its variable inside its pattern already";
    const MATCHING: &str = "GRAPH has rows only for graphs with matching statements";
    const ABSENT: &str = "a path of no steps begins and ends only at terms of the dataset";
    const LANGUAGE: &str = "GROUP_CONCAT keeps a language that all texts have";
    const ADJACENT: &str = "REDUCED may drop any duplicates; the suite expects some of them";
    [
        ("r2/distinct/manifest#distinct-1", VALUES),
        ("r2/distinct/manifest#distinct-9", VALUES),
        (
            "r2/expr-builtin/manifest#case-insensitive-booleans",
            "`True` is refused",
        ),
        ("r2/expr-builtin/manifest#dawg-str-1", VALUES),
        ("r2/expr-builtin/manifest#dawg-str-2", VALUES),
        ("r2/expr-builtin/manifest#sameTerm-eq", VALUES),
        ("r2/expr-builtin/manifest#sameTerm-not-eq", VALUES),
        ("r2/expr-builtin/manifest#sameTerm-simple", VALUES),
        ("r2/expr-equals/manifest#eq-graph-1", VALUES),
        ("r2/expr-equals/manifest#eq-graph-2", VALUES),
        ("r2/graph/manifest#graph-optional", INSIDE),
        ("r2/graph/manifest#graph-variable-scope", INSIDE),
        (
            "r2/open-world/manifest#date-2",
            "dates are compared as in XML Schema 1.1",
        ),
        ("r2/open-world/manifest#open-eq-01", VALUES),
        (
            "r2/optional-filter/manifest#dawg-optional-filter-005-simplified",
            "the suite allows one of two answers, and the store gives the other",
        ),
        ("r2/reduced/manifest#reduced-1", ADJACENT),
        ("r2/reduced/manifest#reduced-2", ADJACENT),
        (
            "sparql11/aggregates/manifest#agg-empty-group-count-graph",
            MATCHING,
        ),
        ("sparql11/aggregates/manifest#agg-groupconcat-04", LANGUAGE),
        ("sparql11/aggregates/manifest#agg-groupconcat-06", LANGUAGE),
        ("sparql11/bindings/manifest#graph", MATCHING),
        (
            "sparql11/functions/manifest#bnode01",
            "BNODE makes the same node of the same text in all rows",
        ),
        ("sparql11/negation/manifest#graph-minus", INSIDE),
        (
            "sparql11/property-path/manifest#zero_or_more_set_end",
            ABSENT,
        ),
        (
            "sparql11/property-path/manifest#zero_or_more_set_start",
            ABSENT,
        ),
        (
            "sparql11/property-path/manifest#zero_or_one_set_end",
            ABSENT,
        ),
        (
            "sparql11/property-path/manifest#zero_or_one_set_start",
            ABSENT,
        ),
    ]
};

const MANIFEST: &str = "http://www.w3.org/2001/sw/DataAccess/tests/test-manifest#";
const TEST_QUERY: &str = "http://www.w3.org/2001/sw/DataAccess/tests/test-query#";
const RESULT_SET: &str = "http://www.w3.org/2001/sw/DataAccess/tests/result-set#";
const UPDATE: &str = "http://www.w3.org/2009/sparql/tests/test-update#";
const ENTAILMENT: NamedNodeRef<'_> =
    NamedNodeRef::new_unchecked("http://www.w3.org/ns/sparql-service-description#entailmentRegime");

fn name(namespace: &str, name: &str) -> NamedNode {
    NamedNode::new_unchecked(format!("{namespace}{name}"))
}

/// A folder with manifests, queries, data and results.
struct Suite {
    root: PathBuf,
}

/// A query with its data and its expected answer. Files are given by their addresses.
struct Case {
    name: String,
    query: String,
    data: Vec<String>,
    graphs: Vec<String>,
    /// `None` if the expected answer needs entailment.
    expected: Option<String>,
}

impl Suite {
    fn path(&self, file: &str) -> PathBuf {
        let inner = file.strip_prefix(BASE);
        self.root.join(inner.unwrap_or_else(|| panic!("{file}")))
    }

    fn text(&self, file: &str) -> String {
        let path = self.path(file);
        std::fs::read_to_string(&path).unwrap_or_else(|why| panic!("{}: {why}", path.display()))
    }

    /// The statements of a file, with blank nodes of their own.
    fn graph(&self, file: &str) -> Vec<Triple> {
        let (_, ending) = file.rsplit_once('.').unwrap();
        let parser = RdfParser::from_format(RdfFormat::from_extension(ending).unwrap())
            .with_base_iri(file)
            .unwrap()
            .rename_blank_nodes();
        let text = self.text(file);
        let triples = parser.for_slice(&text).map(|quad| {
            let quad = quad.unwrap_or_else(|why| panic!("{file}: {why}"));
            Triple::new(quad.subject, quad.predicate, quad.object)
        });
        triples.collect()
    }

    /// Addresses of the manifests of SPARQL 1.0 and 1.1.
    fn manifests(&self) -> Vec<String> {
        let (mut found, mut folders) = (Vec::new(), vec![self.root.clone()]);
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(&folder).unwrap() {
                let path = entry.unwrap().path();
                let is = |name: &str| path.file_name().is_some_and(|own| own == name);
                if path.is_dir() && !is("sparql12") {
                    folders.push(path);
                } else if is("manifest.ttl") {
                    let inner = path.strip_prefix(&self.root).unwrap();
                    found.push(format!("{BASE}{}", inner.display()));
                }
            }
        }
        found.sort();
        found
    }

    /// The answer that a file has.
    fn expected(&self, file: &str) -> Answer {
        let (_, ending) = file.rsplit_once('.').unwrap();
        if let Some(format) = QueryResultsFormat::from_extension(ending) {
            let text = self.text(file);
            let results = QueryResultsParser::from_format(format).for_slice(&text);
            let answer = Answer::of(results.unwrap().into());
            return answer.unwrap_or_else(|why| panic!("{file}: {why}"));
        }
        let graph: Graph = self.graph(file).into_iter().collect();
        let is_result_set = name(RESULT_SET, "ResultSet");
        match graph.subject_for_predicate_object(rdf::TYPE, &is_result_set) {
            Some(set) => Answer::of_result_set(&graph, set),
            None => Answer::Graph(graph.iter().map(Into::into).collect()),
        }
    }
}

/// The answer to a query.
enum Answer {
    Boolean(bool),
    Graph(Vec<Triple>),
    Rows {
        columns: BTreeSet<String>,
        rows: Vec<BTreeMap<String, Term>>,
        is_ordered: bool,
    },
}

impl Answer {
    fn of(results: QueryResults<'_>) -> Result<Self, QueryEvaluationError> {
        Ok(match results {
            QueryResults::Boolean(answer) => Self::Boolean(answer),
            QueryResults::Graph(triples) => Self::Graph(triples.collect::<Result<_, _>>()?),
            QueryResults::Solutions(solutions) => {
                let columns = solutions.variables().iter();
                let columns = columns.map(|column| column.as_str().to_owned()).collect();
                let mut rows = Vec::new();
                for solution in solutions {
                    let solution = solution?;
                    let values = solution.iter();
                    let values =
                        values.map(|(name, value)| (name.as_str().to_owned(), value.clone()));
                    rows.push(values.collect());
                }
                Self::Rows {
                    columns,
                    rows,
                    is_ordered: false,
                }
            }
        })
    }

    /// Reads an answer that is written as RDF.
    fn of_result_set(graph: &Graph, set: NamedOrBlankNodeRef<'_>) -> Self {
        let one = |node: TermRef<'_>, property: &str| -> Option<Term> {
            let node = match node {
                TermRef::NamedNode(node) => NamedOrBlankNodeRef::from(node),
                TermRef::BlankNode(node) => node.into(),
                TermRef::Literal(_) => return None,
            };
            let property = name(RESULT_SET, property);
            let value = graph.object_for_subject_predicate(node, &property);
            value.map(TermRef::into_owned)
        };
        let text = |term: TermRef<'_>| match term {
            TermRef::Literal(literal) => literal.value().to_owned(),
            other => panic!("{other}"),
        };
        if let Some(answer) = one(set.into(), "boolean") {
            return Self::Boolean(text(answer.as_ref()) == "true");
        }
        let all = |node: NamedOrBlankNodeRef<'_>, property: &str| -> Vec<Term> {
            let property = name(RESULT_SET, property);
            let values = graph.objects_for_subject_predicate(node, &property);
            values.map(TermRef::into_owned).collect()
        };
        let columns = all(set, "resultVariable");
        let columns = columns.iter().map(|column| text(column.as_ref())).collect();
        let mut rows = Vec::new();
        for solution in all(set, "solution") {
            let index = one(solution.as_ref(), "index").map(|index| text(index.as_ref()));
            let node = NamedOrBlankNode::try_from(solution).unwrap();
            let bindings = all(node.as_ref(), "binding");
            let row: BTreeMap<String, Term> = bindings
                .iter()
                .map(|binding| {
                    let variable = one(binding.as_ref(), "variable").unwrap();
                    let value = one(binding.as_ref(), "value").unwrap();
                    (text(variable.as_ref()), value)
                })
                .collect();
            rows.push((index.map(|index| index.parse::<u64>().unwrap()), row));
        }
        rows.sort_by_key(|(index, _)| *index);
        Self::Rows {
            columns,
            is_ordered: rows.first().is_some_and(|(index, _)| index.is_some()),
            rows: rows.into_iter().map(|(_, row)| row).collect(),
        }
    }

    /// The same answer, with literals as a store returns them.
    fn stored(self) -> Self {
        let stored = |term: Term| {
            let store = Store::new().unwrap();
            let property = NamedNode::new_unchecked("urn:property");
            let quad = Quad::new(property.clone(), property, term, GraphName::DefaultGraph);
            store.insert(&quad).unwrap();
            store.iter().next().unwrap().unwrap().object
        };
        match self {
            Self::Boolean(answer) => Self::Boolean(answer),
            Self::Graph(triples) => Self::Graph(
                triples
                    .into_iter()
                    .map(|triple| {
                        Triple::new(triple.subject, triple.predicate, stored(triple.object))
                    })
                    .collect(),
            ),
            Self::Rows {
                columns,
                rows,
                is_ordered,
            } => Self::Rows {
                columns,
                rows: rows
                    .into_iter()
                    .map(|row| {
                        row.into_iter()
                            .map(|(column, value)| (column, stored(value)))
                            .collect()
                    })
                    .collect(),
                is_ordered,
            },
        }
    }

    fn is_ordered(&self) -> bool {
        matches!(
            self,
            Self::Rows {
                is_ordered: true,
                ..
            }
        )
    }

    /// The lines that only one of two answers has; `None` if they are equal. The labels of blank
    /// nodes do not count, and the order of rows only `with_order`.
    fn difference(&self, wanted: &Self, with_order: bool) -> Option<String> {
        if self.canonical(with_order) == wanted.canonical(with_order) {
            return None;
        }
        let (own, wanted) = (self.lines(), wanted.lines());
        let only = |mark: char, of: &[String], other: &[String]| -> String {
            let lines = of.iter().filter(|line| !other.contains(line));
            lines.map(|line| format!("  {mark} {line}\n")).collect()
        };
        let lines = only('-', &wanted, &own) + &only('+', &own, &wanted);
        Some(if lines.is_empty() {
            "  the same lines, in another order or number\n".to_owned()
        } else {
            lines
        })
    }

    /// The answer as text.
    fn lines(&self) -> Vec<String> {
        match self {
            Self::Boolean(answer) => vec![answer.to_string()],
            Self::Graph(triples) => triples.iter().map(ToString::to_string).collect(),
            Self::Rows { columns, rows, .. } => {
                let header = columns.iter().map(|column| format!("?{column} ")).collect();
                let row = |row: &BTreeMap<String, Term>| {
                    let values = row.iter();
                    values
                        .map(|(name, value)| format!("{name}={value} "))
                        .collect()
                };
                std::iter::once(header)
                    .chain(rows.iter().map(row))
                    .collect()
            }
        }
    }

    /// The answer as statements that are equal for equal answers.
    fn canonical(&self, with_order: bool) -> BTreeSet<String> {
        let mut triples = Vec::new();
        let mut say = |subject: &NamedOrBlankNode, property: &str, value: Term| {
            let property = name("urn:", property);
            triples.push(Triple::new(subject.clone(), property, value));
        };
        let answer = NamedOrBlankNode::from(name("urn:", "answer"));
        match self {
            Self::Boolean(value) => say(&answer, "is", Literal::from(*value).into()),
            Self::Graph(graph) => triples.clone_from(graph),
            Self::Rows { columns, rows, .. } => {
                for column in columns {
                    say(&answer, "column", Literal::from(column.as_str()).into());
                }
                // Equal rows are counted: many equal blank nodes would take long.
                let mut places: BTreeMap<String, Vec<u64>> = BTreeMap::new();
                let lines = self.lines().into_iter().skip(1);
                for (line, place) in lines.zip(0..) {
                    places.entry(line).or_default().push(place);
                }
                for places in places.values() {
                    let node = NamedOrBlankNode::from(BlankNode::default());
                    for (column, value) in &rows[places[0] as usize] {
                        say(&node, &format!("value:{column}"), value.clone());
                    }
                    say(&node, "count", Literal::from(places.len() as u64).into());
                    for place in places.iter().filter(|_| with_order) {
                        say(&node, "place", Literal::from(*place).into());
                    }
                }
            }
        }
        let mut graph: Graph = triples.into_iter().collect();
        graph.canonicalize(CanonicalizationAlgorithm::Unstable);
        graph.iter().map(|triple| triple.to_string()).collect()
    }
}

impl Case {
    /// Reads a case of a manifest.
    ///
    /// # Errors
    /// The reason why it can't run.
    fn read(manifest: &Graph, case: NamedOrBlankNodeRef<'_>) -> Result<Self, &'static str> {
        let action = name(MANIFEST, "action");
        let action = manifest
            .object_for_subject_predicate(case, &action)
            .unwrap();
        let action = NamedOrBlankNode::try_from(action.into_owned()).unwrap();
        let files = |property: &str| -> Vec<String> {
            let property = name(TEST_QUERY, property);
            let files = manifest.objects_for_subject_predicate(&action, &property);
            files.map(file).collect()
        };
        if !files("serviceData").is_empty() {
            return Err("it asks other endpoints (SERVICE)");
        }
        let needs_entailment = manifest
            .object_for_subject_predicate(&action, ENTAILMENT)
            .is_some();
        let result = name(MANIFEST, "result");
        let result = manifest.object_for_subject_predicate(case, &result);
        let iri = case.to_string();
        let iri = iri.trim_matches(['<', '>']);
        Ok(Self {
            name: iri
                .rsplit_once("/data-")
                .map_or(iri, |(_, name)| name)
                .to_owned(),
            query: files("query").pop().unwrap(),
            data: files("data"),
            graphs: files("graphData"),
            expected: result.filter(|_| !needs_entailment).map(file),
        })
    }

    /// The statements that the query is about, with those of the files that it names.
    fn statements(&self, suite: &Suite, query: &Query) -> Vec<Quad> {
        let mut quads = Vec::new();
        let mut add = |file: &str, graph: GraphName| {
            let triples = suite.graph(file).into_iter();
            quads.extend(triples.map(|triple| triple.in_graph(graph.clone())));
        };
        for file in &self.data {
            add(file, GraphName::DefaultGraph);
        }
        let from = query.dataset().into_iter().flat_map(|from| {
            let named = from.named.iter().flatten();
            from.default
                .iter()
                .chain(named)
                .map(|name| name.as_str().to_owned())
        });
        let names: BTreeSet<String> = self.graphs.iter().cloned().chain(from).collect();
        for file in &names {
            add(file, NamedNode::new_unchecked(file.as_str()).into());
        }
        quads
    }

    /// Compares the answers. If the store can't parse the query, that is the only difference.
    fn run(&self, suite: &Suite) -> Comparison {
        // The query's address is the base of its IRIs.
        let text = format!("BASE <{}>\n{}", self.query, suite.text(&self.query));
        let query = match SparqlParser::new().parse_query(&text) {
            Ok(query) => query,
            Err(error) => {
                return Comparison {
                    of_store: Some(format!("  {error}\n")),
                    ..Comparison::default()
                };
            }
        };
        let quads = self.statements(suite, &query);
        let store = Store::new().unwrap();
        store.extend(quads.iter().cloned()).unwrap();
        let prepared = || SparqlEvaluator::new().for_query(query.clone());
        let stored = Answer::of(prepared().on_store(&store).execute().unwrap()).unwrap();

        let mut dataset = Dataset::default();
        dataset.extend(quads.iter().cloned());
        dataset.merge_pending();
        assert_eq!(dataset.len(), store.len().unwrap(), "{}", self.name);
        let bound = prepared().on_queryable_dataset(&dataset);
        let plain = Answer::of(bound.execute().unwrap()).unwrap();

        // No case has rows of equal rank that differ.
        let with_order = text.to_uppercase().contains("ORDER BY");
        Comparison {
            of_dataset: plain.difference(&stored, with_order),
            of_query: asked(&text, &quads).difference(&stored, with_order),
            of_store: self.expected.as_deref().and_then(|file| {
                let expected = suite.expected(file).stored();
                stored.stored().difference(&expected, expected.is_ordered())
            }),
        }
    }
}

/// The differences of answers; `None` if they are equal.
#[derive(Default)]
struct Comparison {
    /// Of a dataset with all statements, from the store.
    of_dataset: Option<String>,
    /// Of a query as a history answers it, from the store.
    of_query: Option<String>,
    /// Of the store, from the suite.
    of_store: Option<String>,
}

/// The address of a file in a manifest.
fn file(term: TermRef<'_>) -> String {
    match term {
        TermRef::NamedNode(node) => node.as_str().to_owned(),
        other => other.to_string(),
    }
}

/// Answers a query as a history does: from the statements that it demands, with limited texts.
fn asked(text: &str, quads: &[Quad]) -> Answer {
    let demand = Demand::query(text);
    let mut dataset = Dataset::default();
    for quad in quads {
        let graph = match &quad.graph_name {
            GraphName::NamedNode(graph) => Some(graph.as_str()),
            _ => None,
        };
        if let Some(graph) = graph.filter(|graph| demand.has_graph(graph)) {
            dataset.add_graph(NamedNodeRef::new_unchecked(graph).into());
        }
        let property = quad.predicate.as_str();
        if demand.has(quad.subject.as_ref(), property, quad.object.as_ref(), graph) {
            dataset.insert_quad(quad.as_ref());
        }
    }
    dataset.merge_pending();
    let (source, cancel) = (Source::new("query", text), Cancel::new());
    refuse_update(&source).unwrap();
    refuse_excess(&source).unwrap();
    let query = prepare_counting(BTreeSet::new(), &source, &cancel).unwrap();
    let bound = query.prepared.clone().on_queryable_dataset(&dataset);
    let answer = Answer::of(bound.execute().unwrap()).unwrap();
    query.check_texts(&source).unwrap();
    answer
}

/// Numbers of cases.
#[derive(Default)]
struct Tally {
    run: usize,
    /// Cases with an answer in the suite.
    expected: usize,
    deviating: usize,
    /// Cases that can't run, by the reason.
    left_out: BTreeMap<String, usize>,
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            run,
            expected,
            deviating,
            left_out,
        } = self;
        writeln!(
            f,
            "{run} cases, {expected} with an expected answer, {deviating} listed deviations"
        )?;
        left_out
            .iter()
            .try_for_each(|(why, count)| writeln!(f, "{count} left out: {why}"))
    }
}

/// Runs all cases of a folder.
fn run(root: PathBuf) -> Tally {
    let suite = Suite { root };
    let (mut tally, mut faults) = (Tally::default(), Vec::new());
    for file in suite.manifests() {
        let manifest: Graph = suite.graph(&file).into_iter().collect();
        for typed in manifest.triples_for_predicate(rdf::TYPE) {
            let TermRef::NamedNode(kind) = typed.object else {
                continue;
            };
            let kind = kind.as_str();
            let kind = kind.strip_prefix(MANIFEST).or(kind.strip_prefix(UPDATE));
            let case = match kind {
                Some("QueryEvaluationTest") => Case::read(&manifest, typed.subject),
                Some(kind) if kind.ends_with("Test") || kind.ends_with("Test11") => Err(kind),
                _ => continue,
            };
            let case = match case {
                Ok(case) => case,
                Err(why) => {
                    *tally.left_out.entry(why.to_owned()).or_default() += 1;
                    continue;
                }
            };
            tally.run += 1;
            tally.expected += usize::from(case.expected.is_some());
            let found = case.run(&suite);
            let listed = DEVIATIONS.iter().find(|(name, _)| *name == case.name);
            tally.deviating += usize::from(listed.is_some());
            let of_store = match (listed, found.of_store) {
                (None, difference) => difference,
                (Some(_), Some(_)) => None,
                (Some(_), None) => Some("remove it from `DEVIATIONS`".to_owned()),
            };
            let differences = [
                ("dataset", found.of_dataset),
                ("query", found.of_query),
                ("store", of_store),
            ];
            for (of, difference) in differences {
                faults.extend(difference.map(|lines| format!("{} ({of}):\n{lines}", case.name)));
            }
        }
    }
    println!("{tally}");
    assert!(
        faults.is_empty(),
        "{} differences\n{}",
        faults.len(),
        faults.join("\n")
    );
    tally
}

/// The checkout's root.
fn checkout() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

#[test]
fn a_selection_has_the_answers_of_a_store_and_of_the_suite() {
    let tally = run(checkout().join("tests/w3c"));
    assert_eq!(tally.run, 111, "{tally}");
}

/// Left out without `ACTCHECK_W3C`.
#[test]
fn the_whole_suite_has_the_answers_of_a_store() {
    let Some(suite) = std::env::var_os("ACTCHECK_W3C") else {
        let why = "ACTCHECK_W3C names no checkout of w3c/rdf-tests";
        left_out("W3C's whole test suite of SPARQL queries", why);
        return;
    };
    // Tests run in the folder of the crate.
    let tally = run(checkout().join(suite).join("sparql"));
    assert!(tally.run > 500, "{tally}");
}
