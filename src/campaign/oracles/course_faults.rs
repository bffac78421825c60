//! The table of faults of the course: they change only the recorded course, not the states before
//! and after. One fault also adds a person to both states.

use crate::Env;
use crate::oracles::retouch::{Retouch, distance};
use actcheck_config::Step;
use actcheck_data::Trace;

/// A fault of the course of an action that properties about time should detect.
///
/// It is put into the samples of a run that was made without a fault, so that nothing is simulated
/// again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CourseFault {
    /// Its name in results.
    pub name: &'static str,
    /// The fault in one sentence.
    pub description: &'static str,
    /// The action whose course is changed.
    pub action: &'static str,
    /// The change.
    pub change: CourseChange,
}

/// Changes of a recorded course.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CourseChange {
    /// The hand moves the last 15 cm before the first touch at 0.6 m/s and stops there.
    FastApproach,
    /// Hand and object move 8 cm to the side before the object is lifted.
    Dragged,
    /// The carried object tips by 60 degrees.
    Tipped,
    /// The carried object falls out of the hand.
    DroppedInTheAir,
    /// The fingers leave the object for 0.4 s and close again.
    GraspedTwice,
    /// Hand and object are jerked: up to 30 m/s².
    Jerked,
    /// Hand and object swing to the side: up to 12 m/s².
    Swung,
    /// A finger presses the object with 90 N for half a second.
    Squeezed,
    /// The object slides down in the hand at 12 cm/s for 0.7 s.
    Slipping,
    /// The object swings in the last half second.
    SwingsAtTheEnd,
    /// The hand takes a detour.
    HandDetour,
    /// The hand shakes at 15 Hz, by 5 mm.
    Shaking,
    /// A person of 1.75 m is at most 20 cm from the carried object.
    PersonNear,
    /// The base believes for a third of the time that it is 30 cm beside its place.
    BeliefJumps,
    /// The base is jerked: up to 30 m/s².
    BaseJerked,
    /// The base takes a detour.
    BaseDetour,
    /// Nothing moves: the object stays in the hand.
    NothingMoves,
    /// The hand lets go at the highest point, at least 25 cm above the final height.
    DroppedFromHigh,
    /// Hand and object move sideways at 0.4 m/s when the fingers open.
    Thrown,
    /// The object rocks from its release to the end.
    Rocking,
    /// The hand touches the object again at the end.
    TouchedAgain,
}

/// Height from which an object counts as dropped. Unit: metres. It falls for 0.2 s: longer than the
/// 0.1 s for which the fingers may lose contact.
const HIGH_M: f64 = 0.25;

/// A fault of the course of one action.
const fn fault(
    name: &'static str,
    action: &'static str,
    change: CourseChange,
    description: &'static str,
) -> CourseFault {
    CourseFault {
        name,
        description,
        action,
        change,
    }
}

