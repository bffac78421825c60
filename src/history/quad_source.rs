//! Where the statements about a run are read from: a store, or the statements of one outline.

use std::collections::HashMap;

use oxigraph::model::{
    GraphName, GraphNameRef, NamedNodeRef, NamedOrBlankNode, NamedOrBlankNodeRef, Quad, QuadRef,
    Term, TermRef,
};
use oxigraph::store::{StorageError, Store};

/// A source of statements.
pub(super) trait QuadSource {
    /// All statements about a subject in a graph.
    ///
    /// # Errors
    /// The store can't be read.
    fn about(
        &self,
        subject: NamedOrBlankNodeRef<'_>,
        graph: GraphNameRef<'_>,
    ) -> Result<Vec<Quad>, StorageError>;

    /// The subjects that have a value of a property in a graph, unsorted.
    ///
    /// # Errors
    /// The store can't be read.
    fn with_value(
        &self,
        property: NamedNodeRef<'_>,
        value: TermRef<'_>,
        graph: GraphNameRef<'_>,
    ) -> Result<Vec<NamedOrBlankNode>, StorageError>;

    /// Whether any subject has a value of a property in a graph.
    ///
    /// # Errors
    /// The store can't be read.
    fn has_value(
        &self,
        property: NamedNodeRef<'_>,
        value: TermRef<'_>,
        graph: GraphNameRef<'_>,
    ) -> Result<bool, StorageError>;

    /// Whether it has a statement.
    ///
    /// # Errors
    /// The store can't be read.
    fn has(&self, quad: QuadRef<'_>) -> Result<bool, StorageError>;
}

impl QuadSource for Store {
    fn about(
        &self,
        subject: NamedOrBlankNodeRef<'_>,
        graph: GraphNameRef<'_>,
    ) -> Result<Vec<Quad>, StorageError> {
        self.quads_for_pattern(Some(subject), None, None, Some(graph))
            .collect()
    }

    fn with_value(
        &self,
        property: NamedNodeRef<'_>,
        value: TermRef<'_>,
        graph: GraphNameRef<'_>,
    ) -> Result<Vec<NamedOrBlankNode>, StorageError> {
        let quads = self.quads_for_pattern(None, Some(property), Some(value), Some(graph));
        quads.map(|quad| quad.map(|quad| quad.subject)).collect()
    }

    fn has_value(
        &self,
        property: NamedNodeRef<'_>,
        value: TermRef<'_>,
        graph: GraphNameRef<'_>,
    ) -> Result<bool, StorageError> {
        let mut quads = self.quads_for_pattern(None, Some(property), Some(value), Some(graph));
        quads.next().transpose().map(|quad| quad.is_some())
    }

    fn has(&self, quad: QuadRef<'_>) -> Result<bool, StorageError> {
        self.contains(quad)
    }
}

/// The statements about one run, in memory: a store would take ten times as long to fill as to
/// read.
#[derive(Debug)]
pub(super) struct RunQuads {
    quads: Vec<Quad>,
    by_subject: HashMap<NamedOrBlankNode, Vec<usize>>,
    by_value: HashMap<Term, Vec<usize>>,
}

impl RunQuads {
    pub(super) fn new(quads: Vec<Quad>) -> Self {
        let mut by_subject: HashMap<NamedOrBlankNode, Vec<usize>> = HashMap::new();
        let mut by_value: HashMap<Term, Vec<usize>> = HashMap::new();
        for (at, quad) in quads.iter().enumerate() {
            by_subject.entry(quad.subject.clone()).or_default().push(at);
            // Runs are never looked for by numbers or texts.
            if !matches!(quad.object, Term::Literal(_)) {
                by_value.entry(quad.object.clone()).or_default().push(at);
            }
        }
        Self {
            quads,
            by_subject,
            by_value,
        }
    }
}

impl QuadSource for RunQuads {
    fn about(
        &self,
        subject: NamedOrBlankNodeRef<'_>,
        graph: GraphNameRef<'_>,
    ) -> Result<Vec<Quad>, StorageError> {
        let graph = GraphName::from(graph);
        let found = self
            .by_subject
            .get(&subject.into_owned())
            .into_iter()
            .flatten();
        Ok(found
            .map(|at| &self.quads[*at])
            .filter(|quad| quad.graph_name == graph)
            .cloned()
            .collect())
    }

    fn with_value(
        &self,
        property: NamedNodeRef<'_>,
        value: TermRef<'_>,
        graph: GraphNameRef<'_>,
    ) -> Result<Vec<NamedOrBlankNode>, StorageError> {
        let graph = GraphName::from(graph);
        let found = self
            .by_value
            .get(&value.into_owned())
            .into_iter()
            .flatten()
            .map(|at| &self.quads[*at]);
        let has = |quad: &&Quad| quad.predicate.as_ref() == property && quad.graph_name == graph;
        Ok(found.filter(has).map(|quad| quad.subject.clone()).collect())
    }

    fn has_value(
        &self,
        property: NamedNodeRef<'_>,
        value: TermRef<'_>,
        graph: GraphNameRef<'_>,
    ) -> Result<bool, StorageError> {
        self.with_value(property, value, graph)
            .map(|found| !found.is_empty())
    }

    fn has(&self, quad: QuadRef<'_>) -> Result<bool, StorageError> {
        let about = self
            .by_subject
            .get(&quad.subject.into_owned())
            .into_iter()
            .flatten();
        Ok(about
            .map(|at| &self.quads[*at])
            .any(|known| known.as_ref() == quad))
    }
}
