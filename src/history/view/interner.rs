//! Terms by number. Literals with an identical value are one term.

use std::fmt;
use std::hash::{BuildHasher, Hash, Hasher};

use foldhash::fast::RandomState;
use hashbrown::{HashMap, HashTable};
use oxigraph::model::vocab::xsd;
use oxigraph::model::{BlankNode, LiteralRef, NamedNode, Term, TermRef};
use spareval::ExpressionTerm;

/// Namespace of the datatypes whose values are compared.
pub(super) const XSD: &str = "http://www.w3.org/2001/XMLSchema#";

/// A term as the evaluator computes with it. Equality is identity: `1` and `1.0`, and one moment
/// in two time zones, are different.
#[derive(Clone)]
pub(crate) struct LiteralValue(pub(super) ExpressionTerm);

impl fmt::Debug for LiteralValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(&Term::from(self.0.clone()), f)
    }
}

impl PartialEq for LiteralValue {
    fn eq(&self, other: &Self) -> bool {
        use ExpressionTerm as E;
        match (&self.0, &other.0) {
            (E::DateTimeLiteral(a), E::DateTimeLiteral(b)) => a.is_identical_with(*b),
            (E::DateLiteral(a), E::DateLiteral(b)) => a.is_identical_with(*b),
            (E::TimeLiteral(a), E::TimeLiteral(b)) => a.is_identical_with(*b),
            (E::GYearLiteral(a), E::GYearLiteral(b)) => a.is_identical_with(*b),
            (E::GYearMonthLiteral(a), E::GYearMonthLiteral(b)) => a.is_identical_with(*b),
            (E::GMonthLiteral(a), E::GMonthLiteral(b)) => a.is_identical_with(*b),
            (E::GMonthDayLiteral(a), E::GMonthDayLiteral(b)) => a.is_identical_with(*b),
            (E::GDayLiteral(a), E::GDayLiteral(b)) => a.is_identical_with(*b),
            (a, b) => a == b,
        }
    }
}

impl Eq for LiteralValue {}

impl Hash for LiteralValue {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.0.hash(state);
    }
}

/// Returns the value of a term as a condition, or `None` if a condition must not have that type.
pub(super) fn effective_boolean(term: &ExpressionTerm) -> Option<bool> {
    match term {
        ExpressionTerm::BooleanLiteral(value) => Some((*value).into()),
        ExpressionTerm::StringLiteral(value) => Some(!value.is_empty()),
        ExpressionTerm::IntegerLiteral(value) => Some(i64::from(*value) != 0),
        ExpressionTerm::DecimalLiteral(value) => Some(*value != 0.into()),
        ExpressionTerm::FloatLiteral(value) => Some(is_true(f32::from(*value).into())),
        ExpressionTerm::DoubleLiteral(value) => Some(is_true((*value).into())),
        _ => None,
    }
}

/// Returns the value of a floating-point number as a condition.
fn is_true(number: f64) -> bool {
    number != 0.0 && !number.is_nan()
}

/// Parses a literal whose datatype has values, the same datatypes as those of oxigraph's store.
fn value_of(text: &str, datatype: &str) -> Option<ExpressionTerm> {
    use ExpressionTerm as E;
    Some(match datatype.strip_prefix(XSD)? {
        "boolean" => E::BooleanLiteral(text.parse().ok()?),
        "float" => E::FloatLiteral(text.parse().ok()?),
        "double" => E::DoubleLiteral(text.parse().ok()?),
        "decimal" => E::DecimalLiteral(text.parse().ok()?),
        "integer" | "byte" | "short" | "int" | "long" | "unsignedByte" | "unsignedShort"
        | "unsignedInt" | "unsignedLong" | "positiveInteger" | "negativeInteger"
        | "nonPositiveInteger" | "nonNegativeInteger" => E::IntegerLiteral(text.parse().ok()?),
        "dateTime" | "dateTimeStamp" => E::DateTimeLiteral(text.parse().ok()?),
        "time" => E::TimeLiteral(text.parse().ok()?),
        "date" => E::DateLiteral(text.parse().ok()?),
        "gYearMonth" => E::GYearMonthLiteral(text.parse().ok()?),
        "gYear" => E::GYearLiteral(text.parse().ok()?),
        "gMonthDay" => E::GMonthDayLiteral(text.parse().ok()?),
        "gDay" => E::GDayLiteral(text.parse().ok()?),
        "gMonth" => E::GMonthLiteral(text.parse().ok()?),
        "duration" => E::DurationLiteral(text.parse().ok()?),
        "yearMonthDuration" => E::YearMonthDurationLiteral(text.parse().ok()?),
        "dayTimeDuration" => E::DayTimeDurationLiteral(text.parse().ok()?),
        _ => return None,
    })
}

