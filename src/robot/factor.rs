//! Solves small symmetric systems of linear equations.

/// The Cholesky factor of a symmetric positive definite matrix, row by row.
pub struct Factor {
    lower: Vec<f64>,
    size: usize,
}

impl Factor {
    /// Factorises a matrix given row by row; reads its lower half.
    pub fn new(mut matrix: Vec<f64>, size: usize) -> Self {
        for row in 0..size {
            let (above, rest) = matrix.split_at_mut(row * size);
            let this = &mut rest[..size];
            for column in 0..row {
                let other = &above[column * size..column * size + column + 1];
                let known: f64 = this[..column].iter().zip(other).map(|(a, b)| a * b).sum();
                this[column] = (this[column] - known) / other[column];
            }
            let known: f64 = this[..row].iter().map(|value| value * value).sum();
            this[row] = (this[row] - known).sqrt();
        }
        Self {
            lower: matrix,
            size,
        }
    }

    /// Solves the equations for this right side, in place.
    pub fn solve(&self, side: &mut [f64]) {
        for row in 0..self.size {
            let factors = &self.lower[row * self.size..row * self.size + row + 1];
            let known: f64 = factors[..row]
                .iter()
                .zip(side.iter())
                .map(|(a, b)| a * b)
                .sum();
            side[row] = (side[row] - known) / factors[row];
        }
        for row in (0..self.size).rev() {
            side[row] /= self.lower[row * self.size + row];
            let (before, value) = (
                &self.lower[row * self.size..row * self.size + row],
                side[row],
            );
            for (other, factor) in side.iter_mut().zip(before) {
                *other -= factor * value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solutions_fulfil_their_equations() {
        let matrix = vec![4.0, 1.0, -2.0, 1.0, 5.0, 0.5, -2.0, 0.5, 6.0];
        let expected = [1.5, -2.0, 0.25];
        let mut side: Vec<f64> = matrix
            .chunks(3)
            .map(|row| row.iter().zip(expected).map(|(a, b)| a * b).sum())
            .collect();
        Factor::new(matrix, 3).solve(&mut side);
        for (found, expected) in side.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{side:?}");
        }
    }
}
