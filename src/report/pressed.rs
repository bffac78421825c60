//! The hardest contact of the robot with something that it is not to touch.

use actcheck_base::names::mentions;
use actcheck_data::{ActionTrace, ContactEpisode, Trace};

/// A contact with at least this force is shown even if no failure names it. Unit: newtons. It
/// slides 14 kg of furniture with a friction coefficient of 0.5.
const HARD_N: f64 = 70.0;
/// The designator of the object that the robot may touch.
pub(super) const TARGET: &str = "pickObject";
/// Prefix of the robot's links in traces.
const LINK: &str = "robot/";

/// A contact of a link of the robot.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Pressed {
    /// Name of the link; of two links, the first.
    pub link: String,
    /// Id of the object, name of the other link, or `floor`.
    pub thing: String,
    /// Whether the thing is another link of the robot.
    pub of_robot: bool,
    /// Largest normal force. Unit: newtons.
    pub force_n: f64,
    /// Start and end, since the run began. Unit: seconds.
    pub secs: [f64; 2],
    /// Position at the largest force. Unit: metres. Frame: world.
    pub point_m: [f64; 3],
}

impl Pressed {
    /// The pressed body's name in traces: the floor, an object, or another link of the robot.
    pub(super) fn body(&self) -> String {
        if self.of_robot {
            format!("{LINK}{}", self.thing)
        } else {
            self.thing.clone()
        }
    }

    /// The contact in a few words: `base_link presses coffee_table_1: 759 N`.
    pub(super) fn label(&self) -> String {
        let force = if self.force_n < 10.0 {
            format!("{:.1}", self.force_n)
        } else {
            format!("{:.0}", self.force_n)
        };
        let thing = if self.thing == "floor" {
            "the floor"
        } else {
            &self.thing
        };
        format!("{} presses {thing}: {force} N", self.link)
    }

    /// The contact with its time and its position.
    pub(super) fn sentence(&self) -> String {
        let ([start, end], [x, y, z]) = (self.secs, self.point_m);
        format!(
            "{}, from {start:.1} s to {end:.1} s, at x = {x:.2}, y = {y:.2}, z = {z:.2} m",
            self.label()
        )
    }
}

/// Returns the hardest contact that the witness of a failure names. `action_idx` is the index of
/// its action.
pub(super) fn pressed_in(trace: &Trace, action_idx: usize, witness: &str) -> Option<Pressed> {
    hardest(of_action(trace, action_idx).filter(|pressed| is_named(pressed, witness)))
}

/// Returns the hardest contact of a run, given the failures of its actions: index of the action and
/// witness. Contacts that no failure names count if they are hard.
pub(super) fn hardest_of_run<'a>(
    trace: &Trace,
    failures: impl Iterator<Item = (usize, &'a str)>,
) -> Option<Pressed> {
    let named = failures.filter_map(|(idx, witness)| pressed_in(trace, idx, witness));
    let hard = (0..trace.actions.len())
        .flat_map(|idx| of_action(trace, idx))
        .filter(|pressed| pressed.force_n >= HARD_N);
    hardest(named.chain(hard))
}

fn hardest(all: impl Iterator<Item = Pressed>) -> Option<Pressed> {
    all.max_by(|a, b| a.force_n.total_cmp(&b.force_n))
}

/// Whether a text names the body, and of another link also the link itself.
fn is_named(pressed: &Pressed, text: &str) -> bool {
    mentions(text, &pressed.thing) && (mentions(text, &pressed.link) || !text.contains(" pressed "))
}

/// All contacts of the robot during an action, except with the object that it may touch or holds,
/// and of its wheels with the floor.
fn of_action(trace: &Trace, idx: usize) -> impl Iterator<Item = Pressed> {
    let begin = trace.snapshots.first().map_or(0.0, |state| state.time_secs);
    let before = trace.snapshots.get(idx);
    let start = before.map_or(begin, |state| state.time_secs) - begin;
    let action = trace.actions.get(idx);
    let contacts = action
        .into_iter()
        .flat_map(|action| action.contacts.iter().map(move |contact| (action, contact)));
    contacts.filter_map(move |(action, contact)| {
        let (link, thing) = sides(contact)?;
        let held = before.is_some_and(|state| {
            let touches = [&state.robot.left_touches, &state.robot.right_touches];
            touches
                .into_iter()
                .all(|touched| touched.iter().any(|other| other == thing))
        });
        let rolls = thing == "floor" && contact.start_secs <= 0.0;
        (!held && !rolls && !is_target(action, thing) && !fingers_meet(trace, idx, contact)).then(
            || Pressed {
                link: link.to_owned(),
                thing: thing.to_owned(),
                of_robot: contact.pair.iter().all(|name| name.starts_with(LINK)),
                force_n: contact.max_force_n,
                secs: [start + contact.start_secs, start + contact.end_secs],
                point_m: contact.point_m,
            },
        )
    })
}

