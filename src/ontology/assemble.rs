//! Assembles statements into an ontology and checks that all its references resolve.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;

use crate::graph::{Graph, rdfs};
use crate::read::Statement;
use crate::{Action, Ontology, Property, RuleFile, RuleLanguage, Vocabulary, VocabularyTerm};
use crate::{check, read, rule_files, unlinked};
use actcheck_base::{Diagnostic, Diagnostics, Digest, Files, Severity, Source, Term, names};

/// Loads an ontology with its imports and linked rule files.
///
/// Accepts Turtle and RDF/XML, distinguished by file extension or content. Relative file IRIs
/// become machine-independent IRIs.
///
/// # Errors
/// Reports all faults at once: a file can't be read or parsed (O001 to O003), a success property is
/// not a property (O004), a property has no rule or several (O005, O006), a parameter is missing or
/// unknown (O007, O008), a rule file is missing, has an unknown extension or an absolute path (O009
/// to O011), the ontology has no action (O012), or a predicate is misspelt (O014).
pub fn load(files: &Files, path: &Path) -> Result<Ontology, Diagnostics> {
    load_with(files, path, Severity::Error)
}

/// As [`load`], to report outcomes that are stored: a rule file that can't be read is a warning
/// (O009), and its property has an empty rule.
///
/// # Errors
/// As [`load`], except for O009.
pub fn load_to_report(files: &Files, path: &Path) -> Result<Ontology, Diagnostics> {
    load_with(files, path, Severity::Warning)
}

/// Reads an ontology. `missing`: how severe a rule file is that can't be read.
fn load_with(files: &Files, path: &Path, missing: Severity) -> Result<Ontology, Diagnostics> {
    let mut found = Diagnostics::new();
    let graph = Graph::new(read::read(files, path, &mut found));
    // Missing definitions may be in the part that could not be parsed, so further checks would
    // mislead.
    if found.has_errors() {
        return Err(found);
    }
    let libraries = libraries(&graph, missing, &mut found);
    let mut rules = property_rules(&graph, missing, &mut found);
    let properties: BTreeMap<String, Property> = graph
        .individuals(&names::act("Property"))
        .into_iter()
        .filter_map(|iri| {
            rules
                .remove(&iri)
                .map(|rule| (iri.clone(), property(&graph, iri, rule)))
        })
        .collect();
    let actions: BTreeMap<String, Action> = check::action_iris(&graph)
        .into_iter()
        .map(|iri| (names::local(&iri).to_owned(), action(&graph, iri)))
        .collect();
    check::actions(&graph, &actions, &mut found);
    check::misspelt_predicates(&graph, &mut found);
    if !found.has_errors() {
        check::never_judged(&graph, &actions, &mut found);
    }
    let found = in_order_of_place(found, graph.sources());
    let unlinked = if found.has_errors() {
        Diagnostics::new()
    } else {
        unlinked::rule_files(&graph)
    };
    let mut digest = Digest::new();
    graph
        .sources()
        .iter()
        .for_each(|source| digest.update(source.text.as_bytes()));
    let warnings = found.clone();
    found.or(Ontology {
        sources: graph.sources().to_vec(),
        actions,
        properties,
        designators: check::parameters(&graph),
        libraries,
        triples: triples(&graph),
        superclasses: graph.superclasses.clone(),
        vocabulary: vocabulary(&graph),
        digest: digest.finish(),
        warnings,
        unlinked,
    })
}

/// Reads the terms of a vocabulary with its imports, such as `ontology/history.ttl`, which need
/// have no actions.
///
/// # Errors
/// A file can't be read or parsed (O001 to O003).
pub fn load_vocabulary(files: &Files, path: &Path) -> Result<Vocabulary, Diagnostics> {
    let mut found = Diagnostics::new();
    let graph = Graph::new(read::read(files, path, &mut found));
    found.or(vocabulary(&graph))
}

/// Sorts faults by source file, then by position.
fn in_order_of_place(found: Diagnostics, sources: &[Source]) -> Diagnostics {
    let rank = |fault: &Diagnostic| {
        sources
            .iter()
            .position(|source| fault.source.as_ref() == Some(source))
    };
    let mut faults: Vec<Diagnostic> = found.into_iter().collect();
    faults.sort_by_key(|fault| {
        (
            rank(fault),
            fault.span.as_ref().map_or(0, |span| span.start),
        )
    });
    let mut sorted = Diagnostics::new();
    faults.into_iter().for_each(|fault| sorted.push(fault));
    sorted
}

/// Rule libraries without duplicates, sorted by path.
fn libraries(graph: &Graph, missing: Severity, found: &mut Diagnostics) -> Vec<RuleFile> {
    let predicate = names::act("ruleLibrary");
    let mut libraries: BTreeMap<(String, Arc<str>), RuleFile> = BTreeMap::new();
    for statement in graph
        .statements()
        .iter()
        .filter(|statement| *statement.predicate == *predicate)
    {
        let Some(library) = rule_files::read(graph, statement, missing, found) else {
            continue;
        };
        if library.language != RuleLanguage::Datalog
            && let Some((source, span)) = &library.linked_at
        {
            let message = format!("the rule library `{}` is not Datalog", library.path);
            found.push(
                Diagnostic::error("O010", message)
                    .at(source, span.clone())
                    .help("rule libraries must end in `.rls`"),
            );
        }
        libraries.insert(
            (library.path.clone(), Arc::clone(&library.source.name)),
            library,
        );
    }
    libraries.into_values().collect()
}

