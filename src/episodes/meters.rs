//! Measures the course of one action: contacts, extremes, joints, holds, clearances, samples.

use std::collections::BTreeMap;

use actcheck_data::{
    Clearance, ContactEpisode, Extremes, HeldCourse, JointCourse, Pose, RobotCourse, Samples,
    SelfCollision, SelfPress, Series,
};
use nalgebra::{Isometry3, Vector3};

use crate::cast::{Owner, link_name};
use crate::snapshot::{Touch, Watched};
use crate::{Lacks, Quantity, State};

/// Shorter gaps between contacts of a pair are ignored. Unit: seconds. As in our own traces.
const SAME_CONTACT_SECS: f64 = 0.05;
/// Objects farther from the robot than this are not measured. Unit: metres. As in our own traces.
const RANGE_M: f64 = 0.5;
/// A motor above this share of its effort limit is overloaded. As in our own traces.
const OVERLOAD_SHARE: f64 = 0.99;
const POSE: [&str; 7] = ["x", "y", "z", "qx", "qy", "qz", "qw"];
const VELOCITY: [&str; 6] = ["vx", "vy", "vz", "wx", "wy", "wz"];

type Touches = BTreeMap<(Owner, Owner), Touch>;

/// The course of one action.
pub(crate) struct Measured {
    pub(crate) contacts: Vec<ContactEpisode>,
    pub(crate) extremes: Vec<Extremes>,
    pub(crate) base: Option<[[f64; 2]; 2]>,
    pub(crate) course: RobotCourse,
}

/// Measures the states of one action, of which there is at least one.
pub(crate) fn measure(watched: &Watched<'_>, states: &[State]) -> Measured {
    let touches: Vec<Touches> = states.iter().map(|state| watched.touches(state)).collect();
    let lacks = &watched.episode.lacks;
    let samples = samples(watched, states, &touches, lacks);
    Measured {
        contacts: contacts(watched, states, &touches),
        extremes: extremes(watched, states),
        base: base(watched, states),
        course: RobotCourse {
            joints: joints(watched, states),
            self_contacts: self_contacts(watched, states, &touches),
            held: held(watched, states, &touches),
            clearances: clearances(watched, states, &touches),
            intervals: samples.intervals(),
            samples,
            ..RobotCourse::default()
        },
    }
}

/// Time since the first state. Unit: seconds.
fn since(states: &[State], idx: usize) -> f64 {
    states[idx].time_secs - states[0].time_secs
}

fn contacts(watched: &Watched<'_>, states: &[State], touches: &[Touches]) -> Vec<ContactEpisode> {
    let model = &watched.episode.model;
    let mut open: BTreeMap<(Owner, Owner), (usize, ContactEpisode)> = BTreeMap::new();
    let mut closed = Vec::new();
    for (idx, touches) in touches.iter().enumerate() {
        for (owners, touch) in touches {
            let secs = since(states, idx);
            if let Some((last, _)) = open.get(owners)
                && *last + 1 < idx
                && secs - since(states, *last) > SAME_CONTACT_SECS
            {
                closed.extend(open.remove(owners).map(|(_, episode)| episode));
            }
            let (last, episode) = open.entry(*owners).or_insert_with(|| {
                let mut pair = [owners.0, owners.1].map(|owner| watched.cast.name(owner, model));
                pair.sort();
                // A contact of the first state was there before.
                let start_secs = if idx == 0 {
                    0.0
                } else {
                    since(states, idx - 1).max(f64::MIN_POSITIVE)
                };
                let episode = ContactEpisode {
                    pair,
                    start_secs,
                    end_secs: secs,
                    max_force_n: 0.0,
                    point_m: touch.point_m,
                };
                (idx, episode)
            });
            *last = idx;
            episode.end_secs = secs;
            if touch.normal_n > episode.max_force_n {
                episode.max_force_n = touch.normal_n;
                episode.point_m = touch.point_m;
            }
        }
    }
    closed.extend(open.into_values().map(|(_, episode)| episode));
    closed.sort_by(|a, b| {
        a.start_secs
            .total_cmp(&b.start_secs)
            .then_with(|| a.pair.cmp(&b.pair))
    });
    closed
}

