//! Triangulates planar faces for the viewer.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Point3, Vector3};
use re_sdk_types::archetypes::Mesh3D;
use re_sdk_types::components::AlbedoFactor;

use crate::recording::hull::Face;

/// Number of sides that approximate a circle.
const AROUND: u32 = 32;

/// Triangles; each corner has the normal of its face.
#[derive(Debug, Default)]
pub(super) struct Mesh {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// Adds faces; `at` is the pose of their frame in the frame of the mesh.
    pub fn add(&mut self, faces: &[Face], at: &Isometry3<f64>) {
        for face in faces {
            let first = self.positions.len() as u32;
            let normal = at.rotation * face.normal;
            self.positions.extend(
                face.corners
                    .iter()
                    .map(|corner| single((at * corner).coords)),
            );
            self.normals
                .extend(face.corners.iter().map(|_| single(normal)));
            let corners = first..self.positions.len() as u32;
            self.triangles.extend(
                corners
                    .clone()
                    .skip(2)
                    .map(|corner| [first, corner - 1, corner]),
            );
        }
    }

    /// Converts to a mesh of the viewer. Returns `None` if there are no triangles.
    pub fn drawn(self, rgba: u32) -> Option<Mesh3D> {
        let mesh = || {
            Mesh3D::new(self.positions)
                .with_vertex_normals(self.normals)
                .with_triangle_indices(self.triangles.clone())
                .with_albedo_factor(AlbedoFactor::from(rgba))
        };
        (!self.triangles.is_empty()).then(mesh)
    }
}

/// Converts to the viewer's single precision.
fn single(vector: Vector3<f64>) -> [f32; 3] {
    vector.map(|value| value as f32).into()
}

/// Faces of a hollow wall around z, open at both ends. Radii are outer radii. Unit: metres.
pub(super) fn tube(radius_low: f64, radius_high: f64, wall: f64, height: f64) -> Vec<Face> {
    let top = height / 2.0;
    // Cross-section of the wall: outside, upper rim, inside, lower rim.
    let profile = [
        (radius_low, -top),
        (radius_high, top),
        (radius_high - wall, top),
        (radius_low - wall, -top),
    ];
    let at = |(radius, z): (f64, f64), step: u32| {
        let angle = TAU * f64::from(step % AROUND) / f64::from(AROUND);
        let radius = radius.max(0.0);
        Point3::new(radius * libm::cos(angle), radius * libm::sin(angle), z)
    };
    let sides = profile.iter().zip(profile.iter().cycle().skip(1));
    let quads = sides.flat_map(|(a, b)| {
        (0..AROUND).map(move |step| {
            vec![
                at(*a, step),
                at(*a, step + 1),
                at(*b, step + 1),
                at(*b, step),
            ]
        })
    });
    let face = |corners: Vec<Point3<f64>>| {
        // If the wall has no thickness, two corners of its rim coincide.
        let turned = (corners[2] - corners[0]).cross(&(corners[3] - corners[1]));
        Some(Face {
            normal: turned.try_normalize(1e-12)?,
            corners,
        })
    };
    quads.filter_map(face).collect()
}
