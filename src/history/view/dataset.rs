//! RDF statements in memory, as sorted numbers, which oxigraph's SPARQL evaluator reads in place.
//!
//! Gives the same answers as oxigraph's own store in memory, in less than a sixth of its memory:
//! literals with numbers, dates and durations are one term if their values are identical, and are
//! returned in canonical form. The order of the rows of a query without `ORDER BY` differs.
//!
//! Never: removes a statement, reads files, or parses a query.

use std::convert::Infallible;
use std::fmt;
use std::hash::{BuildHasher, Hash, Hasher};
use std::iter::Peekable;
use std::ops::Range;
use std::rc::Rc;
use std::slice;
use std::sync::OnceLock;

use foldhash::fast::RandomState;
use hashbrown::{HashMap, HashTable};
use oxigraph::model::vocab::xsd;
use oxigraph::model::{
    BlankNode, GraphNameRef, LiteralRef, NamedNode, Quad, QuadRef, Term, TermRef,
};
use spareval::{ExpressionTerm, InternalQuad, QueryableDataset};

/// Namespace of the datatypes whose values are compared.
const XSD: &str = "http://www.w3.org/2001/XMLSchema#";

/// Number of a term. Only valid for the [`Dataset`] that returned it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct TermNumber(u32);

/// Statements of a default graph and of named graphs.
///
/// New statements are pending until [`Dataset::merge_pending`] sorts them in; queries see only
/// merged statements.
#[derive(Debug, Default, Clone)]
pub(crate) struct Dataset {
    terms: Terms,
    default: DefaultGraph,
    named: NamedGraphs,
    pending: Pending,
}

/// Statements and graph names that are not sorted in yet.
#[derive(Debug, Default, Clone)]
struct Pending {
    /// Statements of the default graph: subject, property, object.
    default: Vec<[u32; 3]>,
    /// Statements of named graphs: graph, subject, property, object.
    named: Vec<[u32; 4]>,
    graphs: Vec<u32>,
}

impl Dataset {
    /// Returns the number of a term, which is the same for all literals with an identical value.
    pub(crate) fn intern(&mut self, term: TermRef<'_>) -> TermNumber {
        TermNumber(self.terms.intern(&Parts::of_term(term)))
    }

    /// Returns the number of a term that was interned before.
    #[cfg(test)]
    pub(crate) fn number(&self, term: TermRef<'_>) -> Option<TermNumber> {
        self.terms.find(&Parts::of_term(term)).map(TermNumber)
    }

    /// Returns a term in canonical form.
    pub(crate) fn term(&self, number: TermNumber) -> Term {
        self.terms.expression(number.0).into()
    }

    /// Adds a statement (subject, property, object) to the default graph (`None`) or to a named
    /// graph. Duplicates count once.
    pub(crate) fn insert(&mut self, statement: [TermNumber; 3], graph: Option<TermNumber>) {
        let [subject, property, object] = statement.map(|term| term.0);
        match graph {
            None => self.pending.default.push([subject, property, object]),
            Some(graph) => {
                let row = [graph.0, subject, property, object];
                self.pending.named.push(row);
            }
        }
    }

    /// Adds a statement given by its terms.
    pub(crate) fn insert_quad(&mut self, quad: QuadRef<'_>) {
        let statement = [
            self.intern(quad.subject.into()),
            self.intern(quad.predicate.into()),
            self.intern(quad.object),
        ];
        let graph = match quad.graph_name {
            GraphNameRef::DefaultGraph => None,
            GraphNameRef::NamedNode(name) => Some(self.intern(name.into())),
            GraphNameRef::BlankNode(name) => Some(self.intern(name.into())),
        };
        self.insert(statement, graph);
    }

    /// Adds statements.
    pub(crate) fn extend(&mut self, quads: impl IntoIterator<Item = Quad>) {
        for quad in quads {
            self.insert_quad(quad.as_ref());
        }
    }

    /// Adds a named graph, which may have no statements.
    pub(crate) fn add_graph(&mut self, name: TermRef<'_>) {
        let name = self.intern(name);
        self.pending.graphs.push(name.0);
    }

    /// Sorts the pending statements in, so that queries see them.
    pub(crate) fn merge_pending(&mut self) {
        let pending = std::mem::take(&mut self.pending);
        let n_terms = self.terms.entries.len();
        self.default.merge(pending.default, n_terms);
        self.named.merge(pending.named, pending.graphs, n_terms);
        self.terms.shrink();
    }

    /// Returns the number of different statements, without the pending ones.
    pub(crate) fn len(&self) -> usize {
        self.default.spo.rows.len() + self.named.gspo.rows.len()
    }

    /// Returns whether there are no statements except pending ones.
    #[cfg(test)]
    pub(crate) fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns a term of the dataset by number, or the term itself if the dataset lacks it.
    fn internal(&self, term: ExpressionTerm) -> DatasetTerm {
        match self.terms.find(&Parts::of_expression(&term)) {
            Some(number) => DatasetTerm::Known(TermNumber(number)),
            None => DatasetTerm::Created(Rc::new(LiteralValue(term))),
        }
    }
}

/// A term of a dataset by number, or a term created by the query.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) enum DatasetTerm {
    Known(TermNumber),
    /// Never equal to a term of the dataset.
    Created(Rc<LiteralValue>),
}

impl DatasetTerm {
    fn number(&self) -> Option<u32> {
        match self {
            Self::Known(number) => Some(number.0),
            Self::Created(_) => None,
        }
    }
}

