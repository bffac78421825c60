//! Shapes of objects, furniture, percepts and contacts as markers.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Point3, Translation3};

use crate::bag::cdr::{Cdr, Stamp};
use crate::bag::motion::{Frames, MAP};
use crate::faces::{Face, faces, tube};
use crate::look::Look;
use actcheck_base::names;
use actcheck_data::{Appearances, BodyState, Colour, Form, Part, Pose, SeenPart, Shape, Trace};
use actcheck_history::RunDetail;

/// Colour of contacts of the robot, as 0xRRGGBBAA.
const CONTACT_RGBA: u32 = 0xe023_23ff;
/// Diameter of the mark of a contact. Unit: metres.
const CONTACT_M: f64 = 0.015;
/// Opacity of bodies of which other drawings show only the edges.
const CLEAR: u32 = 0x50;

/// A marker of `visualization_msgs/Marker`.
pub(super) struct Marker {
    /// Its namespace and its number in it.
    pub name: (&'static str, i32),
    /// The frame that it moves with.
    pub frame: String,
    /// Duration; 0 for always.
    pub lifetime: Stamp,
    pose: Pose,
    kind: MarkerKind,
    rgba: u32,
    label: String,
}

/// The form of a marker. Unit: metres.
enum MarkerKind {
    Cube([f64; 3]),
    Ball([f64; 3]),
    Cylinder([f64; 3]),
    Triangles(Vec<[Point3<f64>; 3]>),
}

impl Marker {
    /// Serialises its fields.
    pub fn write(&self, message: &mut Cdr, at: Stamp) {
        let (kind, scale, triangles): (i32, [f64; 3], &[[Point3<f64>; 3]]) = match &self.kind {
            MarkerKind::Cube(size) => (1, *size, &[]),
            MarkerKind::Ball(size) => (2, *size, &[]),
            MarkerKind::Cylinder(size) => (3, *size, &[]),
            MarkerKind::Triangles(all) => (11, [1.0; 3], all),
        };
        message.header(at, &self.frame);
        message.text(self.name.0);
        message.i32(self.name.1);
        message.i32(kind);
        // It is added, or replaces the one with its name.
        message.i32(0);
        message.pose(&self.pose);
        message.vector(scale);
        self.rgba
            .to_be_bytes()
            .into_iter()
            .for_each(|channel| message.f32(f32::from(channel) / 255.0));
        message.time(self.lifetime);
        message.u8(1);
        let corners: Vec<[f64; 3]> = triangles
            .iter()
            .flatten()
            .map(|corner| corner.coords.into())
            .collect();
        message.each(&corners, |message, corner| message.vector(*corner));
        // No colours of corners.
        message.count(0);
        self.no_texture(message);
        message.text(&self.label);
        // No file with a mesh.
        message.text("");
        message.text("");
        message.count(0);
        message.u8(0);
    }

