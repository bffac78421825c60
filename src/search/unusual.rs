//! Points that are unusual a priori, one kind at a time: large perception errors, and objects close
//! to each other.

use super::proposal::{Component, Marginal};
use super::space::{Dimension, Space};

/// Noise is unusual from this many standard deviations: about 5 % of all noise.
const FAR: f64 = 2.0;

/// Standard deviation of the distance between objects placed beside each other, as a share of the
/// axis.
const BESIDE: f64 = 0.2;

/// Exponent of the preference for many objects: a count's weight is its rank to this power.
const MANY: i32 = 2;

/// Number of points in the first turn.
const FIRST_TURN: usize = 2;

/// Ratio of the lengths of successive turns.
const LONGER: usize = 3;

/// Returns the kinds of unusual points of a space. In the first, perception errors of the target
/// and the base are large; in the second, there are many other objects, close to the target, with
/// large perception errors. All other axes stay uniform.
///
/// Each point has one kind, because the kinds mask each other: a misplaced gripper in a crowd
/// always fails in the same way.
///
/// Based on scaled-sigma sampling (Sun, Li and others, 2015), which finds rare failures of circuits
/// by enlarging the noise. Here the distance is uniform from [`FAR`] to four standard deviations.
pub(crate) fn kinds(space: &Space) -> Vec<Component> {
    let of = |axis: fn(&Dimension) -> Option<Marginal>| {
        let axes: Vec<Option<Marginal>> = space.dimensions().iter().map(axis).collect();
        let is_there = axes.iter().any(Option::is_some);
        is_there.then(|| {
            Component(
                axes.into_iter()
                    .map(|axis| axis.unwrap_or_else(Marginal::uniform))
                    .collect(),
            )
        })
    };
    [of(astray), of(crowded)].into_iter().flatten().collect()
}

/// Returns the kind of a generation's unusual point with this number. Kinds take turns; the first
/// turn has two points, and each further turn is three times as long. Frequent failures of the
/// first kind need only a few points, and the next kind does not wait for rare failures of the
/// first.
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
        Dimension::Rising(count @ 2..) => Some(Marginal::steps(
            &(1..=*count)
                .map(|rank| (rank as f64).powi(MANY))
                .collect::<Vec<_>>(),
        )),
        Dimension::Beside(axis) => Some(Marginal::Beside {
            axis: *axis,
            sigma: BESIDE,
        }),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_of_each_kind_get_longer() {
        let kinds: Vec<usize> = (0..30).map(|number| kind_at(number, 2)).collect();
        let turns: Vec<usize> = kinds.chunk_by(|a, b| a == b).map(<[usize]>::len).collect();
        assert_eq!(turns, [2, 6, 18, 4]);
        assert!((0..30).all(|number| kind_at(number, 1) == 0));
    }

    #[test]
    fn unusual_kinds_depend_on_the_space() {
        let kinds_of =
            |dimensions: &[Dimension]| kinds(&Space::new(dimensions.iter().copied())).len();
        assert_eq!(
            kinds_of(&[Dimension::Continuous, Dimension::Categorical(3)]),
            0
        );
        assert_eq!(kinds_of(&[Dimension::Continuous, Dimension::Rising(3)]), 1);
        assert_eq!(kinds_of(&[Dimension::Normal, Dimension::Rising(1)]), 1);
        assert_eq!(
            kinds_of(&[
                Dimension::Continuous,
                Dimension::Normal,
                Dimension::Beside(0)
            ]),
            2
        );
    }
}
