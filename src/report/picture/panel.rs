//! A panel: one state of the world in a window, with labels.

use std::collections::BTreeMap;

use crate::picture::drawing::{Drawing, Line, Paint, Rect, Style, Words};
use crate::picture::facets::Facets;
use crate::picture::labels::{Label, Labels};
use crate::picture::outline::{bounds_of, silhouette};
use crate::picture::paths::{Mover, Path};
use crate::picture::window::{Bounds, Window};
use crate::picture::{font, paint};
use crate::pressed::Pressed;
use actcheck_base::names;
use actcheck_data::{BodyState, Form, Part, Role, SeenPart, Shape, Snapshot, Trace};

/// Links farther than this outside of the window, such as those behind the things of a side view,
/// are omitted. Unit: metres.
const BESIDE_M: f64 = 0.6;

/// Room around a path in which a label would touch it. Unit: pixels.
const LINE_PX: f64 = 3.0;

/// Radius of the star at the hardest contact. Unit: pixels.
const STAR_PX: f64 = 11.0;

/// Data shared by all panels of a run.
pub(super) struct PanelData<'a> {
    pub(super) trace: &'a Trace,
    pub(super) paths: &'a [Path],
    pub(super) pressed: Option<Pressed>,
    pub(super) roles: &'a BTreeMap<String, Role>,
    /// The appearance of bodies, by the id of the object or the name of the link in traces.
    pub(super) seen: &'a BTreeMap<String, Vec<SeenPart>>,
    pub(super) forms: BTreeMap<&'a str, &'a Form>,
}

/// The moment that a panel shows.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Moment {
    /// The state before the first action, with percepts.
    Before,
    /// The state after the last action, with paths.
    After,
}

impl PanelData<'_> {
    fn snapshot(&self, moment: Moment) -> Option<&Snapshot> {
        match moment {
            Moment::Before => self.trace.snapshots.first(),
            Moment::After => self.trace.snapshots.last(),
        }
    }

    fn role(&self, body: &BodyState) -> Role {
        let role = self.roles.get(&body.id).copied();
        role.unwrap_or(if body.fixed {
            Role::Platform
        } else {
            Role::Other
        })
    }
}

/// Draws a panel. Maps show places and label furniture; close-ups label movable objects.
pub(super) fn draw(
    drawing: &mut Drawing,
    data: &PanelData<'_>,
    moment: Moment,
    window: &Window,
    is_map: bool,
) {
    let Some(snapshot) = data.snapshot(moment) else {
        return;
    };
    drawing.polygon(window.panel.corners(), paint::BACKGROUND);
    drawing.clip(Some(window.panel));
    if is_map {
        rooms(drawing, data.trace, window);
    }
    let shown: Vec<&BodyState> = snapshot
        .bodies
        .iter()
        .filter(|body| window.overlaps(&Bounds::of(body)))
        .collect();
    bodies(drawing, data, &shown, window);
    let mut labels = Labels::new(window.panel, things(&shown, window));
    labels.spare(robot(drawing, data, snapshot, window));
    heading(drawing, snapshot.robot.base_true, window);
    match moment {
        Moment::Before => percepts(drawing, data.trace, window),
        Moment::After => labels.spare(paths(drawing, data.paths, window)),
    }
    ruler(drawing, window, &mut labels);
    if moment == Moment::After {
        press(drawing, data, window, &mut labels);
    }
    if is_map {
        name_places(drawing, data.trace, window, &mut labels);
    }
    name_bodies(drawing, data, &shown, window, &mut labels, is_map);
    if moment == Moment::Before && !is_map && window.view.up == 1 {
        name_percepts(drawing, data.trace, window, &mut labels);
    }
    drawing.clip(None);
}

fn is_wall(body: &BodyState) -> bool {
    names::local(&body.category) == "Wall"
}

fn fixed_style(body: &BodyState) -> Style {
    if is_wall(body) {
        paint::WALL
    } else {
        paint::FURNITURE
    }
}

/// Outline of a body's shape, or of its bounding box if the trace has no shape.
fn form(data: &PanelData<'_>, body: &BodyState, window: &Window) -> Vec<Vec<[f64; 2]>> {
    match data.forms.get(body.id.as_str()) {
        Some(form) => silhouette(&form.parts, &body.pose.to_isometry(), window),
        None => vec![window.rect(&Bounds::of(body)).corners()],
    }
}

