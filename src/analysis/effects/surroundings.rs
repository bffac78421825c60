//! The things around an action's goal: where they were, and which of them were hit.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::effects::action::ActionView;
use crate::effects::base::turned;
use crate::effects::contacts::{Hit, hits};
use actcheck_data::BodyState;

/// Distance below which a base is at the goal itself, so that it has no direction to it. Unit:
/// metres.
const AT_GOAL_M: f64 = 0.05;
/// Positions and forces are rounded to this step: a tenth of a millimetre, and of a millinewton.
const STEP: f64 = 1e-4;

/// A thing that an action is not to touch: each movable object other than its target, and each
/// piece of furniture that was hit.
///
/// Positions are relative to the goal: the target, or the location to reach. *Beyond* is along the
/// approach, the direction from the robot's base to the goal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Surrounding {
    /// Its id.
    pub object: String,
    /// Its class: an IRI.
    pub category: String,
    /// Its role in the scene, such as `other`.
    pub role: String,
    /// Distance beyond the goal; negative on the robot's side. `None` if the action has no goal.
    /// Unit: metres.
    pub beyond_m: Option<f64>,
    /// Distance to the left of the goal. Unit: metres.
    pub left_m: Option<f64>,
    /// Largest force on it. `None` if it was not hit. Unit: newtons.
    pub force_n: Option<f64>,
    /// The part that hit it hardest: `robot/LINK`, or the id of the object that the action handles.
    pub by: Option<String>,
    /// When it was first hit, since the action began. Unit: seconds.
    pub at_s: Option<f64>,
    /// Phase of the action when it was first hit.
    pub phase: Option<String>,
}

/// The hits of one thing.
#[derive(Clone, Copy)]
struct Blow<'a> {
    force_n: f64,
    by: &'a str,
    at_secs: f64,
    /// Where the hardest contact was, in the world.
    point: [f64; 2],
}

/// Returns the things around the goal, in scene order.
pub(super) fn of(view: &ActionView<'_>) -> Vec<Surrounding> {
    let mut blows: BTreeMap<&str, Blow<'_>> = BTreeMap::new();
    for Hit { contact, thing, by } in hits(view) {
        let [x, y, _] = contact.point_m;
        let found = Blow {
            force_n: contact.max_force_n,
            by,
            at_secs: contact.start_secs,
            point: [x, y],
        };
        let known = blows.entry(thing).or_insert(found);
        let at_secs = known.at_secs.min(found.at_secs);
        if found.force_n > known.force_n {
            *known = found;
        }
        known.at_secs = at_secs;
    }
    let frame = Frame::of(view);
    let around = view.before.bodies.iter().filter(|body| {
        !view.may_touch(&body.id)
            && (view.is_movable(&body.id) || blows.contains_key(body.id.as_str()))
    });
    around
        .map(|body| surrounding(view, body, blows.get(body.id.as_str()), frame.as_ref()))
        .collect()
}

fn surrounding(
    view: &ActionView<'_>,
    body: &BodyState,
    blow: Option<&Blow<'_>>,
    frame: Option<&Frame>,
) -> Surrounding {
    let middle = [0, 1].map(|axis| (body.aabb_min[axis] + body.aabb_max[axis]) / 2.0);
    // The middle of a large piece of furniture says little about the place of a contact.
    let point = match blow {
        Some(blow) if body.fixed => blow.point,
        _ => middle,
    };
    let place = frame.map(|frame| frame.place(point));
    Surrounding {
        object: body.id.clone(),
        category: body.category.clone(),
        role: view.role(&body.id).word().to_owned(),
        beyond_m: place.map(|[beyond, _]| rounded(beyond)),
        left_m: place.map(|[_, left]| rounded(left)),
        force_n: blow.map(|blow| rounded(blow.force_n)),
        by: blow.map(|blow| blow.by.to_owned()),
        at_s: blow.map(|blow| rounded(blow.at_secs)),
        phase: blow.and_then(|blow| view.phase_at(blow.at_secs)),
    }
}

/// The frame of an approach: its origin is the goal, its first axis the direction of the approach.
struct Frame {
    goal: [f64; 2],
    heading: f64,
}

impl Frame {
    /// The direction from where the base was after the action to the goal, or from where it was
    /// before if it reached the goal itself.
    fn of(view: &ActionView<'_>) -> Option<Self> {
        let goal = view.goal?;
        let bases = view
            .after
            .into_iter()
            .chain([view.before])
            .map(|state| state.robot.base_true);
        bases
            .map(|[x, y, _]| [goal[0] - x, goal[1] - y])
            .find(|way| libm::hypot(way[0], way[1]) > AT_GOAL_M)
            .map(|way| Self {
                goal,
                heading: libm::atan2(way[1], way[0]),
            })
    }

    /// Shape: beyond, to the left.
    fn place(&self, point: [f64; 2]) -> [f64; 2] {
        turned(
            [point[0] - self.goal[0], point[1] - self.goal[1]],
            -self.heading,
        )
    }
}

fn rounded(value: f64) -> f64 {
    // Dividing by a power of ten gives the number nearest to the decimal.
    (value / STEP).round() / (1.0 / STEP)
}
