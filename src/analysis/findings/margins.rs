//! Quantiles of margins.

use serde::Serialize;

/// Quantiles of numbers, in their unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Quantiles {
    /// Number of values.
    pub count: u64,
    /// Minimum.
    pub least: f64,
    /// 5th percentile.
    pub p05: f64,
    /// 25th percentile.
    pub p25: f64,
    /// Median.
    pub p50: f64,
    /// 75th percentile.
    pub p75: f64,
    /// 95th percentile.
    pub p95: f64,
    /// Maximum.
    pub most: f64,
}

/// Returns the quantiles of the finite numbers, or `None` if there are none.
///
/// Interpolates linearly (type 7 of Hyndman and Fan, "Sample quantiles in statistical packages",
/// The American Statistician 50 (1996) 361–365).
pub fn quantiles(numbers: impl IntoIterator<Item = f64>) -> Option<Quantiles> {
    let mut sorted: Vec<f64> = numbers
        .into_iter()
        .filter(|number| number.is_finite())
        .collect();
    sorted.sort_by(f64::total_cmp);
    let (first, last) = (*sorted.first()?, *sorted.last()?);
    let at = |share: f64| {
        let place = share * (sorted.len() - 1) as f64;
        let (below, part) = (place.floor() as usize, place - place.floor());
        let above = sorted[(below + 1).min(sorted.len() - 1)];
        sorted[below] + part * (above - sorted[below])
    };
    Some(Quantiles {
        count: sorted.len() as u64,
        least: first,
        p05: at(0.05),
        p25: at(0.25),
        p50: at(0.5),
        p75: at(0.75),
        p95: at(0.95),
        most: last,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference values from `numpy.quantile`.
    #[test]
    fn quantiles_equal_numpys() {
        let found = quantiles([4.0, 1.0, f64::NAN, 3.0, 2.0]).expect("the values are not empty");
        assert_eq!((found.count, found.least, found.most), (4, 1.0, 4.0));
        for (found, wanted) in [
            (found.p05, 1.15),
            (found.p25, 1.75),
            (found.p50, 2.5),
            (found.p75, 3.25),
            (found.p95, 3.85),
        ] {
            assert!((found - wanted).abs() < 1e-12, "{found} {wanted}");
        }
        assert_eq!(quantiles([f64::NAN]), None);
    }
}
