//! Evenly spread sample points in a unit cube, with a limit on their number.

/// Samples of one plan. They are limited in number, so that planning ends after the same work on
/// every machine.
#[derive(Debug, Clone)]
pub struct Samples {
    /// Start of the sequence, from 0 to 1.
    start: f64,
    n_drawn: u32,
    most: u32,
}

/// Bases of the Halton sequence, one for each joint.
const PRIMES: [u32; 12] = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37];
/// The golden ratio conjugate, which turns one number into many nearly independent ones.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

impl Samples {
    /// At most `most` samples of the sequence selected by a number from 0 to 1.
    pub fn new(start: f64, most: u32) -> Self {
        Self {
            start,
            n_drawn: 0,
            most,
        }
    }

    /// The next point, with coordinates from 0 to 1. Returns `None` when all samples are used.
    ///
    /// A Halton sequence with a random shift modulo 1 in each dimension (Cranley and Patterson
    /// 1976).
    pub fn next(&mut self, n_dimensions: usize) -> Option<Vec<f64>> {
        if self.n_drawn >= self.most {
            return None;
        }
        self.n_drawn += 1;
        let coordinate = |dimension: usize| {
            let shift = self.start * 97.0 + GOLDEN * (dimension + 1) as f64;
            (radical_inverse(self.n_drawn, PRIMES[dimension % PRIMES.len()]) + shift).fract()
        };
        Some((0..n_dimensions).map(coordinate).collect())
    }

    /// Whether no samples are left.
    pub fn are_spent(&self) -> bool {
        self.n_drawn >= self.most
    }

    /// Takes at most `most` of the remaining samples, for one of several attempts.
    pub fn share(&mut self, most: u32) -> Self {
        let part = Self {
            most: (self.n_drawn + most).min(self.most),
            ..self.clone()
        };
        self.n_drawn = part.most;
        part
    }
}

/// The digits of a number mirrored at the radix point.
fn radical_inverse(mut number: u32, base: u32) -> f64 {
    let (mut place, mut inverse) = (1.0, 0.0);
    while number > 0 {
        place /= f64::from(base);
        inverse += place * f64::from(number % base);
        number /= base;
    }
    inverse
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_uniform_finite_and_depend_on_the_start() {
        let draw = |start: f64| {
            let mut samples = Samples::new(start, 400);
            std::iter::from_fn(move || samples.next(7)).collect::<Vec<_>>()
        };
        let (one, other) = (draw(0.25), draw(0.75));
        assert_eq!(one.len(), 400);
        assert_ne!(one[0], other[0]);
        assert_eq!(one, draw(0.25));
        for dimension in 0..7 {
            let low = one.iter().filter(|point| point[dimension] < 0.5).count();
            assert!(
                (180..=220).contains(&low),
                "{low} of 400 in the lower half of dimension {dimension}"
            );
        }
        let mut samples = Samples::new(0.25, 10);
        let mut part = samples.share(4);
        assert_eq!(std::iter::from_fn(|| part.next(1)).count(), 4);
        assert_eq!(std::iter::from_fn(|| samples.next(1)).count(), 6);
    }
}
