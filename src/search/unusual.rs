//! What is unusual before anything is known, one kind at a time: senses that err much, and things close to each other.

use super::proposal::{Component, Marginal};
use super::space::{Dimension, Space};

/// Noise is unusual from so many standard deviations on: twenty times rarer than noise that is not.
const FAR: f64 = 2.0;

/// Standard deviation of how far things lie from what they are put beside, in shares of the way that they could be.
const BESIDE: f64 = 0.2;

/// How much a larger count of things is preferred to a smaller one: its rank to this power.
const MANY: i32 = 2;

/// Points of the first turn.
const FIRST_TURN: usize = 2;

/// Each turn is so many times as long as the one before.
const LONGER: usize = 3;

/// The kinds of unusual points that a space has: what the search is about is perceived far from where it is; and there are
/// many things, close to what the search is about, and perceived far from where they are. Everything else stays as it is.
///
/// One at a time, because together they hide each other: a hand that goes astray in a crowd always fails in the same way.
///
/// The idea is that of scaled-sigma sampling (Sun, Li and others, 2015), which finds rare failures of circuits where noise is
/// made larger; here every distance, from where it is unusual up to four deviations, is as frequent as any other.
pub(crate) fn kinds(space: &Space) -> Vec<Component> {
    let of = |axis: fn(&Dimension) -> Option<Marginal>| {
        let axes: Vec<Option<Marginal>> = space.dimensions().iter().map(axis).collect();
        let is_there = axes.iter().any(Option::is_some);
        is_there.then(|| Component(axes.into_iter().map(|axis| axis.unwrap_or_else(Marginal::uniform)).collect()))
    };
    [of(astray), of(crowded)].into_iter().flatten().collect()
}

/// Which of so many kinds the unusual point of this number in its generation is of: in turns, the first of two points and
/// each next one three times as long. What is common in the first kind takes few points, and the next one need not wait for
/// what is rare in it.
pub(crate) fn kind_at(number: usize, kinds: usize) -> usize {
    let (mut turn, mut end) = (0, FIRST_TURN);
    while number >= end {
        turn += 1;
        end = LONGER * end + FIRST_TURN;
    }
    turn % kinds.max(1)
}

fn astray(dimension: &Dimension) -> Option<Marginal> {
    match dimension {
        Dimension::Normal => Some(Marginal::Far(FAR)),
        _ => None,
    }
}

fn crowded(dimension: &Dimension) -> Option<Marginal> {
    match dimension {
        Dimension::Aside => Some(Marginal::Far(FAR)),
        Dimension::Rising(count @ 2..) => {
            Some(Marginal::steps(&(1..=*count).map(|rank| (rank as f64).powi(MANY)).collect::<Vec<_>>()))
        }
        Dimension::Beside(axis) => Some(Marginal::Beside { axis: *axis, sigma: BESIDE }),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_get_longer() {
        let kinds: Vec<usize> = (0..30).map(|number| kind_at(number, 2)).collect();
        let turns: Vec<usize> = kinds.chunk_by(|a, b| a == b).map(<[usize]>::len).collect();
        assert_eq!(turns, [2, 6, 18, 4]);
        assert!((0..30).all(|number| kind_at(number, 1) == 0));
    }

    #[test]
    fn kinds_are_those_that_the_space_has() {
        let kinds_of = |dimensions: &[Dimension]| kinds(&Space::new(dimensions.iter().copied())).len();
        assert_eq!(kinds_of(&[Dimension::Continuous, Dimension::Categorical(3)]), 0);
        assert_eq!(kinds_of(&[Dimension::Continuous, Dimension::Rising(3)]), 1);
        assert_eq!(kinds_of(&[Dimension::Normal, Dimension::Rising(1)]), 1);
        assert_eq!(kinds_of(&[Dimension::Continuous, Dimension::Normal, Dimension::Beside(0)]), 2);
    }
}