/// Draws furniture, then objects: their appearance, or their shapes. Objects have an outline in
/// the colour of their role.
fn bodies(drawing: &mut Drawing, data: &PanelData<'_>, shown: &[&BodyState], window: &Window) {
    for is_fixed in [true, false] {
        let mut facets = Facets::new(window, false);
        for body in shown.iter().filter(|body| body.fixed == is_fixed) {
            let style = match is_fixed {
                true => fixed_style(body),
                false => paint::movable(data.role(body)),
            };
            match data.seen.get(&body.id) {
                Some(parts) => facets.add(parts, &body.pose.to_isometry(), paint::plain(&style)),
                None => drawing.shape(form(data, body, window), true, style),
            }
        }
        show(drawing, &facets, window, 1.0);
    }
    let looks = |body: &&&BodyState| data.seen.contains_key(&body.id);
    for body in shown.iter().filter(|body| !body.fixed).filter(looks) {
        outline(drawing, data, body, window);
    }
}

/// Draws the outline of an object in the colour of its role.
fn outline(drawing: &mut Drawing, data: &PanelData<'_>, body: &BodyState, window: &Window) {
    let style = paint::movable(data.role(body));
    let line = Style {
        fill: None,
        ..style
    };
    drawing.shape(form(data, body, window), true, line);
}

fn show(drawing: &mut Drawing, facets: &Facets, window: &Window, opacity: f64) {
    if let Some(pixels) = facets.picture() {
        drawing.image(pixels, [window.panel.left, window.panel.top], opacity);
    }
}

/// Draws all links of the robot, also those that are fixed to a fixed base: their appearance, or
/// their shapes. Returns the rectangles around them.
fn robot(
    drawing: &mut Drawing,
    data: &PanelData<'_>,
    snapshot: &Snapshot,
    window: &Window,
) -> Vec<Rect> {
    let links = data
        .trace
        .linked_forms(snapshot)
        .filter_map(|(form, pose)| {
            let pose = pose.to_isometry();
            let origin = Bounds::point(pose.translation.vector.into());
            let around = bounds_of(&form.parts, &pose).map_or(origin, |shapes| shapes.with(origin));
            let is_near = window.overlaps(&around.grown(BESIDE_M));
            is_near.then(|| (form.name.as_str(), silhouette(&form.parts, &pose, window)))
        });
    let links: Vec<(&str, Vec<Vec<[f64; 2]>>)> = links.collect();
    let outlines = links.iter().flat_map(|(_, outlines)| outlines);
    let mut around: Vec<Rect> = outlines.filter_map(|line| rect_around(line)).collect();
    let plain = links
        .into_iter()
        .filter(|(name, _)| !data.seen.contains_key(*name));
    drawing.shape(
        plain.flat_map(|(_, lines)| lines).collect(),
        true,
        paint::ROBOT,
    );
    let mut facets = Facets::new(window, false);
    for link in &snapshot.robot.links {
        let Some(parts) = data.seen.get(&format!("robot/{}", link.name)) else {
            continue;
        };
        let pose = link.pose.to_isometry();
        let shapes = parts.iter().map(|seen| seen.part.bounds_at(&pose));
        let bounds = Bounds::union(shapes.map(|(low, high)| Bounds { low, high }));
        if let Some(bounds) = bounds.filter(|bounds| window.overlaps(&bounds.grown(BESIDE_M))) {
            facets.add(parts, &pose, paint::PLAIN_ROBOT);
            around.push(window.rect(&bounds));
        }
    }
    if let Some(pixels) = facets.picture() {
        drawing.image(
            pixels,
            [window.panel.left, window.panel.top],
            paint::ROBOT_OPACITY,
        );
        // The hand must not hide the thing in it.
        for body in snapshot.bodies.iter().filter(|body| !body.fixed) {
            if window.overlaps(&Bounds::of(body)) {
                outline(drawing, data, body, window);
            }
        }
    }
    around
}

/// The rectangle around some points; `None` if there are none.
fn rect_around(points: &[[f64; 2]]) -> Option<Rect> {
    let (first, rest) = points.split_first()?;
    let start = Rect {
        left: first[0],
        top: first[1],
        width: 0.0,
        height: 0.0,
    };
    Some(rest.iter().fold(start, |rect, point| rect.with(*point)))
}

/// Draws an arrow at the robot's base, in views from above.
fn heading(drawing: &mut Drawing, [x, y, heading]: [f64; 3], window: &Window) {
    if window.view.up != 1 {
        return;
    }
    arrow(
        drawing,
        window.pixel([x, y, 0.0]),
        heading,
        11.0,
        Style::fill(Paint::new(0x2d_4560, 0.9)),
    );
}

/// Draws a star at the hardest contact, with its label.
fn press(drawing: &mut Drawing, data: &PanelData<'_>, window: &Window, labels: &mut Labels) {
    let Some(pressed) = &data.pressed else {
        return;
    };
    let [x, y] = window.pixel(pressed.point_m);
    drawing.polygon(star([x, y], STAR_PX), paint::PRESSED);
    let at = Rect {
        left: x,
        top: y,
        width: 0.0,
        height: 0.0,
    }
    .grown(STAR_PX);
    labels.keep_out(at);
    let text = pressed.label();
    labels.write(
        drawing,
        &Label {
            text: &text,
            size: 13.0,
            bold: true,
            rgb: paint::FAILED,
            at,
        },
    );
}

