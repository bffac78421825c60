//! The perception skill: looks where the surface is expected, or ahead, until a surface is found;
//! looks at its unseen corners; reports the objects on it.

use std::collections::BTreeMap;

use nalgebra::Point3;

use crate::ActionCall;
use crate::operator::{Interrupt, Operator};
use crate::perceive::interpret::Surface;
use crate::perceive::sight::Sight;
use crate::perceive::survey::near;
use crate::route::length;
use actcheck_base::names;
use actcheck_data::{ActionReport, Perceived};
use actcheck_world::Sighting;

/// Where to look for a surface: distance in front of the base, and height. Unit: metres. A table, a
/// low table, a far one.
const AHEAD_M: [[f64; 2]; 3] = [[1.0, 0.7], [0.8, 0.35], [1.8, 0.8]];
/// Designator of the surface.
const SURFACE: &str = "objectSurface";
/// The floor plan is ignored for surfaces farther away than this. Unit: metres.
const FAR_M: f64 = 2.5;
/// A surface whose sides differ from the expected ones by more is cut off, or several surfaces.
/// Unit: metres. Twice the error of an outline.
const SIZE_OFF_M: f64 = 0.05;
/// Largest number of pictures.
const MOST_VIEWS: usize = 7;

/// Looks for a surface and the objects on it, and keeps them for later actions.
///
/// # Errors
/// [`Interrupt`] if simulation broke or time ran out.
pub fn perceive_plane(
    call: &ActionCall,
    robot: &mut Operator<'_>,
) -> Result<ActionReport, Interrupt> {
    let mut sight = Sight::default();
    let expected = expected(call, robot);
    // The surface at the expected place; otherwise the largest of all.
    let find = |points: &[Point3<f64>]| {
        let there = expected
            .as_ref()
            .and_then(|expected| Surface::find(&near(points, expected)));
        there.or_else(|| Surface::find(points))
    };
    let mut surface = None;
    let ahead = AHEAD_M.map(|ahead| in_front(robot, ahead));
    for point in expected.as_ref().map(middle).into_iter().chain(ahead) {
        robot.begin("look ahead");
        sight.add_look_at(&point, robot)?;
        surface = find(&sight.points);
        if surface.is_some() {
            break;
        }
    }
    let Some(surface) = surface else {
        robot.remember(Perceived::default());
        return Ok(ActionReport {
            succeeded: false,
            message: "no level surface was found".to_owned(),
        });
    };
    let surface = sight.take_in(surface, MOST_VIEWS, find, robot)?;
    robot.begin("interpret");
    let things = surface.things(&sight.points, &sight.eye(), robot.known_kinds());
    let perceived = Perceived {
        plane: Some(surface.perceived()),
        things,
        look: None,
    };
    let report = report(&perceived, sight.unseen(&surface).is_none());
    robot.remember(perceived);
    Ok(
        match expected.filter(|expected| report.succeeded && !is_of_size(&surface, expected)) {
            Some(Sighting {
                size_m: [width, depth, _],
                ..
            }) => {
                let message = format!(
                    "{}; the floor plan has one of {width:.2} × {depth:.2} m there",
                    report.message
                );
                ActionReport {
                    succeeded: false,
                    message,
                }
            }
            None => report,
        },
    )
}

/// Whether a surface has the expected size, in either orientation.
fn is_of_size(surface: &Surface, expected: &Sighting) -> bool {
    let sorted = |[a, b]: [f64; 2]| [a.min(b), a.max(b)];
    let [seen, known] = [
        surface.outline.size_m,
        [expected.size_m[0], expected.size_m[1]],
    ]
    .map(sorted);
    seen.iter()
        .zip(known)
        .all(|(seen, known)| (seen - known).abs() <= SIZE_OFF_M)
}

/// The designated surface according to the floor plan, if it is within sight. The camera decides
/// whether it is there.
fn expected(call: &ActionCall, robot: &Operator<'_>) -> Option<Sighting> {
    let id = call.value(SURFACE)?;
    let base = robot.base().translation.vector;
    let is_near =
        |piece: &Sighting| length(middle(piece).x - base.x, middle(piece).y - base.y) <= FAR_M;
    robot
        .known_furniture()
        .into_iter()
        .find(|piece| piece.id == id)
        .filter(is_near)
}

/// Centre of the top of a piece of furniture.
fn middle(piece: &Sighting) -> Point3<f64> {
    piece.pose.to_isometry() * Point3::new(0.0, 0.0, piece.size_m[2])
}

/// The point at this distance in front of the base and at this height. Frame: world, by the base's
/// belief.
fn in_front(robot: &Operator<'_>, [distance, height]: [f64; 2]) -> Point3<f64> {
    let mut point = robot.base() * Point3::new(distance, 0.0, 0.0);
    point.z = height;
    point
}

fn report(perceived: &Perceived, whole: bool) -> ActionReport {
    let Some(plane) = perceived.plane else {
        return ActionReport {
            succeeded: false,
            message: "no level surface was found".to_owned(),
        };
    };
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for thing in &perceived.things {
        *counts
            .entry(thing.category.as_deref().map_or("unknown", names::local))
            .or_default() += 1;
    }
    let things: Vec<String> = counts
        .into_iter()
        .map(|(kind, count)| format!("{count} {kind}"))
        .collect();
    let things = if things.is_empty() {
        "nothing".to_owned()
    } else {
        things.join(", ")
    };
    let ([_, _, height], [width, depth]) = (plane.pose.position, plane.size_m);
    let found =
        format!("a surface of {width:.2} × {depth:.2} m, {height:.2} m high, and on it {things}");
    if !whole {
        return ActionReport {
            succeeded: false,
            message: format!("{found}; it extends beyond the head's view"),
        };
    }
    ActionReport {
        succeeded: true,
        message: found,
    }
}
