//! Finds the moment of a run at which a failed property was decided, as the starting point for playback.

use actcheck_data::{BodyState, Trace};

/// A displacement beyond this counts as moved. Unit: metres.
const MOVED_M: f64 = 0.01;
/// A contact that ends closer than this to the end of its action does not count as lost. Unit: seconds.
const LOST_SECS: f64 = 0.2;
/// Lead time: playback starts this long before the deciding event. Unit: seconds.
const BEFORE_SECS: f64 = 0.3;

/// Returns the moment that decided an outcome, from the objects that its witness names. Unit: seconds since the run
/// began.
///
/// In this order: the robot first touched named furniture or a named object that is not a parameter of the action; such
/// an object moved;
/// the robot lost contact with the named objects; if it never touched them, a link was nearest to them. If none
/// applies, returns the end of the action. All but the last are shifted earlier by [`BEFORE_SECS`].
pub(super) fn deciding_moment(trace: &Trace, action_idx: usize, witness: &str) -> f64 {
    let begin = |idx: usize| trace.snapshots.get(idx).or(trace.snapshots.last()).map_or(0.0, |state| state.time_secs);
    let (run_begin, start, end) = (begin(0), begin(action_idx), begin(action_idx + 1));
    let Some(action) = trace.actions.get(action_idx) else { return end - run_begin };
    let handled = |id: &str| action.parameters.values().flatten().any(|value| value == id);
    let bodies = trace.snapshots.first().into_iter().flat_map(|state| &state.bodies);
    let (furniture, things): (Vec<&BodyState>, Vec<&BodyState>) =
        bodies.filter(|body| names(witness, &body.id)).partition(|body| body.fixed);
    let named: Vec<&str> = things.iter().map(|body| body.id.as_str()).collect();
    let others: Vec<&str> = named.iter().copied().filter(|id| !handled(id)).collect();
    let touchable: Vec<&str> = furniture.iter().map(|body| body.id.as_str()).chain(others.iter().copied()).collect();
    let by_robot = |ids: &[&str]| -> Vec<(f64, f64)> {
        let touches = action.contacts.iter().filter(|contact| {
            let [a, b] = &contact.pair;
            [(a, b), (b, a)].iter().any(|(robot, thing)| robot.starts_with("robot/") && ids.contains(&thing.as_str()))
        });
        touches.map(|contact| (contact.start_secs, contact.end_secs)).collect()
    };
    let touched = by_robot(&touchable).into_iter().map(|(start, _)| start).min_by(f64::total_cmp);
    let moved = || {
        others
            .iter()
            .filter_map(|id| first_movement(trace, id, start - run_begin, end - run_begin))
            .min_by(f64::total_cmp)
    };
    let lost = || match by_robot(&named).into_iter().map(|(_, end)| end).max_by(f64::total_cmp) {
        Some(last) => (start + last < end - LOST_SECS).then_some(last),
        None => nearest(trace, &named, start - run_begin, end - run_begin),
    };
    let since_start = touched.or_else(moved).or_else(lost);
    let at = since_start.map_or(end, |secs| start + secs - BEFORE_SECS);
    at.clamp(start, end.max(start)) - run_begin
}

/// Whether a text contains a whole word.
pub(super) fn names(text: &str, word: &str) -> bool {
    let of_word = |c: char| c.is_alphanumeric() || c == '_';
    !word.is_empty()
        && text
            .match_indices(word)
            .any(|(at, _)| !text[..at].ends_with(of_word) && !text[at + word.len()..].starts_with(of_word))
}

/// Positions of a track in the frames of an action, with times since the action began. Units: seconds, metres.
fn positions<'a>(
    trace: &'a Trace,
    slot: usize,
    start: f64,
    end: f64,
) -> impl Iterator<Item = (f64, [f64; 3])> + use<'a> {
    let secs = |idx: usize| idx as f64 * trace.frames.period_secs;
    let at = move |row: &Vec<f32>| row.get(7 * slot..7 * slot + 3).map(|at| [at[0], at[1], at[2]].map(f64::from));
    let rows = trace.frames.rows.iter().enumerate().map(move |(idx, row)| (secs(idx), row));
    rows.filter(move |(secs, _)| (start..=end).contains(secs))
        .filter_map(move |(secs, row)| Some((secs - start, at(row)?)))
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>().sqrt()
}

/// When an object had moved, since the action began. Returns `None` if it did not. Unit: seconds; `start` and `end`
/// since the run began.
fn first_movement(trace: &Trace, id: &str, start: f64, end: f64) -> Option<f64> {
    let slot = trace.frames.names.iter().position(|name| name == id)?;
    let mut track = positions(trace, slot, start, end);
    let (_, place) = track.next()?;
    track.find(|(_, now)| distance(*now, place) > MOVED_M).map(|(secs, _)| secs)
}

/// When a link of the robot was nearest to any of the objects, since the action began. Unit: seconds; `start` and `end`
/// since the run began.
fn nearest(trace: &Trace, ids: &[&str], start: f64, end: f64) -> Option<f64> {
    let slots = |wanted: &dyn Fn(&str) -> bool| -> Vec<usize> {
        trace.frames.names.iter().enumerate().filter(|(_, name)| wanted(name)).map(|(slot, _)| slot).collect()
    };
    let (links, things) = (slots(&|name| name.starts_with("robot/")), slots(&|name| ids.contains(&name)));
    let pairs = things.iter().flat_map(|thing| links.iter().map(move |link| (*thing, *link)));
    let apart = pairs.flat_map(|(thing, link)| {
        let both = positions(trace, thing, start, end).zip(positions(trace, link, start, end));
        both.map(|((secs, thing), (_, link))| (secs, distance(thing, link)))
    });
    apart.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(secs, _)| secs)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_match_whole_words_only() {
        assert!(names("glass_1 is 57.5 cm from the gripper", "glass_1"));
        assert!(names("touched (glass_1)", "glass_1"));
        assert!(!names("glass_12 fell", "glass_1") && !names("a glass_1b", "glass_1") && !names("x", ""));
    }
}
