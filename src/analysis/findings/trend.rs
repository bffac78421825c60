//! How often a property fails from campaign to campaign, and where that changed.

use crate::analysis::findings::judged::{JudgedProperty, failed, outcomes};
use crate::analysis::findings::scenes::Scenes;
use crate::analysis::{Interval, OutcomeTable, TwoByTwo, wilson};

/// One campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct TrendPoint {
    /// Id of the campaign.
    pub campaign: String,
    /// When its first run in the table began (RFC 3339).
    pub started: String,
    /// Decided runs, the first of each scene.
    pub runs: u64,
    /// Of them failed.
    pub failed: u64,
    /// Share of failed.
    pub failing: Option<Interval>,
}

/// A place between two campaigns where the share of failures changed.
#[derive(Debug, Clone, PartialEq)]
pub struct ChangePoint {
    /// Position of the first campaign behind it.
    pub at: usize,
    /// Share of failures of the campaigns before, since the change before that.
    pub before: Interval,
    /// The same behind, until the next change.
    pub behind: Interval,
    /// Fisher's exact test, two-sided, times the number of places where it could have been.
    pub p: f64,
}

/// A property over campaigns.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Trend {
    /// Campaigns in which it was decided, in the order of their starts.
    pub points: Vec<TrendPoint>,
    /// Changes, in that order.
    pub changes: Vec<ChangePoint>,
}

/// The campaigns of a property, and where its share of failures changed: the place that parts them most surely, if it does so beyond
/// chance at the level, and then the same before and behind it.
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