impl<'a> QueryableDataset<'a> for &'a Dataset {
    type InternalTerm = DatasetTerm;
    type Error = Infallible;

    fn internal_quads_for_pattern(
        &self,
        subject: Option<&DatasetTerm>,
        predicate: Option<&DatasetTerm>,
        object: Option<&DatasetTerm>,
        graph_name: Option<Option<&DatasetTerm>>,
    ) -> impl Iterator<Item = Result<InternalQuad<DatasetTerm>, Infallible>> + use<'a> {
        let dataset: &'a Dataset = self;
        let parts = [subject, predicate, object, graph_name.flatten()];
        let numbers = parts.map(|part| part.and_then(DatasetTerm::number));
        let [s, p, o, g] = numbers;
        let created = parts.iter().flatten().any(|part| part.number().is_none());
        let found = match graph_name {
            _ if created => FoundRows::Nothing,
            Some(None) => FoundRows::Default(dataset.default.find(s, p, o)),
            Some(Some(_)) | None => FoundRows::Named(dataset.named.find(g, s, p, o)),
        };
        found.map(|row| {
            let known = |number| DatasetTerm::Known(TermNumber(number));
            Ok(InternalQuad {
                subject: known(row.subject),
                predicate: known(row.property),
                object: known(row.object),
                graph_name: row.graph.map(known),
            })
        })
    }

    fn internal_named_graphs(
        &self,
    ) -> impl Iterator<Item = Result<DatasetTerm, Infallible>> + use<'a> {
        let dataset: &'a Dataset = self;
        let names = dataset.named.names.iter();
        names.map(|name| Ok(DatasetTerm::Known(TermNumber(*name))))
    }

    fn contains_internal_graph_name(&self, graph_name: &DatasetTerm) -> Result<bool, Infallible> {
        let number = graph_name.number();
        Ok(number.is_some_and(|number| self.named.names.binary_search(&number).is_ok()))
    }

    fn internalize_term(&self, term: Term) -> Result<DatasetTerm, Infallible> {
        Ok(match self.terms.find(&Parts::of_term(term.as_ref())) {
            Some(number) => DatasetTerm::Known(TermNumber(number)),
            None => DatasetTerm::Created(Rc::new(LiteralValue(term.into()))),
        })
    }

    fn externalize_term(&self, term: DatasetTerm) -> Result<Term, Infallible> {
        Ok(match term {
            DatasetTerm::Known(number) => self.term(number),
            DatasetTerm::Created(value) => value.0.clone().into(),
        })
    }

    fn externalize_expression_term(&self, term: DatasetTerm) -> Result<ExpressionTerm, Infallible> {
        Ok(match term {
            DatasetTerm::Known(number) => self.terms.expression(number.0),
            DatasetTerm::Created(value) => value.0.clone(),
        })
    }

    fn internalize_expression_term(&self, term: ExpressionTerm) -> Result<DatasetTerm, Infallible> {
        // A literal that the query made of a text and a datatype may have a value.
        Ok(match term {
            ExpressionTerm::OtherTypedLiteral { .. } => {
                self.internal(ExpressionTerm::from(Term::from(term)))
            }
            _ => self.internal(term),
        })
    }

    fn internal_term_effective_boolean_value(
        &self,
        term: DatasetTerm,
    ) -> Result<Option<bool>, Infallible> {
        Ok(match term {
            DatasetTerm::Known(number) => self.terms.effective_boolean(number.0),
            DatasetTerm::Created(value) => effective_boolean(&value.0),
        })
    }
}

