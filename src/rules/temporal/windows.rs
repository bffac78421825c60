//! Extremes over moving windows of samples, in time linear in the samples whatever the windows'
//! length.

use std::collections::VecDeque;

/// A window of samples relative to the present: from the first to the last offset, inclusive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Window {
    pub(super) from: usize,
    /// `None` reaches to the end of the samples.
    pub(super) to: Option<usize>,
}

/// Rounding that does not move a bound to the next sample. Unit: samples.
const ROUNDING: f64 = 1e-6;

impl Window {
    /// Returns the samples between two times. Unit: seconds. Returns an empty window (`to` before
    /// `from`) if no sample is between them.
    pub(super) fn of(from_secs: f64, to_secs: f64, period_secs: f64) -> Self {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "the cast saturates"
        )]
        let (from, to) = (
            (from_secs / period_secs - ROUNDING).ceil().max(0.0) as usize,
            to_secs
                .is_finite()
                .then(|| (to_secs / period_secs + ROUNDING).floor().max(0.0) as usize),
        );
        Self { from, to }
    }
}

/// Returns the smallest value in the window after each sample; infinity for an empty window.
pub(super) fn smallest_after(values: &[f64], window: Window) -> Vec<f64> {
    let count = values.len();
    let Some(to) = window.to else {
        let mut found = vec![f64::INFINITY; count];
        let mut least = f64::INFINITY;
        for at in (0..count).rev() {
            least = least.min(values[at]);
            if let Some(slot) = at.checked_sub(window.from).and_then(|at| found.get_mut(at)) {
                *slot = least;
            }
        }
        return found;
    };
    if to < window.from {
        return vec![f64::INFINITY; count];
    }
    // Indices of values that may still become the smallest of a window, with growing values.
    let mut candidates: VecDeque<usize> = VecDeque::new();
    let mut next = window.from;
    let found = (0..count).map(|now| {
        while next < count && next <= now.saturating_add(to) {
            while candidates
                .back()
                .is_some_and(|last| values[*last] >= values[next])
            {
                candidates.pop_back();
            }
            candidates.push_back(next);
            next += 1;
        }
        while candidates
            .front()
            .is_some_and(|first| *first < now.saturating_add(window.from))
        {
            candidates.pop_front();
        }
        candidates
            .front()
            .map_or(f64::INFINITY, |first| values[*first])
    });
    found.collect()
}

/// Returns the largest value in the window after each sample; negative infinity for an empty
/// window.
pub(super) fn largest_after(values: &[f64], window: Window) -> Vec<f64> {
    negated(smallest_after(&negated(values.to_vec()), window))
}

/// Returns the robustness of "`first` until `second`", with `second` in the window after each
/// sample.
pub(super) fn until(first: &[f64], second: &[f64], window: Window) -> Vec<f64> {
    let count = first.len();
    let mut unbounded = vec![f64::NEG_INFINITY; count];
    let mut later = f64::NEG_INFINITY;
    for at in (0..count).rev() {
        later = second[at].max(first[at].min(later));
        unbounded[at] = later;
    }
    if window.from == 0 && window.to.is_none() {
        return unbounded;
    }
    // `second` comes in time, `first` holds until the window, and from there until `second`.
    let in_time = largest_after(second, window);
    let before = match window.from {
        0 => vec![f64::INFINITY; count],
        from => smallest_after(
            first,
            Window {
                from: 0,
                to: Some(from - 1),
            },
        ),
    };
    let found = (0..count).map(|at| {
        let from_window = unbounded
            .get(at.saturating_add(window.from))
            .copied()
            .unwrap_or(f64::NEG_INFINITY);
        in_time[at].min(before[at]).min(from_window)
    });
    found.collect()
}

/// Reverses the time of samples: a window after becomes one before.
pub(super) fn reversed(mut values: Vec<f64>) -> Vec<f64> {
    values.reverse();
    values
}

/// Negates each value.
pub(super) fn negated(mut values: Vec<f64>) -> Vec<f64> {
    values.iter_mut().for_each(|value| *value = -*value);
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Offsets that a window covers at a sample.
    fn covered(window: Window, now: usize, count: usize) -> std::ops::Range<usize> {
        let end = window.to.map_or(count, |to| (now + to + 1).min(count));
        (now + window.from).min(end)..end
    }

    fn window() -> impl Strategy<Value = Window> {
        (0usize..6, proptest::option::of(0usize..9)).prop_map(|(from, to)| Window { from, to })
    }

    proptest! {
        #[test]
        fn extremes_equal_those_of_each_window_alone(
            values in proptest::collection::vec(-3i8..4, 0..20), window in window()
        ) {
            let values: Vec<f64> = values.into_iter().map(f64::from).collect();
            let expected: Vec<f64> = (0..values.len())
                .map(|now| values[covered(window, now, values.len())].iter().copied().fold(f64::INFINITY, f64::min))
                .collect();
            prop_assert_eq!(smallest_after(&values, window), expected);
        }

        #[test]
        fn until_equals_its_definition(
            pairs in proptest::collection::vec((-3i8..4, -3i8..4), 0..16), window in window()
        ) {
            let (first, second): (Vec<f64>, Vec<f64>) =
                pairs.into_iter().map(|(a, b)| (f64::from(a), f64::from(b))).unzip();
            let expected: Vec<f64> = (0..first.len())
                .map(|now| {
                    covered(window, now, first.len())
                        .map(|then| first[now..then].iter().copied().fold(second[then], f64::min))
                        .fold(f64::NEG_INFINITY, f64::max)
                })
                .collect();
            prop_assert_eq!(until(&first, &second, window), expected);
        }
    }

    #[test]
    fn bounds_between_samples_select_the_samples_inside() {
        let inside = |from, to| Window::of(from, to, 1.0 / 60.0);
        assert_eq!(
            inside(0.0, 0.1),
            Window {
                from: 0,
                to: Some(6)
            }
        );
        assert_eq!(
            inside(0.01, 0.02),
            Window {
                from: 1,
                to: Some(1)
            }
        );
        assert_eq!(inside(0.5, f64::INFINITY), Window { from: 30, to: None });
    }
}
