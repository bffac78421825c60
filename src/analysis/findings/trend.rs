//! Failure rate of a property over campaigns, with change points.

use crate::findings::judged::{JudgedProperty, failed, outcomes};
use crate::findings::scenes::Scenes;
use crate::{Interval, OutcomeTable, TwoByTwo, wilson};

/// A campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct TrendPoint {
    /// ID of the campaign.
    pub campaign: String,
    /// Start of its first run in the table (RFC 3339).
    pub started: String,
    /// Number of decided runs, one for each scene.
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

/// Computes the trend of a property. Change points are found by recursive splitting at the position with the lowest
/// p-value, if it is significant at `level`.
pub fn trend(table: &OutcomeTable, of: &JudgedProperty, level: f64) -> Trend {
    let outcomes = outcomes(table);
    let (campaign, started) = (table.text("campaign"), table.text("started"));
    let mut points: Vec<TrendPoint> = Vec::new();
    let decided: Vec<u32> = of.rows.iter().copied().filter(|row| failed(outcomes[*row as usize]).is_some()).collect();
    for row in Scenes::of(table).first_rows(&decided).into_iter().map(|row| row as usize) {
        let (Some(id), Some(failed)) = (campaign.get(row), failed(outcomes[row])) else { continue };
        if points.last().is_none_or(|point| point.campaign != id) {
            let started = started.get(row).unwrap_or_default().to_owned();
            points.push(TrendPoint { campaign: id.to_owned(), started, runs: 0, failed: 0, failing: None });
        }
        if let Some(point) = points.last_mut() {
            point.runs += 1;
            point.failed += u64::from(failed);
        }
    }
    points.iter_mut().for_each(|point| point.failing = wilson(point.failed, point.runs));
    let mut places = Vec::new();
    part(&points, 0, level, &mut places);
    places.sort_by_key(|(at, _)| *at);
    let bounds: Vec<usize> = std::iter::once(0).chain(places.iter().map(|(at, _)| *at)).chain([points.len()]).collect();
    let share = |from: usize, to: usize| {
        let part = &points[from..to];
        wilson(part.iter().map(|point| point.failed).sum(), part.iter().map(|point| point.runs).sum())
    };
    let changes = places
        .iter()
        .enumerate()
        .filter_map(|(number, (at, p))| {
            let (before, behind) = (share(bounds[number], *at)?, share(*at, bounds[number + 2])?);
            Some(ChangePoint { at: *at, before, behind, p: *p })
        })
        .collect();
    Trend { points, changes }
}

fn part(points: &[TrendPoint], offset: usize, level: f64, found: &mut Vec<(usize, f64)>) {
    let sum = |points: &[TrendPoint]| {
        let failed: u64 = points.iter().map(|point| point.failed).sum();
        (failed, points.iter().map(|point| point.runs).sum::<u64>() - failed)
    };
    let p = |at: usize| {
        let ((failed_in, passed_in), (failed_out, passed_out)) = (sum(&points[..at]), sum(&points[at..]));
        TwoByTwo { failed_in, passed_in, failed_out, passed_out }.fisher().two_sided
    };
    let surest = (1..points.len()).map(|at| (at, p(at))).min_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((at, p)) = surest {
        let adjusted = (p * (points.len() - 1) as f64).min(1.0);
        if adjusted <= level {
            found.push((offset + at, adjusted));
            part(&points[..at], offset, level, found);
            part(&points[at..], offset + at, level, found);
        }
    }
}