/// A term as the evaluator computes with it. Equality is identity: `1` and `1.0`, and one moment
/// in two time zones, are different.
#[derive(Clone)]
pub(crate) struct LiteralValue(ExpressionTerm);

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
fn effective_boolean(term: &ExpressionTerm) -> Option<bool> {
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
struct Form(u32);

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
enum TextKind<'t> {
    Form(Form),
    Language(&'t str),
    Datatype(&'t str),
}

/// The parts by which a term is found.
#[derive(Debug)]
enum Parts<'t> {
    Text(TextKind<'t>, &'t str),
    /// A value of at most 64 bits.
    Bits(Form, u64),
    LiteralValue(LiteralValue),
}

impl<'t> Parts<'t> {
    fn of_term(term: TermRef<'t>) -> Self {
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

    fn of_expression(term: &'t ExpressionTerm) -> Self {
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
struct Terms {
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
    fn find(&self, parts: &Parts<'_>) -> Option<u32> {
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

    fn intern(&mut self, parts: &Parts<'_>) -> u32 {
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

    fn expression(&self, number: u32) -> ExpressionTerm {
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

    fn effective_boolean(&self, number: u32) -> Option<bool> {
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

    /// Returns most of the memory that was reserved for more terms.
    fn shrink(&mut self) {
        self.text.shrink_to(self.text.len() + self.text.len() / 8);
        self.entries
            .shrink_to(self.entries.len() + self.entries.len() / 8);
    }
}

/// Returns a count as the 32 bits that the rows and entries hold.
fn narrow(count: usize) -> u32 {
    // A view is limited to far fewer terms, statements and bytes.
    u32::try_from(count).unwrap_or(u32::MAX)
}

/// Rows of numbers in ascending order, found by their first number.
///
/// `REST` is the count of the other numbers of a row.
#[derive(Debug, Default, Clone)]
struct Order<const REST: usize> {
    /// The rows that begin with `n` are `rows[starts[n]..starts[n + 1]]`.
    starts: Vec<u32>,
    /// The rows without their first number.
    rows: Vec<[u32; REST]>,
}

impl<const REST: usize> Order<REST> {
    /// Takes rows (of `REST + 1` numbers) that are sorted and differ.
    fn new<const ALL: usize>(sorted: Vec<[u32; ALL]>) -> Self {
        narrow(sorted.len());
        let n_starts = sorted.last().map_or(0, |row| row[0] as usize + 2);
        let mut starts = Vec::with_capacity(n_starts);
        let mut rows = Vec::with_capacity(sorted.len());
        for row in &sorted {
            if starts.len() <= row[0] as usize {
                starts.resize(row[0] as usize + 1, rows.len() as u32);
            }
            let mut rest = [0; REST];
            rest.copy_from_slice(&row[1..]);
            rows.push(rest);
        }
        starts.resize(n_starts, rows.len() as u32);
        Self { starts, rows }
    }

    /// Returns the rows that begin with a number.
    fn beginning_with(&self, first: u32) -> &[[u32; REST]] {
        let first = first as usize;
        match self.starts.get(first..first + 2) {
            Some(bounds) => &self.rows[bounds[0] as usize..bounds[1] as usize],
            None => &[],
        }
    }

    /// Returns the rows that begin with a number and continue with others (without the first).
    fn find(&self, first: u32, then: &[u32]) -> Cursor<'_, REST> {
        let mut rows = self.beginning_with(first);
        for (column, wanted) in then.iter().enumerate() {
            let start = rows.partition_point(|row| row[column] < *wanted);
            rows = &rows[start..];
            rows = &rows[..run_length(rows, column, *wanted)];
        }
        Cursor {
            order: self,
            first,
            rows: rows.iter(),
            upcoming: 0..0,
        }
    }

    fn all(&self) -> Cursor<'_, REST> {
        Cursor {
            order: self,
            first: 0,
            rows: [].iter(),
            upcoming: 0..narrow(self.starts.len().saturating_sub(1)),
        }
    }

    /// Returns all rows, with their columns in another order.
    fn arranged<const ALL: usize>(&self, columns: [usize; ALL]) -> Vec<[u32; ALL]> {
        let mut rows = Vec::with_capacity(self.rows.len());
        rows.extend(self.all().map(|(first, rest)| {
            let row = joined::<ALL, REST>(first, rest);
            columns.map(|column| row[column])
        }));
        rows
    }

    /// Adds rows. Returns whether any of them was new.
    fn merge<const ALL: usize>(&mut self, new: Vec<[u32; ALL]>, n_terms: usize) -> bool {
        let all_columns: [usize; ALL] = std::array::from_fn(|column| ALL - 1 - column);
        let mut new = sorted_by(new, &all_columns, n_terms);
        new.dedup();
        let n_before = self.rows.len();
        let merged = if n_before == 0 {
            new
        } else if new.is_empty() {
            return false;
        } else {
            let old = self.all().map(|(first, rest)| joined(first, rest));
            let mut merged = Vec::with_capacity(n_before + new.len());
            merge_into(&mut merged, old.peekable(), &new);
            merged
        };
        if merged.len() == n_before {
            return false;
        }
        *self = Self::new(merged);
        true
    }
}

/// Returns the length of the run of rows at the start that have a number in a column.
///
/// Runs are short: looking further and further ahead is faster than bisecting all rows.
fn run_length<const N: usize>(rows: &[[u32; N]], column: usize, wanted: u32) -> usize {
    let mut ahead = 1;
    while rows.get(ahead - 1).is_some_and(|row| row[column] == wanted) {
        ahead *= 2;
    }
    let checked = ahead / 2;
    let unsure = &rows[checked..rows.len().min(ahead)];
    checked + unsure.partition_point(|row| row[column] == wanted)
}

/// Returns a row with its first number.
fn joined<const ALL: usize, const REST: usize>(first: u32, rest: [u32; REST]) -> [u32; ALL] {
    let mut row = [first; ALL];
    row[1..].copy_from_slice(&rest);
    row
}

/// Merges two sorted sequences of rows without duplicates into one.
fn merge_into<const N: usize>(
    merged: &mut Vec<[u32; N]>,
    mut old: Peekable<impl Iterator<Item = [u32; N]>>,
    new: &[[u32; N]],
) {
    for row in new {
        while let Some(earlier) = old.next_if(|old| old < row) {
            merged.push(earlier);
        }
        if old.peek() != Some(row) {
            merged.push(*row);
        }
    }
    merged.extend(old);
}

/// Sorts rows by columns, the least significant column first. Rows that are equal in these columns
/// must be in their final order already.
fn sorted_by<const N: usize>(
    mut rows: Vec<[u32; N]>,
    columns: &[usize],
    n_terms: usize,
) -> Vec<[u32; N]> {
    // Counting needs a counter for each term: comparisons are faster for few rows.
    if rows.len() < n_terms / 8 || rows.len() < 64 {
        rows.sort_unstable();
        return rows;
    }
    let mut counts = vec![0_u32; n_terms + 1];
    let mut target = vec![[0; N]; rows.len()];
    for column in columns {
        if rows.is_sorted_by_key(|row| row[*column]) {
            continue;
        }
        counts.fill(0);
        for row in &rows {
            counts[row[*column] as usize + 1] += 1;
        }
        let mut sum = 0;
        for count in &mut counts {
            sum += *count;
            *count = sum;
        }
        for row in &rows {
            let place = &mut counts[row[*column] as usize];
            target[*place as usize] = *row;
            *place += 1;
        }
        std::mem::swap(&mut rows, &mut target);
    }
    rows
}

/// An iterator over found rows, as first number and other numbers.
#[derive(Debug)]
struct Cursor<'a, const REST: usize> {
    order: &'a Order<REST>,
    first: u32,
    rows: slice::Iter<'a, [u32; REST]>,
    /// First numbers of the rows after these.
    upcoming: Range<u32>,
}

impl<const REST: usize> Iterator for Cursor<'_, REST> {
    type Item = (u32, [u32; REST]);

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(row) = self.rows.next() {
                return Some((self.first, *row));
            }
            self.first = self.upcoming.next()?;
            self.rows = self.order.beginning_with(self.first).iter();
        }
    }
}

/// One statement, by numbers.
#[derive(Debug)]
struct Row {
    subject: u32,
    property: u32,
    object: u32,
    graph: Option<u32>,
}

/// The statements of a default graph that match a pattern.
#[derive(Debug)]
struct FoundTriples<'a> {
    rows: Cursor<'a, 2>,
    /// The columns with subject, property and object.
    columns: [usize; 3],
}

/// The statements of named graphs that match a pattern.
#[derive(Debug)]
struct FoundQuads<'a> {
    rows: Cursor<'a, 3>,
    /// The columns with graph, subject, property and object.
    columns: [usize; 4],
}

/// The statements that match a pattern.
#[derive(Debug)]
enum FoundRows<'a> {
    Nothing,
    Default(FoundTriples<'a>),
    Named(FoundQuads<'a>),
}

impl Iterator for FoundRows<'_> {
    type Item = Row;

    fn next(&mut self) -> Option<Row> {
        match self {
            Self::Nothing => None,
            Self::Default(found) => {
                let (first, [second, third]) = found.rows.next()?;
                let row = [first, second, third];
                let [subject, property, object] = found.columns.map(|column| row[column]);
                Some(Row {
                    subject,
                    property,
                    object,
                    graph: None,
                })
            }
            Self::Named(found) => {
                let (first, [second, third, fourth]) = found.rows.next()?;
                let row = [first, second, third, fourth];
                let [graph, subject, property, object] = found.columns.map(|column| row[column]);
                Some(Row {
                    subject,
                    property,
                    object,
                    graph: Some(graph),
                })
            }
        }
    }
}

/// The statements of the default graph, in the orders that lookups use: each is named for its
/// columns (`s`ubject, `p`roperty, `o`bject), and all but the first are made at first use.
#[derive(Debug, Default, Clone)]
struct DefaultGraph {
    spo: Order<2>,
    pos: OnceLock<Order<2>>,
    osp: OnceLock<Order<2>>,
}

