//! Confidence interval of a mean score.

use statrs::distribution::{ContinuousCDF as _, StudentsT};

use crate::Interval;

/// Returns the mean of the finite scores with Student's 95 % interval, clamped to [0, 1], or `None`
/// for fewer than two scores.
pub fn score_interval(scores: impl IntoIterator<Item = f64>) -> Option<Interval> {
    let scores: Vec<f64> = scores
        .into_iter()
        .filter(|score| score.is_finite())
        .collect();
    let count = scores.len() as f64;
    let rate = scores.iter().sum::<f64>() / count;
    let squares: f64 = scores
        .iter()
        .map(|score| (score - rate) * (score - rate))
        .sum();
    let student = StudentsT::new(0.0, 1.0, count - 1.0).ok()?;
    let half = student.inverse_cdf(0.975) * libm::sqrt(squares / (count - 1.0) / count);
    Some(Interval {
        rate,
        low: (rate - half).max(0.0),
        high: (rate + half).min(1.0),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference values from `scipy.stats.t.interval`.
    #[test]
    fn the_interval_of_four_scores_equals_scipys() {
        let found =
            score_interval([0.1, 0.2, 0.3, 0.4, f64::NAN]).expect("four scores are numbers");
        for (value, known) in [
            (found.rate, 0.25),
            (found.low, 0.044_573_974_323_919_5),
            (found.high, 0.455_426_025_676_080_5),
        ] {
            assert!((value - known).abs() < 1e-9, "{value} {known}");
        }
        assert_eq!(score_interval([0.5]), None);
        assert_eq!(score_interval([]), None);
        assert_eq!(
            score_interval([1.0, 1.0]).map(|found| (found.low, found.high)),
            Some((1.0, 1.0))
        );
    }
}