/// How the content of a term is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Form(u32);

impl Form {
    const IRI: Self = Self(0);
    const BLANK: Self = Self(1);
    const STRING: Self = Self(2);
    const BOOLEAN: Self = Self(3);
    const INTEGER: Self = Self(4);
    const FLOAT: Self = Self(5);
    const DOUBLE: Self = Self(6);
    /// A literal with any other value, in [`Terms::values`].
    const VALUE: Self = Self(7);
    /// A text with the first language or datatype of [`Terms::suffixes`]; further ones follow.
    const FIRST_SUFFIX: u32 = 8;
}

/// The language or the datatype of a literal that is kept as text.
#[derive(Debug, Clone)]
enum Suffix {
    Language(String),
    Datatype(NamedNode),
}

/// The kind of a term that is kept as text.
#[derive(Debug, Clone, Copy)]
pub(super) enum TextKind<'t> {
    Form(Form),
    Language(&'t str),
    Datatype(&'t str),
}

/// The parts by which a term is found.
#[derive(Debug)]
pub(super) enum Parts<'t> {
    Text(TextKind<'t>, &'t str),
    /// A value of at most 64 bits.
    Bits(Form, u64),
    LiteralValue(LiteralValue),
}

impl<'t> Parts<'t> {
    pub(super) fn of_term(term: TermRef<'t>) -> Self {
        match term {
            TermRef::NamedNode(node) => Self::Text(TextKind::Form(Form::IRI), node.as_str()),
            TermRef::BlankNode(node) => Self::Text(TextKind::Form(Form::BLANK), node.as_str()),
            TermRef::Literal(literal) => Self::of_literal(literal),
        }
    }

    fn of_literal(literal: LiteralRef<'t>) -> Self {
        let text = literal.value();
        if let Some(language) = literal.language() {
            return Self::Text(TextKind::Language(language), text);
        }
        let datatype = literal.datatype();
        if datatype == xsd::STRING {
            return Self::Text(TextKind::Form(Form::STRING), text);
        }
        Self::of_typed(text, datatype.as_str())
    }

    fn of_typed(text: &'t str, datatype: &'t str) -> Self {
        match value_of(text, datatype) {
            Some(value) => Self::of_value(&value),
            None => Self::Text(TextKind::Datatype(datatype), text),
        }
    }

    /// The parts of a literal that has a value.
    fn of_value(value: &ExpressionTerm) -> Self {
        match value {
            ExpressionTerm::BooleanLiteral(value) => {
                Self::Bits(Form::BOOLEAN, bool::from(*value).into())
            }
            ExpressionTerm::IntegerLiteral(value) => {
                Self::Bits(Form::INTEGER, i64::from(*value).cast_unsigned())
            }
            ExpressionTerm::FloatLiteral(value) => {
                Self::Bits(Form::FLOAT, f32::from(*value).to_bits().into())
            }
            ExpressionTerm::DoubleLiteral(value) => {
                Self::Bits(Form::DOUBLE, f64::from(*value).to_bits())
            }
            other => Self::LiteralValue(LiteralValue(other.clone())),
        }
    }

    pub(super) fn of_expression(term: &'t ExpressionTerm) -> Self {
        match term {
            ExpressionTerm::NamedNode(node) => Self::Text(TextKind::Form(Form::IRI), node.as_str()),
            ExpressionTerm::BlankNode(node) => {
                Self::Text(TextKind::Form(Form::BLANK), node.as_str())
            }
            ExpressionTerm::StringLiteral(text) => Self::Text(TextKind::Form(Form::STRING), text),
            ExpressionTerm::LangStringLiteral { value, language } => {
                Self::Text(TextKind::Language(language), value)
            }
            ExpressionTerm::OtherTypedLiteral { value, datatype } => {
                Self::of_typed(value, datatype.as_str())
            }
            value => Self::of_value(value),
        }
    }
}

