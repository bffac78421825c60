//! Type tests, conversions between types, and boolean functions.

use crate::builtins::Value;
use crate::model::datatypes;
use crate::model::values::{self, Number};
use actcheck_base::Term;

fn truth(value: &Term) -> Option<bool> {
    match value {
        Term::Boolean(value) => Some(*value),
        _ => None,
    }
}

fn all(args: &[Value<'_>]) -> Option<Vec<bool>> {
    args.iter().map(|a| truth(a)).collect()
}

pub(super) fn and(args: &[Value<'_>]) -> Option<Term> {
    all(args).map(|values| Term::Boolean(values.into_iter().all(|v| v)))
}

pub(super) fn or(args: &[Value<'_>]) -> Option<Term> {
    all(args).map(|values| Term::Boolean(values.into_iter().any(|v| v)))
}

pub(super) fn not(args: &[Value<'_>]) -> Option<Term> {
    truth(&args[0]).map(|value| Term::Boolean(!value))
}

pub(super) fn str(args: &[Value<'_>]) -> Option<Term> {
    Some(Term::string(values::lexical(&args[0])))
}

pub(super) fn full_str(args: &[Value<'_>]) -> Option<Term> {
    Some(Term::string(values::full(&args[0])))
}

pub(super) fn int(args: &[Value<'_>]) -> Option<Term> {
    let whole = |value: f64| {
        // Doubles of this magnitude are whole, but may not fit in 64 bits.
        (value.fract() == 0.0 && value.abs() < 9.0e18).then_some(Term::Integer(value as i64))
    };
    match args[0].as_ref() {
        Term::Integer(value) => Some(Term::Integer(*value)),
        Term::Boolean(value) => Some(Term::Integer(i64::from(*value))),
        Term::String(text) => integer(text).map(Term::Integer),
        other => match Number::of(other) {
            Some(number) => whole(number.double()),
            None => match other {
                Term::Literal(text, _) => integer(text).map(Term::Integer),
                _ => None,
            },
        },
    }
}

fn integer(text: &str) -> Option<i64> {
    match text.get(..2) {
        Some("0b") => i64::from_str_radix(&text[2..], 2).ok(),
        Some("0o") => i64::from_str_radix(&text[2..], 8).ok(),
        Some("0x") => i64::from_str_radix(&text[2..], 16).ok(),
        _ => text.parse().ok(),
    }
}

fn real(term: &Term) -> Option<f64> {
    match term {
        Term::String(text) => text.parse().ok(),
        Term::Literal(text, _) => text.parse().ok(),
        other => Number::of(other).map(Number::double),
    }
    .filter(|value: &f64| value.is_finite())
}

pub(super) fn double(args: &[Value<'_>]) -> Option<Term> {
    real(&args[0]).map(values::double_term)
}

pub(super) fn float(args: &[Value<'_>]) -> Option<Term> {
    Number::Float(real(&args[0])? as f32).term()
}

pub(super) fn iri(args: &[Value<'_>]) -> Option<Term> {
    match args[0].as_ref() {
        Term::Iri(text) | Term::String(text) => Some(Term::iri(text)),
        _ => None,
    }
}

pub(super) fn datatype(args: &[Value<'_>]) -> Option<Term> {
    Some(Term::iri(values::datatype(&args[0])))
}

pub(super) fn canonical(args: &[Value<'_>]) -> Option<Term> {
    datatypes::canonical(&args[0])
}

pub(super) fn is_of_datatype(args: &[Value<'_>]) -> Option<Term> {
    datatypes::belongs(&args[0], args[1].as_iri()?).map(Term::Boolean)
}

pub(super) fn lang(args: &[Value<'_>]) -> Option<Term> {
    match args[0].as_ref() {
        Term::LangString(_, tag) => Some(Term::string(tag)),
        _ => None,
    }
}

pub(super) fn str_lang(args: &[Value<'_>]) -> Option<Term> {
    match (args[0].as_ref(), args[1].as_ref()) {
        (Term::String(text), Term::String(tag)) => {
            Some(Term::LangString(text.clone(), tag.clone()))
        }
        _ => None,
    }
}

pub(super) fn str_dt(args: &[Value<'_>]) -> Option<Term> {
    match (args[0].as_ref(), args[1].as_ref()) {
        (Term::String(text), Term::Iri(datatype)) => Some(values::literal(text, datatype)),
        _ => None,
    }
}

/// Returns whether a language tag is in a range: `en-GB` is in `en`, and every tag is in `*`.
pub(super) fn lang_matches(args: &[Value<'_>]) -> Option<Term> {
    let (Term::String(tag), Term::String(range)) = (args[0].as_ref(), args[1].as_ref()) else {
        return None;
    };
    let (tag, range) = (tag.to_ascii_lowercase(), range.to_ascii_lowercase());
    let begins = tag
        .strip_prefix(&range)
        .is_some_and(|rest| rest.is_empty() || rest.starts_with('-'));
    Some(Term::Boolean(if range == "*" {
        !tag.is_empty()
    } else {
        begins
    }))
}

fn is(args: &[Value<'_>], kind: fn(&Term) -> bool) -> Option<Term> {
    Some(Term::Boolean(kind(&args[0])))
}

pub(super) fn is_numeric(args: &[Value<'_>]) -> Option<Term> {
    is(args, |term| Number::of(term).is_some())
}

pub(super) fn is_integer(args: &[Value<'_>]) -> Option<Term> {
    is(args, |term| matches!(term, Term::Integer(_)))
}

pub(super) fn is_float(args: &[Value<'_>]) -> Option<Term> {
    is(args, |term| {
        matches!(Number::of(term), Some(Number::Float(_)))
    })
}

pub(super) fn is_double(args: &[Value<'_>]) -> Option<Term> {
    is(args, |term| matches!(term, Term::Double(_)))
}

pub(super) fn is_string(args: &[Value<'_>]) -> Option<Term> {
    is(args, |term| matches!(term, Term::String(_)))
}

pub(super) fn is_iri(args: &[Value<'_>]) -> Option<Term> {
    is(args, |term| matches!(term, Term::Iri(_)))
}

pub(super) fn is_null(args: &[Value<'_>]) -> Option<Term> {
    is(args, |term| matches!(term, Term::Blank(_)))
}

pub(super) fn is_boolean(args: &[Value<'_>]) -> Option<Term> {
    is(args, |term| matches!(term, Term::Boolean(_)))
}

pub(super) fn is_literal(args: &[Value<'_>]) -> Option<Term> {
    is(args, |term| !matches!(term, Term::Iri(_) | Term::Blank(_)))
}