impl DefaultGraph {
    fn merge(&mut self, new: Vec<[u32; 3]>, n_terms: usize) {
        if self.spo.merge(new, n_terms) {
            self.pos.take();
            self.osp.take();
        }
    }

    fn find(&self, s: Option<u32>, p: Option<u32>, o: Option<u32>) -> FoundTriples<'_> {
        let (rows, columns) = match (s, p, o) {
            (Some(s), Some(p), Some(o)) => (self.spo.find(s, &[p, o]), [0, 1, 2]),
            (Some(s), Some(p), None) => (self.spo.find(s, &[p]), [0, 1, 2]),
            (Some(s), None, None) => (self.spo.find(s, &[]), [0, 1, 2]),
            (Some(s), None, Some(o)) => (self.osp().find(o, &[s]), [1, 2, 0]),
            (None, None, Some(o)) => (self.osp().find(o, &[]), [1, 2, 0]),
            (None, Some(p), Some(o)) => (self.pos().find(p, &[o]), [2, 0, 1]),
            (None, Some(p), None) => (self.pos().find(p, &[]), [2, 0, 1]),
            (None, None, None) => (self.spo.all(), [0, 1, 2]),
        };
        FoundTriples { rows, columns }
    }

    fn pos(&self) -> &Order<2> {
        self.pos.get_or_init(|| self.order_by([1, 2, 0], &[1, 0]))
    }

    fn osp(&self) -> &Order<2> {
        self.osp.get_or_init(|| self.order_by([2, 0, 1], &[0]))
    }

    /// Sorts the statements with their columns in another order. `unsorted` are the columns of the
    /// result, least significant first, that the present order does not sort already.
    fn order_by(&self, columns: [usize; 3], unsorted: &[usize]) -> Order<2> {
        let rows = self.spo.arranged(columns);
        let n_terms = n_terms(&rows);
        Order::new(sorted_by(rows, unsorted, n_terms))
    }
}

/// Returns the least count of terms in which all numbers of the rows occur.
fn n_terms<const N: usize>(rows: &[[u32; N]]) -> usize {
    let last = rows.iter().flatten().max();
    last.map_or(0, |last| *last as usize + 1)
}

/// The statements of the named graphs, in the orders that lookups use: each is named for its
/// columns (`g`raph, `s`ubject, `p`roperty, `o`bject), and all but the first are made at first use.
#[derive(Debug, Default, Clone)]
struct NamedGraphs {
    /// The names of all graphs, also of those without statements, in ascending order.
    names: Vec<u32>,
    gspo: Order<3>,
    gpos: OnceLock<Order<3>>,
    gosp: OnceLock<Order<3>>,
    spog: OnceLock<Order<3>>,
    posg: OnceLock<Order<3>>,
    ospg: OnceLock<Order<3>>,
}

impl NamedGraphs {
    fn merge(&mut self, new: Vec<[u32; 4]>, names: Vec<u32>, n_terms: usize) {
        if self.gspo.merge(new, n_terms) {
            let Self {
                gpos,
                gosp,
                spog,
                posg,
                ospg,
                ..
            } = self;
            for other in [gpos, gosp, spog, posg, ospg] {
                other.take();
            }
            let starts = self.gspo.starts.windows(2).zip(0..);
            let with_statements = starts.filter(|(bounds, _)| bounds[0] < bounds[1]);
            self.names.extend(with_statements.map(|(_, name)| name));
        }
        self.names.extend(names);
        self.names.sort_unstable();
        self.names.dedup();
    }

    fn find(
        &self,
        g: Option<u32>,
        s: Option<u32>,
        p: Option<u32>,
        o: Option<u32>,
    ) -> FoundQuads<'_> {
        let (rows, columns) = match g {
            Some(g) => self.find_in(g, s, p, o),
            None => self.find_anywhere(s, p, o),
        };
        FoundQuads { rows, columns }
    }

    /// Finds statements in one graph.
    fn find_in(
        &self,
        g: u32,
        s: Option<u32>,
        p: Option<u32>,
        o: Option<u32>,
    ) -> (Cursor<'_, 3>, [usize; 4]) {
        match (s, p, o) {
            (Some(s), Some(p), Some(o)) => (self.gspo.find(g, &[s, p, o]), [0, 1, 2, 3]),
            (Some(s), Some(p), None) => (self.gspo.find(g, &[s, p]), [0, 1, 2, 3]),
            (Some(s), None, None) => (self.gspo.find(g, &[s]), [0, 1, 2, 3]),
            (Some(s), None, Some(o)) => (self.gosp().find(g, &[o, s]), [0, 2, 3, 1]),
            (None, None, Some(o)) => (self.gosp().find(g, &[o]), [0, 2, 3, 1]),
            (None, Some(p), Some(o)) => (self.gpos().find(g, &[p, o]), [0, 3, 1, 2]),
            (None, Some(p), None) => (self.gpos().find(g, &[p]), [0, 3, 1, 2]),
            (None, None, None) => (self.gspo.find(g, &[]), [0, 1, 2, 3]),
        }
    }

    /// Finds statements in all named graphs.
    fn find_anywhere(
        &self,
        s: Option<u32>,
        p: Option<u32>,
        o: Option<u32>,
    ) -> (Cursor<'_, 3>, [usize; 4]) {
        match (s, p, o) {
            (Some(s), Some(p), Some(o)) => (self.spog().find(s, &[p, o]), [3, 0, 1, 2]),
            (Some(s), Some(p), None) => (self.spog().find(s, &[p]), [3, 0, 1, 2]),
            (Some(s), None, None) => (self.spog().find(s, &[]), [3, 0, 1, 2]),
            (Some(s), None, Some(o)) => (self.ospg().find(o, &[s]), [3, 1, 2, 0]),
            (None, None, Some(o)) => (self.ospg().find(o, &[]), [3, 1, 2, 0]),
            (None, Some(p), Some(o)) => (self.posg().find(p, &[o]), [3, 2, 0, 1]),
            (None, Some(p), None) => (self.posg().find(p, &[]), [3, 2, 0, 1]),
            (None, None, None) => (self.gspo.all(), [0, 1, 2, 3]),
        }
    }

    fn gpos(&self) -> &Order<3> {
        self.gpos
            .get_or_init(|| self.order_by([0, 2, 3, 1], &[2, 1, 0]))
    }

    fn gosp(&self) -> &Order<3> {
        self.gosp
            .get_or_init(|| self.order_by([0, 3, 1, 2], &[1, 0]))
    }

    fn spog(&self) -> &Order<3> {
        self.spog
            .get_or_init(|| self.order_by([1, 2, 3, 0], &[2, 1, 0]))
    }

    fn posg(&self) -> &Order<3> {
        self.posg
            .get_or_init(|| self.order_by([2, 3, 1, 0], &[2, 1, 0]))
    }

    fn ospg(&self) -> &Order<3> {
        self.ospg
            .get_or_init(|| self.order_by([3, 1, 2, 0], &[2, 1, 0]))
    }

    /// Sorts the statements with their columns in another order. `unsorted` are the columns of the
    /// result, least significant first, that the present order does not sort already.
    fn order_by(&self, columns: [usize; 4], unsorted: &[usize]) -> Order<3> {
        let rows = self.gspo.arranged(columns);
        let n_terms = n_terms(&rows);
        Order::new(sorted_by(rows, unsorted, n_terms))
    }
}

