//! Namespaces, and functions that build and shorten IRIs.

/// The paper's namespace: actions, properties, designators.
pub const ACT: &str = "http://actions#";
/// The world vocabulary, defined in `ontology/world.ttl`.
pub const W: &str = "https://w3id.org/actcheck/world#";
/// Objects of a scene; an id such as `glass_1` is unique within its run.
pub const OBJ: &str = "https://w3id.org/actcheck/object/";
/// Runs of a history.
pub const RUN: &str = "https://w3id.org/actcheck/run/";
/// Campaigns of a history.
pub const CAMPAIGN: &str = "https://w3id.org/actcheck/campaign/";
/// RDF.
pub const RDF: &str = "http://www.w3.org/1999/02/22-rdf-syntax-ns#";
/// RDF Schema.
pub const RDFS: &str = "http://www.w3.org/2000/01/rdf-schema#";
/// OWL.
pub const OWL: &str = "http://www.w3.org/2002/07/owl#";
/// XML Schema datatypes.
pub const XSD: &str = "http://www.w3.org/2001/XMLSchema#";
/// Evaluation and report language: outcomes.
pub const EARL: &str = "http://www.w3.org/ns/earl#";
/// Provenance.
pub const PROV: &str = "http://www.w3.org/ns/prov#";

/// Prefixes that shipped queries and messages may use. If one namespace begins with another, the longer
/// one comes first.
pub const PREFIXES: [(&str, &str); 11] = [
    ("act", ACT),
    ("w", W),
    ("obj", OBJ),
    ("run", RUN),
    ("campaign", CAMPAIGN),
    ("rdf", RDF),
    ("rdfs", RDFS),
    ("owl", OWL),
    ("xsd", XSD),
    ("earl", EARL),
    ("prov", PROV),
];

/// Returns the `act:` IRI of a local name.
pub fn act(local: &str) -> String {
    format!("{ACT}{local}")
}

/// Returns the `w:` IRI of a local name.
pub fn w(local: &str) -> String {
    format!("{W}{local}")
}

/// Returns the IRI of an object of a scene.
pub fn obj(id: &str) -> String {
    format!("{OBJ}{id}")
}

/// Returns the local name of an IRI: the part after its last `#` or `/`.
pub fn local(iri: &str) -> &str {
    iri.rsplit(['#', '/']).next().unwrap_or(iri)
}

/// Shortens an IRI to a known prefix, or returns it in angle brackets.
pub fn shorten(iri: &str) -> String {
    for (prefix, namespace) in PREFIXES {
        if let Some(rest) = iri.strip_prefix(namespace)
            && rest.chars().all(|c| c.is_alphanumeric() || "_-".contains(c))
        {
            return format!("{prefix}:{rest}");
        }
    }
    format!("<{iri}>")
}
