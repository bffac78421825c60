//! Values of terms: literals in their canonical form, numbers, lexical forms.

use crate::base::{Term, names};

/// A number with its type kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Number {
    /// `xsd:integer`.
    Integer(i64),
    /// `xsd:float`.
    Float(f32),
    /// `xsd:double`; decimals are taken as such when they are computed with.
    Double(f64),
}

impl Number {
    /// The number of a term, if it is one.
    pub(crate) fn of(term: &Term) -> Option<Self> {
        match term {
            Term::Integer(value) => Some(Self::Integer(*value)),
            Term::Double(value) => Some(Self::Double(*value)),
            Term::Decimal(text) => text.parse().ok().map(Self::Double),
            Term::Literal(text, datatype) if datatype.strip_prefix(names::XSD) == Some("float") => {
                text.parse().ok().map(Self::Float)
            }
            _ => None,
        }
    }

    /// Its value as a double.
    pub(crate) fn double(self) -> f64 {
        match self {
            Self::Integer(value) => value as f64,
            Self::Float(value) => f64::from(value),
            Self::Double(value) => value,
        }
    }

    /// Its term; nothing where the value is no finite number, because a computation that leaves the numbers has no result.
    pub(crate) fn term(self) -> Option<Term> {
        match self {
            Self::Integer(value) => Some(Term::Integer(value)),
            Self::Float(value) => value
                .is_finite()
                .then(|| Term::Literal(value.to_string().into(), format!("{}float", names::XSD).into())),
            Self::Double(value) => value.is_finite().then(|| double_term(value)),
        }
    }
}

/// A double as a term; `-0.0` becomes `0.0`, so that equal results are the same term.
pub(crate) fn double_term(value: f64) -> Term {
    Term::Double(if value == 0.0 { 0.0 } else { value })
}

/// The integer types of XML Schema, whose values are all kept as integers.
const INTEGER_TYPES: [&str; 13] = [
    "integer",
    "int",
    "long",
    "short",
    "byte",
    "nonNegativeInteger",
    "positiveInteger",
    "nonPositiveInteger",
    "negativeInteger",
    "unsignedLong",
    "unsignedInt",
    "unsignedShort",
    "unsignedByte",
];

/// The term of a literal with a datatype, in its canonical form where the form is known and right.
pub(crate) fn literal(text: &str, datatype: &str) -> Term {
    let other = || Term::Literal(text.into(), datatype.into());
    let Some(local) = datatype.strip_prefix(names::XSD) else { return other() };
    match local {
        "string" => Term::string(text),
        "boolean" => match text {
            "true" | "1" => Term::Boolean(true),
            "false" | "0" => Term::Boolean(false),
            _ => other(),
        },
        "double" => xsd_float(text).map_or_else(other, Term::Double),
        "float" => match xsd_float(text) {
            Some(value) if value.is_finite() => Term::Literal((value as f32).to_string().into(), datatype.into()),
            _ => other(),
        },
        "decimal" => decimal(text).map_or_else(other, |canonical| match whole(&canonical) {
            Some(term) => term,
            None => Term::Decimal(canonical.into()),
        }),
        _ if INTEGER_TYPES.contains(&local) => integer(text).unwrap_or_else(other),
        _ => other(),
    }
}

/// The term of an integer of any length, in decimal digits with or without a sign; nothing for another text.
///
/// One that 64 bits don't hold is, as in Nemo, an `xsd:integer` literal in canonical form: equal to itself alone, exact, and
/// no number to compute with, because a double in its place would be rounded.
pub(crate) fn integer(text: &str) -> Option<Term> {
    if text.contains('.') { None } else { whole(&decimal(text)?) }
}

/// The same for a canonical decimal; nothing where it has a fraction.
fn whole(canonical: &str) -> Option<Term> {
    match canonical.parse() {
        Ok(value) => Some(Term::Integer(value)),
        Err(_) if canonical.contains('.') => None,
        Err(_) => Some(Term::Literal(canonical.into(), format!("{}integer", names::XSD).into())),
    }
}

