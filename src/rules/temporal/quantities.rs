//! Quantities that formulas may read: the recorded ones, and those that follow from them.

use std::collections::BTreeSet;

use crate::temporal::formula::{CheckedFormula, Quantity, Thing};
use crate::temporal::gap::gaps;
use actcheck_base::{Course, Signal, names, tilt_of, yaw_of};

/// Name of a quantity in the world vocabulary, and the number of things it is of.
const QUANTITIES: [(&str, usize); 43] = [
    ("x", 1),
    ("y", 1),
    ("z", 1),
    ("qx", 1),
    ("qy", 1),
    ("qz", 1),
    ("qw", 1),
    ("vx", 1),
    ("vy", 1),
    ("vz", 1),
    ("wx", 1),
    ("wy", 1),
    ("wz", 1),
    ("opening", 1),
    ("baseX", 1),
    ("baseY", 1),
    ("baseYaw", 1),
    ("believedX", 1),
    ("believedY", 1),
    ("believedYaw", 1),
    ("position", 1),
    ("velocity", 1),
    ("effort", 1),
    ("held", 1),
    ("tilt", 1),
    ("yaw", 1),
    ("speed", 1),
    ("angularSpeed", 1),
    ("acceleration", 1),
    ("acceleration2d", 1),
    ("accelerationZ", 1),
    ("jerk", 1),
    ("rise", 1),
    ("displacement", 1),
    ("pathLength", 1),
    ("distance", 2),
    ("distance2d", 2),
    ("gap", 2),
    ("relativeSpeed", 2),
    ("contactForce", 2),
    ("touches", 2),
    ("phase", 1),
    ("time", 0),
];

/// Returns the number of things that a quantity of the world vocabulary is of. Returns `None` for
/// an unknown quantity.
pub(crate) fn known_quantity(local: &str) -> Option<usize> {
    QUANTITIES
        .iter()
        .find(|(name, _)| *name == local)
        .map(|(_, things)| *things)
}

/// Returns the IRIs of the facts without which a formula has no value.
pub(crate) fn quantities_read(formula: &CheckedFormula) -> Vec<String> {
    let mut read = Vec::new();
    formula.visit(&mut |part| {
        let quantities = match part {
            CheckedFormula::Compare { left, right, .. } => vec![left, right],
            CheckedFormula::Truth { quantity, .. } => vec![quantity],
            _ => Vec::new(),
        };
        quantities
            .into_iter()
            .for_each(|quantity| recorded_for(quantity, &mut read));
    });
    read
}

/// Appends the IRIs of the recorded quantities that a number over time needs, and of the things that
/// it names.
fn recorded_for(quantity: &Quantity, read: &mut Vec<String>) {
    match quantity {
        Quantity::Number(_) | Quantity::Variable(_) => {}
        Quantity::Recorded { iri, things } => {
            read.extend(things.iter().filter_map(|thing| match thing {
                Thing::Constant(iri) => Some(iri.clone()),
                Thing::Variable(_) => None,
            }));
            match (iri.strip_prefix(names::W), things.len()) {
                (Some("angularSpeed"), _) => {
                    read.extend(["wx", "wy", "wz"].map(names::w));
                }
                (Some("gap"), _) => read.extend(["sizeX", "sizeY", "sizeZ"].map(names::w)),
                (Some("touches"), 2) => read.push(names::w("contactForce")),
                _ => read.push(iri.clone()),
            }
        }
        Quantity::Call(_, args) => args.iter().for_each(|arg| recorded_for(arg, read)),
    }
}

/// Returns the names of all quantities of the world vocabulary.
pub(crate) fn quantity_names() -> impl Iterator<Item = &'static str> + Clone {
    QUANTITIES.iter().map(|(name, _)| *name)
}

