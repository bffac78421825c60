//! Cuts an episode into actions.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use crate::cast::Thing;
use crate::mapping::{Action, Moment};
use crate::snapshot::Watched;
use crate::{Episode, Mark, State};

/// A shorter interruption does not end a hold: contact with a finger may be lost for some states.
/// Unit: seconds.
const INTERRUPTION_SECS: f64 = 0.1;
/// Scenes come to rest within this time, or are not meant to. Unit: seconds.
const SETTLING_SECS: f64 = 3.0;
/// Things that move more slowly are at rest. Unit: m/s.
const AT_REST_M_S: f64 = 0.05;
/// A thing that is farther away in the next state did not begin to fall: it was put elsewhere. Unit:
/// metres. A fall of this length takes 0.1 s.
const JUMP_M: f64 = 0.05;

/// One action in an episode.
#[derive(Debug, Clone, PartialEq)]
pub struct Span {
    /// Name of the action, such as `Pick`.
    pub action: String,
    /// Values of the designators.
    pub parameters: BTreeMap<String, Vec<String>>,
    /// Indices of the states before and after it; `None` if it was never reached.
    pub states: Option<[usize; 2]>,
    /// Whether the action reported success, with the report's words; `None` without a report.
    pub report: Option<(bool, String)>,
}

/// Returns the actions of an episode: those that the mapping lists, or else those that the recording
/// program marked.
///
/// Each begins where the one before it ended, because the state after an action is the state before
/// the next one: everything between two actions belongs to the later one.
pub(crate) fn spans(watched: &Watched<'_>, actions: &[Action]) -> Vec<Span> {
    let mut spans = if actions.is_empty() {
        marked(watched.episode)
    } else {
        listed(watched, actions)
    };
    let mut ended = None;
    for [from, to] in spans.iter_mut().filter_map(|span| span.states.as_mut()) {
        *from = ended.unwrap_or(*from);
        *to = (*to).max(*from);
        ended = Some(*to);
    }
    spans
}

/// Returns the actions that the mapping lists.
fn listed(watched: &Watched<'_>, actions: &[Action]) -> Vec<Span> {
    let episode = watched.episode;
    let holds = Holds::new(watched, actions);
    let mut spans = Vec::new();
    let mut earliest = Some(0);
    for action in actions {
        let from = holds
            .state(action, action.from)
            .filter(|_| earliest.is_some());
        let from = from.map(|from| from.max(earliest.unwrap_or_default()));
        let to = from.and_then(|from| Some(holds.state(action, action.to)?.max(from)));
        // An action whose end was never reached goes on to the end of the episode.
        let last = episode.states.len().saturating_sub(1);
        let states = from.filter(|from| *from < last || spans.is_empty());
        let states = states.map(|from| [from, to.unwrap_or(last)]);
        earliest = states.filter(|_| to.is_some()).map(|[_, to]| to);
        spans.push(Span {
            action: action.name.clone(),
            parameters: action.parameters.clone(),
            report: states.and_then(|[_, to]| report(episode, action, to)),
            states,
        });
    }
    spans
}

/// The environment's success at the end of an action, if the mapping says that it is its report.
fn report(episode: &Episode, action: &Action, at: usize) -> Option<(bool, String)> {
    if !action.reports_success {
        return None;
    }
    let success = episode.states.get(at)?.outcome?.success?;
    let words = if success {
        "the environment counts it as a success"
    } else {
        "the environment does not count it as a success"
    };
    Some((success, words.to_owned()))
}

/// Returns the actions that the recording program marked.
fn marked(episode: &Episode) -> Vec<Span> {
    let index = |secs: f64| {
        let after = episode
            .states
            .partition_point(|state| state.time_secs < secs - 1e-9);
        after.min(episode.states.len().saturating_sub(1))
    };
    let mut spans: Vec<Span> = Vec::new();
    let mut open: Option<&Mark> = None;
    let last = episode.states.len().saturating_sub(1);
    let mut close = |begin: &Mark, next: Option<&Mark>| {
        let to = next.map_or(last, |next| index(next.time_secs));
        let end = next.filter(|next| !next.begins && next.action == begin.action);
        spans.push(Span {
            action: begin.action.clone(),
            parameters: begin.parameters.clone(),
            states: Some([index(begin.time_secs), to]),
            report: end.and_then(|end| Some((end.reported?, end.message.clone()))),
        });
    };
    for mark in &episode.marks {
        if let Some(begin) = open.take() {
            close(begin, Some(mark));
        }
        if mark.begins {
            open = Some(mark);
        }
    }
    if let Some(begin) = open {
        close(begin, None);
    }
    spans
}