/// The corners of a star with eight points.
pub(super) fn star([x, y]: [f64; 2], radius: f64) -> Vec<[f64; 2]> {
    let corner = |step: u32| {
        let angle = std::f64::consts::TAU * f64::from(step) / 16.0;
        let reach = if step.is_multiple_of(2) {
            radius
        } else {
            0.45 * radius
        };
        [x + reach * libm::sin(angle), y - reach * libm::cos(angle)]
    };
    (0..16).map(corner).collect()
}

fn arrow(drawing: &mut Drawing, [x, y]: [f64; 2], heading: f64, size: f64, style: Style) {
    let corners = [
        (0.0, 1.0),
        (2.5, 0.75),
        (std::f64::consts::PI, 0.35),
        (-2.5, 0.75),
    ];
    let corner = |(turn, reach): (f64, f64)| {
        let angle = heading + turn;
        [
            x + size * reach * libm::cos(angle),
            y - size * reach * libm::sin(angle),
        ]
    };
    drawing.polygon(corners.map(corner).to_vec(), style);
}

fn rooms(drawing: &mut Drawing, trace: &Trace, window: &Window) {
    for room in &trace.map.rooms {
        let bounds = Bounds {
            low: [room.low_m[0], room.low_m[1], 0.0],
            high: [room.high_m[0], room.high_m[1], 0.0],
        };
        drawing.polygon(window.rect(&bounds).corners(), paint::ROOM);
    }
}

/// Percepts as boxes: objects, planes, and objects that a skill queried.
fn percept_parts(trace: &Trace) -> Vec<(String, Part)> {
    let standing = |pose: &actcheck_data::Pose, [x, y, z]: [f64; 3]| {
        let middle = pose.to_isometry() * nalgebra::Translation3::new(0.0, 0.0, z / 2.0);
        Part {
            pose: actcheck_data::Pose::from_isometry(&middle),
            shape: Shape::Box { size: [x, y, z] },
        }
    };
    let mut parts = Vec::new();
    for action in &trace.actions {
        for percept in &action.percepts {
            parts.push((percept.id.clone(), standing(&percept.pose, percept.size_m)));
        }
        for thing in action
            .perceived
            .iter()
            .flat_map(|perceived| &perceived.things)
        {
            let name = thing.category.as_deref().map_or("?", names::local);
            parts.push((name.to_owned(), standing(&thing.pose, thing.size_m)));
        }
        for plane in action
            .perceived
            .iter()
            .filter_map(|perceived| perceived.plane)
        {
            let [x, y] = plane.size_m;
            parts.push((
                String::new(),
                Part {
                    pose: plane.pose,
                    shape: Shape::Box {
                        size: [x, y, 0.004],
                    },
                },
            ));
        }
    }
    parts
}

fn percepts(drawing: &mut Drawing, trace: &Trace, window: &Window) {
    for (_, part) in percept_parts(trace) {
        let outline = silhouette(&[part], &nalgebra::Isometry3::identity(), window);
        drawing.shape(outline, true, paint::GLIMPSE);
    }
}

/// Labels percepts with their recognised category.
fn name_percepts(drawing: &mut Drawing, trace: &Trace, window: &Window, labels: &mut Labels) {
    let seen = trace
        .actions
        .iter()
        .filter_map(|action| action.perceived.as_ref());
    for thing in seen.flat_map(|perceived| &perceived.things) {
        let name = thing.category.as_deref().map_or("unknown", names::local);
        let reach = thing.size_m[0].max(thing.size_m[1]) / 2.0;
        let at = window.rect(&Bounds::point(thing.pose.position).grown(reach));
        let text = format!("seen: {name}");
        labels.write(
            drawing,
            &Label {
                text: &text,
                size: 10.5,
                bold: false,
                rgb: paint::PERCEIVED,
                at,
            },
        );
    }
}

/// Draws paths, and returns the rectangles around their pieces.
fn paths(drawing: &mut Drawing, paths: &[Path], window: &Window) -> Vec<Rect> {
    let mut around = Vec::new();
    // In side views, the path of the base is only a line on the floor.
    for path in paths
        .iter()
        .filter(|path| path.mover != Mover::Base || window.view.up == 1)
    {
        let points: Vec<[f64; 2]> = path
            .points
            .iter()
            .map(|point| window.pixel(*point))
            .collect();
        let rgb = paint::action(path.action);
        if let (Some(start), Mover::Hand | Mover::Base) = (points.first(), path.mover) {
            drawing.circle(*start, 2.6, Style::fill(Paint::solid(rgb)));
        }
        let pieces = points.windows(2).filter_map(rect_around);
        around.extend(pieces.map(|piece| piece.grown(LINE_PX)));
        drawing.line(points, paint::path(path.mover, rgb));
    }
    around
}

