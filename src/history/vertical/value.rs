//! Values in expressions, and how the evaluator compares them.

use std::borrow::Cow;
use std::cmp::Ordering;

use oxigraph::model::vocab::xsd;
use oxigraph::model::{NamedNode, Term};

use crate::vertical::column::Value;
use crate::vertical::stop::{Stop, unfit};

/// Largest number of digits of a decimal that a double has exactly.
const MOST_DIGITS: usize = 15;

/// A value in an expression.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Cell<'a> {
    Iri(Cow<'a, str>),
    Text(Cow<'a, str>),
    Integer(i64),
    Double(f64),
    /// Its value as a double, which has all of its digits.
    Decimal(f64),
    Boolean(bool),
    /// Any other term.
    Other(&'a Term),
}

impl<'a> Cell<'a> {
    pub(super) fn of(value: &'a Value) -> Self {
        match value {
            Value::Double(bits) => Self::Double(f64::from_bits(*bits)),
            Value::Integer(number) => Self::Integer(*number),
            Value::Boolean(value) => Self::Boolean(*value),
            Value::Term(term) => match term {
                Term::NamedNode(node) => Self::Iri(Cow::Borrowed(node.as_str())),
                Term::Literal(literal) if literal.datatype() == xsd::STRING => {
                    Self::Text(Cow::Borrowed(literal.value()))
                }
                Term::Literal(literal) if literal.datatype() == xsd::DECIMAL => {
                    decimal(literal.value()).map_or(Self::Other(term), Self::Decimal)
                }
                other => Self::Other(other),
            },
        }
    }

    /// The value from which the same term can be made.
    pub(super) fn value(&self) -> Result<Value, Stop> {
        Ok(match self {
            Self::Iri(iri) => Value::Term(NamedNode::new_unchecked(iri.as_ref()).into()),
            Self::Text(text) => {
                Value::Term(oxigraph::model::Literal::new_simple_literal(text.as_ref()).into())
            }
            Self::Integer(number) => Value::Integer(*number),
            Self::Double(number) => Value::Double(number.to_bits()),
            Self::Decimal(_) => return unfit("a decimal"),
            Self::Boolean(value) => Value::Boolean(*value),
            Self::Other(term) => Value::Term((*term).clone()),
        })
    }

    /// Its text, as `STR` has it; `None` if it is an error.
    pub(super) fn text(self) -> Result<Option<Cow<'a, str>>, Stop> {
        Ok(match self {
            Self::Iri(text) | Self::Text(text) => Some(text),
            Self::Other(Term::Literal(literal)) => Some(Cow::Borrowed(literal.value())),
            Self::Other(_) => None,
            number => match number.value()?.term() {
                Term::Literal(literal) => Some(Cow::Owned(literal.destruct().0)),
                _ => None,
            },
        })
    }

    fn number(&self) -> Option<f64> {
        match self {
            Self::Integer(number) => Some(*number as f64),
            Self::Double(number) | Self::Decimal(number) => Some(*number),
            _ => None,
        }
    }

    /// Whether a condition with this value holds; `None` if it is an error.
    pub(super) fn truth(&self) -> Result<Option<bool>, Stop> {
        Ok(match self {
            Self::Boolean(value) => Some(*value),
            Self::Text(text) => Some(!text.is_empty()),
            Self::Integer(number) => Some(*number != 0),
            Self::Double(number) | Self::Decimal(number) => {
                Some(*number != 0.0 && !number.is_nan())
            }
            Self::Iri(_) => None,
            Self::Other(_) => return unfit("a condition on a value of a rare type"),
        })
    }

    /// Whether two values are equal, as `=` has it.
    pub(super) fn equals(&self, other: &Self) -> Result<Option<bool>, Stop> {
        Ok(Some(match (self, other) {
            (Self::Iri(one), Self::Iri(other)) => one == other,
            (Self::Text(one), Self::Text(other)) => one == other,
            (Self::Boolean(one), Self::Boolean(other)) => one == other,
            (Self::Integer(one), Self::Integer(other)) => one == other,
            (Self::Other(one), Self::Other(other)) => match (moment(one), moment(other)) {
                _ if one == other => true,
                (Some(one), Some(other)) => one == other,
                _ => return unfit("a comparison of values of a rare type"),
            },
            (Self::Other(_), _) | (_, Self::Other(_)) => {
                return unfit("a comparison of values of a rare type");
            }
            _ => match (self.number(), other.number()) {
                (Some(one), Some(other)) => one == other,
                // Of different kinds.
                _ => false,
            },
        }))
    }

    /// The order of two values, as `<` has it; `None` if it is an error.
    pub(super) fn compare(&self, other: &Self) -> Result<Option<Ordering>, Stop> {
        Ok(match (self, other) {
            (Self::Text(one), Self::Text(other)) => Some(one.cmp(other)),
            (Self::Boolean(one), Self::Boolean(other)) => Some(one.cmp(other)),
            (Self::Integer(one), Self::Integer(other)) => Some(one.cmp(other)),
            (Self::Other(one), Self::Other(other)) => match (moment(one), moment(other)) {
                (Some(one), Some(other)) => Some(one.cmp(&other)),
                _ => return unfit("a comparison of values of a rare type"),
            },
            _ => match (self.number(), other.number()) {
                (Some(one), Some(other)) => one.partial_cmp(&other),
                _ => return unfit("a comparison of values of different types"),
            },
        })
    }

    /// The order of two values in `ORDER BY`, `MIN` and `MAX`. IRIs come before literals.
    pub(super) fn order(&self, other: &Self) -> Result<Ordering, Stop> {
        match (self, other) {
            (Self::Iri(one), Self::Iri(other)) => Ok(one.cmp(other)),
            (Self::Iri(_), _) => Ok(Ordering::Less),
            (_, Self::Iri(_)) => Ok(Ordering::Greater),
            _ => match self.compare(other)? {
                Some(order) => Ok(order),
                None => unfit("the order of values that are not numbers"),
            },
        }
    }
}

/// A value in the form in which equal values are the same; `None` if its type is not known here.
pub(super) fn canonical(value: &Value) -> Option<Cow<'_, Value>> {
    let Value::Term(Term::Literal(literal)) = value else {
        return Some(Cow::Borrowed(value));
    };
    if literal.language().is_some() || literal.datatype() == xsd::STRING {
        return Some(Cow::Borrowed(value));
    }
    let Value::Term(term) = value else {
        return None;
    };
    let (seconds, fraction) = moment(term)?;
    let dot = if fraction.is_empty() { "" } else { "." };
    let text = format!("{seconds}{dot}{fraction}Z");
    Some(Cow::Owned(Value::Term(
        oxigraph::model::Literal::new_typed_literal(text, xsd::DATE_TIME).into(),
    )))
}