fn extremes(watched: &Watched<'_>, states: &[State]) -> Vec<Extremes> {
    let things = watched.cast.things.iter();
    things
        .map(|thing| {
            let start = thing.pose(&states[0].poses).translation.vector;
            let mut found = Extremes {
                id: thing.id.clone(),
                max_tilt_rad: 0.0,
                max_speed: 0.0,
                max_rise_m: 0.0,
                max_displacement_m: 0.0,
            };
            for state in states {
                let way = thing.pose(&state.poses).translation.vector - start;
                let speed = Vector3::from(watched.velocities(thing, state)[0]).norm();
                found.max_tilt_rad = found.max_tilt_rad.max(watched.tilt(thing, state));
                found.max_speed = found.max_speed.max(speed);
                found.max_rise_m = found.max_rise_m.max(way.z);
                found.max_displacement_m = found.max_displacement_m.max(way.norm());
            }
            found
        })
        .collect()
}

/// The box around the base's path; `None` if it does not move.
fn base(watched: &Watched<'_>, states: &[State]) -> Option<[[f64; 2]; 2]> {
    let base = watched.cast.base?;
    if !watched.episode.model.bodies[base].moves {
        return None;
    }
    let [x, y, _] = watched.base(&states[0]);
    let path = states.iter().map(|state| watched.base(state));
    Some(path.fold([[x, y], [x, y]], |[low, high], [x, y, _]| {
        [
            [low[0].min(x), low[1].min(y)],
            [high[0].max(x), high[1].max(y)],
        ]
    }))
}

fn joints(watched: &Watched<'_>, states: &[State]) -> Vec<JointCourse> {
    let fingers = watched.cast.hand.iter().flat_map(|hand| &hand.opening);
    let fingers: Vec<usize> = fingers.copied().collect();
    watched
        .robot_joints()
        .map(|(idx, joint)| {
            let [lower, upper] = joint.limits.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
            let (mut max_excess, mut max_speed, mut overload_secs) =
                (f64::NEG_INFINITY, 0.0f64, 0.0f64);
            let mut began: Option<f64> = None;
            for state in states {
                if let Some(position) = state.positions.get(idx) {
                    max_excess = max_excess.max((lower - position).max(position - upper));
                }
                max_speed = max_speed.max(state.speeds.get(idx).map_or(0.0, |speed| speed.abs()));
                let effort = state.efforts.get(idx).map_or(0.0, |effort| effort.abs());
                let is_overloaded = joint
                    .max_effort
                    .is_some_and(|most| effort >= OVERLOAD_SHARE * most)
                    && !fingers.contains(&idx);
                if is_overloaded {
                    let began = *began.get_or_insert(state.time_secs);
                    overload_secs = overload_secs.max(state.time_secs - began);
                } else {
                    began = None;
                }
            }
            JointCourse {
                name: joint.name.clone(),
                max_excess,
                max_speed_share: joint.max_velocity.map_or(0.0, |most| max_speed / most),
                overload_secs,
            }
        })
        .collect()
}