/// All faults of courses, in the order of the table of results. To add one, add a row and its
/// change.
pub const COURSE_FAULTS: [CourseFault; 21] = [
    fault(
        "fast-approach",
        "Pick",
        CourseChange::FastApproach,
        "the hand does not slow down before it touches the object",
    ),
    fault(
        "dragged",
        "Pick",
        CourseChange::Dragged,
        "the hand drags the object before it lifts it",
    ),
    fault(
        "tipped",
        "Pick",
        CourseChange::Tipped,
        "the carried object tips",
    ),
    fault(
        "dropped",
        "Pick",
        CourseChange::DroppedInTheAir,
        "the carried object falls out of the hand",
    ),
    fault(
        "grasped-twice",
        "Pick",
        CourseChange::GraspedTwice,
        "the fingers leave the object and grasp it again",
    ),
    fault(
        "jerked",
        "Pick",
        CourseChange::Jerked,
        "hand and object are jerked",
    ),
    fault(
        "swung",
        "Pick",
        CourseChange::Swung,
        "hand and object swing to the side",
    ),
    fault(
        "squeezed",
        "Pick",
        CourseChange::Squeezed,
        "a finger presses the object too hard for half a second",
    ),
    fault(
        "slipping",
        "Pick",
        CourseChange::Slipping,
        "the object slides in the hand for longer than half a second",
    ),
    fault(
        "swings-at-the-end",
        "Pick",
        CourseChange::SwingsAtTheEnd,
        "the object still swings when the action ends",
    ),
    fault(
        "hand-detour",
        "Pick",
        CourseChange::HandDetour,
        "the hand takes a detour",
    ),
    fault("shaking", "Pick", CourseChange::Shaking, "the hand shakes"),
    fault(
        "person-near",
        "Pick",
        CourseChange::PersonNear,
        "a person is next to the carried object",
    ),
    fault(
        "belief-jumps",
        "MoveTo",
        CourseChange::BeliefJumps,
        "the believed position jumps aside for a while",
    ),
    fault(
        "base-jerked",
        "MoveTo",
        CourseChange::BaseJerked,
        "the base is jerked",
    ),
    fault(
        "base-detour",
        "MoveTo",
        CourseChange::BaseDetour,
        "the base takes a detour",
    ),
    fault(
        "nothing-moves",
        "Place",
        CourseChange::NothingMoves,
        "nothing moves, and the object stays in the hand",
    ),
    fault(
        "dropped-from-high",
        "Place",
        CourseChange::DroppedFromHigh,
        "the hand lets go high above the surface",
    ),
    fault(
        "thrown",
        "Place",
        CourseChange::Thrown,
        "the hand still moves when it lets go",
    ),
    fault(
        "rocking",
        "Place",
        CourseChange::Rocking,
        "the released object rocks to the end",
    ),
    fault(
        "touched-again",
        "Place",
        CourseChange::TouchedAgain,
        "the hand touches the released object again",
    ),
];

impl CourseFault {
    /// Whether it can occur in a test with these actions, and some rule reads courses.
    pub fn concerns(&self, test: &[Step], env: &Env) -> bool {
        env.rules.reads_course() && test.iter().any(|step| step.action == self.action)
    }

    /// Puts the fault into the first action of its kind. Returns whether the course has the moment
    /// that the fault needs.
    pub fn put_into(&self, trace: &mut Trace) -> bool {
        let step = trace
            .actions
            .iter()
            .position(|action| action.action == self.action);
        step.and_then(|step| Retouch::new(trace, step))
            .and_then(|mut course| self.change.apply(&mut course))
            .is_some()
    }
}