/// The double of a decimal with few digits.
fn decimal(text: &str) -> Option<f64> {
    let digits = text.bytes().filter(u8::is_ascii_digit).count();
    (digits <= MOST_DIGITS).then(|| text.parse().ok())?
}

/// A point in time in UTC, for comparison: up to the second, and the digits of its fraction.
fn moment(term: &Term) -> Option<(&str, &str)> {
    let Term::Literal(literal) = term else {
        return None;
    };
    if literal.datatype() != xsd::DATE_TIME {
        return None;
    }
    let (seconds, rest) = literal.value().split_at_checked(19)?;
    let shape = |(at, byte): (usize, u8)| match at {
        4 | 7 => byte == b'-',
        10 => byte == b'T',
        13 | 16 => byte == b':',
        _ => byte.is_ascii_digit(),
    };
    let rest = rest.strip_suffix('Z')?;
    let fraction = if rest.is_empty() {
        ""
    } else {
        rest.strip_prefix('.')?.trim_end_matches('0')
    };
    let is_plain = seconds.bytes().enumerate().all(shape)
        && fraction.bytes().all(|byte| byte.is_ascii_digit());
    is_plain.then_some((seconds, fraction))
}

#[cfg(test)]
mod tests {
    use super::*;
    use oxigraph::model::Literal;

    #[test]
    fn times_are_compared_by_their_moment() {
        let time = |text: &str| Term::from(Literal::new_typed_literal(text, xsd::DATE_TIME));
        let order = |one: &str, other: &str| {
            let (one, other) = (time(one), time(other));
            Cell::Other(&one)
                .compare(&Cell::Other(&other))
                .ok()
                .flatten()
        };
        assert_eq!(
            order("2026-01-01T00:00:00Z", "2026-01-01T00:00:00.5Z"),
            Some(Ordering::Less)
        );
        assert_eq!(
            order("2026-01-01T00:00:00.50Z", "2026-01-01T00:00:00.5Z"),
            Some(Ordering::Equal)
        );
        assert_eq!(
            order("2026-01-01T00:00:00.123Z", "2026-01-01T00:00:00.13Z"),
            Some(Ordering::Less)
        );
        assert_eq!(
            order("2026-01-01T00:00:00+01:00", "2026-01-01T00:00:00Z"),
            None
        );
    }
}
