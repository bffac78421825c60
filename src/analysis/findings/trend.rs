//! Failure rate of a property over campaigns, with change points.

use crate::findings::judged::{JudgedProperty, failed, outcomes};
use crate::findings::scenes::Scenes;
use crate::{Interval, OutcomeTable, TwoByTwo};

/// A campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct TrendPoint {
    /// ID of the campaign.
    pub campaign: String,
    /// Start of its first run in the table (RFC 3339).
    pub started: String,
    /// Number of decided runs, one for each scene and trace.
    pub runs: u64,
    /// Number of failed runs among them.
    pub failed: u64,
    /// Failure rate.
    pub failing: Option<Interval>,
}

/// A change of the failure rate between two campaigns.
#[derive(Debug, Clone, PartialEq)]
pub struct ChangePoint {
    /// Index of the first campaign after the change.
    pub at: usize,
    /// Failure rate since the previous change.
    pub before: Interval,
    /// Failure rate until the next change.
    pub behind: Interval,
    /// Two-sided p-value of Fisher's exact test, times the number of candidate positions.
    pub p: f64,
}

/// Trend of a property over campaigns.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Trend {
    /// Campaigns in which the property was decided, sorted by start.
    pub points: Vec<TrendPoint>,
    /// Changes, in the same order.
    pub changes: Vec<ChangePoint>,
}

/// Failed and passed runs.
type RunCounts = (u64, u64);

/// A decided run: its trace, by which bit-identical runs are recognised, and whether it failed.
type Decided = (Trace, bool);

/// Identifies the trace of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Trace {
    Hash(u32),
    /// A trace without a hash equals no other.
    Alone,
}

/// The order of campaigns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Order {
    OldestFirst,
    NewestFirst,
}

/// Computes the trend of a property. Change points are found by recursive splitting at the position
/// with the lowest p-value, if it is significant at `level`. Each campaign shows all of its runs;
/// between two changes, bit-identical runs of several campaigns count once.
pub fn trend(table: &OutcomeTable, of: &JudgedProperty, level: f64) -> Trend {
    let outcomes = outcomes(table);
    let (campaign, started, hash) = (
        table.text("campaign"),
        table.text("started"),
        table.text("trace_hash"),
    );
    let mut points: Vec<TrendPoint> = Vec::new();
    let mut runs: Vec<Vec<Decided>> = Vec::new();
    let decided: Vec<u32> = of
        .every_row
        .iter()
        .copied()
        .filter(|row| failed(outcomes[*row as usize]).is_some())
        .collect();
    for number in Scenes::of(table).first_rows(&decided) {
        let row = number as usize;
        let (Some(id), Some(failed)) = (campaign.get(row), failed(outcomes[row])) else {
            continue;
        };
        if points.last().is_none_or(|point| point.campaign != id) {
            let started = started.get(row).unwrap_or_default().to_owned();
            points.push(TrendPoint {
                campaign: id.to_owned(),
                started,
                runs: 0,
                failed: 0,
                failing: None,
            });
            runs.push(Vec::new());
        }
        if let Some(runs) = runs.last_mut() {
            let known = hash
                .of_row
                .get(row)
                .copied()
                .flatten()
                .filter(|of| !hash.texts[*of as usize].is_empty());
            runs.push((known.map_or(Trace::Alone, Trace::Hash), failed));
        }
    }
    for (point, runs) in points.iter_mut().zip(&runs) {
        let (failed, passed) = distinct([runs], Order::OldestFirst)
            .last()
            .copied()
            .unwrap_or_default();
        (point.runs, point.failed) = (failed + passed, failed);
        point.failing = table.sampling.interval(point.failed, point.runs);
    }
    let mut places = Vec::new();
    part(&runs, 0, level, &mut places);
    places.sort_by_key(|(at, _)| *at);
    let bounds: Vec<usize> = std::iter::once(0)
        .chain(places.iter().map(|(at, _)| *at))
        .chain([points.len()])
        .collect();
    let share = |from: usize, to: usize| {
        let (failed, passed) = distinct(&runs[from..to], Order::OldestFirst)
            .last()
            .copied()
            .unwrap_or_default();
        table.sampling.interval(failed, failed + passed)
    };
    let changes = places
        .iter()
        .enumerate()
        .filter_map(|(number, (at, p))| {
            let (before, behind) = (share(bounds[number], *at)?, share(*at, bounds[number + 2])?);
            Some(ChangePoint {
                at: *at,
                before,
                behind,
                p: *p,
            })
        })
        .collect();
    Trend { points, changes }
}

/// Counts the runs with different traces in the first campaigns, for each number of campaigns from 1.
/// The newest of bit-identical runs decides: their outcomes differ if the rule has changed.
fn distinct<'a>(
    campaigns: impl IntoIterator<Item = &'a Vec<Decided>>,
    order: Order,
) -> Vec<RunCounts> {
    // By the number of the hash: whether the newest run with it failed.
    let mut newest: Vec<Option<bool>> = Vec::new();
    let (mut failures, mut known, mut counts) = (0, 0, Vec::new());
    for runs in campaigns {
        for (trace, failed) in runs {
            let before = match trace {
                // A run without a hash is never a duplicate.
                Trace::Alone => None,
                Trace::Hash(hash) => {
                    let hash = *hash as usize;
                    if hash >= newest.len() {
                        newest.resize(hash + 1, None);
                    }
                    if order == Order::NewestFirst && newest[hash].is_some() {
                        continue;
                    }
                    newest[hash].replace(*failed)
                }
            };
            failures += u64::from(*failed);
            failures -= u64::from(before == Some(true));
            known += u64::from(before.is_none());
        }
        counts.push((failures, known - failures));
    }
    counts
}

fn part(runs: &[Vec<Decided>], offset: usize, level: f64, found: &mut Vec<(usize, f64)>) {
    let (before, mut behind) = (
        distinct(runs, Order::OldestFirst),
        distinct(runs.iter().rev(), Order::NewestFirst),
    );
    behind.reverse();
    let p = |at: usize| {
        let ((failed_in, passed_in), (failed_out, passed_out)) = (before[at - 1], behind[at]);
        TwoByTwo {
            failed_in,
            passed_in,
            failed_out,
            passed_out,
        }
        .fisher()
        .two_sided
    };
    let surest = (1..runs.len())
        .map(|at| (at, p(at)))
        .min_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((at, p)) = surest {
        let adjusted = (p * (runs.len() - 1) as f64).min(1.0);
        if adjusted <= level {
            found.push((offset + at, adjusted));
            part(&runs[..at], offset, level, found);
            part(&runs[at..], offset + at, level, found);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten campaigns of the same three scenes are no more evidence than one.
    #[test]
    fn bit_identical_runs_of_several_campaigns_count_once() {
        let same: Vec<Decided> = vec![
            (Trace::Hash(0), true),
            (Trace::Hash(1), false),
            (Trace::Hash(2), false),
        ];
        let counts = distinct(&vec![same.clone(); 10], Order::OldestFirst);
        assert_eq!(counts, [(1, 2); 10]);
        // The rule changed: in the newest campaign, the first run passes.
        let changed = vec![
            (Trace::Hash(0), false),
            (Trace::Alone, true),
            (Trace::Alone, true),
        ];
        let both = [same, changed];
        assert_eq!(distinct(&both, Order::OldestFirst), [(1, 2), (2, 3)]);
        assert_eq!(
            distinct(both.iter().rev(), Order::NewestFirst),
            [(2, 1), (2, 3)]
        );
    }
}
