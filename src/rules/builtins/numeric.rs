//! Arithmetic: integers stay integers, mixed arguments become doubles; overflow and non-finite
//! values have no result.

use std::cmp::Ordering;

use crate::builtins::Value;
use crate::model::values::Number::{self, Double, Float, Integer};
use actcheck_base::Term;

/// Returns whether two values are the same term.
pub(crate) fn equal(a: &Term, b: &Term) -> bool {
    a == b
}

/// Compares two numbers by value. Returns `None` if one is not a number.
pub(crate) fn compare(a: &Term, b: &Term) -> Option<Ordering> {
    match (Number::of(a)?, Number::of(b)?) {
        (Integer(a), Integer(b)) => Some(a.cmp(&b)),
        (a, b) => a.double().partial_cmp(&b.double()),
    }
}

pub(super) fn ordered(args: &[Value<'_>], holds: fn(Ordering) -> bool) -> Option<Term> {
    compare(&args[0], &args[1]).map(|order| Term::Boolean(holds(order)))
}

/// Applies an operation to two numbers of the same type, otherwise to both as doubles.
fn pair(
    a: &Term,
    b: &Term,
    integers: fn(i64, i64) -> Option<i64>,
    doubles: fn(f64, f64) -> f64,
) -> Option<Number> {
    Some(match (Number::of(a)?, Number::of(b)?) {
        (Integer(a), Integer(b)) => Integer(integers(a, b)?),
        (Float(a), Float(b)) => Float(doubles(f64::from(a), f64::from(b)) as f32),
        (a, b) => Double(doubles(a.double(), b.double())),
    })
}

fn single(a: &Term, integer: fn(i64) -> Option<i64>, double: fn(f64) -> f64) -> Option<Term> {
    match Number::of(a)? {
        Integer(a) => Integer(integer(a)?),
        Float(a) => Float(double(f64::from(a)) as f32),
        Double(a) => Double(double(a)),
    }
    .term()
}

/// Folds any number of arguments of the same type, otherwise all as doubles.
fn fold(
    args: &[Value<'_>],
    integers: fn(i64, i64) -> Option<i64>,
    doubles: fn(f64, f64) -> f64,
) -> Option<Term> {
    let numbers: Vec<Number> = args.iter().map(|a| Number::of(a)).collect::<Option<_>>()?;
    let first = *numbers.first()?;
    let alike = numbers
        .iter()
        .all(|n| std::mem::discriminant(n) == std::mem::discriminant(&first));
    let start = if alike { first } else { Double(first.double()) };
    numbers[1..]
        .iter()
        .try_fold(start, |sum, number| {
            Some(match (sum, *number) {
                (Integer(a), Integer(b)) => Integer(integers(a, b)?),
                (Float(a), Float(b)) => Float(doubles(f64::from(a), f64::from(b)) as f32),
                (a, b) => Double(doubles(a.double(), b.double())),
            })
        })?
        .term()
}

pub(super) fn sum(args: &[Value<'_>]) -> Option<Term> {
    fold(args, i64::checked_add, |a, b| a + b)
}

pub(super) fn product(args: &[Value<'_>]) -> Option<Term> {
    fold(args, i64::checked_mul, |a, b| a * b)
}

pub(super) fn min(args: &[Value<'_>]) -> Option<Term> {
    fold(args, |a, b| Some(a.min(b)), f64::min)
}

pub(super) fn max(args: &[Value<'_>]) -> Option<Term> {
    fold(args, |a, b| Some(a.max(b)), f64::max)
}

/// Łukasiewicz t-norm of n numbers: max(0, sum − (n − 1)).
pub(super) fn lukasiewicz(args: &[Value<'_>]) -> Option<Term> {
    let numbers: Vec<Number> = args.iter().map(|a| Number::of(a)).collect::<Option<_>>()?;
    let sum: f64 = numbers.iter().map(|n| n.double()).sum();
    Double((sum - (numbers.len() as f64 - 1.0)).max(0.0)).term()
}

pub(super) fn minus(args: &[Value<'_>]) -> Option<Term> {
    pair(&args[0], &args[1], i64::checked_sub, |a, b| a - b)?.term()
}

pub(super) fn division(args: &[Value<'_>]) -> Option<Term> {
    pair(&args[0], &args[1], i64::checked_div, |a, b| a / b)?.term()
}

pub(super) fn inverse(args: &[Value<'_>]) -> Option<Term> {
    single(&args[0], i64::checked_neg, |a| -a)
}

pub(super) fn abs(args: &[Value<'_>]) -> Option<Term> {
    single(&args[0], i64::checked_abs, f64::abs)
}

pub(super) fn sqrt(args: &[Value<'_>]) -> Option<Term> {
    single(&args[0], i64::checked_isqrt, libm::sqrt)
}

pub(super) fn pow(args: &[Value<'_>]) -> Option<Term> {
    pair(
        &args[0],
        &args[1],
        |a, b| a.checked_pow(u32::try_from(b).ok()?),
        libm::pow,
    )?
    .term()
}

/// Logarithm of the first argument to the base of the second.
pub(super) fn log(args: &[Value<'_>]) -> Option<Term> {
    let integers = |a: i64, base: i64| (a > 0 && base >= 2).then(|| i64::from(a.ilog(base)));
    pair(&args[0], &args[1], integers, |a, base| {
        libm::log(a) / libm::log(base)
    })?
    .term()
}

fn real(args: &[Value<'_>], function: fn(f64) -> f64) -> Option<Term> {
    match Number::of(&args[0])? {
        Float(a) => Float(function(f64::from(a)) as f32),
        a => Double(function(a.double())),
    }
    .term()
}

pub(super) fn sin(args: &[Value<'_>]) -> Option<Term> {
    real(args, libm::sin)
}

pub(super) fn cos(args: &[Value<'_>]) -> Option<Term> {
    real(args, libm::cos)
}

pub(super) fn tan(args: &[Value<'_>]) -> Option<Term> {
    real(args, libm::tan)
}

pub(super) fn asin(args: &[Value<'_>]) -> Option<Term> {
    real(args, libm::asin)
}

pub(super) fn acos(args: &[Value<'_>]) -> Option<Term> {
    real(args, libm::acos)
}

pub(super) fn atan2(args: &[Value<'_>]) -> Option<Term> {
    Double(libm::atan2(
        Number::of(&args[0])?.double(),
        Number::of(&args[1])?.double(),
    ))
    .term()
}

pub(super) fn round(args: &[Value<'_>]) -> Option<Term> {
    single(&args[0], Some, f64::round)
}

pub(super) fn ceil(args: &[Value<'_>]) -> Option<Term> {
    single(&args[0], Some, f64::ceil)
}

pub(super) fn floor(args: &[Value<'_>]) -> Option<Term> {
    single(&args[0], Some, f64::floor)
}

pub(super) fn rem(args: &[Value<'_>]) -> Option<Term> {
    pair(&args[0], &args[1], i64::checked_rem, |a, b| a % b)?.term()
}
