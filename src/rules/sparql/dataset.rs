//! One action's facts as a SPARQL dataset: sorted term ids, searched in place, without copying the
//! ontology.

use std::convert::Infallible;
use std::hash::{Hash, Hasher};
use std::rc::Rc;

use oxrdf::Term as RdfTerm;
use spareval::{InternalQuad, QueryableDataset};

use crate::model::rdf::{from_rdf, to_rdf};
use crate::model::universe::Universe;
use crate::sparql::ledger::{Entry, Ledger, Weight};
use actcheck_base::{Term, TermId, Terms, names};

/// Statements in the two orders that lookups use.
#[derive(Debug, Default)]
pub(crate) struct Graph {
    by_subject: Vec<[TermId; 3]>,
    /// Columns: property, object, subject.
    by_property: Vec<[TermId; 3]>,
}

impl Graph {
    pub(crate) fn new(mut triples: Vec<[TermId; 3]>) -> Self {
        triples.sort_unstable();
        triples.dedup();
        let mut by_property: Vec<[TermId; 3]> =
            triples.iter().map(|[s, p, o]| [*p, *o, *s]).collect();
        by_property.sort_unstable();
        Self {
            by_subject: triples,
            by_property,
        }
    }

    /// Returns the statements that match the given parts; `None` matches any term.
    fn find(&self, s: Option<TermId>, p: Option<TermId>, o: Option<TermId>) -> Vec<[TermId; 3]> {
        let fits = |[a, b, c]: &[TermId; 3]| {
            s.is_none_or(|s| s == *a) && p.is_none_or(|p| p == *b) && o.is_none_or(|o| o == *c)
        };
        match (s, p) {
            (Some(s), _) => range(&self.by_subject, s, p)
                .iter()
                .filter(|t| fits(t))
                .copied()
                .collect(),
            (None, Some(p)) => range(&self.by_property, p, o)
                .iter()
                .map(|[p, o, s]| [*s, *p, *o])
                .filter(fits)
                .collect(),
            (None, None) => self
                .by_subject
                .iter()
                .filter(|t| fits(t))
                .copied()
                .collect(),
        }
    }
}

/// Returns the rows that begin with the given one or two ids.
fn range(rows: &[[TermId; 3]], first: TermId, second: Option<TermId>) -> &[[TermId; 3]] {
    let key = |row: &[TermId; 3]| (row[0], second.map_or(0, |_| row[1]));
    let wanted = (first, second.unwrap_or(0));
    let start = rows.partition_point(|row| key(row) < wanted);
    let length = rows[start..].partition_point(|row| key(row) <= wanted);
    &rows[start..start + length]
}

/// The named graphs of one action. The default graph is their union.
#[derive(Debug)]
pub(crate) struct Snapshot {
    /// Name and statements.
    pub(crate) graphs: Vec<(TermId, Graph)>,
}

/// The constant part of the dataset: the ontology's statements and the graph names.
#[derive(Debug)]
pub(crate) struct Statements {
    pub(crate) name: TermId,
    pub(crate) graph: Graph,
    /// Name of the graph with the designators.
    pub(crate) parameters: TermId,
    /// Property that links a designator to its value.
    pub(crate) value: TermId,
}

impl Statements {
    pub(crate) fn new(triples: &[[TermId; 3]], terms: &mut Terms) -> Self {
        Self {
            name: terms.intern(Term::iri(names::act("ontology"))),
            graph: Graph::new(triples.to_vec()),
            parameters: terms.intern(Term::iri(names::act("parameters"))),
            value: terms.intern(Term::iri(names::act("value"))),
        }
    }
}

/// A view of both, with the ledger that counts the terms it returns.
#[derive(Clone, Copy)]
pub(crate) struct View<'a> {
    pub(crate) snapshot: &'a Snapshot,
    pub(crate) statements: &'a Statements,
    pub(crate) universe: &'a Universe<'a>,
    pub(crate) ledger: &'a Ledger,
}

/// A term held by the evaluator. Copying it may stop the evaluation.
#[derive(Debug, Clone)]
pub(crate) struct ViewTerm<'a> {
    value: DatasetTerm<'a>,
    _entry: Entry<'a>,
}

/// A term of the dataset by id, or a term created by the query.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
enum DatasetTerm<'a> {
    Known(TermId),
    Created(Rc<Created<'a>>),
}

/// A term created by the query.
#[derive(Debug)]
struct Created<'a> {
    term: RdfTerm,
    _weight: Weight<'a>,
}

