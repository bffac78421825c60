//! A condition on one parameter.

use crate::patterns::{PatternInput, Values};

/// A condition on one parameter of a scene.
#[derive(Debug, Clone, PartialEq)]
pub enum Condition {
    /// The value is of this kind or a subkind.
    Kind {
        /// Index of the parameter.
        parameter: usize,
        /// Name of the kind.
        kind: String,
    },
    /// The value is in a range. Without both ends: the parameter has a value.
    Range {
        /// Index of the parameter.
        parameter: usize,
        /// Inclusive lower end.
        low: Option<f64>,
        /// Exclusive upper end.
        high: Option<f64>,
    },
    /// A direction is in an arc that contains ±π: it is at least `from`, or less than `to`.
    Arc {
        /// Index of the parameter.
        parameter: usize,
        /// Inclusive start of the arc. Unit: radians.
        from: f64,
        /// Exclusive end of the arc, less than `from`. Unit: radians.
        to: f64,
    },
}

impl Condition {
    /// Index of the parameter.
    pub fn parameter(&self) -> usize {
        match self {
            Self::Kind { parameter, .. }
            | Self::Range { parameter, .. }
            | Self::Arc { parameter, .. } => *parameter,
        }
    }

    /// Returns for each run whether the condition holds. A run without a value for the parameter
    /// satisfies no condition on it.
    pub fn holds(&self, input: &PatternInput) -> Vec<bool> {
        match (self, &input.parameters[self.parameter()].values) {
            (Self::Range { low, high, .. }, Values::Numbers(numbers) | Values::Angles(numbers)) => {
                numbers
                    .iter()
                    .map(|value| {
                        !value.is_nan()
                            && low.is_none_or(|low| *value >= low)
                            && high.is_none_or(|high| *value < high)
                    })
                    .collect()
            }
            (
                Self::Kind { kind, .. },
                Values::Kinds {
                    of_run,
                    names,
                    above,
                },
            ) => {
                let belongs: Vec<bool> = names
                    .iter()
                    .zip(above)
                    .map(|(name, above)| name == kind || above.contains(kind))
                    .collect();
                of_run
                    .iter()
                    .map(|of| of.is_some_and(|of| belongs[of as usize]))
                    .collect()
            }
            (Self::Arc { from, to, .. }, Values::Angles(angles)) => angles
                .iter()
                .map(|angle| angle >= from || angle < to)
                .collect(),
            // A condition of the wrong type holds for no run.
            _ => vec![false; input.len()],
        }
    }

    /// Returns weaker conditions: without the lower end, without the upper end, or `None` for no
    /// condition.
    pub(super) fn weaker(&self) -> Vec<Option<Self>> {
        match self {
            Self::Range {
                parameter,
                low: low @ Some(_),
                high: high @ Some(_),
            } => vec![
                Some(Self::Range {
                    parameter: *parameter,
                    low: None,
                    high: *high,
                }),
                Some(Self::Range {
                    parameter: *parameter,
                    low: *low,
                    high: None,
                }),
            ],
            _ => vec![None],
        }
    }
}

/// Returns for each run whether all conditions hold.
pub(super) fn all_hold(conditions: &[Condition], input: &PatternInput) -> Vec<bool> {
    let mut holds = vec![true; input.len()];
    for condition in conditions {
        for (all, one) in holds.iter_mut().zip(condition.holds(input)) {
            *all &= one;
        }
    }
    holds
}

/// Returns the number with the fewest decimals in (`low`, `high`]: a readable bound between two
/// values.
pub fn simplest_between(low: f64, high: f64) -> f64 {
    for digits in 0..16 {
        let scale = libm::exp10(f64::from(digits));
        // Dividing by a power of ten gives the number nearest to the decimal.
        let candidate = (high * scale).floor() / scale;
        if candidate > low && candidate <= high {
            return candidate;
        }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_the_simplest_numbers() {
        assert_eq!(simplest_between(0.3487, 0.3512), 0.35);
        assert_eq!(simplest_between(2.0, 3.0), 3.0);
        assert_eq!(simplest_between(-0.27, -0.13), -0.2);
        assert_eq!(simplest_between(-1.5, 1.5), 1.0);
        let (low, high) = (1.0, 1.0 + f64::EPSILON);
        assert_eq!(simplest_between(low, high), high);
    }
}
