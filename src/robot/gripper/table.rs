//! The gap between the fingers at positions between closed and open.

use crate::gripper::gap::Gap;

/// A difference of openings below this is none. Unit: metres.
const LEAST_CHANGE_M: f64 = 1e-6;

/// The gripper at one share of the way from closed to open.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Entry {
    pub(super) share: f64,
    pub(super) gap: Gap,
}

/// Returns the share and the gap at a value of an ascending key, interpolated between the entries
/// of the table.
pub(super) fn interpolated(table: &[Entry], key: impl Fn(&Entry) -> f64, value: f64) -> (f64, Gap) {
    let above = table
        .partition_point(|entry| key(entry) < value)
        .clamp(1, table.len() - 1);
    let (from, to) = (&table[above - 1], &table[above]);
    let part = ((value - key(from)) / (key(to) - key(from))).clamp(0.0, 1.0);
    (
        from.share + part * (to.share - from.share),
        from.gap.towards(&to.gap, part),
    )
}

/// Returns the difference between the last and the first opening. Unit: metres.
pub(super) fn travel(table: &[Entry]) -> f64 {
    match (table.first(), table.last()) {
        (Some(first), Some(last)) => last.gap.width_m() - first.gap.width_m(),
        _ => 0.0,
    }
}

/// Returns the measured part of the way on which the fingers open furthest, of at least two
/// entries. `samples` are evenly spaced on the whole way.
pub(super) fn longest_run(samples: &[Option<Gap>]) -> Option<Vec<Entry>> {
    let intervals = samples.len().saturating_sub(1).max(1) as f64;
    let mut runs: Vec<Vec<Entry>> = vec![Vec::new()];
    for (idx, sample) in samples.iter().enumerate() {
        let Some(gap) = *sample else {
            runs.push(Vec::new());
            continue;
        };
        let last = runs.last_mut()?;
        let entry = Entry {
            share: idx as f64 / intervals,
            gap,
        };
        if last
            .last()
            .is_none_or(|before| gap.width_m() > before.gap.width_m() + LEAST_CHANGE_M)
        {
            last.push(entry);
        } else {
            runs.push(vec![entry]);
        }
    }
    runs.into_iter()
        .filter(|run| run.len() > 1)
        .max_by(|a, b| travel(a).total_cmp(&travel(b)))
}