#[cfg(test)]
mod tests {
    use oxigraph::model::vocab::rdf;
    use oxigraph::model::{GraphName, Literal, NamedOrBlankNode};
    use oxigraph::sparql::{PreparedSparqlQuery, QueryResults, SparqlEvaluator};
    use oxigraph::store::Store;

    use super::*;

    /// A pseudo-random generator (xorshift64*), so that a failure can be repeated.
    struct Random(u64);

    impl Random {
        fn below(&mut self, bound: usize) -> usize {
            self.0 ^= self.0 >> 12;
            self.0 ^= self.0 << 25;
            self.0 ^= self.0 >> 27;
            let number = self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 33;
            number as usize % bound
        }

        fn pick<'t, T: ?Sized>(&mut self, choices: &[&'t T]) -> &'t T {
            choices[self.below(choices.len())]
        }
    }

    /// Text and datatype of literals that are alike, unusual or invalid.
    const TYPED: &[(&str, &str)] = &[
        ("1", "integer"),
        ("01", "integer"),
        ("+1", "integer"),
        ("1", "int"),
        ("001", "nonNegativeInteger"),
        ("-7", "long"),
        ("300", "byte"),
        ("0", "integer"),
        ("-0", "integer"),
        ("99999999999999999999", "integer"),
        ("1.5", "integer"),
        ("abc", "integer"),
        ("", "integer"),
        ("1", "decimal"),
        ("1.0", "decimal"),
        ("1.50", "decimal"),
        ("0.0", "decimal"),
        ("-.5", "decimal"),
        ("1e3", "decimal"),
        ("0.00000000000000000001", "decimal"),
        ("1", "double"),
        ("1.0", "double"),
        ("1e0", "double"),
        ("1.0E0", "double"),
        ("0.1", "double"),
        ("-0", "double"),
        ("0", "double"),
        ("NaN", "double"),
        ("INF", "double"),
        ("-INF", "double"),
        ("+INF", "double"),
        ("1e400", "double"),
        ("123456789012345678", "double"),
        ("one", "double"),
        ("1", "float"),
        ("0.1", "float"),
        ("0.10", "float"),
        ("NaN", "float"),
        ("0", "float"),
        ("true", "boolean"),
        ("1", "boolean"),
        ("false", "boolean"),
        ("0", "boolean"),
        ("TRUE", "boolean"),
        ("2024-02-29T12:00:00Z", "dateTime"),
        ("2024-02-29T12:00:00.000Z", "dateTime"),
        ("2024-02-29T12:00:00+00:00", "dateTime"),
        ("2024-02-29T14:00:00+02:00", "dateTime"),
        ("2024-02-29T12:00:00", "dateTime"),
        ("2024-02-28T24:00:00", "dateTime"),
        ("2024-02-29T00:00:00", "dateTime"),
        ("2024-02-29T12:00:00Z", "dateTimeStamp"),
        ("2023-02-29T12:00:00Z", "dateTime"),
        ("yesterday", "dateTime"),
        ("2024-02-29", "date"),
        ("2024-02-29Z", "date"),
        ("2024-02-29+00:00", "date"),
        ("2024-13-01", "date"),
        ("12:00:00", "time"),
        ("12:00:00.0", "time"),
        ("24:00:00", "time"),
        ("2024", "gYear"),
        ("2024Z", "gYear"),
        ("2024-02", "gYearMonth"),
        ("--02-29", "gMonthDay"),
        ("---29", "gDay"),
        ("--02", "gMonth"),
        ("P1Y2M", "yearMonthDuration"),
        ("P14M", "yearMonthDuration"),
        ("PT3600S", "dayTimeDuration"),
        ("PT1H", "dayTimeDuration"),
        ("PT1H", "duration"),
        ("P1Y", "duration"),
        ("P12M", "duration"),
        ("P", "duration"),
        ("1", "string"),
        ("00FF", "hexBinary"),
        ("00ff", "hexBinary"),
        ("http://e/a", "anyURI"),
    ];

    const IRIS: &[&str] = &["a", "b", "c", "d", "e", "f", "p", "q"];
    const PROPERTIES: &[&str] = &["p", "q", "r", "next"];
    const GRAPHS: &[&str] = &["g", "h", "i", "a"];

    fn iri(name: &str) -> NamedNode {
        NamedNode::new_unchecked(format!("http://e/{name}"))
    }

    fn node(random: &mut Random) -> NamedOrBlankNode {
        match random.below(10) {
            // A label of hexadecimal digits is a number for oxigraph.
            0 => BlankNode::new_unchecked("a1f").into(),
            1 => BlankNode::new_unchecked("x").into(),
            2 => BlankNode::new_unchecked("a-label-with-more-than-16-bytes").into(),
            _ => iri(random.pick(IRIS)).into(),
        }
    }

    fn literal(random: &mut Random) -> Literal {
        const TEXTS: &[&str] = &[
            "",
            "a",
            "A",
            "abc",
            "\u{e4}\u{f6} \"quoted\"\n",
            "a text with more than sixteen bytes",
            "1",
        ];
        const TAGS: &[&str] = &["en", "EN", "de", "en-GB", "en-GB-x-actcheck-a"];
        match random.below(12) {
            0 | 1 => Literal::new_simple_literal(random.pick(TEXTS)),
            2 | 3 => {
                let tag = random.pick(TAGS);
                Literal::new_language_tagged_literal_unchecked(random.pick(TEXTS), tag)
            }
            4 => Literal::new_typed_literal(random.pick(TEXTS), iri("datatype")),
            5 => Literal::new_typed_literal("untagged", rdf::LANG_STRING),
            _ => {
                let (text, datatype) = TYPED[random.below(TYPED.len())];
                let datatype = NamedNode::new_unchecked(format!("{XSD}{datatype}"));
                Literal::new_typed_literal(text, datatype)
            }
        }
    }

    fn quad(random: &mut Random) -> Quad {
        let object: Term = match random.below(3) {
            0 => node(random).into(),
            _ => literal(random).into(),
        };
        let graph = match random.below(10) {
            0..5 => GraphName::DefaultGraph,
            5 => BlankNode::new_unchecked("x").into(),
            _ => iri(random.pick(GRAPHS)).into(),
        };
        Quad::new(node(random), iri(random.pick(PROPERTIES)), object, graph)
    }

    /// Queries with a place for a node (`$s`), a property (`$p`), a term (`$o`), a literal (`$l`)
    /// and a graph (`$g`). Their rows do not depend on the order of the statements.
    const QUERIES: &[&str] = &[
        "SELECT * { ?s ?p ?o }",
        "SELECT * { $s ?p ?o }",
        "SELECT * { ?s $p ?o }",
        "SELECT * { ?s ?p $o }",
        "SELECT * { $s $p ?o }",
        "SELECT * { ?s $p $o }",
        "SELECT * { $s ?p $o }",
        "ASK { $s $p $o }",
        "SELECT * { ?s ?p ?s }",
        "SELECT * { ?s $p ?o . ?o $p ?x }",
        "SELECT * { ?s $p ?o . ?s $p ?x . ?x ?p ?y }",
        "SELECT * { ?s $p ?o OPTIONAL { ?o $p ?x } }",
        "SELECT * { ?s ?p ?o OPTIONAL { ?s $p ?x FILTER(?x > ?o) } }",
        "SELECT * { ?s ?p ?o MINUS { ?s $p ?o } }",
        "SELECT * { ?s ?p ?o MINUS { ?x $p $o . ?x ?p ?o } }",
        "SELECT * { { ?s $p ?o } UNION { $s ?p ?o } UNION { GRAPH $g { ?s ?p ?o } } }",
        "SELECT * { ?s ?p ?o FILTER(?o > $l) }",
        "SELECT * { ?s ?p ?o FILTER(?o <= $l) }",
        "SELECT * { ?s ?p ?o FILTER(?o = $l) }",
        "SELECT * { ?s ?p ?o FILTER(?o != $l) }",
        "SELECT * { ?s ?p ?o FILTER(sameTerm(?o, $l)) }",
        "SELECT * { ?s ?p ?o FILTER(?o IN ($l, $o, 1, 'a')) }",
        "SELECT * { ?s ?p ?o FILTER(?o) }",
        "SELECT * { ?s ?p ?o FILTER(!?o) }",
        "SELECT * { ?s ?p ?o FILTER(?o > '2024-01-01T00:00:00Z'^^xsd:dateTime) }",
        "SELECT * { ?s ?p ?o FILTER(STRSTARTS(STR(?o), 'a') || ?o = 'abc') }",
        "SELECT * { ?s ?p ?o FILTER(isNumeric(?o) && ?o < 2) }",
        "SELECT * { ?s ?p ?o FILTER(LANGMATCHES(LANG(?o), 'en')) }",
        "SELECT ?o (DATATYPE(?o) AS ?d) (STR(?o) AS ?t) (LANG(?o) AS ?l) { ?s ?p ?o }",
        "SELECT * { ?s ?p ?o FILTER EXISTS { ?o $p ?x } }",
        "SELECT * { ?s ?p ?o FILTER NOT EXISTS { ?s $p $o } }",
        "SELECT * { ?s $p* ?o }",
        "SELECT * { $s $p* ?o }",
        "SELECT * { ?s $p? ?o }",
        "SELECT * { $s ($p|<http://e/next>)+ ?o }",
        "SELECT * { $s $p*/^$p ?o }",
        "SELECT * { ?s !($p) ?o }",
        "SELECT * { $o $p* ?o }",
        "SELECT * { <http://e/absent> $p? ?o }",
        "SELECT * { GRAPH ?g { $s ($p/<http://e/q>)* ?o } }",
        "SELECT * { GRAPH ?g {} }",
        "SELECT * { GRAPH $g {} }",
        "SELECT * { GRAPH <http://e/absent> {} }",
        "SELECT * { VALUES ?g { $g <http://e/absent> $l } GRAPH ?g {} }",
        "SELECT * { GRAPH ?g { ?s ?p ?o } }",
        "SELECT * { GRAPH ?g { $s ?p ?o } }",
        "SELECT * { GRAPH ?g { ?s $p ?o } }",
        "SELECT * { GRAPH ?g { ?s ?p $o } }",
        "SELECT * { GRAPH ?g { $s $p ?o } }",
        "SELECT * { GRAPH ?g { ?s $p $o } }",
        "SELECT * { GRAPH ?g { $s ?p $o } }",
        "SELECT * { GRAPH ?g { $s $p $o } }",
        "SELECT * { GRAPH ?g { ?g ?p ?o } }",
        "SELECT * { GRAPH $g { ?s ?p ?o } }",
        "SELECT * { GRAPH $g { $s ?p ?o } }",
        "SELECT * { GRAPH $g { ?s $p ?o } }",
        "SELECT * { GRAPH $g { ?s ?p $o } }",
        "SELECT * { GRAPH $g { ?s $p $o } }",
        "SELECT * { GRAPH $g { $s ?p $o } }",
        "SELECT * { GRAPH $g { $s $p $o } }",
        "SELECT * { ?s $p ?x GRAPH ?g { ?s ?p ?o . ?s $p ?y } }",
        "SELECT * { GRAPH ?g { ?s $p ?o } \
         FILTER NOT EXISTS { GRAPH ?h { ?s $p ?o } FILTER(?g != ?h) } }",
        "SELECT * FROM $g { ?s ?p ?o }",
        "SELECT * FROM $g FROM <http://e/h> { ?s ?p ?o . ?s $p ?x }",
        "SELECT * FROM NAMED $g { GRAPH ?g { ?s ?p ?o } }",
        "SELECT * FROM <http://e/h> FROM NAMED $g { ?s ?q ?x GRAPH ?g { ?s ?p ?o } }",
        "SELECT * FROM NAMED $g FROM NAMED <http://e/absent> { GRAPH ?g {} }",
        "SELECT (COUNT(*) AS ?n) { ?s ?p ?o }",
        "SELECT ?p (COUNT(*) AS ?n) (COUNT(DISTINCT ?o) AS ?d) { ?s ?p ?o } GROUP BY ?p",
        "SELECT ?o (COUNT(?s) AS ?n) { ?s ?p ?o } GROUP BY ?o HAVING(COUNT(?s) > 1)",
        "SELECT ?s (SUM(?o) AS ?n) (AVG(?o) AS ?a) (MIN(?o) AS ?least) (MAX(?o) AS ?most) \
         { ?s ?p ?o FILTER(DATATYPE(?o) = xsd:integer) } GROUP BY ?s",
        "SELECT (MAX(?o) AS ?most) { ?s ?p ?o FILTER(DATATYPE(?o) = xsd:decimal) }",
        "SELECT * { { SELECT ?s (COUNT(*) AS ?n) { ?s ?p ?o } GROUP BY ?s } ?s $p ?n }",
        "SELECT * { { SELECT DISTINCT ?s { ?s $p ?o } } ?s ?p ?o }",
        "SELECT ?o { ?s ?p ?o } ORDER BY ?o ?s",
        "SELECT ?s ?o { ?s ?p ?o } ORDER BY DESC(?o) ?s ?p LIMIT 0",
        "SELECT * { VALUES ?o { $o $l 1 1.0 '1' '01'^^xsd:integer 1e0 true } ?s ?p ?o }",
        "SELECT * { VALUES (?s ?p) { ($s $p) (UNDEF $p) ($s UNDEF) } ?s ?p ?o }",
        "SELECT * { BIND($l AS ?o) ?s ?p ?o }",
        "SELECT * { BIND(STRDT('01', xsd:integer) AS ?o) ?s ?p ?o }",
        "SELECT * { BIND(STRDT('x', xsd:integer) AS ?o) OPTIONAL { ?s ?p ?o } }",
        "SELECT * { BIND(STRLANG('a', 'en') AS ?o) OPTIONAL { ?s ?p ?o } }",
        "SELECT * { ?s ?p ?o BIND(?o + 0 AS ?sum) OPTIONAL { ?x ?y ?sum } }",
        "SELECT * { ?s ?p ?o BIND(IF(?o, ?o, $l) AS ?x) OPTIONAL { ?y $p ?x } }",
        "SELECT * { ?s ?p ?o BIND(xsd:double(?o) AS ?n) OPTIONAL { ?x ?q ?n } }",
        "SELECT * { ?s ?p ?o BIND(?o / 0 AS ?n) OPTIONAL { ?x ?q ?n } }",
        "SELECT * { ?s ?p ?o BIND(CONCAT(STR(?o), '') AS ?t) ?x ?q ?t }",
        "SELECT * { ?s ?p ?o BIND(IRI(STR(?o)) AS ?i) ?i ?q ?x }",
        "SELECT * { ?s ?p ?o BIND(?o - 'PT1H'^^xsd:dayTimeDuration AS ?t) FILTER(BOUND(?t)) }",
        "SELECT DISTINCT ?o { { ?s ?p ?o } UNION { GRAPH ?g { ?s ?p ?o } } }",
        "SELECT REDUCED ?p { ?s ?p $o }",
        "CONSTRUCT { ?o $p ?s . ?s <http://e/made> ?o } { ?s $p ?o }",
        "CONSTRUCT { ?s ?p ?o } { GRAPH ?g { ?s ?p ?o } }",
        "DESCRIBE $s",
        "DESCRIBE ?s { ?s $p $o }",
        "ASK { ?s $p ?o FILTER(?o = $l) }",
        "ASK { GRAPH $g { ?s $p $o } }",
    ];

    /// Puts terms into a query: random ones, or half of the time those of one of the statements.
    fn filled(query: &str, quads: &[Quad], random: &mut Random) -> String {
        let mut subject = iri(random.pick(IRIS));
        let mut property = iri(random.pick(PROPERTIES));
        let mut graph = iri(random.pick(GRAPHS));
        let mut object = match random.below(2) {
            0 => Term::from(iri(random.pick(IRIS))),
            _ => literal(random).into(),
        };
        if !quads.is_empty() && random.below(2) == 0 {
            let quad = &quads[random.below(quads.len())];
            property = quad.predicate.clone();
            if let NamedOrBlankNode::NamedNode(node) = &quad.subject {
                subject = node.clone();
            }
            if let GraphName::NamedNode(name) = &quad.graph_name {
                graph = name.clone();
            }
            // A blank node in a query is a variable.
            if !quad.object.is_blank_node() {
                object = quad.object.clone();
            }
        }
        // A subject in a query must not be a literal.
        if object.is_literal() && query.contains("{ $o $p") {
            object = subject.clone().into();
        }
        let query = query
            .replace("$s", &subject.to_string())
            .replace("$p", &property.to_string())
            .replace("$g", &graph.to_string())
            .replace("$l", &literal(random).to_string())
            .replace("$o", &object.to_string());
        format!("PREFIX xsd: <{XSD}> {query}")
    }

    fn prepared(query: &str) -> PreparedSparqlQuery {
        let parsed = SparqlEvaluator::new().parse_query(query);
        parsed.unwrap_or_else(|error| panic!("{query}: {error}"))
    }

    /// Rows in the order of their text.
    fn rows(results: QueryResults<'_>) -> Vec<String> {
        let mut rows: Vec<String> = match results {
            QueryResults::Boolean(answer) => vec![answer.to_string()],
            QueryResults::Graph(triples) => triples.map(|t| t.unwrap().to_string()).collect(),
            QueryResults::Solutions(solutions) => solutions
                .map(|row| {
                    let row = row.unwrap();
                    let values = row.iter().map(|(name, value)| format!("{name}={value}"));
                    values.collect::<Vec<_>>().join(" ")
                })
                .collect(),
        };
        rows.sort();
        rows
    }

    fn answer(dataset: &Dataset, query: &str) -> Vec<String> {
        let bound = prepared(query).on_queryable_dataset(dataset);
        rows(bound.execute().unwrap())
    }

    fn stored_answer(store: &Store, query: &str) -> Vec<String> {
        rows(prepared(query).on_store(store).execute().unwrap())
    }

    fn dataset_of(quads: &[Quad]) -> Dataset {
        let mut dataset = Dataset::default();
        dataset.extend(quads.iter().cloned());
        dataset.merge_pending();
        dataset
    }

    #[test]
    fn queries_have_the_same_rows_as_those_of_a_store() {
        let mut random = Random(20_260_801);
        let mut n_rows = vec![0; QUERIES.len()];
        for case in 0..200 {
            let n_quads = random.below(80);
            let quads: Vec<Quad> = (0..n_quads).map(|_| quad(&mut random)).collect();
            let store = Store::new().unwrap();
            store.extend(quads.iter().cloned()).unwrap();
            let mut dataset = dataset_of(&quads);
            if random.below(2) == 0 {
                let empty = iri("empty");
                store.insert_named_graph(&empty).unwrap();
                dataset.add_graph(empty.as_ref().into());
                dataset.merge_pending();
            }
            assert_eq!(dataset.len(), store.len().unwrap());
            for (query, n_rows) in QUERIES.iter().zip(&mut n_rows) {
                let query = filled(query, &quads, &mut random);
                let expected = stored_answer(&store, &query);
                *n_rows += expected.len();
                assert_eq!(answer(&dataset, &query), expected, "case {case}: {query}");
            }
        }
        for (query, n_rows) in QUERIES.iter().zip(n_rows) {
            assert!(
                n_rows > 0 || query.contains("absent") || query.ends_with("LIMIT 0"),
                "{query}"
            );
        }
    }

    #[test]
    fn literals_are_returned_as_a_store_returns_them() {
        for (text, datatype) in TYPED {
            let datatype = NamedNode::new_unchecked(format!("{XSD}{datatype}"));
            let literal = Literal::new_typed_literal(*text, datatype);
            let quad = Quad::new(iri("a"), iri("p"), literal, GraphName::DefaultGraph);
            let store = Store::new().unwrap();
            store.insert(&quad).unwrap();
            let mut dataset = Dataset::default();
            let number = dataset.intern(quad.object.as_ref());
            let stored = store.iter().next().unwrap().unwrap();
            assert_eq!(dataset.term(number), stored.object);
            assert_eq!(dataset.number(stored.object.as_ref()), Some(number));
        }
    }

    #[test]
    fn literals_with_an_identical_value_are_one_term() {
        let mut dataset = Dataset::default();
        let mut number = |text, datatype| {
            let literal = LiteralRef::new_typed_literal(text, datatype);
            dataset.intern(literal.into())
        };
        let one = number("1", xsd::INTEGER);
        assert_eq!(number("01", xsd::INTEGER), one);
        assert_eq!(number("1", xsd::SHORT), one);
        assert_ne!(number("1", xsd::DOUBLE), one);
        assert_ne!(number("1", xsd::DECIMAL), one);
        assert_ne!(number("1", xsd::STRING), one);
        assert_eq!(number("1e0", xsd::DOUBLE), number("1.0", xsd::DOUBLE));
        assert_ne!(number("0", xsd::DOUBLE), number("-0", xsd::DOUBLE));
        assert_eq!(number("true", xsd::BOOLEAN), number("1", xsd::BOOLEAN));
        let noon = number("2024-02-29T12:00:00Z", xsd::DATE_TIME);
        assert_eq!(number("2024-02-29T12:00:00.0+00:00", xsd::DATE_TIME), noon);
        assert_ne!(number("2024-02-29T14:00:00+02:00", xsd::DATE_TIME), noon);
    }

    #[test]
    fn adding_statements_in_parts_gives_the_same_as_at_once() {
        let mut random = Random(77);
        for case in 0..15 {
            let n_quads = 1 + random.below(120);
            let quads: Vec<Quad> = (0..n_quads).map(|_| quad(&mut random)).collect();
            let whole = dataset_of(&quads);
            let mut parts = Dataset::default();
            let mut rest = &quads[..];
            while !rest.is_empty() {
                let (part, later) = rest.split_at(1 + random.below(rest.len()));
                parts.extend(part.iter().cloned());
                parts.merge_pending();
                rest = later;
                // Queries make the orders that the next part must reset.
                for query in QUERIES {
                    answer(&parts, &filled(query, &quads, &mut random));
                }
            }
            parts.merge_pending();
            assert_eq!(parts.len(), whole.len());
            for query in QUERIES {
                let query = filled(query, &quads, &mut random);
                assert_eq!(
                    answer(&parts, &query),
                    answer(&whole, &query),
                    "case {case}: {query}"
                );
            }
            assert_eq!(
                answer(&parts.clone(), QUERIES[0]),
                answer(&whole, QUERIES[0])
            );
        }
    }

    #[test]
    fn counting_sorts_like_comparing() {
        let mut random = Random(5);
        for n_terms in [1, 3, 100, 5000] {
            for n_rows in [0, 1, 63, 64, 700, 3000] {
                let row =
                    |random: &mut Random| std::array::from_fn(|_| random.below(n_terms) as u32);
                let rows: Vec<[u32; 4]> = (0..n_rows).map(|_| row(&mut random)).collect();
                let mut expected = rows.clone();
                expected.sort_unstable();
                assert_eq!(sorted_by(rows, &[3, 2, 1, 0], n_terms), expected);
            }
        }
    }

    #[test]
    fn pending_statements_are_not_seen() {
        let mut dataset = Dataset::default();
        let [a, p, g] = ["a", "p", "g"].map(|name| dataset.intern(iri(name).as_ref().into()));
        dataset.insert([a, p, a], None);
        dataset.insert([a, p, a], Some(g));
        assert!(dataset.is_empty());
        assert!(answer(&dataset, "SELECT * { ?s ?p ?o }").is_empty());
        dataset.merge_pending();
        assert_eq!(dataset.len(), 2);
        assert_eq!(answer(&dataset, "SELECT * { GRAPH ?g {} }").len(), 1);
    }

    #[test]
    fn threads_can_share_a_dataset() {
        fn check<T: Send + Sync>(_: &T) {}
        check(&Dataset::default());
    }
}
