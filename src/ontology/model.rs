//! The checked ontology: actions, properties, designators, categories, vocabulary.

use std::collections::{BTreeMap, BTreeSet};

use actcheck_base::{Diagnostics, Source, Span, Term, digest_of, names};

/// A checked ontology, including its imports.
///
/// [`Ontology::default`] is empty: add statements, properties and libraries to apply rules without
/// an ontology file.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct Ontology {
    /// The root file and its imports, in reading order.
    pub sources: Vec<Source>,
    /// Actions by local name (`Pick`).
    pub actions: BTreeMap<String, Action>,
    /// Properties by IRI.
    pub properties: BTreeMap<String, Property>,
    /// Local names of all designators (`pickObject`), including those that no action uses.
    pub designators: BTreeSet<String>,
    /// Rule files whose derived predicates every rule may use (`act:ruleLibrary`), sorted by path.
    pub libraries: Vec<RuleFile>,
    /// All statements, sorted: the facts of `ontology(s, p, o)`.
    pub triples: Vec<[Term; 3]>,
    /// Each class with all its superclasses, excluding itself.
    pub superclasses: BTreeMap<String, BTreeSet<String>>,
    /// Terms that facts and rules may use. If it is empty, rules may use any term.
    pub vocabulary: Vocabulary,
    /// Digest of all sources, excluding the rule files.
    pub digest: String,
    /// Warnings about statements without effect (O015, O016).
    pub warnings: Diagnostics,
    /// Warnings about rule files that no ontology links (O017).
    pub unlinked: Diagnostics,
}

/// One action.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Action {
    /// Its IRI.
    pub iri: String,
    /// `rdfs:label`, or its local name.
    pub label: String,
    /// `rdfs:comment`.
    pub comment: Option<String>,
    /// IRI of the coordinate frame in which it is performed.
    pub performed_in: Option<String>,
    /// IRIs of its success properties, including inherited ones, in the order of the ontology text.
    pub success_properties: Vec<String>,
    /// IRIs of properties that must hold before the action for the success properties to be
    /// applicable.
    pub preconditions: Vec<String>,
    /// IRIs of properties of the first state of a run: if one does not hold, the scene is not the
    /// one that the task is about, and the success properties are inapplicable.
    pub premises: Vec<String>,
    /// Local names of its designators.
    pub parameters: BTreeSet<String>,
}

impl Action {
    /// Creates an action without properties and designators. Its label is its local name.
    pub fn new(iri: impl Into<String>) -> Self {
        let iri = iri.into();
        Self {
            label: names::local(&iri).to_owned(),
            iri,
            comment: None,
            performed_in: None,
            success_properties: Vec::new(),
            preconditions: Vec::new(),
            premises: Vec::new(),
            parameters: BTreeSet::new(),
        }
    }

    /// Returns the action with these success properties.
    pub fn with_properties(self, success_properties: Vec<String>) -> Self {
        Self {
            success_properties,
            ..self
        }
    }
}

/// One property.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Property {
    /// Its IRI.
    pub iri: String,
    /// Local name (`MovedObject`).
    pub name: String,
    /// `rdfs:label`, or its local name.
    pub label: String,
    /// `rdfs:comment`.
    pub comment: Option<String>,
    /// The rule file that verifies it.
    pub rule: RuleFile,
    /// Local names of the designators that it needs.
    pub needs: BTreeSet<String>,
    /// Unit of its margin (`act:unit`), such as `m`.
    pub unit: Option<String>,
}

/// A rule file, read but not yet parsed.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct RuleFile {
    /// Its text.
    pub source: Source,
    /// Its language, from the file extension.
    pub language: RuleLanguage,
    /// Path relative to the ontology's folder, as written in the ontology. The history stores this
    /// path.
    pub path: String,
    /// Digest of its text.
    pub digest: String,
    /// Where the ontology links it.
    pub linked_at: Option<(Source, Span)>,
}

/// The two rule languages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum RuleLanguage {
    /// `.rls`
    Datalog,
    /// `.rq`
    Sparql,
}

/// The described terms.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct Vocabulary {
    /// All described terms, by IRI.
    pub terms: BTreeMap<String, VocabularyTerm>,
}

/// One described term.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct VocabularyTerm {
    /// Whether it can be a predicate.
    pub is_property: bool,
    /// Unit of its values (`w:unit`), such as `m`, `rad`, `kg`, `N`.
    pub unit: Option<String>,
    /// `rdfs:label`.
    pub label: Option<String>,
    /// `rdfs:comment`.
    pub comment: Option<String>,
}

impl Property {
    /// Creates a property that a rule file verifies. Its label is the local name of its IRI.
    pub fn new(iri: impl Into<String>, rule: RuleFile) -> Self {
        let iri = iri.into();
        let name = names::local(&iri).to_owned();
        Self {
            label: name.clone(),
            name,
            iri,
            comment: None,
            rule,
            needs: BTreeSet::new(),
            unit: None,
        }
    }
}

impl RuleFile {
    /// Creates a rule file from its text. The language is SPARQL if the source's name ends in
    /// `.rq`, else Datalog.
    pub fn new(source: Source) -> Self {
        let language = if source.name.ends_with(".rq") {
            RuleLanguage::Sparql
        } else {
            RuleLanguage::Datalog
        };
        let (path, digest) = (source.name.to_string(), digest_of(&source.text));
        Self {
            source,
            language,
            path,
            digest,
            linked_at: None,
        }
    }
}

impl RuleLanguage {
    /// Returns the language's name.
    pub fn word(self) -> &'static str {
        match self {
            Self::Datalog => "Datalog",
            Self::Sparql => "SPARQL",
        }
    }
}

impl VocabularyTerm {
    /// Creates a term that can be a predicate, without a description.
    pub fn property() -> Self {
        Self {
            is_property: true,
            ..Self::default()
        }
    }
}
