//! RDF terms with typed values, and their interning.

use std::cmp::Ordering;
use std::collections::HashMap;
use std::fmt;
use std::hash::{Hash, Hasher};
use std::sync::Arc;

use crate::names;

/// An RDF term. Equality compares terms, not values: `1`, `1.0` and `"1"` are three different terms.
#[derive(Debug, Clone)]
pub enum Term {
    /// An absolute IRI. (A bare name of a rule program is a relative IRI, kept as written.)
    Iri(Arc<str>),
    /// A blank node, by its label.
    Blank(Arc<str>),
    /// `xsd:string`.
    String(Arc<str>),
    /// `rdf:langString`: text and language tag.
    LangString(Arc<str>, Arc<str>),
    /// An `xsd:integer` that fits 64 bits.
    Integer(i64),
    /// An `xsd:decimal` as its canonical text, because binary floating point can't represent it exactly.
    Decimal(Arc<str>),
    /// An `xsd:double`. All NaNs are one term; `0.0` and `-0.0` are two.
    Double(f64),
    /// `xsd:boolean`.
    Boolean(bool),
    /// Any other literal: lexical form and datatype IRI.
    Literal(Arc<str>, Arc<str>),
}

impl Term {
    /// Creates an IRI term.
    pub fn iri(iri: impl AsRef<str>) -> Self {
        Self::Iri(Arc::from(iri.as_ref()))
    }

    /// Creates a plain string literal.
    pub fn string(text: impl AsRef<str>) -> Self {
        Self::String(Arc::from(text.as_ref()))
    }

    /// Returns the numeric value of an integer, decimal or double, and `None` for other terms.
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Integer(value) => Some(*value as f64),
            Self::Double(value) => Some(*value),
            Self::Decimal(text) => text.parse().ok(),
            _ => None,
        }
    }

    /// Returns the text of an IRI, and `None` for other terms.
    pub fn as_iri(&self) -> Option<&str> {
        match self {
            Self::Iri(iri) => Some(iri),
            _ => None,
        }
    }

    fn key(&self) -> (u8, &str, &str, u64) {
        match self {
            Self::Iri(iri) => (0, iri, "", 0),
            Self::Blank(label) => (1, label, "", 0),
            Self::String(text) => (2, text, "", 0),
            Self::LangString(text, tag) => (3, text, tag, 0),
            Self::Integer(value) => (4, "", "", value.cast_unsigned() ^ (1 << 63)),
            Self::Decimal(text) => (5, text, "", 0),
            Self::Double(value) => (6, "", "", double_key(*value)),
            Self::Boolean(value) => (7, "", "", u64::from(*value)),
            Self::Literal(text, datatype) => (8, text, datatype, 0),
        }
    }
}

/// Maps a double to bits that sort by value. All NaNs map to the same bits.
fn double_key(value: f64) -> u64 {
    let bits = if value.is_nan() { f64::NAN.to_bits() } else { value.to_bits() };
    if bits >> 63 == 1 { !bits } else { bits | (1 << 63) }
}

impl PartialEq for Term {
    fn eq(&self, other: &Self) -> bool {
        self.key() == other.key()
    }
}

impl Eq for Term {}

impl PartialOrd for Term {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Term {
    fn cmp(&self, other: &Self) -> Ordering {
        self.key().cmp(&other.key())
    }
}

impl Hash for Term {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.key().hash(state);
    }
}

impl fmt::Display for Term {
    /// Writes the term as in Turtle, with known prefixes. Doubles have no exponent: `0.9`, not `0.9e0`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Iri(iri) => f.write_str(&names::shorten(iri)),
            Self::Blank(label) => write!(f, "_:{label}"),
            Self::String(text) => write!(f, "{text:?}"),
            Self::LangString(text, tag) => write!(f, "{text:?}@{tag}"),
            Self::Integer(value) => write!(f, "{value}"),
            Self::Decimal(text) => f.write_str(text),
            Self::Double(value) => write!(f, "{value}"),
            Self::Boolean(value) => write!(f, "{value}"),
            Self::Literal(text, datatype) => write!(f, "{text:?}^^{}", names::shorten(datatype)),
        }
    }
}

/// ID of an interned term. Only valid for the [`Terms`] that created it.
pub type TermId = u32;

/// An interner of terms.
#[derive(Debug, Clone, Default)]
pub struct Terms {
    by_id: Vec<Term>,
    ids: HashMap<Term, TermId>,
}

impl Terms {
    /// Creates an empty interner.
    pub fn new() -> Self {
        Self::default()
    }

    /// Returns the ID of a term, interning the term if it is new.
    pub fn intern(&mut self, term: Term) -> TermId {
        if let Some(id) = self.ids.get(&term) {
            return *id;
        }
        let id = TermId::try_from(self.by_id.len()).expect("a run has far fewer than 2^32 terms");
        self.by_id.push(term.clone());
        self.ids.insert(term, id);
        id
    }

    /// Returns the ID of a term, or `None` if it is not interned.
    pub fn id(&self, term: &Term) -> Option<TermId> {
        self.ids.get(term).copied()
    }

    /// Returns the term of an ID. Panics if the ID is out of range.
    pub fn term(&self, id: TermId) -> &Term {
        &self.by_id[id as usize]
    }

    /// Number of interned terms.
    pub fn len(&self) -> usize {
        self.by_id.len()
    }

    /// Whether the interner is empty.
    pub fn is_empty(&self) -> bool {
        self.by_id.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terms_of_equal_value_and_different_type_differ() {
        let mut terms = Terms::new();
        let ids: Vec<TermId> =
            [Term::Integer(1), Term::Decimal("1.0".into()), Term::Double(1.0), Term::string("1"), Term::Integer(1)]
                .into_iter()
                .map(|term| terms.intern(term))
                .collect();
        assert_eq!(ids, [0, 1, 2, 3, 0]);
    }

    #[test]
    fn numbers_sort_by_value() {
        assert!(Term::Integer(-2) < Term::Integer(1));
        assert!(Term::Double(-2.5) < Term::Double(-1.0));
        assert!(Term::Double(-1.0) < Term::Double(0.5));
        assert_eq!(Term::Double(f64::NAN), Term::Double(-f64::NAN));
    }
}
