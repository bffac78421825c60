//! The times during which objects were held or moved.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::{Samples, Series};

/// An object moves while its origin is faster than this: twice as fast as an object that settles on
/// a table. Unit: m/s.
const MOVING_SPEED: f64 = 0.02;
/// A shorter interruption does not end an interval: contact with a finger may be lost for some
/// ticks. Unit: seconds.
const INTERRUPTION_SECS: f64 = 0.1;

/// The state of an object during an [`Interval`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum IntervalKind {
    /// Both fingers touch it.
    Hold,
    /// It moves.
    Motion,
}

/// A time during which an object was held or moved.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// Whether it was held or moved.
    pub kind: IntervalKind,
    /// Id of the object.
    pub thing: String,
    /// Time of its first sample, since the action began. Unit: seconds.
    pub start_secs: f64,
    /// Time of the first sample after it, or the end of the action. Unit: seconds.
    pub end_secs: f64,
}

impl Samples {
    /// Returns the holds and motions, sorted by kind, then by start, then by object.
    ///
    /// They follow from the samples alone, which are rounded: a run that is judged while it is
    /// simulated has the same intervals as a stored one.
    pub fn intervals(&self) -> Vec<Interval> {
        let mut found = Vec::new();
        let mut velocities: BTreeMap<&str, Vec<&Series>> = BTreeMap::new();
        for series in &self.series {
            match series.quantity.as_str() {
                "held" => {
                    let held: Vec<bool> = series.steps.iter().map(|step| *step != 0).collect();
                    self.add_intervals(IntervalKind::Hold, &series.thing, &held, &mut found);
                }
                "vx" | "vy" | "vz" => velocities.entry(&series.thing).or_default().push(series),
                _ => {}
            }
        }
        for (thing, parts) in velocities {
            let mut squares = vec![0.0; self.count];
            for part in parts {
                squares
                    .iter_mut()
                    .zip(part.values())
                    .for_each(|(square, value)| *square += value * value);
            }
            let moves: Vec<bool> = squares
                .into_iter()
                .map(|square| square > MOVING_SPEED * MOVING_SPEED)
                .collect();
            self.add_intervals(IntervalKind::Motion, thing, &moves, &mut found);
        }
        let key = |interval: &Interval| (interval.kind, interval.start_secs);
        found.sort_by(|a, b| {
            let ((kind, start), (other_kind, other_start)) = (key(a), key(b));
            kind.cmp(&other_kind)
                .then(start.total_cmp(&other_start))
                .then_with(|| a.thing.cmp(&b.thing))
        });
        found
    }

    /// Appends the times at which a condition holds, joined over short interruptions.
    fn add_intervals(
        &self,
        kind: IntervalKind,
        thing: &str,
        holds: &[bool],
        found: &mut Vec<Interval>,
    ) {
        let mut spans: Vec<[usize; 2]> = Vec::new();
        let last = self.count.saturating_sub(1);
        for idx in (0..holds.len()).filter(|idx| holds[*idx]) {
            let end = (idx + 1).min(last);
            match spans.last_mut() {
                Some(span)
                    if (idx.saturating_sub(span[1])) as f64 * self.period_secs
                        < INTERRUPTION_SECS =>
                {
                    span[1] = end;
                }
                _ => spans.push([idx, end]),
            }
        }
        for [start, end] in spans.into_iter().filter(|[start, end]| start < end) {
            let [start_secs, end_secs] = [start, end].map(|idx| idx as f64 * self.period_secs);
            found.push(Interval {
                kind,
                thing: thing.to_owned(),
                start_secs,
                end_secs,
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(quantity: &str, steps_per_unit: u32, steps: &[i32]) -> Series {
        Series {
            steps: steps.to_vec().into(),
            ..Series::new("cup", "", quantity, steps_per_unit)
        }
    }

    fn intervals(series: Vec<Series>) -> Vec<(IntervalKind, f64, f64)> {
        let count = series[0].steps.len();
        let samples = Samples {
            period_secs: 0.0625,
            count,
            series,
        };
        samples
            .intervals()
            .into_iter()
            .map(|found| (found.kind, found.start_secs, found.end_secs))
            .collect()
    }

    #[test]
    fn an_interval_lasts_from_its_first_sample_to_the_first_one_after_it() {
        let held = intervals(vec![series("held", 1, &[0, 1, 1, 0, 0, 0, 1, 0])]);
        assert_eq!(
            held,
            [
                (IntervalKind::Hold, 0.0625, 0.1875),
                (IntervalKind::Hold, 0.375, 0.4375)
            ]
        );
    }

    #[test]
    fn a_short_interruption_does_not_end_an_interval() {
        let held = intervals(vec![series("held", 1, &[1, 1, 0, 1, 1, 0, 0, 1, 1])]);
        assert_eq!(
            held,
            [
                (IntervalKind::Hold, 0.0, 0.3125),
                (IntervalKind::Hold, 0.4375, 0.5)
            ]
        );
    }

    #[test]
    fn an_object_moves_while_it_is_faster_than_two_centimetres_a_second() {
        let velocities = vec![
            series("vx", 1000, &[0, 20, 16, 0, 0]),
            series("vy", 1000, &[0, 0, 16, 0, 0]),
            series("vz", 1000, &[0, 0, 0, 0, 0]),
        ];
        assert_eq!(
            intervals(velocities),
            [(IntervalKind::Motion, 0.125, 0.1875)]
        );
    }

    #[test]
    fn an_interval_ends_with_the_action() {
        assert_eq!(intervals(vec![series("held", 1, &[0, 0, 1])]), []);
        assert_eq!(
            intervals(vec![series("held", 1, &[1, 1, 1])]),
            [(IntervalKind::Hold, 0.0, 0.125)]
        );
    }
}
