//! Bitwise operations on 64-bit integers.

use crate::builtins::Value;
use actcheck_base::Term;

fn integer(value: &Term) -> Option<i64> {
    match value {
        Term::Integer(value) => Some(*value),
        _ => None,
    }
}

fn fold(args: &[Value<'_>], start: i64, with: fn(i64, i64) -> i64) -> Option<Term> {
    args.iter()
        .try_fold(start, |sum, arg| Some(with(sum, integer(arg)?)))
        .map(Term::Integer)
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

/// Returns the number and the shift distance. Returns `None` if the distance is not from 0 to 63.
fn places(args: &[Value<'_>]) -> Option<(i64, u32)> {
    Some((
        integer(&args[0])?,
        u32::try_from(integer(&args[1])?)
            .ok()
            .filter(|places| *places < 64)?,
    ))
}

pub(super) fn shl(args: &[Value<'_>]) -> Option<Term> {
    places(args).map(|(value, places)| Term::Integer(value << places))
}

pub(super) fn shr(args: &[Value<'_>]) -> Option<Term> {
    places(args).map(|(value, places)| Term::Integer(value >> places))
}

/// Shifts right, filling with zeros.
pub(super) fn shru(args: &[Value<'_>]) -> Option<Term> {
    places(args)
        .map(|(value, places)| Term::Integer((value.cast_unsigned() >> places).cast_signed()))
}
