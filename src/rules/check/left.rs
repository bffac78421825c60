//! The numbers that comparisons leave for a variable or a quantity.

use crate::syntax::Comparison;

/// The numbers that some comparisons leave for a variable or a quantity.
#[derive(Debug, Clone)]
pub(super) struct Left {
    low: f64,
    high: f64,
    /// Whether the bounds themselves are left.
    closed: [bool; 2],
    excluded: Vec<f64>,
}

impl Default for Left {
    fn default() -> Self {
        Self {
            low: f64::NEG_INFINITY,
            high: f64::INFINITY,
            closed: [true; 2],
            excluded: Vec::new(),
        }
    }
}

impl Left {
    /// Keeps only the numbers for which a comparison with `number` holds.
    pub(super) fn keep(&mut self, op: Comparison, number: f64) {
        let closes = matches!(
            op,
            Comparison::Equal | Comparison::LessEqual | Comparison::GreaterEqual
        );
        if op == Comparison::Unequal {
            self.excluded.push(number);
        }
        if matches!(
            op,
            Comparison::Equal | Comparison::Greater | Comparison::GreaterEqual
        ) && number >= self.low
        {
            self.closed[0] = closes && (number > self.low || self.closed[0]);
            self.low = number;
        }
        if matches!(
            op,
            Comparison::Equal | Comparison::Less | Comparison::LessEqual
        ) && number <= self.high
        {
            self.closed[1] = closes && (number < self.high || self.closed[1]);
            self.high = number;
        }
    }

    /// Whether no number is left.
    pub(super) fn is_empty(&self) -> bool {
        self.low > self.high
            || (self.low == self.high
                && (self.closed != [true; 2] || self.excluded.contains(&self.low)))
    }
}
