//! RDF terms with typed values, and their interning.

use std::cmp::Ordering;
use std::fmt;
use std::hash::{BuildHasher, Hash, Hasher};
use std::sync::Arc;

use foldhash::fast::RandomState;
use hashbrown::HashTable;

use crate::names;

/// An RDF term. Equality compares terms, not values: `1`, `1.0` and `"1"` are three different
/// terms.
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
    /// An `xsd:decimal` as its canonical text, because binary floating point can't represent it
    /// exactly.
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

    fn key(&self) -> Key<'_> {
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
    let bits = if value.is_nan() {
        f64::NAN.to_bits()
    } else {
        value.to_bits()
    };
    if bits >> 63 == 1 {
        !bits
    } else {
        bits | (1 << 63)
    }
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
    /// Writes the term as in Turtle, with known prefixes. Doubles have no exponent: `0.9`, not
    /// `0.9e0`.
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
///
/// The table of IDs has no copy of the terms: a large import has tens of millions of them.
#[derive(Debug, Clone, Default)]
pub struct Terms {
    by_id: Vec<Term>,
    ids: HashTable<TermId>,
    hasher: RandomState,
    /// IDs of small integers, or [`ABSENT`]: a column of numbers would otherwise jump about in a
    /// table of gigabytes.
    small: Vec<TermId>,
    /// Memory of the texts. Unit: bytes.
    text_bytes: usize,
}

const ABSENT: TermId = TermId::MAX;

/// The identity of a term: its kind, its texts and its number.
type Key<'a> = (u8, &'a str, &'a str, u64);

impl Terms {
    /// Creates an empty interner.
    pub fn new() -> Self {
        Self::default()
    }

    /// Creates an empty interner with room for this many terms.
    pub fn with_capacity(terms: usize) -> Self {
        Self {
            by_id: Vec::with_capacity(terms),
            ids: HashTable::with_capacity(terms),
            ..Self::default()
        }
    }

    /// Returns the ID of a term, interning the term if it is new.
    pub fn intern(&mut self, term: Term) -> TermId {
        let (hash, found) = self.find(term.key());
        found.unwrap_or_else(|| self.add(hash, term))
    }

    /// Returns the ID of a plain string literal. Allocates only if it is new.
    pub fn intern_string(&mut self, text: &str) -> TermId {
        let (hash, found) = self.find((2, text, "", 0));
        found.unwrap_or_else(|| self.add(hash, Term::string(text)))
    }

    /// Returns the ID of an IRI. Allocates only if it is new.
    pub fn intern_iri(&mut self, iri: &str) -> TermId {
        let (hash, found) = self.find((0, iri, "", 0));
        found.unwrap_or_else(|| self.add(hash, Term::iri(iri)))
    }

    /// Returns the ID of a term, or `None` if it is not interned.
    pub fn id(&self, term: &Term) -> Option<TermId> {
        self.find(term.key()).1
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

    /// Returns the approximate memory of all terms. Unit: bytes.
    pub fn bytes(&self) -> usize {
        let ids = self.small.len() + 2 * self.ids.len();
        self.text_bytes + self.by_id.len() * size_of::<Term>() + ids * size_of::<TermId>()
    }

    /// Returns a term's hash, and its ID if it is interned.
    fn find(&self, key: Key<'_>) -> (u64, Option<TermId>) {
        if let Some(id) = small(key)
            .and_then(|value| self.small.get(value))
            .filter(|id| **id != ABSENT)
        {
            return (0, Some(*id));
        }
        let hash = hash(&self.hasher, key);
        (
            hash,
            self.ids
                .find(hash, |id| self.by_id[*id as usize].key() == key)
                .copied(),
        )
    }

    fn add(&mut self, new_hash: u64, term: Term) -> TermId {
        let id = TermId::try_from(self.by_id.len()).expect("a run has far fewer than 2^32 terms");
        let (_, text, more, _) = term.key();
        // The table has at most two places for each term.
        let place = small(term.key()).filter(|value| *value < 2 * self.by_id.len() + 1024);
        // A shared text has two counters before it.
        self.text_bytes += [text, more]
            .iter()
            .filter(|text| !text.is_empty())
            .map(|text| text.len() + 16)
            .sum::<usize>();
        self.by_id.push(term);
        if let Some(place) = place {
            if self.small.len() <= place {
                self.small.resize(place + 1, ABSENT);
            }
            self.small[place] = id;
            return id;
        }
        let Self {
            by_id, ids, hasher, ..
        } = self;
        ids.insert_unique(new_hash, id, |id| hash(hasher, by_id[*id as usize].key()));
        id
    }
}

/// Returns the value of an integer that is not negative.
fn small((kind, _, _, number): Key<'_>) -> Option<usize> {
    if kind == 4 {
        usize::try_from(number ^ (1 << 63))
            .ok()
            .filter(|value| *value >> 63 == 0)
    } else {
        None
    }
}

fn hash(hasher: &RandomState, (kind, text, more, number): Key<'_>) -> u64 {
    let mut state = hasher.build_hasher();
    state.write_u64(number ^ u64::from(kind));
    if !text.is_empty() {
        state.write(text.as_bytes());
        state.write(more.as_bytes());
    }
    state.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terms_of_equal_value_and_different_type_differ() {
        let mut terms = Terms::new();
        let ids: Vec<TermId> = [
            Term::Integer(1),
            Term::Decimal("1.0".into()),
            Term::Double(1.0),
            Term::string("1"),
            Term::Integer(1),
        ]
        .into_iter()
        .map(|term| terms.intern(term))
        .collect();
        assert_eq!(ids, [0, 1, 2, 3, 0]);
    }

    #[test]
    fn texts_interned_without_a_term_are_the_same_terms() {
        let mut terms = Terms::new();
        let iri = terms.intern(Term::iri("a"));
        assert_eq!(
            (terms.intern_iri("a"), terms.intern_string("a")),
            (iri, iri + 1)
        );
        assert_eq!(
            (terms.intern(Term::string("a")), terms.intern_string("")),
            (iri + 1, iri + 2)
        );
        assert_eq!(terms.id(&Term::string("")), Some(iri + 2));
        assert!(terms.bytes() > 3 * size_of::<Term>() && terms.len() == 3);
    }

    #[test]
    fn integers_of_all_sizes_are_found() {
        let mut terms = Terms::new();
        // Some are too large for the table of small ones, until it has grown.
        let values: Vec<i64> = [i64::MAX, i64::MIN, -1, 3_000, 5_000]
            .into_iter()
            .chain(0..4_000)
            .chain([1 << 40])
            .collect();
        for _ in 0..2 {
            for value in &values {
                let id = terms.intern(Term::Integer(*value));
                assert_eq!(
                    (terms.term(id), terms.id(&Term::Integer(*value))),
                    (&Term::Integer(*value), Some(id))
                );
            }
            assert_eq!(terms.len(), 4_005);
        }
        assert_eq!(terms.id(&Term::Integer(4_500)), None);
    }

    #[test]
    fn numbers_sort_by_value() {
        assert!(Term::Integer(-2) < Term::Integer(1));
        assert!(Term::Double(-2.5) < Term::Double(-1.0));
        assert!(Term::Double(-1.0) < Term::Double(0.5));
        assert_eq!(Term::Double(f64::NAN), Term::Double(-f64::NAN));
    }
}