/// Contacts between links that were not there in the first state.
fn self_contacts(
    watched: &Watched<'_>,
    states: &[State],
    touches: &[Touches],
) -> Vec<SelfCollision> {
    let model = &watched.episode.model;
    let mut met: BTreeMap<(usize, usize), SelfCollision> = BTreeMap::new();
    for (idx, touches) in touches.iter().enumerate() {
        for (owners, touch) in touches {
            let (Owner::Link(one), Owner::Link(other)) = owners else {
                continue;
            };
            if touches_at_start(watched, *owners) {
                continue;
            }
            let found = met.entry((*one, *other)).or_insert_with(|| {
                let mut pair = [*one, *other].map(|body| link_name(&model.bodies[body].name));
                pair.sort();
                SelfCollision {
                    pair,
                    start_secs: since(states, idx),
                    max_depth_m: 0.0,
                    press: SelfPress {
                        max_force_n: 0.0,
                        of_hand: watched.cast.is_of_hand(*one) && watched.cast.is_of_hand(*other),
                    },
                }
            });
            found.max_depth_m = found.max_depth_m.max(touch.depth_m);
            found.press.max_force_n = found.press.max_force_n.max(touch.normal_n);
        }
    }
    let mut met: Vec<SelfCollision> = met.into_values().collect();
    met.sort_by(|a, b| a.pair.cmp(&b.pair));
    met
}

/// Whether two owners touch each other in the first state of the episode.
fn touches_at_start(watched: &Watched<'_>, owners: (Owner, Owner)) -> bool {
    watched
        .episode
        .states
        .first()
        .is_some_and(|first| watched.touches(first).contains_key(&owners))
}

fn held(watched: &Watched<'_>, states: &[State], touches: &[Touches]) -> Vec<HeldCourse> {
    let mut courses: BTreeMap<usize, (f64, f64)> = BTreeMap::new();
    for (idx, touches) in touches.iter().enumerate() {
        for thing in watched.held(touches) {
            let secs = match idx.checked_sub(1) {
                Some(before) => states[idx].time_secs - states[before].time_secs,
                None => 0.0,
            };
            let tilt = watched.tilt(&watched.cast.things[thing], &states[idx]);
            let (held_secs, max_tilt) = courses.entry(thing).or_default();
            *held_secs += secs;
            *max_tilt = max_tilt.max(tilt);
        }
    }
    courses
        .into_iter()
        .map(|(thing, (held_secs, max_tilt_rad))| HeldCourse {
            id: watched.cast.things[thing].id.clone(),
            held_secs,
            max_tilt_rad,
        })
        .collect()
}

fn clearances(watched: &Watched<'_>, states: &[State], touches: &[Touches]) -> Vec<Clearance> {
    let cast = watched.cast;
    let mut smallest = vec![RANGE_M; cast.things.len()];
    for pair in touches.iter().flat_map(BTreeMap::keys) {
        if let (Owner::Thing(thing), Owner::Link(_)) = pair {
            smallest[*thing] = 0.0;
        }
    }
    for state in states {
        for (idx, thing) in cast.things.iter().enumerate() {
            let pose = thing.pose(&state.poses);
            for (body, link) in &watched.links {
                if smallest[idx] <= 0.0 {
                    break;
                }
                let at = state
                    .poses
                    .get(*body)
                    .map_or_else(Isometry3::identity, Pose::to_isometry);
                smallest[idx] = link.gap(&at, &watched.solids[idx], &pose, smallest[idx]);
            }
        }
    }
    cast.things
        .iter()
        .zip(smallest)
        .filter(|(_, smallest)| *smallest < RANGE_M)
        .map(|(thing, smallest_m)| Clearance {
            id: thing.id.clone(),
            smallest_m,
        })
        .collect()
}