impl CourseChange {
    fn apply(self, course: &mut Retouch<'_>) -> Option<()> {
        let object = course.object.clone();
        let both = ["gripper", object.as_str()];
        let last = course.count() - 1;
        match self {
            Self::FastApproach => approach_fast(course),
            Self::Dragged => {
                let places = course.position(&object)?;
                let lifted = places
                    .iter()
                    .position(|place| place[2] - places[0][2] > 0.015)?;
                let offset = course.ramp(lifted.saturating_sub(course.ticks(0.5))..lifted, 0.08);
                course.shift(&both, 0, &offset)
            }
            Self::Tipped => tip(course),
            Self::DroppedInTheAir => {
                let down_to = course.position(&object)?[0][2];
                course.drop(course.carrying()?, down_to)
            }
            Self::GraspedTwice => {
                let again = course.held()?.iter().position(|held| *held)? + course.ticks(0.1);
                course.hold(again..again + course.ticks(0.4), false)
            }
            Self::Jerked => course.shift(&both, 0, &course.swing(course.carrying()?, 0.2, 0.06)),
            Self::Swung => course.shift(&both, 1, &course.swing(course.carrying()?, 0.3, 0.055)),
            Self::Squeezed => {
                let held = course.carrying()?;
                course.press(held..held + course.ticks(0.5), 90.0)
            }
            Self::Slipping => {
                let from = course.carrying()?;
                let during = from..from + course.ticks(0.7);
                course.shift(&[&object], 2, &course.ramp(during.clone(), -0.12 * 0.7))?;
                course.hold(during, true)
            }
            Self::SwingsAtTheEnd => {
                let from = course.count().saturating_sub(course.ticks(0.5));
                course.shift(&[&object], 0, &course.sway(from..last + 1, 2.0, 0.02))
            }
            Self::HandDetour => {
                let places = course.position("gripper")?;
                let far = places
                    .iter()
                    .map(|place| distance(*place, places[0]))
                    .fold(0.0, f64::max);
                course.shift(
                    &["gripper"],
                    1,
                    &course.detour(4.0 * (far + 0.1) + 1.0, 0.1),
                )
            }
            Self::Shaking => {
                let from = course.count() / 3;
                course.shift(
                    &["gripper"],
                    0,
                    &course.sway(from..from + course.ticks(0.5), 15.0, 0.005),
                )
            }
            Self::PersonNear => stand_near(course),
            Self::BeliefJumps => {
                let third = course.count() / 3;
                let offset: Vec<f64> = (0..=last)
                    .map(|idx| {
                        if (third..2 * third).contains(&idx) {
                            0.3
                        } else {
                            0.0
                        }
                    })
                    .collect();
                course.shift_base(&["believedX"], &offset)
            }
            Self::BaseJerked => course.shift_base(
                &["baseX", "believedX"],
                &course.swing(course.count() / 2, 0.2, 0.06),
            ),
            Self::BaseDetour => {
                let (x, y) = (course.get("robot", "baseX")?, course.get("robot", "baseY")?);
                let way = distance([x[0], y[0], 0.0], [x[last], y[last], 0.0]);
                course.shift_base(
                    &["baseY", "believedY"],
                    &course.detour(4.0 * way + 2.0, 0.3),
                )
            }
            Self::NothingMoves => {
                course.freeze();
                Some(())
            }
            Self::DroppedFromHigh => {
                let (held, places) = (course.held()?, course.position(&object)?);
                let (lifting, down_to) = (course.ticks(0.5), places[last][2]);
                let up = (lifting..=last).filter(|idx| held[*idx]);
                let highest = up.max_by(|a, b| places[*a][2].total_cmp(&places[*b][2]))?;
                let higher = (down_to + HIGH_M - places[highest][2]).max(0.0);
                course.shift(&both, 2, &course.ramp(highest - lifting..highest, higher))?;
                course.drop(highest, down_to)
            }
            Self::Thrown => {
                let let_go = course.release()?;
                let during = let_go.saturating_sub(course.ticks(0.25))..let_go + course.ticks(0.1);
                let way = 0.4 * during.len() as f64 * course.period();
                course.shift(&both, 0, &course.ramp(during, way))
            }
            Self::Rocking => {
                let let_go = course.release()?;
                course.shift(&[&object], 0, &course.sway(let_go..last + 1, 2.0, 0.01))
            }
            Self::TouchedAgain => {
                // The object must have been free for half a second.
                let let_go = course.release()?;
                (let_go + course.ticks(0.7) < last).then_some(())?;
                course.press(last - 3..last + 1, 5.0)
            }
        }
    }
}

/// Lets the hand cover its way to the object late, fast, and without slowing down.
fn approach_fast(course: &mut Retouch<'_>) -> Option<()> {
    const NEAR_M: f64 = 0.15;
    const SPEED: f64 = 0.6;
    let touch = course.first_touch()?;
    let (mut hand, object) = (
        course.position("gripper")?,
        course.position(&course.object.clone())?,
    );
    let start = (0..touch)
        .rev()
        .find(|idx| distance(hand[*idx], object[*idx]) > NEAR_M)?;
    let way = hand[start..touch].to_vec();
    let mut lengths = vec![0.0];
    for pair in way.windows(2) {
        lengths.push(lengths.last().copied().unwrap_or(0.0) + distance(pair[0], pair[1]));
    }
    let whole = *lengths.last()?;
    for (idx, place) in hand.iter_mut().enumerate().take(touch).skip(start) {
        let left = SPEED * course.period() * (touch - 1 - idx) as f64;
        let along = (whole - left).max(0.0);
        let before = lengths.iter().rposition(|length| *length <= along)?;
        let after = (before + 1).min(way.len() - 1);
        let between = lengths[after] - lengths[before];
        let share = if between > 0.0 {
            (along - lengths[before]) / between
        } else {
            0.0
        };
        *place = [0, 1, 2]
            .map(|axis| way[before][axis] + share * (way[after][axis] - way[before][axis]));
    }
    course.move_to("gripper", &hand);
    Some(())
}

