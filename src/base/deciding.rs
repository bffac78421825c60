//! The signals that decide a formula about time.

/// A comparison that decides a formula, or a quantity that is true or false, over a whole action.
#[derive(Debug, Clone, PartialEq)]
pub struct DecidingSignal {
    /// The quantity as written in the rule.
    pub quantity: String,
    /// Its unit, such as `m/s`; empty if it has none.
    pub unit: &'static str,
    /// Symbol of the comparison with the limit; empty for a quantity that is true or false.
    pub symbol: &'static str,
    /// Time between two samples. Unit: seconds.
    pub period_secs: f64,
    /// The quantity at each sample.
    pub values: Vec<f64>,
    /// The value that it is compared with: one for each sample.
    pub limit: Vec<f64>,
    /// First and last sample of the interval around the moment in which the comparison stays as it
    /// is there.
    pub interval: [usize; 2],
    /// The deciding sample.
    pub at: usize,
}

impl DecidingSignal {
    /// The deciding moment, since the action began. Unit: seconds.
    pub fn at_secs(&self) -> f64 {
        self.at as f64 * self.period_secs
    }

    /// The interval around the deciding moment, since the action began. Unit: seconds.
    pub fn interval_secs(&self) -> [f64; 2] {
        self.interval.map(|idx| idx as f64 * self.period_secs)
    }

    /// The limit, if it is the same at every sample.
    pub fn constant_limit(&self) -> Option<f64> {
        let first = *self.limit.first()?;
        self.limit
            .iter()
            .all(|value| *value == first)
            .then_some(first)
    }

    /// Smallest and largest finite value of the quantity and of its limit.
    pub fn range(&self) -> [f64; 2] {
        let finite = self
            .values
            .iter()
            .chain(&self.limit)
            .copied()
            .filter(|value| value.is_finite());
        let range = finite.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], one| {
            [low.min(one), high.max(one)]
        });
        if range[0] <= range[1] {
            range
        } else {
            [0.0, 1.0]
        }
    }
}
