//! Reads quantities over time, and derives others from them.

use std::collections::{BTreeMap, BTreeSet};

use actcheck_base::{did_you_mean, tilt_of};
use actcheck_data::{Extremes, IntervalKind, Samples, Series};

use crate::lacks::Lacks;
use crate::reader::At;
use crate::snapshot::State;
use crate::{Key, Value};

/// Quantities over time of one thing, by the recorded ones from which they follow.
const DERIVED: [(&str, &[&str]); 11] = [
    ("tilt", &["qx", "qy", "qz", "qw"]),
    ("yaw", &["qx", "qy", "qz", "qw"]),
    ("speed", &["x", "y", "z"]),
    ("acceleration", &["x", "y", "z"]),
    ("acceleration2d", &["x", "y", "z"]),
    ("accelerationZ", &["x", "y", "z"]),
    ("jerk", &["x", "y", "z"]),
    ("rise", &["x", "y", "z"]),
    ("displacement", &["x", "y", "z"]),
    ("pathLength", &["x", "y", "z"]),
    ("angularSpeed", &["wx", "wy", "wz"]),
];
/// Quantities over time of bodies.
const OF_BODIES: [&str; 14] = [
    "x", "y", "z", "qx", "qy", "qz", "qw", "vx", "vy", "vz", "wx", "wy", "wz", "held",
];
/// Quantities over time of the robot.
const OF_ROBOT: [&str; 10] = [
    "opening",
    "baseX",
    "baseY",
    "baseYaw",
    "believedX",
    "believedY",
    "believedYaw",
    "position",
    "velocity",
    "effort",
];

/// Quantities over time, in the units of the caller.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Course {
    pub(crate) period_secs: f64,
    pub(crate) count: usize,
    /// By quantity, thing and second thing (or an empty text).
    pub(crate) series: Vec<Quantity>,
    /// Whether pairs without a force did not touch each other.
    pub(crate) forces: bool,
}

/// One quantity over time.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Quantity {
    pub(crate) name: String,
    pub(crate) thing: String,
    pub(crate) other: String,
    pub(crate) values: Vec<f64>,
}

/// Reads the samples of an action. Returns `None` for `None`.
pub(crate) fn read(at: &At<'_>, state: &State) -> Option<Course> {
    if at.is_none() {
        return None;
    }
    let mut course = Course::default();
    let mut counts: BTreeSet<usize> = BTreeSet::new();
    let mut has_period = false;
    for (key, at) in at.entries("quantities by their things") {
        match key {
            Key::One(name) if name == "period" => {
                has_period = true;
                course.period_secs = at.amount().unwrap_or(1.0);
                if course.period_secs == 0.0 {
                    at.fault("J002", "it must be greater than 0", "");
                }
            }
            Key::One(thing) => {
                check_thing(&at, thing, state);
                read_thing(&at, [thing, ""], &mut course, &mut counts);
            }
            Key::Pair(pair) => {
                let mut pair = pair.clone();
                pair.sort();
                for thing in &pair {
                    if !thing.starts_with("robot/") {
                        check_thing(&at, thing, state);
                    }
                }
                course.forces = true;
                read_thing(&at, [&pair[0], &pair[1]], &mut course, &mut counts);
            }
        }
    }
    if matches!(at.value(), Value::Map(_)) && !has_period {
        let help = "give the time between two samples in seconds: `\"period\": 0.05`";
        at.fault("J004", "`period` is missing", help);
    }
    if counts.len() > 1 {
        at.fault("J002", "all arrays must have the same length", "");
    }
    course.count = counts.first().copied().unwrap_or(0);
    Some(course)
}

fn check_thing(at: &At<'_>, thing: &str, state: &State) {
    let is_known = ["robot", "gripper", "floor"].contains(&thing)
        || thing.starts_with("joint/")
        || state.is_thing(thing);
    if !is_known {
        let known = state.snapshot.bodies.iter().map(|body| body.id.as_str());
        let known = known.chain(["robot", "gripper", "joint/NAME"]);
        let help = did_you_mean(thing, known.collect::<Vec<&str>>());
        at.fault("J007", "no body has this id", &help);
    }
}

fn read_thing(
    at: &At<'_>,
    [thing, other]: [&str; 2],
    course: &mut Course,
    counts: &mut BTreeSet<usize>,
) {
    let known: &[&str] = match thing {
        _ if !other.is_empty() => &["contactForce"],
        "gripper" => &["x", "y", "z", "qx", "qy", "qz", "qw", "opening"],
        "robot" => &OF_ROBOT[1..7],
        _ if thing.starts_with("joint/") => &OF_ROBOT[7..],
        _ => &OF_BODIES,
    };
    let table = at.table(known);
    for name in known {
        let Some(at) = table.get(name) else { continue };
        let values = match at.value() {
            // `held` is a truth value.
            Value::List(values) if values.iter().any(|it| matches!(it, Value::Bool(_))) => {
                let truths: Option<Vec<f64>> = at
                    .list("truth values")
                    .iter()
                    .map(|at| at.truth().map(|truth| f64::from(u8::from(truth))))
                    .collect();
                truths.unwrap_or_default()
            }
            _ => at
                .numbers("an array of numbers")
                .unwrap_or_default()
                .to_vec(),
        };
        counts.insert(values.len());
        course.series.push(Quantity {
            name: (*name).to_owned(),
            thing: thing.to_owned(),
            other: other.to_owned(),
            values,
        });
    }
}

impl Course {
    fn get(&self, thing: &str, name: &str) -> Option<&[f64]> {
        self.series
            .iter()
            .find(|it| it.name == name && it.thing == thing && it.other.is_empty())
            .map(|it| it.values.as_slice())
    }

