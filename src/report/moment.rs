//! Finds the moments of a run that a failed property is about: the one at which it was decided, as
//! the starting point for playback, and the one that its witness describes.

use crate::pressed::TARGET;
use actcheck_base::names;
use actcheck_data::{BodyState, Trace};

/// A displacement beyond this counts as moved. Unit: metres.
const MOVED_M: f64 = 0.01;
/// A contact that ends closer than this to the end of its action does not count as lost. Unit:
/// seconds.
const LOST_SECS: f64 = 0.2;
/// A gap between the fingers that is larger than the smallest one by at most this is as small. Unit:
/// metres.
const SAME_GAP_M: f64 = 0.002;
/// Fingers that move by less than this between two measurements do not close. Unit: metres.
const STILL_M: f64 = 1e-4;
/// A hand closes if the gap becomes smaller by at least this. Unit: metres.
const CLOSED_M: f64 = 0.01;
/// Lead time: playback starts this long before the deciding event. Unit: seconds.
const BEFORE_SECS: f64 = 0.3;

/// How a failed outcome came about, as far as the trace shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Event {
    /// The robot first touched something that it is not to touch.
    Touched,
    /// Something that it is not to touch moved.
    Moved,
    /// The hand closed, on nothing or on something that it did not keep.
    Closed,
    /// The robot lost contact with the object.
    Lost,
    /// A link was nearest to the object, which was never touched.
    Nearest,
}

impl Event {
    /// The event in words.
    pub(super) fn words(self) -> &'static str {
        match self {
            Self::Touched => "first contact",
            Self::Moved => "first movement",
            Self::Closed => "the hand closes",
            Self::Lost => "last contact",
            Self::Nearest => "nearest approach",
        }
    }

    /// Whether a witness describes the event itself. Otherwise it describes the state after the
    /// action.
    fn is_stated(self) -> bool {
        matches!(self, Self::Touched | Self::Moved)
    }
}

/// Returns the moment that decided an outcome, from the objects that its witness names. Unit:
/// seconds since the run began.
///
/// In this order: the robot first touched named furniture or a named object that the action does not
/// handle; such an object moved; the hand closed, unless the robot had lost contact with the
/// named objects before; it lost that contact; if it never touched them, a link was nearest to them.
/// If none applies, returns the end of the action. All but the last are shifted earlier by
/// [`BEFORE_SECS`].
pub(super) fn deciding_moment(trace: &Trace, action_idx: usize, witness: &str) -> f64 {
    let (start, end) = span(trace, action_idx);
    let event = deciding_event(trace, action_idx, &Named::of(trace, action_idx, witness));
    event.map_or(end, |(secs, _)| {
        (start + secs - BEFORE_SECS).clamp(start, end)
    })
}

/// Returns the moment that the witness of a failure describes, and the event that decided the
/// outcome if that was earlier. Unit: seconds since the run began.
///
/// If the witness names something that the robot touched or moved although it must not, the moment
/// is that event. Any other witness describes the state after the action.
pub(super) fn stated_moment(
    trace: &Trace,
    action_idx: usize,
    witness: &str,
) -> (f64, Option<Event>) {
    let (start, end) = span(trace, action_idx);
    match deciding_event(trace, action_idx, &Named::of(trace, action_idx, witness)) {
        Some((secs, event)) if event.is_stated() => ((start + secs).clamp(start, end), None),
        Some((_, event)) => (end, Some(event)),
        None => (end, None),
    }
}

/// Start and end of an action. Unit: seconds since the run began.
fn span(trace: &Trace, action_idx: usize) -> (f64, f64) {
    let at = |idx: usize| {
        trace
            .snapshots
            .get(idx)
            .or(trace.snapshots.last())
            .map_or(0.0, |state| state.time_secs)
    };
    let (start, end) = (at(action_idx) - at(0), at(action_idx + 1) - at(0));
    (start, end.max(start))
}