/// Rectangles of movable objects, which labels should avoid.
fn things(shown: &[&BodyState], window: &Window) -> Vec<Rect> {
    shown
        .iter()
        .filter(|body| !body.fixed)
        .map(|body| window.rect(&Bounds::of(body)))
        .collect()
}

/// Draws a scale bar of a round length in the lower left corner.
pub(super) fn ruler(drawing: &mut Drawing, window: &Window, labels: &mut Labels) {
    let lengths = [0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0];
    let length = lengths
        .into_iter()
        .find(|metres| metres * window.scale >= 45.0)
        .unwrap_or(5.0);
    let (left, bottom) = (window.panel.left + 10.0, window.panel.bottom() - 9.0);
    let right = left + length * window.scale;
    let line = Line::new(Paint::solid(paint::INK), 1.6);
    drawing.line(
        vec![
            [left, bottom - 4.0],
            [left, bottom],
            [right, bottom],
            [right, bottom - 4.0],
        ],
        line,
    );
    let text = if length < 1.0 {
        format!("{:.0} cm", length * 100.0)
    } else {
        format!("{length:.0} m")
    };
    let width = font::width(&text, 10.5, false);
    let paint = Paint::solid(paint::INK);
    drawing.words(Words {
        text,
        at: [right + 5.0, bottom + 1.0],
        size: 10.5,
        bold: false,
        paint,
        rim: true,
    });
    labels.keep_out(Rect {
        left,
        top: bottom - 12.0,
        width: right - left + width + 8.0,
        height: 16.0,
    });
}

/// Labels rooms and locations.
fn name_places(drawing: &mut Drawing, trace: &Trace, window: &Window, labels: &mut Labels) {
    for location in &trace.map.locations {
        let [x, y, heading] = location.at;
        let at = window.pixel([x, y, 0.0]);
        arrow(
            drawing,
            at,
            heading,
            5.5,
            Style::fill(Paint::new(0x1f_7a4d, 0.9)),
        );
        let spot = Rect {
            left: at[0],
            top: at[1],
            width: 0.0,
            height: 0.0,
        }
        .grown(5.0);
        labels.keep_out(spot);
        labels.write(
            drawing,
            &Label {
                text: &location.name,
                size: 9.5,
                bold: false,
                rgb: 0x1f_6b45,
                at: spot,
            },
        );
    }
    for room in &trace.map.rooms {
        let middle = [0, 1].map(|axis| f64::midpoint(room.low_m[axis], room.high_m[axis]));
        let [left, top] = window.pixel([middle[0], middle[1], 0.0]);
        let at = Rect {
            left,
            top,
            width: 0.0,
            height: 0.0,
        };
        labels.write(
            drawing,
            &Label {
                text: &room.name,
                size: 13.0,
                bold: true,
                rgb: 0x9a_9b8c,
                at,
            },
        );
    }
}

/// Labels movable objects, the target first, then furniture.
fn name_bodies(
    drawing: &mut Drawing,
    data: &PanelData<'_>,
    shown: &[&BodyState],
    window: &Window,
    labels: &mut Labels,
    is_map: bool,
) {
    let mut named: Vec<(&BodyState, Role)> = shown
        .iter()
        .filter(|body| !is_wall(body))
        .map(|body| (*body, data.role(body)))
        .collect();
    let order = [
        Role::Target,
        Role::Obstacle,
        Role::Other,
        Role::PlaceOther,
        Role::Platform,
    ];
    let rank = |role: Role| order.iter().position(|other| *other == role);
    named.sort_by_key(|(body, role)| (body.fixed, rank(*role)));
    for (body, role) in named {
        // On a map, objects on tables are too small to label.
        if is_map && !body.fixed && matches!(role, Role::Other | Role::PlaceOther) {
            continue;
        }
        let at = window.rect(&Bounds::of(body));
        let (rgb, size) = if body.fixed {
            (0x7a_6231, 10.0)
        } else {
            (darker(paint::rgb_of(role)), 11.0)
        };
        labels.write(
            drawing,
            &Label {
                text: &body.id,
                size,
                bold: role == Role::Target,
                rgb,
                at,
            },
        );
    }
}

/// Darkens a colour for text, which has thin strokes.
fn darker(rgb: u32) -> u32 {
    let [_, channels @ ..] = rgb.to_be_bytes();
    channels
        .into_iter()
        .fold(0, |sum, channel| (sum << 8) | (u32::from(channel) * 2 / 3))
}
