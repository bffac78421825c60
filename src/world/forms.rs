//! Simplified shapes of bodies, for drawing their outlines.

use nalgebra::Vector3;

use crate::bodies::Bodies;
use actcheck_data::{Part, Shape};

/// Returns the shapes of all objects and links by their names in traces, in the frame of the
/// object or link. Pieces of meshes are reduced to their outermost points.
pub(super) fn forms(bodies: &Bodies) -> Vec<(String, Vec<Part>)> {
    let objects = bodies
        .objects
        .iter()
        .map(|object| (object.id.clone(), reduced(&object.model.parts)));
    let links = bodies
        .robot
        .model
        .links
        .iter()
        .filter(|link| !link.solids.is_empty());
    objects
        .chain(links.map(|link| (format!("robot/{}", link.name), reduced(&link.solids))))
        .collect()
}

fn reduced(parts: &[Part]) -> Vec<Part> {
    parts
        .iter()
        .map(|part| Part {
            pose: part.pose,
            shape: outermost(&part.shape),
        })
        .collect()
}

/// Reduces a hull or mesh to its extreme points in 26 directions; returns other shapes unchanged.
fn outermost(shape: &Shape) -> Shape {
    let points: Vec<[f64; 3]> = match shape {
        Shape::Hull { points, .. } => points.clone(),
        Shape::Mesh { mesh } => mesh.vertices.clone(),
        other => return other.clone(),
    };
    let along = |point: &[f64; 3], direction: &Vector3<f64>| Vector3::from(*point).dot(direction);
    let mut farthest: Vec<[f64; 3]> = directions()
        .filter_map(|direction| {
            points
                .iter()
                .max_by(|a, b| along(a, &direction).total_cmp(&along(b, &direction)))
                .copied()
        })
        .collect();
    farthest.sort_by(|a, b| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
    farthest.dedup();
    Shape::Hull {
        points: farthest,
        volume: shape.volume(),
    }
}

/// Directions to the faces, edges and corners of a cube.
fn directions() -> impl Iterator<Item = Vector3<f64>> {
    (0..27).filter(|idx| *idx != 13).map(|idx| {
        let part = |divisor: i32| f64::from(idx / divisor % 3 - 1);
        Vector3::new(part(1), part(3), part(9)).normalize()
    })
}
