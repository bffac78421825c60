//! Point sets that fill the cube independently of margins.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Returns a separate generator for each purpose and index, so that purposes don't affect each
/// other's numbers.
pub(crate) fn stream(seed: u64, purpose: u64, index: u64) -> ChaCha8Rng {
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    generator.set_stream((purpose << 48) | index);
    generator
}

/// Draws a number in [0, 1) from 53 random bits.
pub(crate) fn unit(generator: &mut ChaCha8Rng) -> f64 {
    (generator.next_u64() >> 11) as f64 / (1u64 << 53) as f64
}

/// Returns the plain random point of an index.
pub(crate) fn random(seed: u64, index: u64, width: usize) -> Vec<f64> {
    let mut generator = stream(seed, 1, index);
    (0..width).map(|_| unit(&mut generator)).collect()
}

/// Maximum number of axes of Halton's sequence; further axes are random. Axes with large bases are
/// correlated for many points.
const HALTON_AXES: usize = 12;

/// Returns the point of an index in Halton's sequence, shifted modulo 1 by a vector derived from
/// the seed.
///
/// Source: Halton (1960); the shift of Cranley and Patterson (1976) makes each point uniform, so
/// that means over points are unbiased.
pub(crate) fn halton(seed: u64, index: u64, width: usize) -> Vec<f64> {
    let mut generator = stream(seed, 2, 0);
    let mut point: Vec<f64> = primes(width.min(HALTON_AXES))
        .into_iter()
        .map(|base| {
            let shifted = radical_inverse(index, base) + unit(&mut generator);
            if shifted >= 1.0 {
                shifted - 1.0
            } else {
                shifted
            }
        })
        .collect();
    let mut rest = stream(seed, 6, index);
    point.extend((point.len()..width).map(|_| unit(&mut rest)));
    point
}

/// Returns `count` points, one in each of `count` slices of every axis.
///
/// Source: McKay, Beckman and Conover (1979).
pub(crate) fn latin_hypercube(
    seed: u64,
    generation: u64,
    count: usize,
    width: usize,
) -> Vec<Vec<f64>> {
    let mut generator = stream(seed, 3, generation);
    let mut points = vec![Vec::with_capacity(width); count];
    for _ in 0..width {
        let mut slices: Vec<usize> = (0..count).collect();
        for last in (1..count).rev() {
            slices.swap(last, super::space::bucket(unit(&mut generator), last + 1));
        }
        for (point, slice) in points.iter_mut().zip(slices) {
            point.push((slice as f64 + unit(&mut generator)) / count as f64);
        }
    }
    points
}

/// Mirrors the digits of a number in a base at the radix point.
fn radical_inverse(mut number: u64, base: u64) -> f64 {
    let (mut value, mut digit) = (0.0, 1.0);
    while number > 0 {
        digit /= base as f64;
        value += digit * (number % base) as f64;
        number /= base;
    }
    value
}

fn primes(count: usize) -> Vec<u64> {
    let mut found: Vec<u64> = Vec::with_capacity(count);
    let mut candidate = 2;
    while found.len() < count {
        if found
            .iter()
            .take_while(|prime| *prime * *prime <= candidate)
            .all(|prime| candidate % prime != 0)
        {
            found.push(candidate);
        }
        candidate += 1;
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each slice of each axis has exactly one point.
    #[test]
    fn a_latin_hypercube_has_one_point_in_each_slice() {
        let points = latin_hypercube(7, 3, 20, 8);
        for axis in 0..8 {
            let mut slices: Vec<usize> = points
                .iter()
                .map(|point| (point[axis] * 20.0) as usize)
                .collect();
            slices.sort_unstable();
            assert_eq!(slices, (0..20).collect::<Vec<_>>());
        }
    }

    /// Each cell of a 4 × 4 grid over two axes has nearly equally many points; the counts of random
    /// points vary far more.
    #[test]
    fn halton_points_are_more_uniform_than_random_ones() {
        let spread = |point: &dyn Fn(u64) -> Vec<f64>| {
            let mut cells = [0_i32; 16];
            for index in 0..1600 {
                let point = point(index);
                cells[(point[0] * 4.0) as usize * 4 + (point[1] * 4.0) as usize] += 1;
            }
            cells.iter().map(|count| (count - 100).pow(2)).sum::<i32>()
        };
        assert!(10 * spread(&|index| halton(1, index, 8)) < spread(&|index| random(1, index, 8)));
    }

    #[test]
    fn the_sequence_equals_haltons() {
        let first: Vec<f64> = (1..6).map(|index| radical_inverse(index, 3)).collect();
        let known = [1.0 / 3.0, 2.0 / 3.0, 1.0 / 9.0, 4.0 / 9.0, 7.0 / 9.0];
        assert!(
            first
                .iter()
                .zip(known)
                .all(|(found, known)| (found - known).abs() < 1e-12),
            "{first:?}"
        );
        assert_eq!(primes(6), [2, 3, 5, 7, 11, 13]);
    }
}