/// Returns a quantity at each sample. Returns `None` if it was not recorded and does not follow
/// from recorded ones.
pub(crate) fn values_of(course: &Course, iri: &str, things: &[String]) -> Option<Vec<f64>> {
    let first = things.first().map_or("", String::as_str);
    let second = things.get(1).map_or("", String::as_str);
    if let Some(signal) = course.get(iri, first, second) {
        return Some(signal.values(course.count));
    }
    let seconds = || (0..course.count).map(|idx| idx as f64 * course.period_secs);
    match (iri.strip_prefix(names::W)?, things) {
        ("time", []) => Some(seconds().collect()),
        ("phase", [name]) => Some(
            seconds()
                .map(|time| f64::from(u8::from(phase_at(course, time) == Some(name))))
                .collect(),
        ),
        ("distance", [a, b]) => Some(distances(&place(course, a)?, &place(course, b)?)),
        ("distance2d", [a, b]) => Some(distances(
            &flat(place(course, a)?),
            &flat(place(course, b)?),
        )),
        ("gap", [a, b]) => gaps(course, a, b),
        ("relativeSpeed", [a, b]) => {
            Some(norms(&rates(&seen_from(course, a, b)?, course.period_secs)))
        }
        ("contactForce", [a, b]) => force(course, a, b),
        ("touches", [a, b]) => Some(
            force(course, a, b)?
                .into_iter()
                .map(|force| f64::from(u8::from(force > 0.0)))
                .collect(),
        ),
        (local, [thing]) => of_one(course, local, thing),
        _ => None,
    }
}

/// Returns every thing of which a quantity was recorded, sorted.
pub(crate) fn things_of(course: &Course) -> BTreeSet<String> {
    course
        .signals()
        .filter(|(key, _)| key[2].is_empty())
        .map(|(key, _)| key[1].clone())
        .collect()
}

/// Returns a quantity that follows from the recorded ones of one thing.
fn of_one(course: &Course, local: &str, thing: &str) -> Option<Vec<f64>> {
    let [x0, y0, z0] = [0, 1, 2]
        .map(|axis| move |place: &[Vec<f64>; 3]| place[axis].first().copied().unwrap_or(f64::NAN));
    Some(match local {
        "x" | "y" | "z" => {
            let axis = usize::from(local.as_bytes().first()?.checked_sub(b'x')?);
            place(course, thing)?.into_iter().nth(axis)?
        }
        "yaw" if thing == names::w("robot") => recorded(course, "baseYaw", thing)?,
        "tilt" | "yaw" => {
            let [qx, qy, qz, qw] =
                ["qx", "qy", "qz", "qw"].map(|part| recorded(course, part, thing));
            let (qx, qy, qz, qw) = (qx?, qy?, qz?, qw?);
            let angle = if local == "tilt" { tilt_of } else { yaw_of };
            (0..course.count)
                .map(|idx| angle([qx[idx], qy[idx], qz[idx], qw[idx]]))
                .collect()
        }
        "speed" => norms(&velocity(course, thing)?),
        "angularSpeed" => {
            let [x, y, z] = ["wx", "wy", "wz"].map(|part| recorded(course, part, thing));
            norms(&[x?, y?, z?])
        }
        "acceleration" => norms(&rates(&velocity(course, thing)?, course.period_secs)),
        "acceleration2d" => norms(&flat(rates(&velocity(course, thing)?, course.period_secs))),
        "accelerationZ" => {
            let [_, _, z] = rates(&velocity(course, thing)?, course.period_secs);
            z
        }
        "jerk" => norms(&rates(
            &rates(&velocity(course, thing)?, course.period_secs),
            course.period_secs,
        )),
        "rise" => {
            let place = place(course, thing)?;
            let initial = z0(&place);
            place[2].iter().map(|z| z - initial).collect()
        }
        "displacement" => {
            let place = place(course, thing)?;
            let initial =
                [x0(&place), y0(&place), z0(&place)].map(|value| vec![value; course.count]);
            distances(&place, &initial)
        }
        "pathLength" => {
            let place = place(course, thing)?;
            let mut length = 0.0;
            let mut lengths = Vec::with_capacity(course.count);
            for idx in 0..course.count {
                let before = idx.saturating_sub(1);
                length += norm([0, 1, 2].map(|axis| place[axis][idx] - place[axis][before]));
                lengths.push(length);
            }
            lengths
        }
        _ => return None,
    })
}

pub(super) fn recorded(course: &Course, local: &str, thing: &str) -> Option<Vec<f64>> {
    Some(
        course
            .get(&names::w(local), thing, "")?
            .values(course.count),
    )
}

/// Returns the position of a thing. The robot is where its base is, on the floor.
pub(super) fn place(course: &Course, thing: &str) -> Option<[Vec<f64>; 3]> {
    if thing == names::w("robot") {
        let [x, y] = ["baseX", "baseY"].map(|part| recorded(course, part, thing));
        return Some([x?, y?, vec![0.0; course.count]]);
    }
    let [x, y, z] = ["x", "y", "z"].map(|part| recorded(course, part, thing));
    Some([x?, y?, z?])
}

