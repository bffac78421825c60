//! Simplification of patterns.

use crate::TwoByTwo;
use crate::patterns::Condition;
use crate::patterns::cells::Axis;
use crate::patterns::condition::all_hold;
use crate::patterns::confirm::count;
use crate::patterns::refine::OpenRuns;

/// Removes, one by one, conditions and ends of ranges that are not significant: those whose
/// excluded runs do not fail significantly less, corrected for the number of alternative
/// conditions. The result is one of the boxes tried.
pub(super) fn simplify(conditions: &mut Vec<Condition>, open_runs: &OpenRuns<'_>, level: f64) {
    // Any of these conditions could have been chosen.
    let rivals = open_runs.axes.iter().map(Axis::len).sum::<usize>().max(1) as f64;
    loop {
        let within = all_hold(conditions, open_runs.input);
        let mut least: Option<(f64, Vec<Condition>)> = None;
        for simpler in simpler(conditions) {
            let p = excluded_by(&within, &all_hold(&simpler, open_runs.input), open_runs)
                .fisher()
                .greater;
            if p * rivals > level && least.as_ref().is_none_or(|(known, _)| p > *known) {
                least = Some((p, simpler));
            }
        }
        let Some((_, simpler)) = least else { return };
        *conditions = simpler;
    }
}

/// Returns all nonempty patterns with one condition, or one end of a range, removed.
fn simpler(conditions: &[Condition]) -> Vec<Vec<Condition>> {
    let mut found = Vec::new();
    for (at, condition) in conditions.iter().enumerate() {
        for weaker in condition.weaker() {
            let mut simpler = conditions.to_vec();
            match weaker {
                Some(weaker) => simpler[at] = weaker,
                None => drop(simpler.remove(at)),
            }
            found.push(simpler);
        }
    }
    found.retain(|simpler| !simpler.is_empty());
    found
}

/// Compares the runs within the pattern with those that only the simpler pattern contains.
fn excluded_by(within: &[bool], simpler: &[bool], open_runs: &OpenRuns<'_>) -> TwoByTwo {
    count(open_runs.input, within, |run| {
        open_runs.open[run] && simpler[run]
    })
}
