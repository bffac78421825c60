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

/// Longest id of a campaign or a run. Unit: bytes.
const LONGEST_ID: usize = 128;

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

/// Returns `true` if a text can be the id of a campaign or a run: letters, digits, `-` and `_`, beginning with a letter or
/// digit. Ids are parts of file names, so an id of a foreign history must not lead out of a folder.
pub fn is_id(text: &str) -> bool {
    let allowed = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    text.len() <= LONGEST_ID && text.starts_with(|c: char| c.is_ascii_alphanumeric()) && text.chars().all(allowed)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_id_is_part_of_a_file_name_and_nothing_else() {
        for id in ["k7f3", "k7f3-12", "1f00_shrunk", &"a".repeat(128)] {
            assert!(is_id(id), "{id}");
        }
        for wrong in [
            "",
            ".",
            "..",
            "../../x",
            "a/b",
            "a\\b",
            "-rf",
            "a b",
            "a\0",
            "é",
            "a.trace",
            "a\u{1b}[2J",
            &"a".repeat(129),
        ] {
            assert!(!is_id(wrong), "{wrong}");
        }
    }
}
