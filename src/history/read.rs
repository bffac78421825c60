//! Reads the store: all statements about one subject, and rows of internal queries.

use std::collections::BTreeMap;

use oxigraph::model::{
    GraphNameRef, NamedOrBlankNode, NamedOrBlankNodeRef, Term, TermRef, Variable,
};
use oxigraph::sparql::{PreparedSparqlQuery, QueryEvaluationError, QueryResults};
use oxigraph::store::{StorageError, Store};

use crate::Cancel;
use crate::columns::by_columns;
use crate::evaluation::{Unfinished, evaluate};
use crate::light::parser;
use crate::quad_source::QuadSource;
use crate::query::evaluator;
use crate::statements::iri;
use actcheck_base::names;

/// All statements of a graph about one subject.
#[derive(Debug, Default)]
pub(super) struct Node {
    values: BTreeMap<String, Vec<Term>>,
}

impl Node {
    /// Reads a subject from the default graph. The node of an unknown subject is empty.
    pub(super) fn read<'a>(
        store: &impl QuadSource,
        subject: impl Into<NamedOrBlankNodeRef<'a>>,
    ) -> Result<Self, StorageError> {
        Self::read_in(store, subject, GraphNameRef::DefaultGraph)
    }

    /// Like [`Node::read`], for any graph.
    pub(super) fn read_in<'a>(
        store: &impl QuadSource,
        subject: impl Into<NamedOrBlankNodeRef<'a>>,
        graph: GraphNameRef<'_>,
    ) -> Result<Self, StorageError> {
        let mut node = Self::default();
        for quad in store.about(subject.into(), graph)? {
            node.values
                .entry(quad.predicate.into_string())
                .or_default()
                .push(quad.object);
        }
        Ok(node)
    }

    /// All values of a property.
    pub(super) fn all(&self, property: &str) -> &[Term] {
        self.values
            .get(iri(property).as_str())
            .map_or(&[], Vec::as_slice)
    }

    /// The properties with their values, sorted by property.
    pub(super) fn properties(&self) -> impl Iterator<Item = (&str, &[Term])> {
        self.values
            .iter()
            .map(|(property, values)| (property.as_str(), values.as_slice()))
    }

    /// The first value as text: of a literal its text, else the IRI. Returns `None` if the property
    /// has no value.
    pub(super) fn text(&self, property: &str) -> Option<String> {
        self.all(property).first().map(text_of)
    }

    /// The first value as a number. Returns `None` if it is missing or not a number.
    pub(super) fn number(&self, property: &str) -> Option<f64> {
        self.text(property)?.parse().ok()
    }

    /// The first value as a count. Returns `None` if it is missing or not a non-negative integer.
    pub(super) fn count(&self, property: &str) -> Option<u64> {
        self.text(property)?.parse().ok()
    }

    /// The first value as a Boolean. Returns `None` if it is missing or not a Boolean.
    pub(super) fn boolean(&self, property: &str) -> Option<bool> {
        self.text(property)?.parse().ok()
    }
}

/// The text of a literal, the IRI, or the label of a blank node.
pub(super) fn text_of(term: &Term) -> String {
    match term {
        Term::NamedNode(node) => node.as_str().to_owned(),
        Term::BlankNode(node) => node.as_str().to_owned(),
        Term::Literal(literal) => literal.value().to_owned(),
        #[expect(
            unreachable_patterns,
            reason = "other builds of the library have quoted triples, which we never write"
        )]
        other => other.to_string(),
    }
}

/// A value in its short form: the id of an object or run, or the text.
pub(super) fn id_of(term: &Term) -> String {
    match term {
        Term::NamedNode(node) => short_id(node.as_str()).to_owned(),
        other => text_of(other),
    }
}

/// The id in one of our IRIs; other IRIs are returned unchanged.
pub(super) fn short_id(iri: &str) -> &str {
    [names::RUN, names::CAMPAIGN, names::OBJ]
        .iter()
        .find_map(|namespace| iri.strip_prefix(namespace))
        .unwrap_or(iri)
}

/// The subjects that have a value of a property in the default graph, unsorted.
pub(super) fn subjects<'a>(
    store: &impl QuadSource,
    property: &str,
    value: impl Into<TermRef<'a>>,
) -> Result<Vec<NamedOrBlankNode>, StorageError> {
    subjects_in(store, property, value, GraphNameRef::DefaultGraph)
}

/// Like [`subjects`], for any graph.
pub(super) fn subjects_in<'a>(
    store: &impl QuadSource,
    property: &str,
    value: impl Into<TermRef<'a>>,
    graph: GraphNameRef<'_>,
) -> Result<Vec<NamedOrBlankNode>, StorageError> {
    store.with_value(iri(property).as_ref(), value.into(), graph)
}

/// Runs an internal query with some of its variables bound, and returns its rows.
pub(super) fn select(
    store: &Store,
    query: &str,
    given: Vec<(&str, Term)>,
) -> Result<Vec<Vec<Option<Term>>>, QueryEvaluationError> {
    answered(store, evaluator(&Cancel::new()).parse_query(query)?, given)
}

/// Like [`select`], for a query that reads most values of its properties.
pub(super) fn select_columns(
    store: &Store,
    query: &str,
    given: Vec<(&str, Term)>,
) -> Result<Vec<Vec<Option<Term>>>, QueryEvaluationError> {
    let query = parser().parse_query(query)?;
    answered(
        store,
        evaluator(&Cancel::new()).for_query(by_columns(query)),
        given,
    )
}

fn answered(
    store: &Store,
    mut prepared: PreparedSparqlQuery,
    given: Vec<(&str, Term)>,
) -> Result<Vec<Vec<Option<Term>>>, QueryEvaluationError> {
    for (variable, value) in given {
        prepared = prepared.substitute_variable(Variable::new_unchecked(variable), value);
    }
    let rows = evaluate(store, &Cancel::new(), move |store| {
        let mut rows = Vec::new();
        if let QueryResults::Solutions(solutions) = prepared.on_store(store).execute()? {
            for solution in solutions {
                rows.push(solution?.values().to_vec());
            }
        }
        Ok(rows)
    });
    rows.map_err(|fault| match fault {
        Unfinished::Failed(error) => error,
        Unfinished::Damaged(error) => QueryEvaluationError::Dataset(error.into()),
        Unfinished::Crashed | Unfinished::Stopped => {
            QueryEvaluationError::Dataset("the evaluator crashed".into())
        }
    })
}
