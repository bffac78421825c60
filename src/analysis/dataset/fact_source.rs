//! Converts traces to rows of the dataset's tables of facts.

use std::collections::BTreeMap;

use crate::Hierarchy;
use crate::dataset::fact_columns::{
    BODIES, CONTACTS, EXTREMES, INTERVALS, JOINT_EXTREMES, LINKS, PLACES, PLANES, SELF_CONTACTS,
    SHAPES, STATES,
};
use crate::dataset::sheets::Sheets;
use crate::dataset::source::look_cells;
use crate::tables::{Cell, kinds_of};
use actcheck_data::{
    ActionTrace, BodyState, HeldCourse, IntervalKind, Part, RobotCourse, RobotState, SceneMap,
    Shape, Trace,
};
use actcheck_history::RunDetail;

/// Adds the states of a run, the events during its actions, its shapes and its places.
pub(super) fn add(run: &RunDetail, trace: &Trace, hierarchy: &Hierarchy, sheets: &mut Sheets) {
    let id = run.row.run.as_str();
    let roles: BTreeMap<&str, &str> = run
        .objects
        .iter()
        .map(|object| (object.id.as_str(), object.role.word()))
        .collect();
    for (state, snapshot) in trace.snapshots.iter().enumerate() {
        let place = || [Cell::text(id), Cell::count(state)];
        let time = [Cell::number(snapshot.time_secs)];
        sheets.push(
            &STATES,
            place()
                .into_iter()
                .chain(time)
                .chain(robot(&snapshot.robot)),
        );
        for link in &snapshot.robot.links {
            let pose = link
                .pose
                .position
                .into_iter()
                .chain(link.pose.rotation)
                .map(Cell::number);
            sheets.push(
                &LINKS,
                place()
                    .into_iter()
                    .chain([Cell::text(&link.name)])
                    .chain(pose),
            );
        }
        for body in &snapshot.bodies {
            let role = roles.get(body.id.as_str()).copied();
            let kinds = kinds_of(&body.category, hierarchy);
            sheets.push(
                &BODIES,
                place().into_iter().chain(body_cells(body, kinds, role)),
            );
        }
    }
    for (step, action) in trace.actions.iter().enumerate() {
        if action.end.was_begun() {
            let began_secs = trace
                .snapshots
                .get(step)
                .map_or(0.0, |before| before.time_secs);
            add_events(id, step + 1, action, trace.robot_courses.get(step), sheets);
            add_plane(id, step + 1, action, began_secs, sheets);
        }
    }
    for form in &trace.forms {
        for (number, part) in (1usize..).zip(&form.parts) {
            let place = [Cell::text(id), Cell::text(&form.name), Cell::count(number)];
            sheets.push(&SHAPES, place.into_iter().chain(shape(part)));
        }
    }
    add_places(id, &trace.map, sheets);
}

fn robot(robot: &RobotState) -> Vec<Cell> {
    let gripper = robot
        .gripper
        .position
        .into_iter()
        .chain(robot.gripper.rotation);
    let numbers = robot
        .base_true
        .into_iter()
        .chain(robot.base_believed)
        .chain(gripper);
    let numbers = numbers.chain([robot.gripper_opening_m]).map(Cell::number);
    numbers
        .chain([&robot.left_touches, &robot.right_touches].map(|ids| list(ids)))
        .collect()
}

fn body_cells(body: &BodyState, kinds: String, role: Option<&str>) -> Vec<Cell> {
    let names = [&body.id, &body.model, &body.category].map(Cell::text);
    let kind = [
        Cell::text(kinds),
        Cell::Text(role.map(str::to_owned)),
        Cell::Bool(Some(body.fixed)),
    ];
    let motion = body
        .linear_velocity
        .into_iter()
        .chain(body.angular_velocity);
    let bounds = body
        .aabb_min
        .into_iter()
        .chain(body.aabb_max)
        .map(Cell::number);
    let size = body.size_m.map(Cell::number);
    let motion = body
        .pose
        .position
        .into_iter()
        .chain(body.pose.rotation)
        .chain(motion)
        .map(Cell::number);
    let matter = [body.mass_kg, body.friction, body.restitution].map(Cell::number);
    let numbers = motion.chain(bounds).chain(size).chain(matter);
    let relations = [
        list(&body.touches),
        list(&body.rests_on),
        Cell::Bool(Some(body.asleep)),
    ];
    let distance = [Cell::Number(body.grasp_distance_m)];
    names
        .into_iter()
        .chain(kind)
        .chain(numbers)
        .chain(relations)
        .chain(distance)
        .collect()
}