/// Whether an object carried one of some others in a snapshot.
fn carries(trace: &Trace, snapshot_idx: usize, id: &str, others: &[String]) -> bool {
    let bodies = trace
        .snapshots
        .get(snapshot_idx)
        .into_iter()
        .flat_map(|state| &state.bodies);
    bodies
        .filter(|body| others.contains(&body.id))
        .any(|body| body.rests_on.iter().any(|under| under == id))
}

/// The ids that a witness names.
struct Named {
    /// Without the place of the object that the action handles: a sentence like "the glass still
    /// rests on the table" names the table, but nothing that the robot did to it.
    furniture: Vec<String>,
    /// Movable objects.
    things: Vec<String>,
    /// Those of them that the action does not handle.
    others: Vec<String>,
}

impl Named {
    fn of(trace: &Trace, action_idx: usize, witness: &str) -> Self {
        let target = trace
            .actions
            .get(action_idx)
            .and_then(|action| action.parameters.get(TARGET));
        let bodies = trace
            .snapshots
            .first()
            .into_iter()
            .flat_map(|state| &state.bodies);
        let (furniture, things): (Vec<&BodyState>, Vec<&BodyState>) = bodies
            .filter(|body| names::mentions(witness, &body.id))
            .partition(|body| body.fixed);
        let ids = |bodies: Vec<&BodyState>| {
            bodies
                .into_iter()
                .map(|body| body.id.clone())
                .collect::<Vec<_>>()
        };
        let things = ids(things);
        let (handled, others): (Vec<String>, Vec<String>) = things
            .iter()
            .cloned()
            .partition(|id| target.is_some_and(|target| target.contains(id)));
        let mut furniture = ids(furniture);
        furniture.retain(|id| !carries(trace, action_idx + 1, id, &handled));
        Self {
            furniture,
            things,
            others,
        }
    }
}

/// The event that decided an outcome, with its time since the action began. Unit: seconds.
fn deciding_event(trace: &Trace, action_idx: usize, named: &Named) -> Option<(f64, Event)> {
    let action = trace.actions.get(action_idx)?;
    let (start, end) = span(trace, action_idx);
    let by_robot = |ids: &[&String]| -> Vec<(f64, f64)> {
        let touches = action.contacts.iter().filter(|contact| {
            let [a, b] = &contact.pair;
            [(a, b), (b, a)]
                .iter()
                .any(|(robot, thing)| robot.starts_with("robot/") && ids.contains(thing))
        });
        touches
            .map(|contact| (contact.start_secs, contact.end_secs))
            .collect()
    };
    let touchable: Vec<&String> = named.furniture.iter().chain(&named.others).collect();
    if let Some(first) = by_robot(&touchable)
        .into_iter()
        .map(|(start, _)| start)
        .min_by(f64::total_cmp)
    {
        return Some((first, Event::Touched));
    }
    let moved = named
        .others
        .iter()
        .filter_map(|id| first_movement(trace, id, start, end));
    if let Some(first) = moved.min_by(f64::total_cmp) {
        return Some((first, Event::Moved));
    }
    let things: Vec<&String> = named.things.iter().collect();
    let last = by_robot(&things)
        .into_iter()
        .map(|(_, end)| end)
        .max_by(f64::total_cmp);
    if let Some(closed) = hand_closes(trace, action_idx)
        && !things.is_empty()
        && last.is_none_or(|last| closed <= last)
    {
        return Some((closed, Event::Closed));
    }
    match last {
        Some(last) => (start + last < end - LOST_SECS).then_some((last, Event::Lost)),
        None => nearest(trace, &things, start, end).map(|secs| (secs, Event::Nearest)),
    }
}

