//! Contacts of the robot with things that it is not to touch.

use crate::effects::action::ActionView;
use actcheck_data::ContactEpisode;

/// Smallest force of a contact that counts. (1 N: the weight of a hundred grams; a softer touch
/// moves no object.) Unit: newtons.
const LEAST_FORCE_N: f64 = 1.0;
const LINK: &str = "robot/";
const FLOOR: &str = "floor";

/// The first contact of the robot with a thing that it is not to touch.
#[derive(Debug, Clone, PartialEq)]
pub struct FirstContact {
    /// Class of the thing: an IRI.
    pub category: String,
    /// Time since the action began. Unit: seconds.
    pub at_secs: f64,
    /// Phase of the action, if it has phases.
    pub phase: Option<String>,
}

/// The largest force on a thing that is not to be touched.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LargestForce {
    /// 0 without a contact. Unit: newtons.
    pub force_n: f64,
    /// Class of the thing: an IRI. `None` without a contact.
    pub category: Option<String>,
}

/// A contact with a thing that is not to be touched.
pub(super) struct Hit<'a> {
    pub contact: &'a ContactEpisode,
    /// Id of the thing.
    pub thing: &'a str,
    /// The part that hit it: `robot/LINK`, or the id of the object that the action handles.
    pub by: &'a str,
}

/// Returns the contacts of an action that count as hits: of a part of the robot with anything but
/// the floor, the robot itself and the objects that it is to touch; and those of an object that it
/// handles with other movable objects, if they began during the action. In the order of the trace.
pub(super) fn hits<'a>(view: &'a ActionView<'a>) -> impl Iterator<Item = Hit<'a>> {
    let hard = view
        .action
        .contacts
        .iter()
        .filter(|contact| contact.max_force_n > LEAST_FORCE_N);
    hard.filter_map(|contact| {
        let [a, b] = &contact.pair;
        let either = |is: &dyn Fn(&str, &str) -> bool| {
            [(a, b), (b, a)]
                .into_iter()
                .find(|(by, thing)| is(by, thing))
        };
        let by_robot = |by: &str, thing: &str| {
            by.starts_with(LINK) && !thing.starts_with(LINK) && !view.may_touch(thing)
        };
        let by_object = |by: &str, thing: &str| {
            view.may_touch(by)
                && contact.start_secs > 0.0
                && !view.may_touch(thing)
                && view.is_movable(thing)
        };
        let (by, thing) = either(&by_robot).or_else(|| either(&by_object))?;
        (thing != FLOOR).then_some(Hit { contact, thing, by })
    })
}

/// Returns the first hit.
pub(super) fn first(view: &ActionView<'_>) -> Option<FirstContact> {
    let first = hits(view).min_by(|a, b| a.contact.start_secs.total_cmp(&b.contact.start_secs))?;
    let at_secs = first.contact.start_secs;
    Some(FirstContact {
        category: view.category(first.thing)?,
        at_secs,
        phase: view.phase_at(at_secs),
    })
}

/// Returns the hardest hit.
pub(super) fn largest(view: &ActionView<'_>) -> LargestForce {
    let hardest = hits(view).max_by(|a, b| a.contact.max_force_n.total_cmp(&b.contact.max_force_n));
    hardest.map_or_else(LargestForce::default, |hit| LargestForce {
        force_n: hit.contact.max_force_n,
        category: view.category(hit.thing),
    })
}

/// Returns the largest force on the link that carries all others, and the total time of its
/// contacts. Units: newtons, seconds.
pub(super) fn on_base(view: &ActionView<'_>) -> Option<[f64; 2]> {
    let base = view.base_link()?;
    let pressed = hits(view).filter(|hit| hit.by == base);
    Some(
        pressed.fold([0.0, 0.0], |[force, secs], Hit { contact, .. }| {
            [
                f64::max(force, contact.max_force_n),
                secs + contact.end_secs - contact.start_secs,
            ]
        }),
    )
}

/// Returns the time of the robot's first contact with an object, of any force.
pub(super) fn first_touch(view: &ActionView<'_>, id: &str) -> Option<f64> {
    let touches = |contact: &&ContactEpisode| {
        let [a, b] = &contact.pair;
        (a == id && b.starts_with(LINK)) || (b == id && a.starts_with(LINK))
    };
    view.action
        .contacts
        .iter()
        .filter(touches)
        .map(|contact| contact.start_secs)
        .min_by(f64::total_cmp)
}