/// Adds the contacts and extremes of one action.
fn add_events(
    run: &str,
    step: usize,
    action: &ActionTrace,
    course: Option<&RobotCourse>,
    sheets: &mut Sheets,
) {
    let place = || [Cell::text(run), Cell::count(step)];
    for contact in &action.contacts {
        let pair = contact.pair.each_ref().map(Cell::text);
        let numbers = [contact.start_secs, contact.end_secs, contact.max_force_n].map(Cell::number);
        let point = contact.point_m.map(Cell::number);
        sheets.push(
            &CONTACTS,
            place().into_iter().chain(pair).chain(numbers).chain(point),
        );
    }
    for contact in course.into_iter().flat_map(|course| &course.self_contacts) {
        let pair = contact.pair.each_ref().map(Cell::text);
        let numbers = [contact.start_secs, contact.max_depth_m].map(Cell::number);
        let force = Cell::number(contact.press.max_force_n);
        let of_hand = Cell::Bool(Some(contact.press.of_hand));
        sheets.push(
            &SELF_CONTACTS,
            place()
                .into_iter()
                .chain(pair)
                .chain(numbers)
                .chain([force, of_hand]),
        );
    }
    for joint in course.into_iter().flat_map(|course| &course.joints) {
        let excess = Cell::Number(joint.max_excess.is_finite().then_some(joint.max_excess));
        let numbers = [
            Cell::number(joint.max_speed_share),
            Cell::number(joint.overload_secs),
        ];
        sheets.push(
            &JOINT_EXTREMES,
            place()
                .into_iter()
                .chain([Cell::text(&joint.name), excess])
                .chain(numbers),
        );
    }
    for interval in course.into_iter().flat_map(|course| &course.intervals) {
        let kind = match interval.kind {
            IntervalKind::Hold => "hold",
            IntervalKind::Motion => "motion",
        };
        let thing = [Cell::text(kind), Cell::text(&interval.thing)];
        let times = [interval.start_secs, interval.end_secs].map(Cell::number);
        sheets.push(&INTERVALS, place().into_iter().chain(thing).chain(times));
    }
    for extremes in &action.extremes {
        let held = course.and_then(|course| course.held.iter().find(|held| held.id == extremes.id));
        let held = |number: fn(&HeldCourse) -> f64| Cell::Number(held.map(number));
        let numbers = [
            extremes.max_tilt_rad,
            extremes.max_speed,
            extremes.max_rise_m,
            extremes.max_displacement_m,
        ];
        let row = place()
            .into_iter()
            .chain([Cell::text(&extremes.id)])
            .chain(numbers.map(Cell::number));
        let near =
            course.and_then(|course| course.clearances.iter().find(|near| near.id == extremes.id));
        let near = Cell::Number(near.map(|near| near.smallest_m));
        sheets.push(
            &EXTREMES,
            row.chain([
                held(|held| held.held_secs),
                held(|held| held.max_tilt_rad),
                near,
            ]),
        );
    }
}

/// Adds the surface that an action perceived, which began at this time since the scene was built.
/// Unit: seconds.
fn add_plane(run: &str, step: usize, action: &ActionTrace, began_secs: f64, sheets: &mut Sheets) {
    let Some(perceived) = &action.perceived else {
        return;
    };
    let Some(plane) = &perceived.plane else {
        return;
    };
    let numbers = plane
        .pose
        .position
        .into_iter()
        .chain(plane.pose.rotation)
        .chain(plane.size_m)
        .map(Cell::number);
    let place = [Cell::text(run), Cell::count(step)];
    sheets.push(
        &PLANES,
        place
            .into_iter()
            .chain(numbers)
            .chain(look_cells(perceived.look.as_ref(), began_secs)),
    );
}

