//! Namespaces and the terms of them that the program itself speaks of.

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

/// Prefixes that every shipped query and message may use, longest namespace first where one begins another.
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

/// `act:` term of a local name.
pub fn act(local: &str) -> String {
    format!("{ACT}{local}")
}

/// `w:` term of a local name.
pub fn w(local: &str) -> String {
    format!("{W}{local}")
}

/// IRI of an object of a scene.
pub fn obj(id: &str) -> String {
    format!("{OBJ}{id}")
}

/// The part of an IRI behind its last `#` or `/`: what people call it.
pub fn local(iri: &str) -> &str {
    iri.rsplit(['#', '/']).next().unwrap_or(iri)
}

/// An IRI with its namespace shortened to a known prefix, or in angle brackets.
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