    fn no_texture(&self, message: &mut Cdr) {
        message.text("");
        message.header(Stamp::default(), "");
        message.text("");
        message.count(0);
        message.count(0);
    }
}

/// The shapes of all objects and pieces of furniture, each in its own frame.
pub(super) fn bodies(
    run: &RunDetail,
    trace: &Trace,
    frames: &Frames,
    appearances: &Appearances,
) -> Vec<Marker> {
    let forms: BTreeMap<&str, &Form> = trace
        .forms
        .iter()
        .map(|form| (form.name.as_str(), form))
        .collect();
    let first = trace.snapshots.first();
    let mut markers = Vec::new();
    for body in first.into_iter().flat_map(|state| &state.bodies) {
        let role = run.objects.iter().find(|object| object.id == body.id);
        let mut look = Look::of(role.map(|object| object.role), Some(body));
        if !look.filled {
            look.rgba = look.rgba & !0xff | CLEAR;
        }
        let seen = appearances.models.get(&body.model);
        let parts: Vec<SeenPart> = match (seen, forms.get(body.id.as_str())) {
            (Some(seen), _) => seen.clone(),
            (None, Some(form)) => form.parts.iter().cloned().map(plain).collect(),
            (None, None) => vec![plain(around(body))],
        };
        let kind = if body.fixed { "furniture" } else { "objects" };
        for seen in parts {
            let rgba = match seen.colour {
                Some(Colour([red, green, blue])) => {
                    u32::from_be_bytes([red, green, blue, 0]) | look.rgba & 0xff
                }
                None => look.rgba,
            };
            for (pose, form) in solids(&seen.part) {
                markers.push(Marker {
                    name: (kind, number(&markers)),
                    frame: frames.name(&body.id),
                    lifetime: Stamp::default(),
                    pose,
                    kind: form,
                    rgba,
                    label: body.id.clone(),
                });
            }
        }
    }
    markers
}

fn plain(part: Part) -> SeenPart {
    SeenPart { part, colour: None }
}

/// The box around a body without a known shape. Frame: the body's.
fn around(body: &BodyState) -> Part {
    let middle = [0, 1, 2].map(|axis| f64::midpoint(body.aabb_max[axis], body.aabb_min[axis]));
    let at = Isometry3::from_parts(
        Translation3::from(middle),
        nalgebra::UnitQuaternion::identity(),
    );
    Part {
        pose: Pose::from_isometry(&body.pose.to_isometry().inv_mul(&at)),
        shape: Shape::Box {
            size: [0, 1, 2].map(|axis| body.aabb_max[axis] - body.aabb_min[axis]),
        },
    }
}

fn number(markers: &[Marker]) -> i32 {
    i32::try_from(markers.len()).unwrap_or(i32::MAX)
}

/// The forms of a part with their poses. Frame: the body's.
fn solids(part: &Part) -> Vec<(Pose, MarkerKind)> {
    let at = part.pose;
    let round = |radius: f64| [2.0 * radius; 3];
    match &part.shape {
        Shape::Box { size } => vec![(at, MarkerKind::Cube(*size))],
        Shape::Sphere { radius } => vec![(at, MarkerKind::Ball(round(*radius)))],
        Shape::Cylinder { radius, height } => {
            let [x, y, _] = round(*radius);
            vec![(at, MarkerKind::Cylinder([x, y, *height]))]
        }
        Shape::Capsule { radius, height } => {
            let [x, y, _] = round(*radius);
            let end = |along: f64| {
                let moved = at.to_isometry() * Translation3::new(0.0, 0.0, along);
                (
                    Pose::from_isometry(&moved),
                    MarkerKind::Ball(round(*radius)),
                )
            };
            vec![
                (at, MarkerKind::Cylinder([x, y, *height])),
                end(height / 2.0),
                end(-height / 2.0),
            ]
        }
        Shape::Tube {
            radius_low,
            radius_high,
            wall,
            height,
            ..
        } => vec![triangles(
            at,
            &tube(*radius_low, *radius_high, *wall, *height),
        )],
        Shape::Hull { points, .. } => vec![triangles(at, &faces(points))],
        // Meshes of traces have no triangles, only their outermost points.
        Shape::Mesh { mesh } if mesh.triangles.is_empty() => {
            vec![triangles(at, &faces(&mesh.vertices))]
        }
        Shape::Mesh { mesh } => {
            let corner = |idx: u32| {
                let vertex = usize::try_from(idx)
                    .ok()
                    .and_then(|idx| mesh.vertices.get(idx));
                vertex.map(|vertex| Point3::from(*vertex))
            };
            let of = |[a, b, c]: &[u32; 3]| Some([corner(*a)?, corner(*b)?, corner(*c)?]);
            let all = mesh.triangles.iter().filter_map(of).collect();
            vec![(at, MarkerKind::Triangles(all))]
        }
    }
}

fn triangles(at: Pose, faces: &[Face]) -> (Pose, MarkerKind) {
    let of = |face: &Face| {
        let fan = face.corners.windows(2).skip(1);
        let first = face.corners.first().copied().unwrap_or_default();
        fan.map(move |pair| [first, pair[0], pair[1]])
            .collect::<Vec<_>>()
    };
    (
        at,
        MarkerKind::Triangles(faces.iter().flat_map(of).collect()),
    )
}

/// The boxes of percepts: foot pose and size of each. Frame: world.
pub(super) fn percepts<'a>(seen: impl Iterator<Item = (&'a str, Pose, [f64; 3])>) -> Vec<Marker> {
    let mut markers = Vec::new();
    for (name, foot, size) in seen {
        let middle = foot.to_isometry() * Translation3::new(0.0, 0.0, size[2] / 2.0);
        markers.push(Marker {
            name: ("percepts", number(&markers)),
            frame: MAP.to_owned(),
            lifetime: Stamp::default(),
            pose: Pose::from_isometry(&middle),
            kind: MarkerKind::Cube(size),
            rgba: Look::PERCEIVED.rgba & !0xff | CLEAR,
            label: names::local(name).to_owned(),
        });
    }
    markers
}

/// The mark of a contact at a point. Frame: world.
pub(super) fn contact(number: i32, point_m: [f64; 3], lasts: Stamp, label: String) -> Marker {
    Marker {
        name: ("contacts", number),
        frame: MAP.to_owned(),
        lifetime: lasts,
        pose: Pose::upright(point_m, 0.0),
        kind: MarkerKind::Ball([CONTACT_M; 3]),
        rgba: CONTACT_RGBA,
        label,
    }
}
