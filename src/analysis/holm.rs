//! Holm's correction for multiple tests, which controls the family-wise error rate.

/// Returns Holm's adjusted p-values, in the order given. If those at or below a level are called
/// findings, the probability of any false finding is at most the level, regardless of dependences
/// between the tests.
///
/// Source: S. Holm, "A simple sequentially rejective multiple test procedure", Scandinavian Journal
/// of Statistics 6 (1979) 65–70.
pub fn holm(probabilities: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..probabilities.len()).collect();
    order.sort_by(|a, b| probabilities[*a].total_cmp(&probabilities[*b]));
    let mut adjusted = vec![1.0; probabilities.len()];
    let mut largest = 0.0f64;
    for (rank, place) in order.into_iter().enumerate() {
        let left = (probabilities.len() - rank) as f64;
        // Adjusted p-values must not decrease.
        largest = largest.max(probabilities[place] * left).min(1.0);
        adjusted[place] = largest;
    }
    adjusted
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Computed by hand: 4 × 0.005, 3 × 0.01, 2 × 0.03, and 0.04, which must not be adjusted below
    /// 0.03's value.
    #[test]
    fn adjusted_p_values_match_a_calculation_by_hand() {
        let adjusted = holm(&[0.01, 0.04, 0.03, 0.005]);
        for (found, wanted) in adjusted.iter().zip([0.03, 0.06, 0.06, 0.02]) {
            assert!((found - wanted).abs() < 1e-15, "{adjusted:?}");
        }
        assert_eq!(holm(&[0.9, 0.6]), [1.0, 1.0]);
        assert_eq!(holm(&[0.2]), [0.2]);
        assert!(holm(&[]).is_empty());
    }
}
