//! Shapes of bodies, without duplicates.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use actcheck_data::{BodyState, Colour, Form, Mesh, Part, SeenPart, Shape};

/// Distinct shapes, in order of first use.
#[derive(Debug, Default)]
pub(super) struct Shapes {
    known: BTreeMap<String, usize>,
    /// Numbers of the appearance of bodies, by campaign and by link or model.
    seen: BTreeMap<[String; 2], usize>,
    forms: Vec<Value>,
}

impl Shapes {
    /// Returns the index of a shape.
    pub fn of(&mut self, form: &Form) -> usize {
        self.number(form.parts.iter().map(part).collect())
    }

    /// Returns the index of the bounding box of a body without a shape. Frame: world axes, relative
    /// to the body's origin.
    pub fn around(&mut self, body: &BodyState) -> usize {
        let size = [0, 1, 2].map(|axis| round(body.aabb_max[axis] - body.aabb_min[axis]));
        let middle = [0, 1, 2].map(|axis| {
            round(
                f64::midpoint(body.aabb_max[axis], body.aabb_min[axis]) - body.pose.position[axis],
            )
        });
        let [x, y, z] = middle;
        self.number(json!([{ "at": [x, y, z, 0, 0, 0, 1], "kind": "box", "size": size }]))
    }

    /// Returns the index of the appearance of a link or a model of a campaign.
    pub fn of_seen(&mut self, [campaign, name]: [&str; 2], parts: &[SeenPart]) -> usize {
        let key = [campaign, name].map(str::to_owned);
        if let Some(number) = self.seen.get(&key) {
            return *number;
        }
        let number = self.number(parts.iter().map(seen_part).collect());
        self.seen.insert(key, number);
        number
    }

    fn number(&mut self, form: Value) -> usize {
        let next = self.forms.len();
        let number = *self.known.entry(form.to_string()).or_insert(next);
        if number == next {
            self.forms.push(form);
        }
        number
    }

    /// Removes all shapes but the first `count`.
    pub fn truncate(&mut self, count: usize) {
        self.forms.truncate(count);
        self.known.retain(|_, number| *number < count);
        self.seen.retain(|_, number| *number < count);
    }

    /// All shapes, by index.
    pub fn all(&self) -> &[Value] {
        &self.forms
    }
}

/// Each number of a mesh is the difference from the previous one, so that the page is small: that
/// of a coordinate in tenths of a millimetre, and of the first corner of a face; its others are
/// relative to that.
fn seen_part(seen: &SeenPart) -> Value {
    let mut value = match &seen.part.shape {
        Shape::Mesh { mesh } => {
            let (points, faces) = differences(mesh);
            json!({ "at": at(&seen.part), "kind": "mesh", "points": points, "faces": faces })
        }
        _ => part(&seen.part),
    };
    if let Some(Colour([red, green, blue])) = seen.colour {
        value["colour"] = u32::from_be_bytes([0, red, green, blue]).into();
    }
    value
}

fn differences(mesh: &Mesh) -> (Vec<i64>, Vec<i64>) {
    let (mut points, mut last) = (Vec::with_capacity(3 * mesh.vertices.len()), [0; 3]);
    for vertex in &mesh.vertices {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "a mesh reaches a kilometre at most"
        )]
        let steps = vertex.map(|along| (along * STEPS).round() as i64);
        points.extend([0, 1, 2].map(|axis| steps[axis] - last[axis]));
        last = steps;
    }
    let (mut faces, mut before) = (Vec::with_capacity(3 * mesh.triangles.len()), 0);
    for corners in &mesh.triangles {
        let mut corners = corners.map(i64::from);
        let first = (0..3).min_by_key(|idx| corners[*idx]).unwrap_or(0);
        corners.rotate_left(first);
        let [a, b, c] = corners;
        faces.extend([a - before, b - a, c - a]);
        before = a;
    }
    (points, faces)
}

fn at(part: &Part) -> [f64; 7] {
    let [x, y, z] = part.pose.position.map(round);
    let [i, j, k, w] = part.pose.rotation.map(round);
    [x, y, z, i, j, k, w]
}

fn part(part: &Part) -> Value {
    let at = at(part);
    match &part.shape {
        Shape::Box { size } => json!({ "at": at, "kind": "box", "size": size.map(round) }),
        Shape::Cylinder { radius, height } => {
            json!({ "at": at, "kind": "cylinder", "radius": round(*radius), "height": round(*height) })
        }
        Shape::Sphere { radius } => json!({ "at": at, "kind": "sphere", "radius": round(*radius) }),
        Shape::Capsule { radius, height } => {
            json!({ "at": at, "kind": "capsule", "radius": round(*radius), "height": round(*height) })
        }
        Shape::Tube {
            radius_low,
            radius_high,
            wall,
            height,
            ..
        } => json!({
            "at": at, "kind": "tube", "low": round(*radius_low), "high": round(*radius_high), "wall": round(*wall),
            "height": round(*height),
        }),
        Shape::Hull { points, .. } => hull(at, points),
        // Traces only contain the outermost points of a mesh.
        Shape::Mesh { mesh } => hull(at, &mesh.vertices),
    }
}

fn hull(at: [f64; 7], points: &[[f64; 3]]) -> Value {
    json!({ "at": at, "kind": "hull", "points": points.iter().map(|point| point.map(round)).collect::<Vec<_>>() })
}

/// Steps in a metre: 0.1 mm is finer than a pixel.
const STEPS: f64 = 1e4;

fn round(value: f64) -> f64 {
    (value * STEPS).round() / STEPS
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::Pose;

    #[test]
    fn a_seen_mesh_is_stored_once_with_its_colour() {
        let vertices = vec![
            [0.0, 0.0, 0.0],
            [0.1, 0.0, 0.0],
            [0.0, -0.2, 0.0],
            [0.0, 0.0, 0.3],
        ];
        let triangles = vec![[2, 1, 0], [3, 0, 1]];
        let seen = SeenPart {
            part: Part {
                pose: Pose::IDENTITY,
                shape: Shape::Mesh {
                    mesh: Mesh::new(vertices, triangles).expect("it is a mesh"),
                },
            },
            colour: Some(Colour([255, 0, 16])),
        };
        let mut shapes = Shapes::default();
        let parts = [seen];
        assert_eq!(shapes.of_seen(["a", "robot/hand"], &parts), 0);
        assert_eq!(shapes.of_seen(["a", "robot/hand"], &parts), 0);
        // Another campaign of the same robot.
        assert_eq!(shapes.of_seen(["b", "robot/hand"], &parts), 0);
        let [form] = shapes.all() else {
            panic!("{:?}", shapes.all())
        };
        assert_eq!(form[0]["colour"], 0xff_0010);
        assert_eq!(
            form[0]["points"],
            json!([0, 0, 0, 1000, 0, 0, -1000, -2000, 0, 0, 2000, 3000])
        );
        assert_eq!(form[0]["faces"], json!([0, 2, 1, 0, 1, 3]));
        shapes.truncate(0);
        assert!(shapes.all().is_empty());
        assert_eq!(shapes.of_seen(["a", "robot/hand"], &parts), 0);
        assert_eq!(shapes.all().len(), 1);
    }
}
