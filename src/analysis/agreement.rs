//! How often two judges agree: two physics engines, or the rules and people.

use crate::{Interval, wilson};

/// How often two judges agree.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Agreement {
    /// Number of agreements.
    pub agree: u64,
    /// Number of comparisons.
    pub of: u64,
}

impl Agreement {
    /// Counts a comparison.
    pub(crate) fn add(&mut self, agrees: bool) {
        self.agree += u64::from(agrees);
        self.of += 1;
    }

    /// The share with its 95 % interval; `None` without comparisons.
    pub fn interval(self) -> Option<Interval> {
        wilson(self.agree, self.of)
    }
}
