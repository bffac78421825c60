//! Shapes of bodies, without duplicates.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use actcheck_data::{BodyState, Form, Part, Shape};

/// Distinct shapes, in order of first use.
#[derive(Debug, Default)]
pub(super) struct Shapes {
    known: BTreeMap<String, usize>,
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
    }

    /// All shapes, by index.
    pub fn all(&self) -> &[Value] {
        &self.forms
    }
}

fn part(part: &Part) -> Value {
    let [x, y, z] = part.pose.position.map(round);
    let [i, j, k, w] = part.pose.rotation.map(round);
    let at = [x, y, z, i, j, k, w];
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

/// Rounds to 0.1 mm, which is finer than a pixel.
fn round(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}