/// Parts with the language or datatype by number.
#[derive(Debug)]
enum LookupKey<'t> {
    Text(Form, &'t str),
    Bits(Form, u64),
    LiteralValue(&'t LiteralValue),
}

/// The content of one term.
#[derive(Debug, Clone, Copy)]
struct TermEntry {
    /// Start of the text, the bits of the value, or the index of the value.
    place: u64,
    /// Length of the text. Unit: bytes.
    length: u32,
    form: Form,
}

/// A term in the hash table, with a part of its hash, so that most comparisons and all moves to a
/// larger table leave the text alone.
#[derive(Debug, Clone, Copy)]
struct HashSlot {
    number: u32,
    hash: u32,
}

impl HashSlot {
    /// The hash as the table wants it: different in its first and in its last bits.
    fn wide(hash: u32) -> u64 {
        u64::from(hash) << 32 | u64::from(hash)
    }
}

/// The interner of terms.
#[derive(Debug, Default, Clone)]
pub(super) struct Terms {
    entries: Vec<TermEntry>,
    /// The texts of all terms, one after another.
    text: String,
    values: Vec<LiteralValue>,
    suffixes: Vec<Suffix>,
    languages: HashMap<Box<str>, Form, RandomState>,
    datatypes: HashMap<Box<str>, Form, RandomState>,
    slots: HashTable<HashSlot>,
    hasher: RandomState,
}

impl Terms {
    pub(super) fn find(&self, parts: &Parts<'_>) -> Option<u32> {
        let key = match parts {
            Parts::Text(TextKind::Form(form), text) => LookupKey::Text(*form, text),
            Parts::Text(TextKind::Language(tag), text) => {
                LookupKey::Text(*self.languages.get(*tag)?, text)
            }
            Parts::Text(TextKind::Datatype(iri), text) => {
                LookupKey::Text(*self.datatypes.get(*iri)?, text)
            }
            Parts::Bits(form, bits) => LookupKey::Bits(*form, *bits),
            Parts::LiteralValue(value) => LookupKey::LiteralValue(value),
        };
        self.find_key(&key, self.hash(&key))
    }

    pub(super) fn intern(&mut self, parts: &Parts<'_>) -> u32 {
        let key = match parts {
            Parts::Text(kind, text) => LookupKey::Text(self.intern_form(*kind), text),
            Parts::Bits(form, bits) => LookupKey::Bits(*form, *bits),
            Parts::LiteralValue(value) => LookupKey::LiteralValue(value),
        };
        let hash = self.hash(&key);
        match self.find_key(&key, hash) {
            Some(number) => number,
            None => self.add(&key, hash),
        }
    }

    fn intern_form(&mut self, kind: TextKind<'_>) -> Form {
        let (forms, name, suffix): (_, _, fn(&str) -> Suffix) = match kind {
            TextKind::Form(form) => return form,
            TextKind::Language(tag) => (&mut self.languages, tag, |tag| {
                Suffix::Language(tag.to_owned())
            }),
            TextKind::Datatype(iri) => (&mut self.datatypes, iri, |iri| {
                Suffix::Datatype(NamedNode::new_unchecked(iri))
            }),
        };
        if let Some(form) = forms.get(name) {
            return *form;
        }
        let form = Form(Form::FIRST_SUFFIX + narrow(self.suffixes.len()));
        forms.insert(name.into(), form);
        self.suffixes.push(suffix(name));
        form
    }

    fn hash(&self, key: &LookupKey<'_>) -> u32 {
        let mut hasher = self.hasher.build_hasher();
        match key {
            LookupKey::Text(form, text) => {
                hasher.write_u32(form.0);
                hasher.write(text.as_bytes());
            }
            LookupKey::Bits(form, bits) => {
                hasher.write_u32(form.0);
                hasher.write_u64(*bits);
            }
            LookupKey::LiteralValue(value) => value.hash(&mut hasher),
        }
        let hash = hasher.finish();
        // Both halves have good bits; the table needs only one of them.
        (hash ^ (hash >> 32)) as u32
    }

    fn find_key(&self, key: &LookupKey<'_>, hash: u32) -> Option<u32> {
        let is_it = |slot: &HashSlot| slot.hash == hash && self.is(slot.number, key);
        self.slots
            .find(HashSlot::wide(hash), is_it)
            .map(|slot| slot.number)
    }

    fn is(&self, number: u32, key: &LookupKey<'_>) -> bool {
        let entry = self.entry(number);
        match key {
            LookupKey::Text(form, text) => entry.form == *form && self.text_of(entry) == *text,
            LookupKey::Bits(form, bits) => entry.form == *form && entry.place == *bits,
            LookupKey::LiteralValue(value) => {
                entry.form == Form::VALUE && self.value_of(entry) == *value
            }
        }
    }

    fn add(&mut self, key: &LookupKey<'_>, hash: u32) -> u32 {
        let number = narrow(self.entries.len());
        let entry = match key {
            LookupKey::Text(form, text) => {
                let place = self.text.len() as u64;
                self.text.push_str(text);
                TermEntry {
                    place,
                    length: narrow(text.len()),
                    form: *form,
                }
            }
            LookupKey::Bits(form, bits) => TermEntry {
                place: *bits,
                length: 0,
                form: *form,
            },
            LookupKey::LiteralValue(value) => {
                let place = self.values.len() as u64;
                self.values.push((*value).clone());
                TermEntry {
                    place,
                    length: 0,
                    form: Form::VALUE,
                }
            }
        };
        self.entries.push(entry);
        self.slots
            .insert_unique(HashSlot::wide(hash), HashSlot { number, hash }, |slot| {
                HashSlot::wide(slot.hash)
            });
        number
    }

    fn entry(&self, number: u32) -> TermEntry {
        self.entries[number as usize]
    }

    fn text_of(&self, entry: TermEntry) -> &str {
        let start = entry.place as usize;
        &self.text[start..start + entry.length as usize]
    }

    fn value_of(&self, entry: TermEntry) -> &LiteralValue {
        &self.values[entry.place as usize]
    }

    pub(super) fn expression(&self, number: u32) -> ExpressionTerm {
        let entry = self.entry(number);
        let text = || self.text_of(entry).to_owned();
        match entry.form {
            Form::IRI => ExpressionTerm::NamedNode(NamedNode::new_unchecked(text())),
            Form::BLANK => ExpressionTerm::BlankNode(BlankNode::new_unchecked(text())),
            Form::STRING => ExpressionTerm::StringLiteral(text()),
            Form::BOOLEAN => ExpressionTerm::from(entry.place != 0),
            Form::INTEGER => ExpressionTerm::IntegerLiteral(entry.place.cast_signed().into()),
            Form::FLOAT => ExpressionTerm::FloatLiteral(f32::from_bits(entry.place as u32).into()),
            Form::DOUBLE => ExpressionTerm::DoubleLiteral(f64::from_bits(entry.place).into()),
            Form::VALUE => self.value_of(entry).0.clone(),
            Form(suffix) => match &self.suffixes[(suffix - Form::FIRST_SUFFIX) as usize] {
                Suffix::Language(language) => ExpressionTerm::LangStringLiteral {
                    value: text(),
                    language: language.clone(),
                },
                Suffix::Datatype(datatype) => ExpressionTerm::OtherTypedLiteral {
                    value: text(),
                    datatype: datatype.clone(),
                },
            },
        }
    }

    pub(super) fn effective_boolean(&self, number: u32) -> Option<bool> {
        let entry = self.entry(number);
        match entry.form {
            Form::STRING => Some(entry.length > 0),
            Form::BOOLEAN | Form::INTEGER => Some(entry.place != 0),
            Form::FLOAT => Some(is_true(f32::from_bits(entry.place as u32).into())),
            Form::DOUBLE => Some(is_true(f64::from_bits(entry.place))),
            Form::VALUE => effective_boolean(&self.value_of(entry).0),
            _ => None,
        }
    }

    /// Number of terms.
    pub(super) fn len(&self) -> usize {
        self.entries.len()
    }

    /// Returns most of the memory that was reserved for more terms.
    pub(super) fn shrink(&mut self) {
        self.text.shrink_to(self.text.len() + self.text.len() / 8);
        self.entries
            .shrink_to(self.entries.len() + self.entries.len() / 8);
    }
}

/// Returns a count as the 32 bits that the rows and entries hold.
pub(super) fn narrow(count: usize) -> u32 {
    // A view is limited to far fewer terms, statements and bytes.
    u32::try_from(count).unwrap_or(u32::MAX)
}
