//! Counter-based random numbers: each value is a function of a seed and an index, independent of
//! the order of calls.

/// A stateless sequence of random numbers with random access.
///
/// Source: SplitMix64 (Steele, Lea and Flood, "Fast splittable pseudorandom number generators",
/// 2014).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stream(u64);

/// 2⁶⁴ divided by the golden ratio, made odd: steps of this size visit every 64-bit number once.
const STEP: u64 = 0x9e37_79b9_7f4a_7c15;
/// Inverse of √(4/12), the standard deviation of the sum of four uniform numbers.
const TO_UNIT_DEVIATION: f64 = 1.732_050_807_568_877_2;

impl Stream {
    /// Creates the sequence of a seed.
    pub fn new(seed: u64) -> Self {
        Self(mixed(seed.wrapping_add(STEP)))
    }

    /// Returns 64 random bits.
    pub fn bits(self, number: u64) -> u64 {
        mixed(self.0.wrapping_add(number.wrapping_mul(STEP)))
    }

    /// Returns a number in [0, 1).
    pub fn unit(self, number: u64) -> f64 {
        (self.bits(number) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Returns approximately normal noise with mean 0 and standard deviation 1, within ±3.47: the
    /// scaled sum of four uniform numbers. This needs no logarithm or root, so that noise for a
    /// whole image takes a millisecond.
    pub fn bell(self, number: u64) -> f64 {
        let bits = self.bits(number);
        let sum = (0..4)
            .map(|part| (bits >> (16 * part)) & 0xffff)
            .sum::<u64>();
        (sum as f64 / 65_536.0 - (2.0 - 2.0 / 65_536.0)) * TO_UNIT_DEVIATION
    }
}

fn mixed(mut bits: u64) -> u64 {
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_depend_only_on_seed_and_position() {
        let stream = Stream::new(7);
        let forwards: Vec<u64> = (0..100).map(|number| stream.bits(number)).collect();
        let mut backwards: Vec<u64> = (0..100).rev().map(|number| stream.bits(number)).collect();
        backwards.reverse();
        assert_eq!(forwards, backwards);
        assert_ne!(forwards[0], Stream::new(8).bits(0));
    }

    #[test]
    fn noise_has_the_given_spread_and_is_uncorrelated() {
        let stream = Stream::new(3);
        let values: Vec<f64> = (0..100_000).map(|number| stream.bell(number)).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64;
        let together =
            values.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / values.len() as f64;
        assert!(mean.abs() < 0.01, "{mean}");
        assert!((variance - 1.0).abs() < 0.02, "{variance}");
        assert!(together.abs() < 0.01, "{together}");
        assert!(values.iter().all(|value| value.abs() < 3.47));
        let mean = (0..100_000).map(|number| stream.unit(number)).sum::<f64>() / 1e5;
        assert!((mean - 0.5).abs() < 0.005, "{mean}");
    }
}