/// When the fingers began to close to the smallest gap of an action, since it began. Returns `None`
/// if they did not close, or if the trace does not have their gap. Unit: seconds.
fn hand_closes(trace: &Trace, action_idx: usize) -> Option<f64> {
    let course = trace.robot_courses.get(action_idx)?;
    let gaps: Vec<(f64, f64)> = course
        .motion
        .moments()
        .map(|moment| (f64::from(moment.time_secs), f64::from(moment.opening_m)))
        .filter(|(_, gap)| gap.is_finite())
        .collect();
    let least = gaps.iter().map(|(_, gap)| *gap).min_by(f64::total_cmp)?;
    let closed = gaps
        .iter()
        .position(|(_, gap)| *gap <= least + SAME_GAP_M)?;
    let closing = gaps[..=closed].windows(2).rev();
    let began = closed
        - closing
            .take_while(|pair| pair[0].1 > pair[1].1 + STILL_M)
            .count();
    (gaps[began].1 - least >= CLOSED_M).then_some(gaps[began].0)
}

/// Positions of a track in the frames of an action, with times since the action began. Units:
/// seconds, metres.
fn positions<'a>(
    trace: &'a Trace,
    slot: usize,
    start: f64,
    end: f64,
) -> impl Iterator<Item = (f64, [f64; 3])> + use<'a> {
    let secs = |idx: usize| idx as f64 * trace.frames.period_secs;
    let at = move |row: &Vec<f32>| {
        row.get(7 * slot..7 * slot + 3)
            .map(|at| [at[0], at[1], at[2]].map(f64::from))
    };
    let rows = trace
        .frames
        .rows
        .iter()
        .enumerate()
        .map(move |(idx, row)| (secs(idx), row));
    rows.filter(move |(secs, _)| (start..=end).contains(secs))
        .filter_map(move |(secs, row)| Some((secs - start, at(row)?)))
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3)
        .map(|axis| (a[axis] - b[axis]).powi(2))
        .sum::<f64>()
        .sqrt()
}

/// When an object had moved, since the action began. Returns `None` if it did not. Unit: seconds;
/// `start` and `end` since the run began.
fn first_movement(trace: &Trace, id: &str, start: f64, end: f64) -> Option<f64> {
    let slot = trace.frames.names.iter().position(|name| name == id)?;
    let mut track = positions(trace, slot, start, end);
    let (_, place) = track.next()?;
    track
        .find(|(_, now)| distance(*now, place) > MOVED_M)
        .map(|(secs, _)| secs)
}

/// When a link of the robot was nearest to any of the objects, since the action began. Unit:
/// seconds; `start` and `end` since the run began.
fn nearest(trace: &Trace, ids: &[&String], start: f64, end: f64) -> Option<f64> {
    let slots = |wanted: &dyn Fn(&str) -> bool| -> Vec<usize> {
        trace
            .frames
            .names
            .iter()
            .enumerate()
            .filter(|(_, name)| wanted(name))
            .map(|(slot, _)| slot)
            .collect()
    };
    let (links, things) = (
        slots(&|name| name.starts_with("robot/")),
        slots(&|name| ids.iter().any(|id| *id == name)),
    );
    let pairs = things
        .iter()
        .flat_map(|thing| links.iter().map(move |link| (*thing, *link)));
    let apart = pairs.flat_map(|(thing, link)| {
        let both = positions(trace, thing, start, end).zip(positions(trace, link, start, end));
        both.map(|((secs, thing), (_, link))| (secs, distance(thing, link)))
    });
    apart
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(secs, _)| secs)
}

#[cfg(test)]
mod tests {
    use super::*;

    use std::collections::BTreeMap;

    use crate::made_up::snapshot;
    use actcheck_data::{ActionTrace, ContactEpisode, Motion, RobotCourse};

    /// A pick of `glass_1` on `table_1` from 2 s to 12 s, in which the robot touched things for a
    /// second each.
    fn picked(touched: &[(&str, f64)]) -> Trace {
        let parameters = BTreeMap::from([("pickObject".to_owned(), vec!["glass_1".to_owned()])]);
        let contacts = touched.iter().map(|(thing, start)| ContactEpisode {
            pair: [(*thing).to_owned(), "robot/hand".to_owned()],
            start_secs: *start,
            end_secs: start + 1.0,
            max_force_n: 5.0,
            point_m: [0.0; 3],
        });
        let action = ActionTrace {
            contacts: contacts.collect(),
            ..ActionTrace::not_reached("Pick", &parameters)
        };
        Trace {
            snapshots: vec![snapshot(2.0), snapshot(12.0)],
            actions: vec![action],
            ..Trace::default()
        }
    }

