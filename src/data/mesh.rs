//! Triangle meshes.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use actcheck_base::Digest;

/// A triangle mesh. Unit: metres. Frame: the shape's own.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Mesh {
    /// Shape: x, y, z.
    pub vertices: Vec<[f64; 3]>,
    /// Indices of vertices, counterclockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// Triangles whose normal is tilted by less than this count as level. Unit: cosine (about 2.5
/// degrees).
const LEVEL_COSINE: f64 = 0.999;

/// Why vertices and triangles are not a mesh. Numbers count from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum MeshFault {
    /// A coordinate is not finite.
    #[error("its vertex {0} is not finite")]
    Vertex(usize),
    /// An index is out of bounds.
    #[error("its triangle {0} refers to a missing vertex")]
    Triangle(usize),
    /// The mesh lacks triangles.
    #[error("it has no triangles")]
    Empty,
}

impl Mesh {
    /// Creates a mesh with finite coordinates and valid vertex indices.
    ///
    /// # Errors
    /// A coordinate is not finite, an index is out of bounds, or the mesh lacks triangles.
    pub fn new(vertices: Vec<[f64; 3]>, triangles: Vec<[u32; 3]>) -> Result<Self, MeshFault> {
        if let Some(vertex) = vertices
            .iter()
            .position(|vertex| !vertex.iter().all(|x| x.is_finite()))
        {
            return Err(MeshFault::Vertex(vertex + 1));
        }
        let beyond = |idx: &u32| *idx as usize >= vertices.len();
        if let Some(triangle) = triangles
            .iter()
            .position(|corners| corners.iter().any(beyond))
        {
            return Err(MeshFault::Triangle(triangle + 1));
        }
        if triangles.is_empty() {
            return Err(MeshFault::Empty);
        }
        Ok(Self {
            vertices,
            triangles,
        })
    }

    /// Merges equal vertices, so that neighbouring triangles share them, and drops degenerate
    /// triangles.
    #[must_use]
    pub fn welded(&self) -> Self {
        let mut known: BTreeMap<[u64; 3], u32> = BTreeMap::new();
        let mut vertices: Vec<[f64; 3]> = Vec::new();
        let mut place = |idx: u32| {
            let vertex = self.vertices[idx as usize];
            // Adding 0 turns -0 into +0.
            *known
                .entry(vertex.map(|x| (x + 0.0).to_bits()))
                .or_insert_with(|| {
                    vertices.push(vertex);
                    u32::try_from(vertices.len() - 1).unwrap_or(u32::MAX)
                })
        };
        let has_extent = |[a, b, c]: &[u32; 3]| a != b && b != c && a != c;
        let triangles: Vec<[u32; 3]> = self
            .triangles
            .iter()
            .map(|corners| corners.map(&mut place))
            .filter(has_extent)
            .collect();
        Self {
            vertices,
            triangles,
        }
    }

    /// Keeps the first of all triangles with the same corners: some programs write the back of each
    /// face, too.
    #[must_use]
    pub fn one_sided(&self) -> Self {
        let Self {
            vertices,
            triangles,
        } = self.welded();
        let mut known = BTreeSet::new();
        let is_first = |corners: &[u32; 3]| {
            let mut corners = *corners;
            corners.sort_unstable();
            known.insert(corners)
        };
        let triangles = triangles.into_iter().filter(is_first).collect();
        Self {
            vertices,
            triangles,
        }
    }

    /// Adds the triangles of another mesh, moved by `placed`.
    pub(crate) fn append(&mut self, other: &Self, placed: impl Fn([f64; 3]) -> [f64; 3]) {
        let before = u32::try_from(self.vertices.len()).unwrap_or(u32::MAX);
        self.vertices
            .extend(other.vertices.iter().map(|vertex| placed(*vertex)));
        let shifted = other
            .triangles
            .iter()
            .map(|corners| corners.map(|idx| idx.saturating_add(before)));
        self.triangles.extend(shifted);
    }

    /// Removes the vertices that no triangle has.
    #[must_use]
    pub fn with_used_vertices(&self) -> Self {
        let mut places = vec![None; self.vertices.len()];
        let mut vertices = Vec::new();
        let mut place = |idx: u32| {
            *places[idx as usize].get_or_insert_with(|| {
                vertices.push(self.vertices[idx as usize]);
                u32::try_from(vertices.len() - 1).unwrap_or(u32::MAX)
            })
        };
        let triangles = self
            .triangles
            .iter()
            .map(|corners| corners.map(&mut place))
            .collect();
        Self {
            vertices,
            triangles,
        }
    }