    fn all<const N: usize>(&self, thing: &str, names: [&str; N]) -> Option<[&[f64]; N]> {
        let mut found = [&[] as &[f64]; N];
        for (slot, name) in found.iter_mut().zip(names) {
            *slot = self.get(thing, name)?;
        }
        Some(found)
    }

    /// Returns the samples, with the resolution of our own.
    pub(crate) fn samples(&self) -> Samples {
        let series = self.series.iter().map(|quantity| {
            let mut series = Series::recorded(&quantity.thing, &quantity.other, &quantity.name);
            quantity.values.iter().for_each(|value| series.push(*value));
            series
        });
        Samples {
            period_secs: self.period_secs,
            count: self.count,
            series: series.collect(),
        }
    }

    /// Notes the quantities that no thing has, and those that some thing lacks.
    pub(crate) fn note_missing(&self, state: &State, lacks: &mut Lacks) {
        let movable: Vec<&str> = state
            .snapshot
            .bodies
            .iter()
            .filter(|body| !body.fixed)
            .map(|body| body.id.as_str())
            .collect();
        let recorded: BTreeSet<&str> = self.series.iter().map(|it| it.name.as_str()).collect();
        let has_each = |name: &str| movable.iter().all(|thing| self.get(thing, name).is_some());
        let mut missing = |name: &str, some: bool, each: bool| {
            if !some {
                lacks.add_one(format!("samples/{name}"));
            } else if !each {
                lacks.add_one(format!("samples/each/{name}"));
            }
        };
        for name in OF_BODIES {
            missing(name, recorded.contains(name), has_each(name));
        }
        for name in OF_ROBOT {
            missing(name, recorded.contains(name), true);
        }
        for (name, from) in DERIVED {
            let some = from.iter().all(|name| recorded.contains(name));
            missing(name, some, from.iter().all(|name| has_each(name)));
        }
        missing("contactForce", self.forces, true);
    }

    /// Returns when things were held or moved, and whether that is known of each thing.
    pub(crate) fn intervals(&self, state: &State) -> Vec<(IntervalKind, bool)> {
        let bodies = state.snapshot.bodies.iter().filter(|body| !body.fixed);
        let known = |names: &[&str]| {
            bodies
                .clone()
                .all(|body| names.iter().all(|name| self.get(&body.id, name).is_some()))
        };
        vec![
            (IntervalKind::Hold, known(&["held"])),
            (IntervalKind::Motion, known(&["vx", "vy", "vz"])),
        ]
    }

    /// Returns the extremes of a thing, as far as they follow: tilt, speed, and rise with
    /// displacement.
    pub(crate) fn extremes(&self, thing: &str) -> (Extremes, [bool; 3]) {
        let mut found = still(thing);
        let mut known = [false; 3];
        if let Some([x, y, z, w]) = self.all(thing, ["qx", "qy", "qz", "qw"]) {
            let tilts = (0..self.count).map(|at| tilt_of([x[at], y[at], z[at], w[at]]));
            found.max_tilt_rad = tilts.fold(0.0, f64::max);
            known[0] = true;
        }
        if let Some(velocity) = self.all(thing, ["vx", "vy", "vz"]) {
            let speeds = (0..self.count).map(|at| norm(velocity.map(|part| part[at])));
            found.max_speed = speeds.fold(0.0, f64::max);
            known[1] = true;
        }
        if let Some(place) = self.all(thing, ["x", "y", "z"]) {
            for at in 0..self.count {
                let way = place.map(|part| part[at] - part[0]);
                found.max_rise_m = found.max_rise_m.max(way[2]);
                found.max_displacement_m = found.max_displacement_m.max(norm(way));
            }
            known[2] = true;
        }
        (found, known)
    }
}

/// The extremes of a thing that does not move.
pub(crate) fn still(thing: &str) -> Extremes {
    Extremes {
        id: thing.to_owned(),
        max_tilt_rad: 0.0,
        max_speed: 0.0,
        max_rise_m: 0.0,
        max_displacement_m: 0.0,
    }
}

pub(crate) fn norm([x, y, z]: [f64; 3]) -> f64 {
    (x * x + y * y + z * z).sqrt()
}

/// Collects quantities sample by sample.
#[derive(Debug, Clone, Default)]
pub(crate) struct Recorder {
    course: Course,
    places: BTreeMap<(String, String, &'static str), usize>,
}

impl Recorder {
    /// Adds the value of a quantity at the newest sample. A quantity that begins late, such as the
    /// force of a new contact, was 0 before.
    pub(crate) fn put(&mut self, thing: &str, other: &str, name: &'static str, value: f64) {
        let at = self.course.count;
        let key = (thing.to_owned(), other.to_owned(), name);
        let next = self.course.series.len();
        let place = *self.places.entry(key).or_insert(next);
        if place == next {
            self.course.series.push(Quantity {
                name: name.to_owned(),
                thing: thing.to_owned(),
                other: other.to_owned(),
                values: Vec::new(),
            });
        }
        let values = &mut self.course.series[place].values;
        values.resize(at, 0.0);
        values.push(value);
    }

    /// Ends a sample: quantities without a value in it are 0.
    pub(crate) fn end_sample(&mut self) {
        self.course.count += 1;
        let count = self.course.count;
        for quantity in &mut self.course.series {
            quantity.values.resize(count, 0.0);
        }
    }

    /// Returns the quantities so far.
    pub(crate) fn course(&mut self) -> &mut Course {
        &mut self.course
    }
}