fn shape(part: &Part) -> Vec<Cell> {
    // Sizes along x, y and z, radius, upper radius, thickness of the wall.
    let (name, numbers) = match &part.shape {
        Shape::Box { size: [x, y, z] } => ("box", [Some(*x), Some(*y), Some(*z), None, None, None]),
        Shape::Cylinder { radius, height } => (
            "cylinder",
            [None, None, Some(*height), Some(*radius), None, None],
        ),
        Shape::Sphere { radius } => ("sphere", [None, None, None, Some(*radius), None, None]),
        Shape::Capsule { radius, height } => (
            "capsule",
            [None, None, Some(*height), Some(*radius), None, None],
        ),
        Shape::Tube {
            radius_low,
            radius_high,
            wall,
            height,
            ..
        } => (
            "tube",
            [
                None,
                None,
                Some(*height),
                Some(*radius_low),
                Some(*radius_high),
                Some(*wall),
            ],
        ),
        Shape::Mesh { .. } | Shape::Hull { .. } => ("hull", [None; 6]),
    };
    let staves = match &part.shape {
        Shape::Tube { staves, .. } => Some(i64::from(*staves)),
        _ => None,
    };
    let points = match &part.shape {
        Shape::Hull { points, .. } => Some(points),
        Shape::Mesh { mesh } => Some(&mesh.vertices),
        _ => None,
    };
    let points = points.map(|points| serde_json::to_string(points).unwrap_or_default());
    let pose = part
        .pose
        .position
        .into_iter()
        .chain(part.pose.rotation)
        .map(Cell::number);
    let numbers = numbers.map(Cell::Number);
    [Cell::text(name)]
        .into_iter()
        .chain(pose)
        .chain(numbers)
        .chain([Cell::Count(staves), Cell::Text(points)])
        .collect()
}

fn add_places(run: &str, map: &SceneMap, sheets: &mut Sheets) {
    let nothing = || Cell::Number(None);
    for location in &map.locations {
        let [x, y, heading] = location.at.map(Cell::number);
        let place = [
            Cell::text(run),
            Cell::text("location"),
            Cell::text(&location.name),
            x,
            y,
            nothing(),
            heading,
        ];
        let surface = [Cell::Text(location.surface.clone())];
        sheets.push(
            &PLACES,
            place
                .into_iter()
                .chain(surface)
                .chain(std::array::from_fn::<_, 6, _>(|_| nothing())),
        );
    }
    for room in &map.rooms {
        let place = [Cell::text(run), Cell::text("room"), Cell::text(&room.name)];
        let at = [nothing(), nothing(), nothing(), nothing(), Cell::Text(None)];
        let bounds = room.low_m.into_iter().chain(room.high_m).map(Cell::number);
        sheets.push(
            &PLACES,
            place
                .into_iter()
                .chain(at)
                .chain(bounds)
                .chain([nothing(), nothing()]),
        );
    }
    for surface in &map.surfaces {
        let place = [
            Cell::text(run),
            Cell::text("surface"),
            Cell::text(&surface.id),
        ];
        let at = surface
            .at
            .map(Cell::number)
            .into_iter()
            .chain([nothing(), Cell::Text(None)]);
        let bounds = std::array::from_fn::<_, 4, _>(|_| nothing());
        sheets.push(
            &PLACES,
            place
                .into_iter()
                .chain(at)
                .chain(bounds)
                .chain(surface.size_m.map(Cell::number)),
        );
    }
}

/// Ids as a JSON list.
fn list(ids: &[String]) -> Cell {
    Cell::text(serde_json::to_string(ids).unwrap_or_default())
}