    /// Scales each axis. Reverses the triangles of a mirrored mesh, so that they still face
    /// outwards.
    #[must_use]
    pub fn scaled(&self, [x, y, z]: [f64; 3]) -> Self {
        let vertices = self
            .vertices
            .iter()
            .map(|vertex| [vertex[0] * x, vertex[1] * y, vertex[2] * z])
            .collect();
        let mirrored = x * y * z < 0.0;
        let triangles = self
            .triangles
            .iter()
            .map(|[a, b, c]| if mirrored { [*a, *c, *b] } else { [*a, *b, *c] });
        Self {
            vertices,
            triangles: triangles.collect(),
        }
    }

    /// Enclosed volume, by the divergence theorem; approximate if the mesh has small holes. Unit:
    /// cubic metres.
    pub fn volume(&self) -> f64 {
        let sixfold: f64 = self.corners().map(|[a, b, c]| a.dot(&b.cross(&c))).sum();
        (sixfold / 6.0).abs()
    }

    /// Finds the triangles that, transformed by `placed`, are level, face up, and are at most
    /// `depth_m` below `top_m`. Returns their area and bounding rectangle. Units: metres, square
    /// metres.
    pub fn top(
        &self,
        top_m: f64,
        depth_m: f64,
        placed: impl Fn(&Vector3<f64>) -> Vector3<f64>,
    ) -> Top {
        let mut found = Top::default();
        for corners in self.corners() {
            let [a, b, c] = corners.map(|corner| placed(&corner));
            let normal = (b - a).cross(&(c - a));
            let is_level = normal.z >= LEVEL_COSINE * normal.norm() && normal.z > 0.0;
            if is_level && [a, b, c].iter().all(|corner| corner.z >= top_m - depth_m) {
                found.area += normal.norm() / 2.0;
                for corner in [a, b, c] {
                    found.low = [found.low[0].min(corner.x), found.low[1].min(corner.y)];
                    found.high = [found.high[0].max(corner.x), found.high[1].max(corner.y)];
                }
            }
        }
        found
    }

    /// Digest of vertices and triangles.
    pub fn digest(&self) -> String {
        let mut digest = Digest::new();
        for vertex in &self.vertices {
            vertex
                .iter()
                .for_each(|x| digest.update(&x.to_bits().to_le_bytes()));
        }
        for corners in &self.triangles {
            corners
                .iter()
                .for_each(|idx| digest.update(&idx.to_le_bytes()));
        }
        digest.finish()
    }

    fn corners(&self) -> impl Iterator<Item = [Vector3<f64>; 3]> + '_ {
        self.triangles
            .iter()
            .map(|corners| corners.map(|idx| Vector3::from(self.vertices[idx as usize])))
    }
}

/// The level part of a mesh near its top, facing up: area and bounding rectangle (lowest and
/// highest x and y).
pub struct Top {
    pub area: f64,
    pub low: [f64; 2],
    pub high: [f64; 2],
}

impl Default for Top {
    fn default() -> Self {
        Self {
            area: 0.0,
            low: [f64::INFINITY; 2],
            high: [f64::NEG_INFINITY; 2],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn volumes_scale_and_vertices_are_welded() {
        let corner = [
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
        ];
        let faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        let soup: Vec<[f64; 3]> = faces.iter().flatten().map(|idx| corner[*idx]).collect();
        let mesh = Mesh::new(
            soup,
            (0..4)
                .map(|face| [3 * face, 3 * face + 1, 3 * face + 2])
                .collect(),
        )
        .expect("the mesh is valid");
        assert_eq!(mesh.welded().vertices.len(), 4);
        assert!((mesh.volume() - 1.0 / 6.0).abs() < 1e-12);
        assert!((mesh.scaled([2.0, -1.0, 3.0]).volume() - 1.0).abs() < 1e-12);
        let backs = mesh.triangles.iter().map(|[a, b, c]| [*c, *b, *a]);
        let both = Mesh {
            triangles: mesh.triangles.iter().copied().chain(backs).collect(),
            ..mesh.clone()
        };
        assert!(both.volume() < 1e-12 && (both.one_sided().volume() - mesh.volume()).abs() < 1e-12);
        assert!(
            Mesh::new(corner.to_vec(), vec![[0, 1, 4]])
                .expect_err("the index is out of range")
                .to_string()
                .contains("triangle 1")
        );
    }
}