/// Whether a contact is one of two links of the hand, whose fingers may meet.
fn fingers_meet(trace: &Trace, idx: usize, contact: &ContactEpisode) -> bool {
    let own = trace
        .robot_courses
        .get(idx)
        .map(|course| course.self_contacts.as_slice())
        .unwrap_or_default();
    own.iter()
        .any(|own| own.pair == contact.pair && own.press.of_hand)
}

fn is_target(action: &ActionTrace, thing: &str) -> bool {
    action
        .parameters
        .get(TARGET)
        .is_some_and(|ids| ids.iter().any(|id| id == thing))
}

/// The link and the other side of a contact. Returns `None` if it is not one of the robot's.
fn sides(contact: &ContactEpisode) -> Option<(&str, &str)> {
    let [a, b] = &contact.pair;
    let (link, other) = match (a.strip_prefix(LINK), b.strip_prefix(LINK)) {
        (Some(link), _) => (link, b),
        (None, Some(link)) => (link, a),
        (None, None) => return None,
    };
    Some((link, other.strip_prefix(LINK).unwrap_or(other)))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use actcheck_data::{RobotCourse, SelfCollision, SelfPress};

    fn contact(pair: [&str; 2], start_secs: f64, max_force_n: f64) -> ContactEpisode {
        let point_m = [1.0, 0.25, 0.5];
        ContactEpisode {
            pair: pair.map(str::to_owned),
            start_secs,
            end_secs: start_secs + 2.0,
            max_force_n,
            point_m,
        }
    }

    fn trace(contacts: Vec<ContactEpisode>) -> Trace {
        let parameters = BTreeMap::from([(TARGET.to_owned(), vec!["glass_1".to_owned()])]);
        let action = ActionTrace {
            contacts,
            ..ActionTrace::not_reached("Pick", &parameters)
        };
        Trace {
            actions: vec![action],
            ..Trace::default()
        }
    }

    fn label(trace: &Trace, failures: &[(usize, &str)]) -> Option<String> {
        hardest_of_run(trace, failures.iter().copied()).map(|pressed| pressed.label())
    }

    #[test]
    fn the_hardest_contact_is_neither_with_the_target_nor_of_the_wheels_with_the_floor() {
        let contacts = vec![
            contact(["glass_1", "robot/hand"], 1.0, 900.0),
            contact(["floor", "robot/base_link"], 0.0, 400.0),
            contact(["coffee_table_1", "robot/base_link"], 3.0, 759.4),
            contact(["robot/arm", "robot/head"], 3.0, 80.0),
            contact(["mug_1", "table_1"], 3.0, 800.0),
        ];
        let trace = trace(contacts);
        assert_eq!(
            label(&trace, &[]).as_deref(),
            Some("base_link presses coffee_table_1: 759 N")
        );
        let found = hardest_of_run(&trace, std::iter::empty()).map(|pressed| pressed.sentence());
        let told = "base_link presses coffee_table_1: 759 N, from 3.0 s to 5.0 s, at x = 1.00, y = 0.25, z = 0.50 m";
        assert_eq!(found.as_deref(), Some(told));
    }

    #[test]
    fn a_soft_contact_counts_if_a_failure_names_it() {
        let trace = trace(vec![
            contact(["mug_1", "robot/hand"], 1.0, 3.25),
            contact(["bowl_1", "robot/hand"], 1.0, 6.0),
            contact(["bowl_1", "robot/arm"], 1.0, 9.0),
        ]);
        assert_eq!(label(&trace, &[]), None);
        assert_eq!(
            label(&trace, &[(0, "mug_1 moved 2 cm")]).as_deref(),
            Some("hand presses mug_1: 3.2 N")
        );
        let named = [(0, "the robot's hand pressed bowl_1 with 6 N")];
        assert_eq!(
            label(&trace, &named).as_deref(),
            Some("hand presses bowl_1: 6.0 N")
        );
        assert_eq!(label(&trace, &[(0, "glass_1 did not move")]), None);
    }

    /// A hand that closed on nothing with 80 N got a red star.
    #[test]
    fn fingers_that_meet_are_not_shown() {
        let pair = ["robot/left", "robot/right"];
        let mut trace = trace(vec![contact(pair, 1.0, 80.0)]);
        for (of_hand, expected) in [(true, None), (false, Some("left presses right: 80 N"))] {
            let press = SelfPress {
                max_force_n: 80.0,
                of_hand,
            };
            let met = SelfCollision {
                pair: pair.map(str::to_owned),
                start_secs: 1.0,
                max_depth_m: 0.0,
                press,
            };
            trace.robot_courses = vec![RobotCourse {
                self_contacts: vec![met],
                ..RobotCourse::default()
            }];
            assert_eq!(label(&trace, &[]).as_deref(), expected);
        }
    }

    #[test]
    fn of_two_links_both_are_named() {
        let trace = trace(vec![contact(["robot/arm", "robot/head"], 1.0, 90.0)]);
        assert_eq!(
            label(&trace, &[]).as_deref(),
            Some("arm presses head: 90 N")
        );
    }
}
