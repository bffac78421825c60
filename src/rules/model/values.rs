//! Values of terms: canonical literals, numbers, lexical forms.

use actcheck_base::{Term, names};

/// A number with its type.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Number {
    /// `xsd:integer`.
    Integer(i64),
    /// `xsd:float`.
    Float(f32),
    /// `xsd:double`; decimals are converted to it for computation.
    Double(f64),
}

impl Number {
    /// Returns the number of a term, or `None` if the term is not a number.
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

    /// Returns the value as a double.
    pub(crate) fn double(self) -> f64 {
        match self {
            Self::Integer(value) => value as f64,
            Self::Float(value) => f64::from(value),
            Self::Double(value) => value,
        }
    }

    /// Returns the term. Returns `None` if the value is not finite, because such a computation has
    /// no result.
    pub(crate) fn term(self) -> Option<Term> {
        match self {
            Self::Integer(value) => Some(Term::Integer(value)),
            Self::Float(value) => value.is_finite().then(|| {
                Term::Literal(
                    value.to_string().into(),
                    format!("{}float", names::XSD).into(),
                )
            }),
            Self::Double(value) => value.is_finite().then(|| double_term(value)),
        }
    }
}

/// Converts a double to a term; `-0.0` becomes `0.0`, so that equal results are the same term.
pub(crate) fn double_term(value: f64) -> Term {
    Term::Double(if value == 0.0 { 0.0 } else { value })
}

/// The integer types of XML Schema, all stored as integers if they are in their range.
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

/// Converts a literal to a term: canonical if the datatype is known and the text is valid,
/// otherwise unchanged.
pub(crate) fn literal(text: &str, datatype: &str) -> Term {
    let other = || Term::Literal(text.into(), datatype.into());
    let Some(local) = datatype.strip_prefix(names::XSD) else {
        return other();
    };
    match local {
        "string" => Term::string(text),
        "boolean" => match text {
            "true" | "1" => Term::Boolean(true),
            "false" | "0" => Term::Boolean(false),
            _ => other(),
        },
        "double" => xsd_float(text).map_or_else(other, Term::Double),
        "float" => match xsd_float(text) {
            Some(value) if value.is_finite() => {
                Term::Literal((value as f32).to_string().into(), datatype.into())
            }
            _ => other(),
        },
        "decimal" => decimal(text).map_or_else(other, |canonical| match whole(&canonical) {
            Some(term) => term,
            None => Term::Decimal(canonical.into()),
        }),
        _ if INTEGER_TYPES.contains(&local) => integer(text)
            .filter(|value| {
                local == "integer"
                    || crate::model::datatypes::belongs(value, datatype) == Some(true)
            })
            .unwrap_or_else(other),
        _ => other(),
    }
}

/// Converts an integer of any length, in decimal digits with an optional sign. Returns `None` for
/// any other text.
///
/// An integer that does not fit in 64 bits becomes, as in Nemo, an `xsd:integer` literal in
/// canonical form. It is exact and equal only to itself, but not a number for computation, because
/// a double would be rounded.
pub(crate) fn integer(text: &str) -> Option<Term> {
    if text.contains('.') {
        None
    } else {
        whole(&decimal(text)?)
    }
}

/// Converts a canonical decimal to an integer term. Returns `None` if it has a fraction.
fn whole(canonical: &str) -> Option<Term> {
    match canonical.parse() {
        Ok(value) => Some(Term::Integer(value)),
        Err(_) if canonical.contains('.') => None,
        Err(_) => Some(Term::Literal(
            canonical.into(),
            format!("{}integer", names::XSD).into(),
        )),
    }
}

/// Returns whether a term is an integer that does not fit in 64 bits.
pub(crate) fn is_beyond_64_bits(term: &Term) -> bool {
    matches!(term, Term::Literal(text, datatype)
        if (datatype.strip_prefix(names::XSD) == Some("integer") || datatype.as_ref() == "xsd:integer")
            && integer(text).is_some())
}

fn xsd_float(text: &str) -> Option<f64> {
    match text {
        "INF" | "+INF" => Some(f64::INFINITY),
        "-INF" => Some(f64::NEG_INFINITY),
        "NaN" => Some(f64::NAN),
        _ if text
            .bytes()
            .all(|b| b.is_ascii_digit() || b"+-.eE".contains(&b)) =>
        {
            text.parse().ok()
        }
        _ => None,
    }
}

/// Returns the canonical form of a decimal: no redundant zeros, and no dot without a fraction.
/// Returns `None` if the text is not a decimal.
pub(crate) fn decimal(text: &str) -> Option<String> {
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
    let sign = if negative && (whole != "0" || !fraction.is_empty()) {
        "-"
    } else {
        ""
    };
    Some(if fraction.is_empty() {
        format!("{sign}{whole}")
    } else {
        format!("{sign}{whole}.{fraction}")
    })
}

/// Returns the length of a term's text; 0 for numbers. Unit: bytes.
pub(crate) fn text_len(term: &Term) -> usize {
    match term {
        Term::Iri(text) | Term::Blank(text) | Term::String(text) | Term::Decimal(text) => {
            text.len()
        }
        Term::LangString(text, more) | Term::Literal(text, more) => text.len() + more.len(),
        Term::Integer(_) | Term::Double(_) | Term::Boolean(_) => 0,
    }
}

/// Returns the lexical form of a term, as `STR` does.
pub(crate) fn lexical(term: &Term) -> String {
    match term {
        Term::Iri(text)
        | Term::Blank(text)
        | Term::String(text)
        | Term::LangString(text, _)
        | Term::Decimal(text) => text.to_string(),
        Term::Literal(text, _) => text.to_string(),
        Term::Integer(value) => value.to_string(),
        Term::Boolean(value) => value.to_string(),
        Term::Double(value) if value.is_nan() => "NaN".into(),
        Term::Double(value) if value.is_infinite() => {
            if *value > 0.0 { "INF" } else { "-INF" }.into()
        }
        Term::Double(value) => value.to_string(),
    }
}

/// Returns the IRI of a term's datatype, as `DATATYPE` does.
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

/// Returns the canonical form of a term with its type, as in `fullStr` and exports.
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
