//! RDF statements in memory, as sorted numbers, which oxigraph's SPARQL evaluator reads in place.
//!
//! Gives the same answers as oxigraph's own store in memory, in less than a sixth of its memory:
//! literals with numbers, dates and durations are one term if their values are identical, and are
//! returned in canonical form. The order of the rows of a query without `ORDER BY` differs.
//!
//! Never: removes a statement, reads files, or parses a query.

use std::convert::Infallible;
use std::rc::Rc;

use oxigraph::model::{GraphNameRef, Quad, QuadRef, Term, TermRef};
use spareval::{ExpressionTerm, InternalQuad, QueryableDataset};

use crate::view::interner::{LiteralValue, Parts, Terms, effective_boolean};
use crate::view::orders::{DefaultGraph, FoundRows, NamedGraphs};

/// Number of a term. Only valid for the [`Dataset`] that returned it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct TermNumber(u32);

/// Statements of a default graph and of named graphs.
///
/// New statements are pending until [`Dataset::merge_pending`] sorts them in; queries see only
/// merged statements.
#[derive(Debug, Default, Clone)]
pub(crate) struct Dataset {
    terms: Terms,
    default: DefaultGraph,
    named: NamedGraphs,
    pending: Pending,
}

/// Statements and graph names that are not sorted in yet.
#[derive(Debug, Default, Clone)]
struct Pending {
    /// Statements of the default graph: subject, property, object.
    default: Vec<[u32; 3]>,
    /// Statements of named graphs: graph, subject, property, object.
    named: Vec<[u32; 4]>,
    graphs: Vec<u32>,
}

impl Dataset {
    /// Returns the number of a term, which is the same for all literals with an identical value.
    pub(crate) fn intern(&mut self, term: TermRef<'_>) -> TermNumber {
        TermNumber(self.terms.intern(&Parts::of_term(term)))
    }

    /// Returns the number of a term that was interned before.
    #[cfg(test)]
    pub(crate) fn number(&self, term: TermRef<'_>) -> Option<TermNumber> {
        self.terms.find(&Parts::of_term(term)).map(TermNumber)
    }

    /// Returns a term in canonical form.
    pub(crate) fn term(&self, number: TermNumber) -> Term {
        self.terms.expression(number.0).into()
    }

    /// Adds a statement (subject, property, object) to the default graph (`None`) or to a named
    /// graph. Duplicates count once.
    pub(crate) fn insert(&mut self, statement: [TermNumber; 3], graph: Option<TermNumber>) {
        let [subject, property, object] = statement.map(|term| term.0);
        match graph {
            None => self.pending.default.push([subject, property, object]),
            Some(graph) => {
                let row = [graph.0, subject, property, object];
                self.pending.named.push(row);
            }
        }
    }

    /// Adds a statement given by its terms.
    pub(crate) fn insert_quad(&mut self, quad: QuadRef<'_>) {
        let statement = [
            self.intern(quad.subject.into()),
            self.intern(quad.predicate.into()),
            self.intern(quad.object),
        ];
        let graph = match quad.graph_name {
            GraphNameRef::DefaultGraph => None,
            GraphNameRef::NamedNode(name) => Some(self.intern(name.into())),
            GraphNameRef::BlankNode(name) => Some(self.intern(name.into())),
        };
        self.insert(statement, graph);
    }

    /// Adds statements.
    pub(crate) fn extend(&mut self, quads: impl IntoIterator<Item = Quad>) {
        for quad in quads {
            self.insert_quad(quad.as_ref());
        }
    }

    /// Adds a named graph, which may have no statements.
    pub(crate) fn add_graph(&mut self, name: TermRef<'_>) {
        let name = self.intern(name);
        self.pending.graphs.push(name.0);
    }

    /// Sorts the pending statements in, so that queries see them.
    pub(crate) fn merge_pending(&mut self) {
        let pending = std::mem::take(&mut self.pending);
        let n_terms = self.terms.len();
        self.default.merge(pending.default, n_terms);
        self.named.merge(pending.named, pending.graphs, n_terms);
        self.terms.shrink();
    }