impl PartialEq for Created<'_> {
    fn eq(&self, other: &Self) -> bool {
        self.term == other.term
    }
}

impl Eq for Created<'_> {}

impl Hash for Created<'_> {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.term.hash(state);
    }
}

impl ViewTerm<'_> {
    /// Returns the id, or `None` for a term created by the query, which matches no statement.
    fn id(&self) -> Option<TermId> {
        match self.value {
            DatasetTerm::Known(id) => Some(id),
            DatasetTerm::Created(_) => None,
        }
    }
}

impl PartialEq for ViewTerm<'_> {
    fn eq(&self, other: &Self) -> bool {
        self.value == other.value
    }
}

impl Eq for ViewTerm<'_> {}

impl Hash for ViewTerm<'_> {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.value.hash(state);
    }
}

impl<'a> View<'a> {
    fn graphs(&self) -> impl Iterator<Item = (TermId, &'a Graph)> + use<'a> {
        let statements = self.statements;
        self.snapshot
            .graphs
            .iter()
            .map(|(name, graph)| (*name, graph))
            .chain([(statements.name, &statements.graph)])
    }

    fn handed_out(&self, value: DatasetTerm<'a>) -> ViewTerm<'a> {
        ViewTerm {
            value,
            _entry: Entry::new(self.ledger),
        }
    }
}

impl<'a> QueryableDataset<'a> for View<'a> {
    type InternalTerm = ViewTerm<'a>;
    type Error = Infallible;

    fn internal_quads_for_pattern(
        &self,
        subject: Option<&ViewTerm<'a>>,
        predicate: Option<&ViewTerm<'a>>,
        object: Option<&ViewTerm<'a>>,
        graph_name: Option<Option<&ViewTerm<'a>>>,
    ) -> impl Iterator<Item = Result<InternalQuad<ViewTerm<'a>>, Infallible>> + use<'a> {
        // A lookup without results returns no counted terms but takes time, so check the clock
        // here.
        self.ledger.check();
        let mut found = Vec::new();
        let parts = [subject, predicate, object];
        if parts.iter().flatten().all(|term| term.id().is_some()) {
            let [s, p, o] = parts.map(|part| part.and_then(ViewTerm::id));
            for (name, graph) in self.graphs() {
                let named = match graph_name {
                    None => true,
                    Some(None) => false,
                    Some(Some(wanted)) if wanted.id() == Some(name) => true,
                    Some(Some(_)) => continue,
                };
                found.extend(
                    graph
                        .find(s, p, o)
                        .into_iter()
                        .map(|triple| (triple, named.then_some(name))),
                );
            }
        }
        let view = *self;
        found.into_iter().map(move |(triple, graph)| {
            let known = |id| view.handed_out(DatasetTerm::Known(id));
            let [subject, predicate, object] = triple.map(known);
            Ok(InternalQuad {
                subject,
                predicate,
                object,
                graph_name: graph.map(known),
            })
        })
    }

    fn internal_named_graphs(
        &self,
    ) -> impl Iterator<Item = Result<ViewTerm<'a>, Infallible>> + use<'a> {
        let view = *self;
        view.graphs()
            .map(move |(name, _)| Ok(view.handed_out(DatasetTerm::Known(name))))
    }

    fn contains_internal_graph_name(&self, graph_name: &ViewTerm<'a>) -> Result<bool, Infallible> {
        Ok(self.graphs().any(|(name, _)| graph_name.id() == Some(name)))
    }

    fn internalize_term(&self, term: RdfTerm) -> Result<ViewTerm<'a>, Infallible> {
        if let Some(known) = self.universe.id(&from_rdf(&term)) {
            return Ok(self.handed_out(DatasetTerm::Known(known)));
        }
        let weight = Weight::new(self.ledger, length_of(&term));
        let created = Created {
            term,
            _weight: weight,
        };
        Ok(self.handed_out(DatasetTerm::Created(Rc::new(created))))
    }

    fn externalize_term(&self, term: ViewTerm<'a>) -> Result<RdfTerm, Infallible> {
        Ok(match term.value {
            DatasetTerm::Known(id) => to_rdf(self.universe.term(id)),
            DatasetTerm::Created(created) => created.term.clone(),
        })
    }
}

/// Returns the length of a term's text. Unit: bytes.
pub(crate) fn length_of(term: &RdfTerm) -> usize {
    match term {
        RdfTerm::NamedNode(node) => node.as_str().len(),
        RdfTerm::BlankNode(node) => node.as_str().len(),
        RdfTerm::Literal(literal) => literal.value().len(),
    }
}