/// The rule file of each property, by IRI.
fn property_rules(
    graph: &Graph,
    missing: Severity,
    found: &mut Diagnostics,
) -> BTreeMap<String, RuleFile> {
    let mut rules = BTreeMap::new();
    for iri in graph.individuals(&names::act("Property")) {
        let links: Vec<&Statement> = graph.stated(&iri, &names::act("verifiedBy")).collect();
        match links.as_slice() {
            [] => found.push(check::unverified(graph, &iri)),
            [link] => {
                if let Some(rule) = rule_files::read(graph, link, missing, found) {
                    rules.insert(iri, rule);
                }
            }
            [_, second, ..] => {
                let message = format!(
                    "the property `{}` is verified by {} rule files",
                    names::local(&iri),
                    links.len()
                );
                let (source, span) = graph.place(second, second.object.as_iri().unwrap_or(&iri));
                found.push(
                    Diagnostic::error("O006", message)
                        .at(source, span)
                        .help("link one rule file; for two rules, declare two properties"),
                );
            }
        }
    }
    rules
}

fn property(graph: &Graph, iri: String, rule: RuleFile) -> Property {
    Property {
        name: names::local(&iri).to_owned(),
        label: graph.label(&iri),
        comment: graph.text(&iri, &rdfs("comment")),
        rule,
        needs: locals(graph.stated(&iri, &names::act("needsParameter"))),
        unit: graph.text(&iri, &names::act("unit")),
        iri,
    }
}

/// Builds an action from its own statements and those inherited from its classes.
fn action(graph: &Graph, iri: String) -> Action {
    let stated = |predicate: &str| check::inherited(graph, &iri, predicate);
    let iris = |predicate: &str| -> Vec<String> {
        let mut seen = BTreeSet::new();
        let objects = stated(predicate)
            .into_iter()
            .filter_map(|statement| statement.object.as_iri().map(str::to_owned));
        objects
            .filter(|object| seen.insert(object.clone()))
            .collect()
    };
    Action {
        label: graph.label(&iri),
        comment: graph.text(&iri, &rdfs("comment")),
        performed_in: iris(&names::act("performedIn")).into_iter().next(),
        success_properties: iris(&names::act("successProperty")),
        preconditions: iris(&names::act("precondition")),
        premises: iris(&names::act("premise")),
        parameters: locals(stated(&names::act("hasParameter")).into_iter()),
        iri,
    }
}

fn locals<'a>(statements: impl Iterator<Item = &'a Statement>) -> BTreeSet<String> {
    statements
        .filter_map(|statement| statement.object.as_iri())
        .map(|iri| names::local(iri).to_owned())
        .collect()
}

fn triples(graph: &Graph) -> Vec<[Term; 3]> {
    let mut triples: Vec<[Term; 3]> = graph
        .statements()
        .iter()
        .map(|statement| {
            [
                statement.subject.clone(),
                Term::iri(&statement.predicate),
                statement.object.clone(),
            ]
        })
        .collect();
    triples.sort();
    triples.dedup();
    triples
}

/// Classes whose individuals can be predicates.
const PROPERTY_CLASSES: [(&str, &str); 5] = [
    (names::RDF, "Property"),
    (names::OWL, "ObjectProperty"),
    (names::OWL, "DatatypeProperty"),
    (names::OWL, "AnnotationProperty"),
    (names::OWL, "FunctionalProperty"),
];

fn vocabulary(graph: &Graph) -> Vocabulary {
    let predicates: BTreeSet<String> = PROPERTY_CLASSES
        .iter()
        .map(|(space, local)| format!("{space}{local}"))
        .collect();
    let term = |iri: &str| VocabularyTerm {
        is_property: !graph.classes_of(iri).is_disjoint(&predicates)
            || graph
                .about(iri)
                .any(|statement| *statement.predicate == *rdfs("domain")),
        unit: graph.text(iri, &names::w("unit")),
        label: graph.text(iri, &rdfs("label")),
        comment: graph.text(iri, &rdfs("comment")),
    };
    Vocabulary {
        terms: graph
            .subjects()
            .map(|iri| (iri.to_owned(), term(iri)))
            .collect(),
    }
}

impl Ontology {
    /// Whether `class` equals `ancestor` or is a subclass of it.
    pub fn is_a(&self, class: &str, ancestor: &str) -> bool {
        class == ancestor
            || self
                .superclasses
                .get(class)
                .is_some_and(|above| above.contains(ancestor))
    }

    /// Whether the ontology declares a class with this IRI.
    pub fn has_class(&self, class: &str) -> bool {
        self.vocabulary.terms.contains_key(class) || self.superclasses.contains_key(class)
    }
}
