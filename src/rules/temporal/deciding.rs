//! The comparisons that decide a formula: as text, and as signals to draw.

use crate::syntax::Comparison;
use crate::temporal::formula::{CheckedFormula, Quantity};
use crate::temporal::semantics::{Reader, compares};
use actcheck_base::{DecidingSignal, Span, names};

/// A part of the reason for which a formula holds or fails.
#[derive(Debug, Clone, Copy)]
pub(super) enum DecidingPart<'f> {
    /// A comparison, or a quantity that is true or false, at a sample.
    Atom {
        at: usize,
        formula: &'f CheckedFormula,
    },
    /// The sample from which on a condition fails.
    Since { at: usize },
    /// The action ends before the interval of an operator begins.
    NoTime,
}

impl DecidingPart<'_> {
    /// Returns the sentence.
    pub(super) fn text(
        &self,
        reader: &Reader<'_>,
        source: &dyn Fn(Span) -> String,
    ) -> Option<String> {
        let (at, formula) = match self {
            Self::Atom { at, formula } => (*at, *formula),
            Self::Since { at } => {
                return Some(format!("fails from {} s on", shown(reader.secs(*at))));
            }
            Self::NoTime => return Some("the action ends before the interval begins".to_owned()),
        };
        let secs = shown(reader.secs(at));
        match formula {
            CheckedFormula::Compare {
                op,
                left,
                right,
                span,
            } => {
                let (left, right) = (
                    *reader.quantity(left)?.get(at)?,
                    *reader.quantity(right)?.get(at)?,
                );
                let verb = if compares(*op, left, right) {
                    "holds"
                } else {
                    "fails"
                };
                let (text, symbol) = (source(span.clone()), op.symbol());
                Some(format!(
                    "at {secs} s, `{text}` {verb} with {} {symbol} {}",
                    shown(left),
                    shown(right)
                ))
            }
            CheckedFormula::Truth { quantity, span } => {
                let holds = *reader.quantity(quantity)?.get(at)? != 0.0;
                let word = if holds { "is" } else { "is not" };
                Some(format!(
                    "at {secs} s, `{}` {word} true",
                    source(span.clone())
                ))
            }
            _ => None,
        }
    }
}

/// Returns a deciding comparison over the whole action; `None` for the other parts.
pub(super) fn deciding_signal(
    decisive: &DecidingPart<'_>,
    reader: &Reader<'_>,
    source: &dyn Fn(Span) -> String,
) -> Option<DecidingSignal> {
    let DecidingPart::Atom { at, formula } = decisive else {
        return None;
    };
    let period_secs = reader.course.period_secs;
    match formula {
        CheckedFormula::Compare {
            op,
            left,
            right,
            span,
        } => {
            let text = source(span.clone());
            let (one, other) = text
                .split_once(&format!(" {} ", op.symbol()))
                .unwrap_or((text.as_str(), ""));
            // A number on the left is a limit, too.
            let swapped = !left.is_recorded() && right.is_recorded();
            let (quantity, signal, limit) = if swapped {
                (other, right, left)
            } else {
                (one, left, right)
            };
            let op = if swapped { mirrored(*op) } else { *op };
            let (values, limit) = (reader.quantity(signal)?, reader.quantity(limit)?);
            let holds: Vec<bool> = values
                .iter()
                .zip(limit.iter())
                .map(|(value, limit)| compares(op, *value, *limit))
                .collect();
            Some(DecidingSignal {
                quantity: readable(quantity),
                unit: unit_of(signal),
                symbol: op.symbol(),
                period_secs,
                interval: around(&holds, *at),
                values: values.to_vec(),
                limit: limit.to_vec(),
                at: *at,
            })
        }
        CheckedFormula::Truth { quantity, span } => {
            let values = reader.quantity(quantity)?;
            let holds: Vec<bool> = values.iter().map(|value| *value != 0.0).collect();
            let (quantity, interval) = (readable(&source(span.clone())), around(&holds, *at));
            Some(DecidingSignal {
                quantity,
                unit: "",
                symbol: "",
                period_secs,
                values: values.to_vec(),
                limit: Vec::new(),
                interval,
                at: *at,
            })
        }
        _ => None,
    }
}

/// The first and the last sample of those around one in which the same holds.
fn around(holds: &[bool], at: usize) -> [usize; 2] {
    let same = |idx: &usize| holds.get(*idx) == holds.get(at);
    let first = (0..=at).rev().take_while(same).last().unwrap_or(at);
    let last = (at..holds.len()).take_while(same).last().unwrap_or(at);
    [first, last]
}

/// Swaps the sides of a comparison.
fn mirrored(op: Comparison) -> Comparison {
    match op {
        Comparison::Less => Comparison::Greater,
        Comparison::LessEqual => Comparison::GreaterEqual,
        Comparison::Greater => Comparison::Less,
        Comparison::GreaterEqual => Comparison::LessEqual,
        Comparison::Equal | Comparison::Unequal => op,
    }
}

/// Shortens the text of a quantity: `w:speed(?object)` is `speed(object)`.
fn readable(text: &str) -> String {
    text.replace("w:", "").replace("obj:", "").replace('?', "")
}

impl Quantity {
    fn is_recorded(&self) -> bool {
        match self {
            Self::Number(_) | Self::Variable(_) => false,
            Self::Recorded { .. } => true,
            Self::Call(_, args) => args.iter().any(Self::is_recorded),
        }
    }
}

/// Returns the unit of a quantity; empty if it has none or if it is not known.
fn unit_of(quantity: &Quantity) -> &'static str {
    match quantity {
        Quantity::Number(_) | Quantity::Variable(_) => "",
        Quantity::Recorded { iri, .. } => match iri.strip_prefix(names::W).unwrap_or_default() {
            "x" | "y" | "z" | "opening" | "baseX" | "baseY" | "believedX" | "believedY"
            | "rise" | "displacement" | "pathLength" | "distance" | "distance2d" | "gap" => "m",
            "vx" | "vy" | "vz" | "speed" | "relativeSpeed" => "m/s",
            "acceleration" | "acceleration2d" | "accelerationZ" => "m/s²",
            "jerk" => "m/s³",
            "tilt" | "yaw" | "baseYaw" | "believedYaw" => "rad",
            "wx" | "wy" | "wz" | "angularSpeed" => "rad/s",
            "contactForce" => "N",
            "time" => "s",
            _ => "",
        },
        Quantity::Call(builtin, args) => match builtin.name {
            "SUM" | "MINUS" | "ABS" | "MIN" | "MAX" | "INVERSE" | "NEGATIVE" => args
                .iter()
                .map(unit_of)
                .find(|unit| !unit.is_empty())
                .unwrap_or(""),
            "ATAN2" | "ATAN" | "ACOS" | "ASIN" => "rad",
            _ => "",
        },
    }
}

/// Formats a number with at most four decimals.
pub(super) fn shown(value: f64) -> String {
    let text = format!("{value:.4}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" {
        "0".to_owned()
    } else {
        text.to_owned()
    }
}