/// When the things that actions handle are held.
struct Holds<'w> {
    watched: &'w Watched<'w>,
    /// First and last state of the longest hold of each thing, and the state between in which it is
    /// highest.
    longest: BTreeMap<usize, Hold>,
}

#[derive(Debug, Clone, Copy)]
struct Hold {
    first: usize,
    last: usize,
    highest: usize,
}

impl<'w> Holds<'w> {
    fn new(watched: &'w Watched<'w>, actions: &[Action]) -> Self {
        let things: Vec<usize> = actions
            .iter()
            .filter_map(|action| watched.cast.thing(action.handled.as_deref()?))
            .collect();
        let mut held: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        if !things.is_empty() {
            for (idx, state) in watched.episode.states.iter().enumerate() {
                for thing in watched.held(&watched.touches(state)) {
                    held.entry(thing).or_default().push(idx);
                }
            }
        }
        let longest = held
            .into_iter()
            .filter(|(thing, _)| things.contains(thing))
            .filter_map(|(thing, states)| Some((thing, longest(watched, thing, &states)?)))
            .collect();
        Self { watched, longest }
    }

    /// Returns the index of the state at a moment; `None` if the moment does not come.
    fn state(&self, action: &Action, moment: Moment) -> Option<usize> {
        let states = &self.watched.episode.states;
        let hold = || {
            let thing = self.watched.cast.thing(action.handled.as_deref()?)?;
            self.longest.get(&thing)
        };
        match moment {
            Moment::Start => Some(0),
            Moment::Settled => Some(settled(self.watched, action)),
            Moment::End => Some(states.len().saturating_sub(1)),
            Moment::Grasp => Some(hold()?.first),
            Moment::Top => Some(hold()?.highest),
            Moment::Release => {
                let after = hold()?.last + 1;
                (after < states.len()).then_some(after)
            }
            Moment::At(secs) => {
                let idx = states.partition_point(|state| state.time_secs < secs - 1e-9);
                (idx < states.len()).then_some(idx)
            }
        }
    }
}

/// Returns the first of the first states in which the things of an action are at rest and stay so
/// until the next state, or 0. An action without things waits for all that can move.
///
/// A stored state may have no velocities although its things are in the air. A thing that is put
/// elsewhere was at rest before.
fn settled(watched: &Watched<'_>, action: &Action) -> usize {
    let states = &watched.episode.states;
    let begins = states.first().map_or(0.0, |state| state.time_secs);
    let things = &watched.cast.things;
    let named: Vec<usize> = action
        .parameters
        .values()
        .flatten()
        .filter_map(|id| watched.cast.thing(id))
        .collect();
    let waited: Vec<&Thing> = (0..things.len())
        .filter(|idx| named.is_empty() || named.contains(idx))
        .map(|idx| &things[idx])
        .filter(|thing| !thing.fixed)
        .collect();
    let rests = |thing: &Thing, state: &State, next: &State| {
        let place = |state: &State| thing.pose(&state.poses).translation.vector;
        let way = (place(next) - place(state)).norm();
        let secs = (next.time_secs - state.time_secs).max(f64::MIN_POSITIVE);
        let [linear, _] = watched.velocities(thing, state);
        let stays = way / secs < AT_REST_M_S || way > JUMP_M;
        Vector3::from(linear).norm() < AT_REST_M_S && stays
    };
    states
        .windows(2)
        .take_while(|pair| pair[0].time_secs - begins <= SETTLING_SECS)
        .position(|pair| waited.iter().all(|thing| rests(thing, &pair[0], &pair[1])))
        .unwrap_or(0)
}

/// Returns the longest hold. `held` lists the states in which the thing is held, ascending.
fn longest(watched: &Watched<'_>, thing: usize, held: &[usize]) -> Option<Hold> {
    let states = &watched.episode.states;
    let mut holds: Vec<[usize; 2]> = Vec::new();
    for idx in held {
        match holds.last_mut() {
            Some([_, last])
                if *idx <= *last + 1
                    || states[*idx].time_secs - states[*last].time_secs <= INTERRUPTION_SECS =>
            {
                *last = *idx;
            }
            _ => holds.push([*idx, *idx]),
        }
    }
    let [first, last] = holds.into_iter().reduce(|longest, hold| {
        if hold[1] - hold[0] > longest[1] - longest[0] {
            hold
        } else {
            longest
        }
    })?;
    let height = |idx: &usize| {
        watched.cast.things[thing]
            .pose(&states[*idx].poses)
            .translation
            .z
    };
    let highest = (first..=last).max_by(|a, b| height(a).total_cmp(&height(b)))?;
    Some(Hold {
        first,
        last,
        highest,
    })
}
