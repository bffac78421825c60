//! Namespaces, and functions that build and shorten IRIs.

use std::fmt::Write as _;

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
/// Nodes without an IRI of their own, in other stores (RDF 1.1 calls it a Skolem IRI).
pub const NODE: &str = "https://w3id.org/.well-known/genid/actcheck/";
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

/// Prefixes that shipped queries and messages may use. If one namespace begins with another, the
/// longer one comes first.
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

/// Returns `true` if a text can be the id of a campaign or a run: letters, digits, `-` and `_`,
/// beginning with a letter or digit. Ids are parts of file names, so an id of a foreign history
/// must not lead out of a folder.
pub fn is_id(text: &str) -> bool {
    let allowed = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    text.len() <= LONGEST_ID
        && text.starts_with(|c: char| c.is_ascii_alphanumeric())
        && text.chars().all(allowed)
}

/// Returns the local name of an IRI: the part after its last `#` or `/`.
pub fn local(iri: &str) -> &str {
    iri.rsplit(['#', '/']).next().unwrap_or(iri)
}

/// Shortens an IRI to a known prefix, or returns it in angle brackets.
pub fn shorten(iri: &str) -> String {
    for (prefix, namespace) in PREFIXES {
        if let Some(rest) = iri.strip_prefix(namespace)
            && rest
                .chars()
                .all(|c| c.is_alphanumeric() || "_-".contains(c))
        {
            return format!("{prefix}:{rest}");
        }
    }
    format!("<{iri}>")
}

/// Whether a text is an absolute IRI that every RDF parser accepts. (A few exotic IRIs are not
/// recognised, such as those with IPv6 addresses.)
pub fn is_iri(text: &str) -> bool {
    let Some((scheme, rest)) = text.split_once(':') else {
        return false;
    };
    let begins = scheme.starts_with(|c: char| c.is_ascii_alphabetic());
    if !begins
        || !scheme
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
    {
        return false;
    }
    let named = rest.strip_prefix("//").is_none_or(|rest| {
        let authority = rest.split(['/', '?', '#']).next().unwrap_or_default();
        let (host, port) = authority.split_once(':').unwrap_or((authority, ""));
        host.chars()
            .all(|c| c.is_alphanumeric() || "-._~".contains(c))
            && port.chars().all(|c| c.is_ascii_digit())
    });
    named && rest.matches('#').count() <= 1 && has_only_iri_characters(rest)
}

fn has_only_iri_characters(text: &str) -> bool {
    let mut bytes = text.bytes();
    while let Some(byte) = bytes.next() {
        let escapes = byte != b'%'
            || [bytes.next(), bytes.next()]
                .iter()
                .all(|digit| digit.is_some_and(|digit| digit.is_ascii_hexdigit()));
        if !escapes {
            return false;
        }
    }
    text.chars()
        .all(|c| c.is_alphanumeric() || "-._~:/?#@!$&'()*+,;=%".contains(c))
}

/// Returns the IRI of an object category that a skill named: an IRI as it is, and any other text as
/// a label, which becomes `w:category/LABEL` with percent-encoding, so that no text can be anything
/// but one IRI.
pub fn category(named: &str) -> String {
    if is_iri(named) {
        named.to_owned()
    } else {
        w(&format!("category/{}", escaped(named)))
    }
}

/// Escapes a name for an IRI: percent-encodes every byte except ASCII letters, digits and `_-.~`.
pub fn escaped(name: &str) -> String {
    let mut out = String::with_capacity(name.len());
    for byte in name.bytes() {
        if byte.is_ascii_alphanumeric() || b"_-.~".contains(&byte) {
            out.push(char::from(byte));
        } else {
            // Writing to a string can't fail.
            let _ = write!(out, "%{byte:02X}");
        }
    }
    out
}

/// Whether a text mentions a name as a whole word.
pub fn mentions(text: &str, name: &str) -> bool {
    let of_word = |c: char| c.is_alphanumeric() || c == '_';
    !name.is_empty()
        && text.match_indices(name).any(|(at, _)| {
            !text[..at].ends_with(of_word) && !text[at + name.len()..].starts_with(of_word)
        })
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

    #[test]
    fn a_category_is_an_iri_or_becomes_one() {
        for named in [
            "http://actions#Glass",
            "https://w3id.org/x/a%20b?c=d#e",
            "urn:isbn:1",
            "act:Größe",
            "http://a:80/",
        ] {
            assert_eq!(category(named), named);
        }
        for (named, label) in [
            ("coffee mug", "coffee%20mug"),
            ("mug", "mug"),
            ("", ""),
            (
                "http://a> <b> <c> .\n",
                "http%3A%2F%2Fa%3E%20%3Cb%3E%20%3Cc%3E%20.%0A",
            ),
            ("http://a#b#c", "http%3A%2F%2Fa%23b%23c"),
            ("http://a/%zz", "http%3A%2F%2Fa%2F%25zz"),
            ("http://a:b/", "http%3A%2F%2Fa%3Ab%2F"),
            ("a:\u{1b}", "a%3A%1B"),
            ("1:a", "1%3Aa"),
        ] {
            assert_eq!(category(named), format!("{W}category/{label}"));
        }
    }

    #[test]
    fn names_are_mentioned_as_whole_words_only() {
        assert!(mentions("glass_1 is 57.5 cm from the gripper", "glass_1"));
        assert!(mentions("touched (glass_1)", "glass_1"));
        assert!(
            !mentions("glass_12 fell", "glass_1")
                && !mentions("a glass_1b", "glass_1")
                && !mentions("x", "")
        );
    }
}
