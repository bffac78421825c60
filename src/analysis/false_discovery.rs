//! Many tests at once, when some false findings among many true ones are bearable.

/// Benjamini and Hochberg's adjusted probabilities, in the order given: if each of those at or below a level is called a finding, the
/// share of false ones among the findings is at most the level on average.
///
/// `tried`: how many tests there were in all. Those that are not given count as if nothing at all spoke for them, so that the
/// adjusted probabilities are upper bounds; fewer than given count as given.
///
/// Source: Y. Benjamini and Y. Hochberg, "Controlling the false discovery rate", Journal of the Royal Statistical Society B 57 (1995)
/// 289–300.
pub fn benjamini_hochberg(probabilities: &[f64], tried: u64) -> Vec<f64> {
    let tried = tried.max(probabilities.len() as u64) as f64;
    let mut order: Vec<usize> = (0..probabilities.len()).collect();
    order.sort_by(|a, b| probabilities[*a].total_cmp(&probabilities[*b]));
    let mut adjusted = vec![1.0; probabilities.len()];
    let mut smallest = 1.0f64;
    for (rank, place) in order.into_iter().enumerate().rev() {
        // None may be less sure than one with a larger probability.
        smallest = smallest.min(probabilities[place] * tried / (rank + 1) as f64);
        adjusted[place] = smallest;
    }
    adjusted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_given_counts_too() {
        let close = |found: &[f64], wanted: &[f64]| {
            assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-15), "{found:?}");
        };
        close(&benjamini_hochberg(&[0.01, 0.04], 2), &[0.02, 0.04]);
        close(&benjamini_hochberg(&[0.04, 0.001], 100), &[1.0, 0.1]);
        close(&benjamini_hochberg(&[0.01, 0.04], 0), &[0.02, 0.04]);
        assert!(benjamini_hochberg(&[], 7).is_empty());
    }
}