/// Whether a term is an integer that 64 bits don't hold.
pub(crate) fn is_beyond_64_bits(term: &Term) -> bool {
    matches!(term, Term::Literal(text, datatype)
        if (datatype.strip_prefix(names::XSD) == Some("integer") || datatype.as_ref() == "xsd:integer") && integer(text).is_some())
}

fn xsd_float(text: &str) -> Option<f64> {
    match text {
        "INF" | "+INF" => Some(f64::INFINITY),
        "-INF" => Some(f64::NEG_INFINITY),
        "NaN" => Some(f64::NAN),
        _ if text.bytes().all(|b| b.is_ascii_digit() || b"+-.eE".contains(&b)) => text.parse().ok(),
        _ => None,
    }
}

/// Digits with one dot at most, without needless zeros; without the dot where nothing is behind it.
fn decimal(text: &str) -> Option<String> {
    let (negative, digits) = match text.strip_prefix('-') {
        Some(rest) => (true, rest),
        None => (false, text.strip_prefix('+').unwrap_or(text)),
    };
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    let proper = |part: &str| part.bytes().all(|b| b.is_ascii_digit());
    if !(proper(whole) && proper(fraction)) || (whole.is_empty() && fraction.is_empty()) {
        return None;
    }
    let whole = whole.trim_start_matches('0');
    let fraction = fraction.trim_end_matches('0');
    let whole = if whole.is_empty() { "0" } else { whole };
    let sign = if negative && (whole != "0" || !fraction.is_empty()) { "-" } else { "" };
    Some(if fraction.is_empty() { format!("{sign}{whole}") } else { format!("{sign}{whole}.{fraction}") })
}

/// The text of a term's value, as `STR` gives it.
pub(crate) fn lexical(term: &Term) -> String {
    match term {
        Term::Iri(text) | Term::Blank(text) | Term::String(text) | Term::LangString(text, _) | Term::Decimal(text) => {
            text.to_string()
        }
        Term::Literal(text, _) => text.to_string(),
        Term::Integer(value) => value.to_string(),
        Term::Boolean(value) => value.to_string(),
        Term::Double(value) if value.is_nan() => "NaN".into(),
        Term::Double(value) if value.is_infinite() => if *value > 0.0 { "INF" } else { "-INF" }.into(),
        Term::Double(value) => value.to_string(),
    }
}

/// IRI of a term's datatype, as `DATATYPE` gives it.
pub(crate) fn datatype(term: &Term) -> String {
    let local = match term {
        Term::Iri(_) => "anyURI",
        Term::Blank(_) => return format!("{}BlankNode", names::RDF),
        Term::String(_) => "string",
        Term::LangString(..) => return format!("{}langString", names::RDF),
        Term::Integer(value) if i32::try_from(*value).is_ok() => "int",
        Term::Integer(_) => "long",
        Term::Decimal(_) => "decimal",
        Term::Double(_) => "double",
        Term::Boolean(_) => "boolean",
        Term::Literal(_, datatype) => return datatype.to_string(),
    };
    format!("{}{local}", names::XSD)
}

/// The canonical spelling of a term with its type, as `fullStr` gives it and exports write it.
pub(crate) fn full(term: &Term) -> String {
    match term {
        Term::Iri(iri) => iri.to_string(),
        Term::Blank(label) => format!("_:{label}"),
        Term::Integer(value) => value.to_string(),
        Term::String(text) => quoted(text),
        Term::LangString(text, tag) => format!("{}@{tag}", quoted(text)),
        _ => format!("{}^^<{}>", quoted(&lexical(term)), datatype(term)),
    }
}

fn quoted(text: &str) -> String {
    let mut out = String::with_capacity(text.len() + 2);
    out.push('"');
    for c in text.chars() {
        match c {
            '"' => out.push_str("\\\""),
            '\\' => out.push_str("\\\\"),
            '\n' => out.push_str("\\n"),
            '\r' => out.push_str("\\r"),
            '\t' => out.push_str("\\t"),
            c => out.push(c),
        }
    }
    out.push('"');
    out
}