    /// Returns the number of different statements, without the pending ones.
    pub(crate) fn len(&self) -> usize {
        self.default.len() + self.named.len()
    }

    /// Returns whether there are no statements except pending ones.
    #[cfg(test)]
    pub(crate) fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns a term of the dataset by number, or the term itself if the dataset lacks it.
    fn internal(&self, term: ExpressionTerm) -> DatasetTerm {
        match self.terms.find(&Parts::of_expression(&term)) {
            Some(number) => DatasetTerm::Known(TermNumber(number)),
            None => DatasetTerm::Created(Rc::new(LiteralValue(term))),
        }
    }
}

/// A term of a dataset by number, or a term created by the query.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) enum DatasetTerm {
    Known(TermNumber),
    /// Never equal to a term of the dataset.
    Created(Rc<LiteralValue>),
}

impl DatasetTerm {
    fn number(&self) -> Option<u32> {
        match self {
            Self::Known(number) => Some(number.0),
            Self::Created(_) => None,
        }
    }
}

impl<'a> QueryableDataset<'a> for &'a Dataset {
    type InternalTerm = DatasetTerm;
    type Error = Infallible;

    fn internal_quads_for_pattern(
        &self,
        subject: Option<&DatasetTerm>,
        predicate: Option<&DatasetTerm>,
        object: Option<&DatasetTerm>,
        graph_name: Option<Option<&DatasetTerm>>,
    ) -> impl Iterator<Item = Result<InternalQuad<DatasetTerm>, Infallible>> + use<'a> {
        let dataset: &'a Dataset = self;
        let parts = [subject, predicate, object, graph_name.flatten()];
        let numbers = parts.map(|part| part.and_then(DatasetTerm::number));
        let [s, p, o, g] = numbers;
        let created = parts.iter().flatten().any(|part| part.number().is_none());
        let found = match graph_name {
            _ if created => FoundRows::Nothing,
            Some(None) => FoundRows::Default(dataset.default.find(s, p, o)),
            Some(Some(_)) | None => FoundRows::Named(dataset.named.find(g, s, p, o)),
        };
        found.map(|row| {
            let known = |number| DatasetTerm::Known(TermNumber(number));
            Ok(InternalQuad {
                subject: known(row.subject),
                predicate: known(row.property),
                object: known(row.object),
                graph_name: row.graph.map(known),
            })
        })
    }

    fn internal_named_graphs(
        &self,
    ) -> impl Iterator<Item = Result<DatasetTerm, Infallible>> + use<'a> {
        let dataset: &'a Dataset = self;
        let names = dataset.named.names().iter();
        names.map(|name| Ok(DatasetTerm::Known(TermNumber(*name))))
    }

    fn contains_internal_graph_name(&self, graph_name: &DatasetTerm) -> Result<bool, Infallible> {
        let number = graph_name.number();
        Ok(number.is_some_and(|number| self.named.names().binary_search(&number).is_ok()))
    }

    fn internalize_term(&self, term: Term) -> Result<DatasetTerm, Infallible> {
        Ok(match self.terms.find(&Parts::of_term(term.as_ref())) {
            Some(number) => DatasetTerm::Known(TermNumber(number)),
            None => DatasetTerm::Created(Rc::new(LiteralValue(term.into()))),
        })
    }

    fn externalize_term(&self, term: DatasetTerm) -> Result<Term, Infallible> {
        Ok(match term {
            DatasetTerm::Known(number) => self.term(number),
            DatasetTerm::Created(value) => value.0.clone().into(),
        })
    }

    fn externalize_expression_term(&self, term: DatasetTerm) -> Result<ExpressionTerm, Infallible> {
        Ok(match term {
            DatasetTerm::Known(number) => self.terms.expression(number.0),
            DatasetTerm::Created(value) => value.0.clone(),
        })
    }

    fn internalize_expression_term(&self, term: ExpressionTerm) -> Result<DatasetTerm, Infallible> {
        // A literal that the query made of a text and a datatype may have a value.
        Ok(match term {
            ExpressionTerm::OtherTypedLiteral { .. } => {
                self.internal(ExpressionTerm::from(Term::from(term)))
            }
            _ => self.internal(term),
        })
    }

    fn internal_term_effective_boolean_value(
        &self,
        term: DatasetTerm,
    ) -> Result<Option<bool>, Infallible> {
        Ok(match term {
            DatasetTerm::Known(number) => self.terms.effective_boolean(number.0),
            DatasetTerm::Created(value) => effective_boolean(&value.0),
        })
    }
}