fn flat([x, y, _]: [Vec<f64>; 3]) -> [Vec<f64>; 3] {
    let zeros = vec![0.0; x.len()];
    [x, y, zeros]
}

/// Returns the velocity of a thing: as recorded, or from its positions.
fn velocity(course: &Course, thing: &str) -> Option<[Vec<f64>; 3]> {
    match ["vx", "vy", "vz"].map(|part| recorded(course, part, thing)) {
        [Some(x), Some(y), Some(z)] => Some([x, y, z]),
        _ => Some(rates(&place(course, thing)?, course.period_secs)),
    }
}

/// Returns the position of one thing in the frame of another. A thing without an orientation has
/// that of the world.
fn seen_from(course: &Course, thing: &str, from: &str) -> Option<[Vec<f64>; 3]> {
    let (there, here) = (place(course, thing)?, place(course, from)?);
    let mut seen = [0, 1, 2].map(|axis| {
        (0..course.count)
            .map(|idx| there[axis][idx] - here[axis][idx])
            .collect::<Vec<_>>()
    });
    if let [Some(x), Some(y), Some(z), Some(w)] =
        ["qx", "qy", "qz", "qw"].map(|part| recorded(course, part, from))
    {
        for idx in 0..course.count {
            let turned = turned_back(
                [x[idx], y[idx], z[idx], w[idx]],
                [0, 1, 2].map(|axis| seen[axis][idx]),
            );
            (0..3).for_each(|axis| seen[axis][idx] = turned[axis]);
        }
    }
    Some(seen)
}

/// Rotates a vector by the inverse of a unit quaternion.
pub(super) fn turned_back([x, y, z, w]: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]
    };
    let axis = [-x, -y, -z];
    let once = cross(axis, v);
    let twice = cross(axis, once);
    [0, 1, 2].map(|idx| v[idx] + 2.0 * (w * once[idx] + twice[idx]))
}

/// Returns the change per second since the sample before; 0 at the first sample.
fn rates(values: &[Vec<f64>; 3], period_secs: f64) -> [Vec<f64>; 3] {
    [0, 1, 2].map(|axis| {
        let values = &values[axis];
        (0..values.len())
            .map(|idx| (values[idx] - values[idx.saturating_sub(1)]) / period_secs)
            .collect()
    })
}

fn norms(values: &[Vec<f64>; 3]) -> Vec<f64> {
    (0..values[0].len())
        .map(|idx| norm([0, 1, 2].map(|axis| values[axis][idx])))
        .collect()
}

fn norm([x, y, z]: [f64; 3]) -> f64 {
    (x * x + y * y + z * z).sqrt()
}

fn distances(a: &[Vec<f64>; 3], b: &[Vec<f64>; 3]) -> Vec<f64> {
    (0..a[0].len())
        .map(|idx| norm([0, 1, 2].map(|axis| a[axis][idx] - b[axis][idx])))
        .collect()
}

/// Returns the contact force of two things; 0 while they don't touch. The robot is all its links.
fn force(course: &Course, a: &str, b: &str) -> Option<Vec<f64>> {
    if !(is_body(course, a) && is_body(course, b)) {
        return None;
    }
    let matches =
        |thing: &str, asked: &str| thing == asked || (asked == names::w("robot") && is_link(thing));
    let name = names::w("contactForce");
    let mut sum = vec![0.0; course.count];
    for (pair, signal) in course.of(&name) {
        let [first, second] = pair else { continue };
        if (matches(first, a) && matches(second, b)) || (matches(first, b) && matches(second, a)) {
            add(&mut sum, signal, course.count);
        }
    }
    Some(sum)
}

fn add(sum: &mut [f64], signal: &Signal, count: usize) {
    sum.iter_mut()
        .zip(signal.values(count))
        .for_each(|(slot, value)| *slot += value);
}

fn is_link(thing: &str) -> bool {
    thing
        .strip_prefix(names::W)
        .is_some_and(|local| local.starts_with("link/"))
}

/// Returns whether a thing has contacts: a body, the robot, one of its links, or the floor.
fn is_body(course: &Course, thing: &str) -> bool {
    is_link(thing)
        || [names::w("robot"), names::w("floor")]
            .iter()
            .any(|known| known == thing)
        || course.get(&names::w("x"), thing, "").is_some()
}

/// Returns the phase of the action at a time.
fn phase_at(course: &Course, secs: f64) -> Option<&String> {
    course
        .phases
        .iter()
        .rev()
        .find(|(_, start)| *start <= secs + 1e-9)
        .map(|(name, _)| name)
}
