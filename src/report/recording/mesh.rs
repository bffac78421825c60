//! Triangulates planar faces for the viewer.

use nalgebra::{Isometry3, Vector3};
use re_sdk_types::archetypes::Mesh3D;
use re_sdk_types::components::AlbedoFactor;

use crate::faces::Face;

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
