//! Confidence intervals of rates.

use serde::Serialize;

/// The 97.5 % quantile of the normal distribution, for 95 % intervals.
const Z: f64 = 1.959_963_984_540_054;

/// A rate with its 95 % confidence interval. All three lie in [0, 1].
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Interval {
    /// Successes divided by trials.
    pub rate: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Computes Wilson's score interval (1927), which is valid for few trials and for rates of 0 and 1.
/// Returns `None` without trials.
///
/// `successes` is clamped to `trials`.
pub fn wilson(successes: u64, trials: u64) -> Option<Interval> {
    if trials == 0 {
        return None;
    }
    #[expect(
        clippy::cast_precision_loss,
        reason = "counts of runs are far below 2^52"
    )]
    let (successes, trials) = (successes.min(trials) as f64, trials as f64);
    wilson_share(successes / trials, trials)
}

/// Computes Wilson's interval for a rate and a number of trials that need not be an integer.
///
/// Returns `None` if `trials` is not positive or the rate is outside [0, 1].
pub fn wilson_share(rate: f64, trials: f64) -> Option<Interval> {
    if trials <= 0.0 || !(0.0..=1.0).contains(&rate) {
        return None;
    }
    let denominator = 1.0 + Z * Z / trials;
    let centre = (rate + Z * Z / (2.0 * trials)) / denominator;
    let half = Z / denominator
        * libm::sqrt(rate * (1.0 - rate) / trials + Z * Z / (4.0 * trials * trials));
    // At rates of 0 and 1, the end equals the rate exactly; avoid rounding errors.
    let low = if rate == 0.0 {
        0.0
    } else {
        (centre - half).max(0.0)
    };
    let high = if rate == 1.0 {
        1.0
    } else {
        (centre + half).min(1.0)
    };
    Some(Interval { rate, low, high })
}

/// Returns the number of trials after which the interval is at most `width` wide at any rate.
///
/// Source: the interval is widest at a rate of one half, where its width is z / √(n + z²).
pub fn trials_for_width(width: f64) -> u64 {
    let trials = Z * Z * (1.0 / (width * width) - 1.0);
    if trials.is_finite() && trials < 1e18 {
        trials.max(1.0).ceil() as u64
    } else {
        u64::MAX
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Examples of Newcombe (1998), "Two-sided confidence intervals for the single proportion",
    /// table I, method 3.
    #[test]
    fn intervals_match_published_values() {
        for (successes, trials, low, high) in [
            (81, 263, 0.2553, 0.3662),
            (15, 148, 0.0624, 0.1605),
            (0, 20, 0.0, 0.1611),
            (1, 29, 0.0061, 0.1718),
        ] {
            let interval = wilson(successes, trials).expect("the trials are not zero");
            assert!((interval.low - low).abs() < 5e-5, "{interval:?}");
            assert!((interval.high - high).abs() < 5e-5, "{interval:?}");
        }
    }

    #[test]
    fn the_number_of_trials_for_a_width_is_sufficient() {
        for width in [0.02, 0.05, 0.1, 0.3] {
            let trials = trials_for_width(width).next_multiple_of(2);
            let spread = |trials| {
                wilson(trials / 2, trials).map_or(1.0, |interval| interval.high - interval.low)
            };
            assert!(
                spread(trials) <= width && spread(trials - 4) > width,
                "{width}: {trials}"
            );
        }
        assert_eq!(
            (trials_for_width(1.0), trials_for_width(0.0)),
            (1, u64::MAX)
        );
    }

    #[test]
    fn extreme_counts_have_limits_of_exactly_0_and_1() {
        let all = wilson(20, 20).expect("the trials are not zero");
        assert_eq!((all.rate, all.high), (1.0, 1.0));
        assert!((all.low - (1.0 - 0.1611)).abs() < 5e-5);
        assert_eq!(wilson(0, 20).expect("the trials are not zero").low, 0.0);
        assert_eq!(wilson(0, 0), None);
        assert_eq!(wilson(3, 2), wilson(2, 2));
    }
}
