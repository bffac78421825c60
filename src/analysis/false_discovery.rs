//! The Benjamini–Hochberg correction for multiple tests, which controls the false discovery rate.

/// Returns the Benjamini–Hochberg adjusted p-values, in the order given. If those at or below a
/// level are called findings, the expected share of false findings is at most the level.
///
/// `tried` is the total number of tests. Tests that are not given count as if their p-values were
/// 1, so that the adjusted p-values are upper bounds. A `tried` below the number of given p-values
/// is raised to it.
///
/// Source: Y. Benjamini and Y. Hochberg, "Controlling the false discovery rate", Journal of the
/// Royal Statistical Society B 57 (1995) 289–300.
pub fn benjamini_hochberg(probabilities: &[f64], tried: u64) -> Vec<f64> {
    let tried = tried.max(probabilities.len() as u64) as f64;
    let mut order: Vec<usize> = (0..probabilities.len()).collect();
    order.sort_by(|a, b| probabilities[*a].total_cmp(&probabilities[*b]));
    let mut adjusted = vec![1.0; probabilities.len()];
    let mut smallest = 1.0f64;
    for (rank, place) in order.into_iter().enumerate().rev() {
        // Adjusted p-values must not decrease.
        smallest = smallest.min(probabilities[place] * tried / (rank + 1) as f64);
        adjusted[place] = smallest;
    }
    adjusted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn omitted_hypotheses_count_too() {
        let close = |found: &[f64], wanted: &[f64]| {
            assert!(
                found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-15),
                "{found:?}"
            );
        };
        close(&benjamini_hochberg(&[0.01, 0.04], 2), &[0.02, 0.04]);
        close(&benjamini_hochberg(&[0.04, 0.001], 100), &[1.0, 0.1]);
        close(&benjamini_hochberg(&[0.01, 0.04], 0), &[0.02, 0.04]);
        assert!(benjamini_hochberg(&[], 7).is_empty());
    }
}
