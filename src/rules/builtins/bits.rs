//! Bitwise operations on 64-bit integers.

use crate::base::Term;
use crate::rules::builtins::Value;

fn integer(value: &Term) -> Option<i64> {
    match value {
        Term::Integer(value) => Some(*value),
        _ => None,
    }
}

fn fold(args: &[Value<'_>], start: i64, with: fn(i64, i64) -> i64) -> Option<Term> {
    args.iter().try_fold(start, |sum, arg| Some(with(sum, integer(arg)?))).map(Term::Integer)
}

pub(super) fn and(args: &[Value<'_>]) -> Option<Term> {
    fold(args, -1, |a, b| a & b)
}

pub(super) fn or(args: &[Value<'_>]) -> Option<Term> {
    fold(args, 0, |a, b| a | b)
}

pub(super) fn xor(args: &[Value<'_>]) -> Option<Term> {
    fold(args, 0, |a, b| a ^ b)
}

/// Number and places; no result for fewer than 0 or more than 63 places.
fn places(args: &[Value<'_>]) -> Option<(i64, u32)> {
    Some((integer(&args[0])?, u32::try_from(integer(&args[1])?).ok().filter(|places| *places < 64)?))
}

pub(super) fn shl(args: &[Value<'_>]) -> Option<Term> {
    places(args).map(|(value, places)| Term::Integer(value << places))
}

pub(super) fn shr(args: &[Value<'_>]) -> Option<Term> {
    places(args).map(|(value, places)| Term::Integer(value >> places))
}

/// Zeros come in from the left.
pub(super) fn shru(args: &[Value<'_>]) -> Option<Term> {
    places(args).map(|(value, places)| Term::Integer((value.cast_unsigned() >> places).cast_signed()))
}
