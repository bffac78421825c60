//! Index of statements by subject and predicate, with transitive class and property hierarchies.

use std::collections::{BTreeMap, BTreeSet};

use crate::read::{Home, Reading, Statement};
use actcheck_base::{Source, Span, Term, names};

/// Index of the statements of an ontology.
pub(super) struct Graph {
    reading: Reading,
    /// Indices of the statements of each subject IRI, in reading order.
    by_subject: BTreeMap<String, Vec<usize>>,
    /// Each class with all its superclasses, excluding itself.
    pub(super) superclasses: BTreeMap<String, BTreeSet<String>>,
    superproperties: BTreeMap<String, BTreeSet<String>>,
}

impl Graph {
    pub(super) fn new(reading: Reading) -> Self {
        let mut by_subject: BTreeMap<String, Vec<usize>> = BTreeMap::new();
        for (idx, statement) in reading.statements.iter().enumerate() {
            if let Some(subject) = statement.subject.as_iri() {
                by_subject.entry(subject.to_owned()).or_default().push(idx);
            }
        }
        let superclasses = closure(&reading, &rdfs("subClassOf"));
        let superproperties = closure(&reading, &rdfs("subPropertyOf"));
        Self {
            reading,
            by_subject,
            superclasses,
            superproperties,
        }
    }

    pub(super) fn statements(&self) -> &[Statement] {
        &self.reading.statements
    }

    pub(super) fn sources(&self) -> &[Source] {
        &self.reading.sources
    }

    /// IRIs of all subjects, sorted.
    pub(super) fn subjects(&self) -> impl Iterator<Item = &str> {
        self.by_subject.keys().map(String::as_str)
    }

    /// Statements about an IRI, in reading order.
    pub(super) fn about<'a>(&'a self, subject: &str) -> impl Iterator<Item = &'a Statement> {
        self.by_subject
            .get(subject)
            .into_iter()
            .flatten()
            .map(|idx| &self.reading.statements[*idx])
    }

    /// Statements with this subject, and this predicate or one of its sub-properties.
    pub(super) fn stated<'a>(
        &'a self,
        subject: &str,
        predicate: &str,
    ) -> impl Iterator<Item = &'a Statement> {
        self.about(subject)
            .filter(move |statement| self.means(&statement.predicate, predicate))
    }

    /// The first string value of a subject's predicate. Returns `None` if it has none.
    pub(super) fn text(&self, subject: &str, predicate: &str) -> Option<String> {
        self.stated(subject, predicate)
            .find_map(|statement| match &statement.object {
                Term::String(text) | Term::LangString(text, _) => Some(text.to_string()),
                _ => None,
            })
    }

    /// `rdfs:label`, or the local name if there is none.
    pub(super) fn label(&self, iri: &str) -> String {
        self.text(iri, &rdfs("label"))
            .unwrap_or_else(|| names::local(iri).to_owned())
    }

    /// Declared classes of an individual, with all their superclasses.
    pub(super) fn classes_of(&self, individual: &str) -> BTreeSet<String> {
        let mut classes = BTreeSet::new();
        for class in self
            .stated(individual, &format!("{}type", names::RDF))
            .filter_map(|s| s.object.as_iri())
        {
            classes.extend(self.superclasses.get(class).into_iter().flatten().cloned());
            classes.insert(class.to_owned());
        }
        classes
    }

    /// Individuals of a class or of its subclasses, sorted.
    pub(super) fn individuals(&self, class: &str) -> BTreeSet<String> {
        self.subjects()
            .filter(|subject| self.classes_of(subject).contains(class))
            .map(str::to_owned)
            .collect()
    }

    /// Source and span of an IRI in a statement.
    pub(super) fn place(&self, statement: &Statement, iri: &str) -> (&Source, Span) {
        (
            &self.reading.sources[statement.text],
            self.reading.place(statement, iri),
        )
    }

    /// Bases of the relative paths in all sources, in the order of the sources.
    pub(super) fn homes(&self) -> &[Home] {
        &self.reading.homes
    }

    /// Base of the relative paths in a statement's source.
    pub(super) fn home(&self, statement: &Statement) -> &Home {
        &self.reading.homes[statement.text]
    }

    /// Whether a predicate is the wanted one or one of its sub-properties.
    pub(super) fn means(&self, predicate: &str, wanted: &str) -> bool {
        predicate == wanted
            || self
                .superproperties
                .get(predicate)
                .is_some_and(|above| above.contains(wanted))
    }
}

fn closure(reading: &Reading, predicate: &str) -> BTreeMap<String, BTreeSet<String>> {
    let mut direct: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for statement in reading
        .statements
        .iter()
        .filter(|statement| *statement.predicate == *predicate)
    {
        if let (Some(below), Some(above)) = (statement.subject.as_iri(), statement.object.as_iri())
        {
            direct.entry(below).or_default().insert(above);
        }
    }
    let above_of = |start: &str| {
        let mut above: BTreeSet<String> = BTreeSet::new();
        let mut waiting: Vec<&str> = direct.get(start).into_iter().flatten().copied().collect();
        while let Some(next) = waiting.pop() {
            if next != start && above.insert(next.to_owned()) {
                waiting.extend(direct.get(next).into_iter().flatten().copied());
            }
        }
        above
    };
    direct
        .keys()
        .map(|start| ((*start).to_owned(), above_of(start)))
        .collect()
}

pub(super) fn rdfs(local: &str) -> String {
    format!("{}{local}", names::RDFS)
}
