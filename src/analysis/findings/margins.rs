//! How margins are spread.

use serde::Serialize;

/// Quantiles of numbers. Unit: theirs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Quantiles {
    /// How many numbers there are.
    pub count: u64,
    /// The smallest.
    pub least: f64,
    /// A twentieth lies below.
    pub p05: f64,
    /// A quarter lies below.
    pub p25: f64,
    /// The median.
    pub p50: f64,
    /// A quarter lies above.
    pub p75: f64,
    /// A twentieth lies above.
    pub p95: f64,
    /// The largest.
    pub most: f64,
}

/// Quantiles of the numbers that are finite; nothing where there is none.
///
/// Between two numbers by their distance (type 7 of Hyndman and Fan, "Sample quantiles in statistical packages", The American
/// Statistician 50 (1996) 361–365).
pub fn quantiles(numbers: impl IntoIterator<Item = f64>) -> Option<Quantiles> {
    let mut sorted: Vec<f64> = numbers.into_iter().filter(|number| number.is_finite()).collect();
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

    /// As `numpy.quantile` gives them.
    #[test]
    fn quantiles_are_the_usual_ones() {
        let found = quantiles([4.0, 1.0, f64::NAN, 3.0, 2.0]).expect("there are numbers");
        assert_eq!((found.count, found.least, found.most), (4, 1.0, 4.0));
        for (found, wanted) in
            [(found.p05, 1.15), (found.p25, 1.75), (found.p50, 2.5), (found.p75, 3.25), (found.p95, 3.85)]
        {
            assert!((found - wanted).abs() < 1e-12, "{found} {wanted}");
        }
        assert_eq!(quantiles([f64::NAN]), None);
    }
}
