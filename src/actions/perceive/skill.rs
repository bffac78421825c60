//! The skill: look where the surface should be, or ahead, until there is one, look where it runs out of the picture, say what stands on it.

use std::collections::BTreeMap;

use nalgebra::Point3;

use crate::actions::operator::{Interrupt, Operator};
use crate::actions::perceive::interpret::Surface;
use crate::actions::perceive::sight::Sight;
use crate::actions::perceive::survey::near;
use crate::actions::route::length;
use crate::actions::{ActionCall, ActionReport, Perceived};
use crate::base::names;
use crate::world::Sighting;

/// Where a surface is looked for: distance in front of the base, and height. Unit: metres. A table, a low table, a far one.
const AHEAD_M: [[f64; 2]; 3] = [[1.0, 0.7], [0.8, 0.35], [1.8, 0.8]];
/// Designator of the surface that is meant.
const SURFACE: &str = "objectSurface";
/// A surface that is farther away is not looked for by the floor plan. Unit: metres.
const FAR_M: f64 = 2.5;
/// A surface that seems larger or smaller than that by more is cut off, or several things. Unit: metres. What outlines are off by,
/// twice.
const SIZE_OFF_M: f64 = 0.05;
/// Pictures that are taken at most.
const MOST_VIEWS: usize = 7;

/// Looks for a surface and for what stands on it, and keeps that for later actions.
///
/// # Errors
/// [`Interrupt`] if simulation broke or time ran out.
pub fn perceive_plane(call: &ActionCall, robot: &mut Operator<'_>) -> Result<ActionReport, Interrupt> {
    let mut sight = Sight::default();
    let expected = expected(call, robot);
    // What is where a surface is expected; where there is nothing, the largest of all.
    let find = |points: &[Point3<f64>]| {
        let there = expected.as_ref().and_then(|expected| Surface::find(&near(points, expected)));
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
        return Ok(ActionReport { succeeded: false, message: "no level surface was found".to_owned() });
    };
    let surface = sight.take_in(surface, MOST_VIEWS, find, robot)?;
    robot.begin("interpret");
    let things = surface.things(&sight.points, &sight.eye(), robot.known_kinds());
    let perceived = Perceived { plane: Some(surface.perceived()), things };
    let report = report(&perceived, sight.unseen(&surface).is_none());
    robot.remember(perceived);
    Ok(match expected.filter(|expected| report.succeeded && !is_of_size(&surface, expected)) {
        Some(Sighting { size_m: [width, depth, _], .. }) => {
            let message = format!("{}; the floor plan has one of {width:.2} × {depth:.2} m there", report.message);
            ActionReport { succeeded: false, message }
        }
        None => report,
    })
}

/// Whether a surface is as large as it is expected to be, however it is turned.
fn is_of_size(surface: &Surface, expected: &Sighting) -> bool {
    let sorted = |[a, b]: [f64; 2]| [a.min(b), a.max(b)];
    let [seen, known] = [surface.outline.size_m, [expected.size_m[0], expected.size_m[1]]].map(sorted);
    seen.iter().zip(known).all(|(seen, known)| (seen - known).abs() <= SIZE_OFF_M)
}

/// The designated surface by the floor plan, where it is within sight. What is there is for the camera to say.
fn expected(call: &ActionCall, robot: &Operator<'_>) -> Option<Sighting> {
    let id = call.value(SURFACE)?;
    let base = robot.base().translation.vector;
    let is_near = |piece: &Sighting| length(middle(piece).x - base.x, middle(piece).y - base.y) <= FAR_M;
    robot.known_furniture().into_iter().find(|piece| piece.id == id).filter(is_near)
}

/// The middle of a piece of furniture's top.
fn middle(piece: &Sighting) -> Point3<f64> {
    piece.pose.to_isometry() * Point3::new(0.0, 0.0, piece.size_m[2])
}

/// A point so far in front of the base, so high. Frame: world, by the base's belief.
fn in_front(robot: &Operator<'_>, [distance, height]: [f64; 2]) -> Point3<f64> {
    let mut point = robot.base() * Point3::new(distance, 0.0, 0.0);
    point.z = height;
    point
}

fn report(perceived: &Perceived, whole: bool) -> ActionReport {
    let Some(plane) = perceived.plane else {
        return ActionReport { succeeded: false, message: "no level surface was found".to_owned() };
    };
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for thing in &perceived.things {
        *counts.entry(thing.category.as_deref().map_or("unknown", names::local)).or_default() += 1;
    }
    let things: Vec<String> = counts.into_iter().map(|(kind, count)| format!("{count} {kind}")).collect();
    let things = if things.is_empty() { "nothing".to_owned() } else { things.join(", ") };
    let ([_, _, height], [width, depth]) = (plane.pose.position, plane.size_m);
    let found = format!("a surface of {width:.2} × {depth:.2} m, {height:.2} m high, and on it {things}");
    if !whole {
        return ActionReport { succeeded: false, message: format!("{found}; it goes on beyond what the head can see") };
    }
    ActionReport { succeeded: true, message: found }
}