    /// The sentence "48.8 cm from the gripper" was shown with the hand at the glass, where the
    /// robot lost it.
    #[test]
    fn a_sentence_about_the_state_after_an_action_is_shown_at_its_end() {
        let trace = picked(&[("glass_1", 5.0)]);
        let witness = "glass_1 is 48.8 cm from the gripper, needs less than 5 cm";
        assert_eq!(stated_moment(&trace, 0, witness), (10.0, Some(Event::Lost)));
        assert!((deciding_moment(&trace, 0, witness) - 5.7).abs() < 1e-9);
    }

    /// The replay of a hand that closed beside the glass opened at the last frame.
    #[test]
    fn a_missed_grasp_is_decided_when_the_hand_closes() {
        let mut trace = picked(&[("glass_1", 5.0)]);
        let row = |secs: f32, gap: f32| {
            let mut row = vec![0.0; 12];
            (row[0], row[1]) = (secs, gap);
            row
        };
        let gaps = [0.05, 0.135, 0.135, 0.1, 0.05, 0.0, 0.0, 0.0];
        let rows = |from: f32| {
            (0u8..)
                .zip(gaps)
                .map(move |(at, gap)| row(from + f32::from(at), gap))
                .collect()
        };
        let course = |from| RobotCourse {
            motion: Motion {
                joints: Vec::new(),
                rows: rows(from),
            },
            ..RobotCourse::default()
        };
        trace.robot_courses = vec![course(1.0)];
        let witness = "glass_1 is 19.7 cm from the gripper, needs less than 5 cm";
        assert_eq!(
            stated_moment(&trace, 0, witness),
            (10.0, Some(Event::Closed))
        );
        assert!((deciding_moment(&trace, 0, witness) - 2.7).abs() < 1e-9);
        // A hand that closes after it has let go decided nothing.
        trace.robot_courses = vec![course(4.5)];
        assert_eq!(stated_moment(&trace, 0, witness), (10.0, Some(Event::Lost)));
    }

    #[test]
    fn a_sentence_about_a_contact_is_shown_when_it_begins() {
        let trace = picked(&[("glass_1", 5.0), ("table_1", 3.0)]);
        assert_eq!(
            stated_moment(&trace, 0, "the robot pressed table_1 with 90 N"),
            (3.0, None)
        );
    }

    /// All objects on the table are parameters of a pick, but only one is to be touched.
    #[test]
    fn an_object_that_is_not_to_be_picked_is_knocked_over_at_the_first_contact() {
        let mut trace = picked(&[("can_1", 5.0)]);
        let on_surface = vec!["can_1".to_owned()];
        trace.actions[0]
            .parameters
            .insert("surfaceObjects".to_owned(), on_surface);
        let mut can = trace.snapshots[0].bodies[1].clone();
        can.id = "can_1".to_owned();
        trace.snapshots[0].bodies.push(can);
        assert_eq!(
            stated_moment(&trace, 0, "can_1 was knocked over"),
            (5.0, None)
        );
    }

    #[test]
    fn furniture_under_the_named_object_is_its_place_and_was_not_hit() {
        let trace = picked(&[("glass_1", 5.0), ("table_1", 3.0)]);
        let witness = "glass_1 still rests on table_1; the fingers do not both touch glass_1";
        assert_eq!(stated_moment(&trace, 0, witness), (10.0, Some(Event::Lost)));
        // The replay once opened at the contact with the table, named after the loss of the glass.
        assert!((deciding_moment(&trace, 0, witness) - 5.7).abs() < 1e-9);
    }

    #[test]
    fn a_sentence_that_names_nothing_is_shown_at_the_end() {
        assert_eq!(
            stated_moment(&picked(&[]), 0, "the action reported failed"),
            (10.0, None)
        );
    }
}