/// Returns the quantities over time, at the constant period of the recording.
fn samples(watched: &Watched<'_>, states: &[State], touches: &[Touches], lacks: &Lacks) -> Samples {
    let Some(period_secs) = period(states) else {
        return Samples::default();
    };
    // The last state that is not later than each sample.
    let end_secs = since(states, states.len() - 1);
    let mut picked = Vec::new();
    let mut number = 0u32;
    while f64::from(number) * period_secs <= end_secs + period_secs / 2.0 {
        let at_secs = states[0].time_secs + f64::from(number) * period_secs + period_secs / 4.0;
        let after = states.partition_point(|state| state.time_secs <= at_secs);
        picked.push(after.saturating_sub(1));
        number += 1;
    }
    let mut recorded = Recorded {
        picked: &picked,
        series: Vec::new(),
    };
    let has_velocities = !lacks.has(Quantity::Velocities) && !states[0].velocities.is_empty();
    let movable = (watched.cast.things.iter().enumerate()).filter(|(_, thing)| !thing.fixed);
    for (idx, thing) in movable {
        let poses: Vec<Pose> = states
            .iter()
            .map(|state| Pose::from_isometry(&thing.pose(&state.poses)))
            .collect();
        recorded.poses(&thing.id, &poses);
        if has_velocities {
            for (column, quantity) in VELOCITY.into_iter().enumerate() {
                recorded.put(&thing.id, "", quantity, |at| {
                    watched.velocities(thing, &states[at])[column / 3][column % 3]
                });
            }
        }
        recorded.put(&thing.id, "", "held", |at| {
            f64::from(u8::from(watched.held(&touches[at]).contains(&idx)))
        });
    }
    let hands: Vec<Pose> = states.iter().map(|state| watched.hand(state)).collect();
    recorded.poses("gripper", &hands);
    recorded.put("gripper", "", "opening", |at| watched.opening(&states[at]));
    for (column, quantity) in ["baseX", "baseY", "baseYaw"].into_iter().enumerate() {
        recorded.put("robot", "", quantity, |at| {
            watched.base(&states[at])[column]
        });
    }
    for (idx, joint) in watched.robot_joints() {
        let name = format!("joint/{}", joint.name);
        for (quantity, values) in [
            ("position", State::positions as fn(&State) -> &[f64]),
            ("velocity", State::speeds),
            ("effort", State::efforts),
        ] {
            if !values(&states[0]).is_empty() {
                recorded.put(&name, "", quantity, |at| {
                    values(&states[at]).get(idx).copied().unwrap_or_default()
                });
            }
        }
    }
    let mut pairs: Vec<(Owner, Owner)> = touches.iter().flat_map(BTreeMap::keys).copied().collect();
    pairs.sort_unstable();
    pairs.dedup();
    for owners in pairs {
        let mut pair =
            [owners.0, owners.1].map(|owner| watched.cast.name(owner, &watched.episode.model));
        pair.sort();
        recorded.put(&pair[0], &pair[1], "contactForce", |at| {
            touches[at].get(&owners).map_or(0.0, |touch| touch.normal_n)
        });
    }
    Samples {
        period_secs,
        count: picked.len(),
        series: recorded.series,
    }
}

/// Returns the median time between two states, or `None` if there is only one. Unit: seconds.
///
/// If the times are very irregular, it is longer: there are at most four samples for each state.
fn period(states: &[State]) -> Option<f64> {
    let mut steps: Vec<f64> = states
        .windows(2)
        .map(|pair| pair[1].time_secs - pair[0].time_secs)
        .filter(|step| *step > 0.0)
        .collect();
    steps.sort_by(f64::total_cmp);
    let end_secs = since(states, states.len() - 1);
    let median = steps.get(steps.len() / 2)?;
    Some(median.max(end_secs / (4 * states.len()) as f64))
}

/// The series of some states.
struct Recorded<'a> {
    picked: &'a [usize],
    series: Vec<Series>,
}

impl Recorded<'_> {
    fn put(&mut self, thing: &str, other: &str, quantity: &str, value: impl Fn(usize) -> f64) {
        let mut series = Series::recorded(thing, other, quantity);
        self.picked.iter().for_each(|at| series.push(value(*at)));
        self.series.push(series);
    }

    fn poses(&mut self, thing: &str, poses: &[Pose]) {
        for (column, quantity) in POSE.into_iter().enumerate() {
            self.put(thing, "", quantity, |at| match column {
                0..3 => poses[at].position[column],
                _ => poses[at].rotation[column - 3],
            });
        }
    }
}

impl State {
    fn positions(&self) -> &[f64] {
        &self.positions
    }

    fn speeds(&self) -> &[f64] {
        &self.speeds
    }

    fn efforts(&self) -> &[f64] {
        &self.efforts
    }
}
