//! Fisher's exact test for 2 × 2 tables.

/// Relative tolerance of table weights: rounding must not separate tables that are equal by
/// symmetry.
const ALIKE: f64 = 1e-9;

/// Failures and passes within a group and outside it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct TwoByTwo {
    /// Failed within.
    pub failed_in: u64,
    /// Passed within.
    pub passed_in: u64,
    /// Failed outside.
    pub failed_out: u64,
    /// Passed outside.
    pub passed_out: u64,
}

/// Results of Fisher's exact test: p-values under the hypothesis that the failure rates within and
/// outside are equal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FisherTest {
    /// P-value of at least as many failures within.
    pub greater: f64,
    /// P-value of at most as many failures within.
    pub less: f64,
    /// P-value of tables that are at most as probable as this one.
    pub two_sided: f64,
}

impl TwoByTwo {
    /// Counts one run.
    pub fn add(&mut self, within: bool, failed: bool) {
        *match (within, failed) {
            (true, true) => &mut self.failed_in,
            (true, false) => &mut self.passed_in,
            (false, true) => &mut self.failed_out,
            (false, false) => &mut self.passed_out,
        } += 1;
    }

    /// Performs the exact test.
    ///
    /// Source: R. A. Fisher, "The logic of inductive inference", Journal of the Royal Statistical
    /// Society 98 (1935) 39–82. The probabilities are summed from the most probable table outwards,
    /// each as a multiple of its neighbour, so that small ones keep all their digits (one minus a
    /// sum of large ones would lose them). Values below 1e-300 become 0.
    pub fn fisher(&self) -> FisherTest {
        let within = self.failed_in + self.passed_in;
        let failed = self.failed_in + self.failed_out;
        let all = within + self.failed_out + self.passed_out;
        let (least, most) = ((within + failed).saturating_sub(all), within.min(failed));
        let mode = most_probable(within, failed, all).clamp(least, most);
        // Ratio of the probability with one more failure within to the current one.
        let step = |inside: u64| {
            let [inside, within, failed, all] =
                [inside, within, failed, all].map(|count| count as f64);
            (within - inside) * (failed - inside)
                / ((inside + 1.0) * (all - within - failed + inside + 1.0))
        };
        let upwards = [vec![1.0], outwards((mode..most).map(step))].concat();
        let downwards = outwards((least..mode).rev().map(|inside| 1.0 / step(inside)));
        let weight = |inside: u64| {
            let (side, at) = if inside >= mode {
                (&upwards, inside - mode)
            } else {
                (&downwards, mode - inside - 1)
            };
            usize::try_from(at)
                .ok()
                .and_then(|at| side.get(at))
                .copied()
                .unwrap_or(0.0)
        };
        let upwards_from = |start: u64| {
            (start..=mode + upwards.len() as u64 - 1)
                .rev()
                .map(weight)
                .sum::<f64>()
        };
        let start = mode.saturating_sub(downwards.len() as u64);
        let downwards_from = |end: u64| (start..=end).map(weight).sum::<f64>();
        let total = upwards_from(start);
        let seen = weight(self.failed_in);
        let rare = |weight: &&f64| **weight <= seen * (1.0 + ALIKE);
        let two_sided = upwards.iter().rev().filter(rare).sum::<f64>()
            + downwards.iter().rev().filter(rare).sum::<f64>();
        let share = |weights: f64| (weights / total).clamp(0.0, 1.0);
        FisherTest {
            greater: share(upwards_from(self.failed_in)),
            less: share(downwards_from(self.failed_in)),
            two_sided: share(two_sided),
        }
    }
}

/// Returns the most probable number of failures within.
fn most_probable(within: u64, failed: u64, all: u64) -> u64 {
    let product = (u128::from(within) + 1) * (u128::from(failed) + 1);
    u64::try_from(product / (u128::from(all) + 2)).unwrap_or(u64::MAX)
}

/// Returns the weights on one side of the mode, relative to the mode, until they underflow.
fn outwards(ratios: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut weights = Vec::new();
    let mut weight = 1.0;
    for ratio in ratios {
        weight *= ratio;
        if weight < f64::MIN_POSITIVE {
            break;
        }
        weights.push(weight);
    }
    weights
}