#[cfg(test)]
mod tests {
    use oxigraph::model::vocab::{rdf, xsd};
    use oxigraph::model::{BlankNode, GraphName, Literal, LiteralRef, NamedNode, NamedOrBlankNode};
    use oxigraph::sparql::{PreparedSparqlQuery, QueryResults, SparqlEvaluator};
    use oxigraph::store::Store;

    use super::*;
    use crate::view::interner::XSD;

    /// A pseudo-random generator (xorshift64*), so that a failure can be repeated.
    struct Random(u64);

    impl Random {
        fn below(&mut self, bound: usize) -> usize {
            self.0 ^= self.0 >> 12;
            self.0 ^= self.0 << 25;
            self.0 ^= self.0 >> 27;
            let number = self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 33;
            number as usize % bound
        }

        fn pick<'t, T: ?Sized>(&mut self, choices: &[&'t T]) -> &'t T {
            choices[self.below(choices.len())]
        }
    }

    /// Text and datatype of literals that are alike, unusual or invalid.
    const TYPED: &[(&str, &str)] = &[
        ("1", "integer"),
        ("01", "integer"),
        ("+1", "integer"),
        ("1", "int"),
        ("001", "nonNegativeInteger"),
        ("-7", "long"),
        ("300", "byte"),
        ("0", "integer"),
        ("-0", "integer"),
        ("99999999999999999999", "integer"),
        ("1.5", "integer"),
        ("abc", "integer"),
        ("", "integer"),
        ("1", "decimal"),
        ("1.0", "decimal"),
        ("1.50", "decimal"),
        ("0.0", "decimal"),
        ("-.5", "decimal"),
        ("1e3", "decimal"),
        ("0.00000000000000000001", "decimal"),
        ("1", "double"),
        ("1.0", "double"),
        ("1e0", "double"),
        ("1.0E0", "double"),
        ("0.1", "double"),
        ("-0", "double"),
        ("0", "double"),
        ("NaN", "double"),
        ("INF", "double"),
        ("-INF", "double"),
        ("+INF", "double"),
        ("1e400", "double"),
        ("123456789012345678", "double"),
        ("one", "double"),
        ("1", "float"),
        ("0.1", "float"),
        ("0.10", "float"),
        ("NaN", "float"),
        ("0", "float"),
        ("true", "boolean"),
        ("1", "boolean"),
        ("false", "boolean"),
        ("0", "boolean"),
        ("TRUE", "boolean"),
        ("2024-02-29T12:00:00Z", "dateTime"),
        ("2024-02-29T12:00:00.000Z", "dateTime"),
        ("2024-02-29T12:00:00+00:00", "dateTime"),
        ("2024-02-29T14:00:00+02:00", "dateTime"),
        ("2024-02-29T12:00:00", "dateTime"),
        ("2024-02-28T24:00:00", "dateTime"),
        ("2024-02-29T00:00:00", "dateTime"),
        ("2024-02-29T12:00:00Z", "dateTimeStamp"),
        ("2023-02-29T12:00:00Z", "dateTime"),
        ("yesterday", "dateTime"),
        ("2024-02-29", "date"),
        ("2024-02-29Z", "date"),
        ("2024-02-29+00:00", "date"),
        ("2024-13-01", "date"),
        ("12:00:00", "time"),
        ("12:00:00.0", "time"),
        ("24:00:00", "time"),
        ("2024", "gYear"),
        ("2024Z", "gYear"),
        ("2024-02", "gYearMonth"),
        ("--02-29", "gMonthDay"),
        ("---29", "gDay"),
        ("--02", "gMonth"),
        ("P1Y2M", "yearMonthDuration"),
        ("P14M", "yearMonthDuration"),
        ("PT3600S", "dayTimeDuration"),
        ("PT1H", "dayTimeDuration"),
        ("PT1H", "duration"),
        ("P1Y", "duration"),
        ("P12M", "duration"),
        ("P", "duration"),
        ("1", "string"),
        ("00FF", "hexBinary"),
        ("00ff", "hexBinary"),
        ("http://e/a", "anyURI"),
    ];

    const IRIS: &[&str] = &["a", "b", "c", "d", "e", "f", "p", "q"];
    const PROPERTIES: &[&str] = &["p", "q", "r", "next"];
    const GRAPHS: &[&str] = &["g", "h", "i", "a"];

    fn iri(name: &str) -> NamedNode {
        NamedNode::new_unchecked(format!("http://e/{name}"))
    }

    fn node(random: &mut Random) -> NamedOrBlankNode {
        match random.below(10) {
            // A label of hexadecimal digits is a number for oxigraph.
            0 => BlankNode::new_unchecked("a1f").into(),
            1 => BlankNode::new_unchecked("x").into(),
            2 => BlankNode::new_unchecked("a-label-with-more-than-16-bytes").into(),
            _ => iri(random.pick(IRIS)).into(),
        }
    }

    fn literal(random: &mut Random) -> Literal {
        const TEXTS: &[&str] = &[
            "",
            "a",
            "A",
            "abc",
            "\u{e4}\u{f6} \"quoted\"\n",
            "a text with more than sixteen bytes",
            "1",
        ];
        const TAGS: &[&str] = &["en", "EN", "de", "en-GB", "en-GB-x-actcheck-a"];
        match random.below(12) {
            0 | 1 => Literal::new_simple_literal(random.pick(TEXTS)),
            2 | 3 => {
                let tag = random.pick(TAGS);
                Literal::new_language_tagged_literal_unchecked(random.pick(TEXTS), tag)
            }
            4 => Literal::new_typed_literal(random.pick(TEXTS), iri("datatype")),
            5 => Literal::new_typed_literal("untagged", rdf::LANG_STRING),
            _ => {
                let (text, datatype) = TYPED[random.below(TYPED.len())];
                let datatype = NamedNode::new_unchecked(format!("{XSD}{datatype}"));
                Literal::new_typed_literal(text, datatype)
            }
        }
    }

    fn quad(random: &mut Random) -> Quad {
        let object: Term = match random.below(3) {
            0 => node(random).into(),
            _ => literal(random).into(),
        };
        let graph = match random.below(10) {
            0..5 => GraphName::DefaultGraph,
            5 => BlankNode::new_unchecked("x").into(),
            _ => iri(random.pick(GRAPHS)).into(),
        };
        Quad::new(node(random), iri(random.pick(PROPERTIES)), object, graph)
    }

    /// Queries with a place for a node (`$s`), a property (`$p`), a term (`$o`), a literal (`$l`)
    /// and a graph (`$g`). Their rows do not depend on the order of the statements.
    const QUERIES: &[&str] = &[
        "SELECT * { ?s ?p ?o }",
        "SELECT * { $s ?p ?o }",
        "SELECT * { ?s $p ?o }",
        "SELECT * { ?s ?p $o }",
        "SELECT * { $s $p ?o }",
        "SELECT * { ?s $p $o }",
        "SELECT * { $s ?p $o }",
        "ASK { $s $p $o }",
        "SELECT * { ?s ?p ?s }",
        "SELECT * { ?s $p ?o . ?o $p ?x }",
        "SELECT * { ?s $p ?o . ?s $p ?x . ?x ?p ?y }",
        "SELECT * { ?s $p ?o OPTIONAL { ?o $p ?x } }",
        "SELECT * { ?s ?p ?o OPTIONAL { ?s $p ?x FILTER(?x > ?o) } }",
        "SELECT * { ?s ?p ?o MINUS { ?s $p ?o } }",
        "SELECT * { ?s ?p ?o MINUS { ?x $p $o . ?x ?p ?o } }",
        "SELECT * { { ?s $p ?o } UNION { $s ?p ?o } UNION { GRAPH $g { ?s ?p ?o } } }",
        "SELECT * { ?s ?p ?o FILTER(?o > $l) }",
        "SELECT * { ?s ?p ?o FILTER(?o <= $l) }",
        "SELECT * { ?s ?p ?o FILTER(?o = $l) }",
        "SELECT * { ?s ?p ?o FILTER(?o != $l) }",
        "SELECT * { ?s ?p ?o FILTER(sameTerm(?o, $l)) }",
        "SELECT * { ?s ?p ?o FILTER(?o IN ($l, $o, 1, 'a')) }",
        "SELECT * { ?s ?p ?o FILTER(?o) }",
        "SELECT * { ?s ?p ?o FILTER(!?o) }",
        "SELECT * { ?s ?p ?o FILTER(?o > '2024-01-01T00:00:00Z'^^xsd:dateTime) }",
        "SELECT * { ?s ?p ?o FILTER(STRSTARTS(STR(?o), 'a') || ?o = 'abc') }",
        "SELECT * { ?s ?p ?o FILTER(isNumeric(?o) && ?o < 2) }",
        "SELECT * { ?s ?p ?o FILTER(LANGMATCHES(LANG(?o), 'en')) }",
        "SELECT ?o (DATATYPE(?o) AS ?d) (STR(?o) AS ?t) (LANG(?o) AS ?l) { ?s ?p ?o }",
        "SELECT * { ?s ?p ?o FILTER EXISTS { ?o $p ?x } }",
        "SELECT * { ?s ?p ?o FILTER NOT EXISTS { ?s $p $o } }",
        "SELECT * { ?s $p* ?o }",
        "SELECT * { $s $p* ?o }",
        "SELECT * { ?s $p? ?o }",
        "SELECT * { $s ($p|<http://e/next>)+ ?o }",
        "SELECT * { $s $p*/^$p ?o }",
        "SELECT * { ?s !($p) ?o }",
        "SELECT * { $o $p* ?o }",
        "SELECT * { <http://e/absent> $p? ?o }",
        "SELECT * { GRAPH ?g { $s ($p/<http://e/q>)* ?o } }",
        "SELECT * { GRAPH ?g {} }",
        "SELECT * { GRAPH $g {} }",
        "SELECT * { GRAPH <http://e/absent> {} }",
        "SELECT * { VALUES ?g { $g <http://e/absent> $l } GRAPH ?g {} }",
        "SELECT * { GRAPH ?g { ?s ?p ?o } }",
        "SELECT * { GRAPH ?g { $s ?p ?o } }",
        "SELECT * { GRAPH ?g { ?s $p ?o } }",
        "SELECT * { GRAPH ?g { ?s ?p $o } }",
        "SELECT * { GRAPH ?g { $s $p ?o } }",
        "SELECT * { GRAPH ?g { ?s $p $o } }",
        "SELECT * { GRAPH ?g { $s ?p $o } }",
        "SELECT * { GRAPH ?g { $s $p $o } }",
        "SELECT * { GRAPH ?g { ?g ?p ?o } }",
        "SELECT * { GRAPH $g { ?s ?p ?o } }",
        "SELECT * { GRAPH $g { $s ?p ?o } }",
        "SELECT * { GRAPH $g { ?s $p ?o } }",
        "SELECT * { GRAPH $g { ?s ?p $o } }",
        "SELECT * { GRAPH $g { ?s $p $o } }",
        "SELECT * { GRAPH $g { $s ?p $o } }",
        "SELECT * { GRAPH $g { $s $p $o } }",
        "SELECT * { ?s $p ?x GRAPH ?g { ?s ?p ?o . ?s $p ?y } }",
        "SELECT * { GRAPH ?g { ?s $p ?o } \
         FILTER NOT EXISTS { GRAPH ?h { ?s $p ?o } FILTER(?g != ?h) } }",
        "SELECT * FROM $g { ?s ?p ?o }",
        "SELECT * FROM $g FROM <http://e/h> { ?s ?p ?o . ?s $p ?x }",
        "SELECT * FROM NAMED $g { GRAPH ?g { ?s ?p ?o } }",
        "SELECT * FROM <http://e/h> FROM NAMED $g { ?s ?q ?x GRAPH ?g { ?s ?p ?o } }",
        "SELECT * FROM NAMED $g FROM NAMED <http://e/absent> { GRAPH ?g {} }",
        "SELECT (COUNT(*) AS ?n) { ?s ?p ?o }",
        "SELECT ?p (COUNT(*) AS ?n) (COUNT(DISTINCT ?o) AS ?d) { ?s ?p ?o } GROUP BY ?p",
        "SELECT ?o (COUNT(?s) AS ?n) { ?s ?p ?o } GROUP BY ?o HAVING(COUNT(?s) > 1)",
        "SELECT ?s (SUM(?o) AS ?n) (AVG(?o) AS ?a) (MIN(?o) AS ?least) (MAX(?o) AS ?most) \
         { ?s ?p ?o FILTER(DATATYPE(?o) = xsd:integer) } GROUP BY ?s",
        "SELECT (MAX(?o) AS ?most) { ?s ?p ?o FILTER(DATATYPE(?o) = xsd:decimal) }",
        "SELECT * { { SELECT ?s (COUNT(*) AS ?n) { ?s ?p ?o } GROUP BY ?s } ?s $p ?n }",
        "SELECT * { { SELECT DISTINCT ?s { ?s $p ?o } } ?s ?p ?o }",
        "SELECT ?o { ?s ?p ?o } ORDER BY ?o ?s",
        "SELECT ?s ?o { ?s ?p ?o } ORDER BY DESC(?o) ?s ?p LIMIT 0",
        "SELECT * { VALUES ?o { $o $l 1 1.0 '1' '01'^^xsd:integer 1e0 true } ?s ?p ?o }",
        "SELECT * { VALUES (?s ?p) { ($s $p) (UNDEF $p) ($s UNDEF) } ?s ?p ?o }",
        "SELECT * { BIND($l AS ?o) ?s ?p ?o }",
        "SELECT * { BIND(STRDT('01', xsd:integer) AS ?o) ?s ?p ?o }",
        "SELECT * { BIND(STRDT('x', xsd:integer) AS ?o) OPTIONAL { ?s ?p ?o } }",
        "SELECT * { BIND(STRLANG('a', 'en') AS ?o) OPTIONAL { ?s ?p ?o } }",
        "SELECT * { ?s ?p ?o BIND(?o + 0 AS ?sum) OPTIONAL { ?x ?y ?sum } }",
        "SELECT * { ?s ?p ?o BIND(IF(?o, ?o, $l) AS ?x) OPTIONAL { ?y $p ?x } }",
        "SELECT * { ?s ?p ?o BIND(xsd:double(?o) AS ?n) OPTIONAL { ?x ?q ?n } }",
        "SELECT * { ?s ?p ?o BIND(?o / 0 AS ?n) OPTIONAL { ?x ?q ?n } }",
        "SELECT * { ?s ?p ?o BIND(CONCAT(STR(?o), '') AS ?t) ?x ?q ?t }",
        "SELECT * { ?s ?p ?o BIND(STRAFTER(STR(?o), 'a') AS ?t) FILTER(?t) }",
        "SELECT * { ?s ?p ?o BIND(?o - 1 AS ?n) FILTER(?n) }",
        "SELECT * { ?s ?p ?o BIND(IRI(STR(?o)) AS ?i) ?i ?q ?x }",
        "SELECT * { ?s ?p ?o BIND(?o - 'PT1H'^^xsd:dayTimeDuration AS ?t) FILTER(BOUND(?t)) }",
        "SELECT DISTINCT ?o { { ?s ?p ?o } UNION { GRAPH ?g { ?s ?p ?o } } }",
        "SELECT REDUCED ?p { ?s ?p $o }",
        "CONSTRUCT { ?o $p ?s . ?s <http://e/made> ?o } { ?s $p ?o }",
        "CONSTRUCT { ?s ?p ?o } { GRAPH ?g { ?s ?p ?o } }",
        "DESCRIBE $s",
        "DESCRIBE ?s { ?s $p $o }",
        "ASK { ?s $p ?o FILTER(?o = $l) }",
        "ASK { GRAPH $g { ?s $p $o } }",
    ];

    /// Puts terms into a query: random ones, or half of the time those of one of the statements.
    fn filled(query: &str, quads: &[Quad], random: &mut Random) -> String {
        let mut subject = iri(random.pick(IRIS));
        let mut property = iri(random.pick(PROPERTIES));
        let mut graph = iri(random.pick(GRAPHS));
        let mut object = match random.below(2) {
            0 => Term::from(iri(random.pick(IRIS))),
            _ => literal(random).into(),
        };
        if !quads.is_empty() && random.below(2) == 0 {
            let quad = &quads[random.below(quads.len())];
            property = quad.predicate.clone();
            if let NamedOrBlankNode::NamedNode(node) = &quad.subject {
                subject = node.clone();
            }
            if let GraphName::NamedNode(name) = &quad.graph_name {
                graph = name.clone();
            }
            // A blank node in a query is a variable.
            if !quad.object.is_blank_node() {
                object = quad.object.clone();
            }
        }
        // A subject in a query must not be a literal.
        if object.is_literal() && query.contains("{ $o $p") {
            object = subject.clone().into();
        }
        let query = query
            .replace("$s", &subject.to_string())
            .replace("$p", &property.to_string())
            .replace("$g", &graph.to_string())
            .replace("$l", &literal(random).to_string())
            .replace("$o", &object.to_string());
        format!("PREFIX xsd: <{XSD}> {query}")
    }

    fn prepared(query: &str) -> PreparedSparqlQuery {
        let parsed = SparqlEvaluator::new().parse_query(query);
        parsed.unwrap_or_else(|error| panic!("{query}: {error}"))
    }

    /// Rows in the order of their text.
    fn rows(results: QueryResults<'_>) -> Vec<String> {
        let mut rows: Vec<String> = match results {
            QueryResults::Boolean(answer) => vec![answer.to_string()],
            QueryResults::Graph(triples) => triples.map(|t| t.unwrap().to_string()).collect(),
            QueryResults::Solutions(solutions) => solutions
                .map(|row| {
                    let row = row.unwrap();
                    let values = row.iter().map(|(name, value)| format!("{name}={value}"));
                    values.collect::<Vec<_>>().join(" ")
                })
                .collect(),
        };
        rows.sort();
        rows
    }

    fn answer(dataset: &Dataset, query: &str) -> Vec<String> {
        let bound = prepared(query).on_queryable_dataset(dataset);
        rows(bound.execute().unwrap())
    }

    fn stored_answer(store: &Store, query: &str) -> Vec<String> {
        rows(prepared(query).on_store(store).execute().unwrap())
    }

    fn dataset_of(quads: &[Quad]) -> Dataset {
        let mut dataset = Dataset::default();
        dataset.extend(quads.iter().cloned());
        dataset.merge_pending();
        dataset
    }

    #[test]
    fn queries_have_the_same_rows_as_those_of_a_store() {
        let mut random = Random(20_260_801);
        let mut n_rows = vec![0; QUERIES.len()];
        for case in 0..200 {
            let n_quads = random.below(80);
            let quads: Vec<Quad> = (0..n_quads).map(|_| quad(&mut random)).collect();
            let store = Store::new().unwrap();
            store.extend(quads.iter().cloned()).unwrap();
            let mut dataset = dataset_of(&quads);
            if random.below(2) == 0 {
                let empty = iri("empty");
                store.insert_named_graph(&empty).unwrap();
                dataset.add_graph(empty.as_ref().into());
                dataset.merge_pending();
            }
            assert_eq!(dataset.len(), store.len().unwrap());
            for (query, n_rows) in QUERIES.iter().zip(&mut n_rows) {
                let query = filled(query, &quads, &mut random);
                let expected = stored_answer(&store, &query);
                *n_rows += expected.len();
                assert_eq!(answer(&dataset, &query), expected, "case {case}: {query}");
            }
        }
        for (query, n_rows) in QUERIES.iter().zip(n_rows) {
            assert!(
                n_rows > 0 || query.contains("absent") || query.ends_with("LIMIT 0"),
                "{query}"
            );
        }
    }

    #[test]
    fn literals_are_returned_as_a_store_returns_them() {
        for (text, datatype) in TYPED {
            let datatype = NamedNode::new_unchecked(format!("{XSD}{datatype}"));
            let literal = Literal::new_typed_literal(*text, datatype);
            let quad = Quad::new(iri("a"), iri("p"), literal, GraphName::DefaultGraph);
            let store = Store::new().unwrap();
            store.insert(&quad).unwrap();
            let mut dataset = Dataset::default();
            let number = dataset.intern(quad.object.as_ref());
            let stored = store.iter().next().unwrap().unwrap();
            assert_eq!(dataset.term(number), stored.object);
            assert_eq!(dataset.number(stored.object.as_ref()), Some(number));
        }
    }

    #[test]
    fn literals_with_an_identical_value_are_one_term() {
        let mut dataset = Dataset::default();
        let mut number = |text, datatype| {
            let literal = LiteralRef::new_typed_literal(text, datatype);
            dataset.intern(literal.into())
        };
        let one = number("1", xsd::INTEGER);
        assert_eq!(number("01", xsd::INTEGER), one);
        assert_eq!(number("1", xsd::SHORT), one);
        assert_ne!(number("1", xsd::DOUBLE), one);
        assert_ne!(number("1", xsd::DECIMAL), one);
        assert_ne!(number("1", xsd::STRING), one);
        assert_eq!(number("1e0", xsd::DOUBLE), number("1.0", xsd::DOUBLE));
        assert_ne!(number("0", xsd::DOUBLE), number("-0", xsd::DOUBLE));
        assert_eq!(number("true", xsd::BOOLEAN), number("1", xsd::BOOLEAN));
        let noon = number("2024-02-29T12:00:00Z", xsd::DATE_TIME);
        assert_eq!(number("2024-02-29T12:00:00.0+00:00", xsd::DATE_TIME), noon);
        assert_ne!(number("2024-02-29T14:00:00+02:00", xsd::DATE_TIME), noon);
    }

    #[test]
    fn adding_statements_in_parts_gives_the_same_as_at_once() {
        let mut random = Random(77);
        for case in 0..15 {
            let n_quads = 1 + random.below(120);
            let quads: Vec<Quad> = (0..n_quads).map(|_| quad(&mut random)).collect();
            let whole = dataset_of(&quads);
            let mut parts = Dataset::default();
            let mut rest = &quads[..];
            while !rest.is_empty() {
                let (part, later) = rest.split_at(1 + random.below(rest.len()));
                parts.extend(part.iter().cloned());
                parts.merge_pending();
                rest = later;
                // Queries make the orders that the next part must reset.
                for query in QUERIES {
                    answer(&parts, &filled(query, &quads, &mut random));
                }
            }
            parts.merge_pending();
            assert_eq!(parts.len(), whole.len());
            for query in QUERIES {
                let query = filled(query, &quads, &mut random);
                assert_eq!(
                    answer(&parts, &query),
                    answer(&whole, &query),
                    "case {case}: {query}"
                );
            }
            assert_eq!(
                answer(&parts.clone(), QUERIES[0]),
                answer(&whole, QUERIES[0])
            );
        }
    }

    #[test]
    fn pending_statements_are_not_seen() {
        let mut dataset = Dataset::default();
        let [a, p, g] = ["a", "p", "g"].map(|name| dataset.intern(iri(name).as_ref().into()));
        dataset.insert([a, p, a], None);
        dataset.insert([a, p, a], Some(g));
        assert!(dataset.is_empty());
        assert!(answer(&dataset, "SELECT * { ?s ?p ?o }").is_empty());
        dataset.merge_pending();
        assert_eq!(dataset.len(), 2);
        assert_eq!(answer(&dataset, "SELECT * { GRAPH ?g {} }").len(), 1);
    }

    #[test]
    fn threads_can_share_a_dataset() {
        fn check<T: Send + Sync>(_: &T) {}
        check(&Dataset::default());
    }
}