/// Rotates the object about the horizontal x axis, by 60 degrees within half a second.
fn tip(course: &mut Retouch<'_>) -> Option<()> {
    const ANGLE: f64 = 1.05;
    let (object, from) = (course.object.clone(), course.carrying()?);
    let angles = course.ramp(from..from + course.ticks(0.5), ANGLE);
    let (x, y) = (course.get(&object, "qx")?, course.get(&object, "qy")?);
    let (z, w) = (course.get(&object, "qz")?, course.get(&object, "qw")?);
    let (sin, cos) = (
        |angle: &f64| libm::sin(angle / 2.0),
        |angle: &f64| libm::cos(angle / 2.0),
    );
    let product = |of: &dyn Fn(f64, f64, usize) -> f64| -> Vec<f64> {
        angles
            .iter()
            .enumerate()
            .map(|(idx, angle)| of(sin(angle), cos(angle), idx))
            .collect()
    };
    course.put(
        &object,
        "qx",
        &product(&|s, c, idx| c * x[idx] + s * w[idx]),
    );
    course.put(
        &object,
        "qy",
        &product(&|s, c, idx| c * y[idx] - s * z[idx]),
    );
    course.put(
        &object,
        "qz",
        &product(&|s, c, idx| c * z[idx] + s * y[idx]),
    );
    course.put(
        &object,
        "qw",
        &product(&|s, c, idx| c * w[idx] - s * x[idx]),
    );
    Some(())
}

/// Adds a person next to the place at which the object is carried.
fn stand_near(course: &mut Retouch<'_>) -> Option<()> {
    const SIZE_M: [f64; 3] = [0.4, 0.4, 1.75];
    const BESIDE_M: f64 = 0.2;
    let [x, y, _] = course.position(&course.object)?[course.carrying()?];
    let object = course.object.clone();
    for snapshot in &mut course.trace.snapshots {
        let mut person = snapshot
            .bodies
            .iter()
            .find(|body| body.id == object)?
            .clone();
        (person.id, person.model) = ("person_1".to_owned(), "person".to_owned());
        person.category = "https://w3id.org/actcheck/world#Person".to_owned();
        person.fixed = true;
        person.pose.position = [x + BESIDE_M + SIZE_M[0] / 2.0, y, 0.0];
        person.pose.rotation = [0.0, 0.0, 0.0, 1.0];
        (person.linear_velocity, person.angular_velocity) = ([0.0; 3], [0.0; 3]);
        let middle = [
            person.pose.position[0],
            person.pose.position[1],
            SIZE_M[2] / 2.0,
        ];
        person.aabb_min = [0, 1, 2].map(|axis| middle[axis] - SIZE_M[axis] / 2.0);
        person.aabb_max = [0, 1, 2].map(|axis| middle[axis] + SIZE_M[axis] / 2.0);
        person.size_m = SIZE_M;
        (person.touches, person.rests_on) = (Vec::new(), vec!["floor".to_owned()]);
        person.grasp_distance_m = None;
        snapshot.bodies.push(person);
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oracles::FAULTS;

    #[test]
    fn every_fault_of_a_course_has_a_unique_name_and_change() {
        for (idx, fault) in COURSE_FAULTS.iter().enumerate() {
            let others = &COURSE_FAULTS[..idx];
            assert!(
                others
                    .iter()
                    .all(|other| other.name != fault.name && other.change != fault.change)
            );
            assert!(
                FAULTS.iter().all(|other| other.name != fault.name),
                "{}",
                fault.name
            );
        }
    }

    #[test]
    fn a_course_that_was_not_recorded_has_no_faults() {
        assert!(
            COURSE_FAULTS
                .iter()
                .all(|fault| !fault.put_into(&mut Trace::default()))
        );
    }
}
