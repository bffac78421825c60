//! Meshes with fewer triangles, for pictures.

use crate::Mesh;

/// Most cells along the longest side of a mesh.
const FINEST: u32 = 512;

impl Mesh {
    /// Returns the mesh with at most `most` triangles: vertices in the same cell of a cubic grid
    /// become one, which is the nearest of them to their middle. The grid is the finest one that
    /// suffices. Returns the mesh itself if it is small enough; empty if `most` is too small for
    /// its form.
    #[must_use]
    pub fn clustered(&self, most: usize) -> Self {
        if self.triangles.len() <= most {
            return self.clone();
        }
        // The number of triangles rises with that of cells, but for rare exceptions, which only
        // make the result coarser than necessary.
        let (mut low, mut high) = (1, FINEST);
        let mut best = None;
        while low <= high {
            let grid = Grid::of(self, u32::midpoint(low, high));
            if grid.triangles.len() <= most {
                low = grid.cells + 1;
                best = Some(grid);
            } else {
                high = grid.cells - 1;
            }
        }
        best.map(|grid| grid.mesh(self)).unwrap_or_default()
    }
}

/// A mesh whose vertices are gathered in the cells of a grid.
struct Grid {
    /// Number of cells along the longest side.
    cells: u32,
    /// Vertices in the order of their cells, each with that of its cell in the order of cells.
    vertices: Vec<(u32, usize)>,
    /// Triangles between cells, each once.
    triangles: Vec<[u32; 3]>,
}

impl Grid {
    fn of(mesh: &Mesh, cells: u32) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for vertex in &mesh.vertices {
            for axis in 0..3 {
                low[axis] = low[axis].min(vertex[axis]);
                high[axis] = high[axis].max(vertex[axis]);
            }
        }
        let longest = (0..3)
            .map(|axis| high[axis] - low[axis])
            .fold(0.0, f64::max);
        let size = (longest / f64::from(cells)).max(f64::MIN_POSITIVE);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "at most the number of cells"
        )]
        let along = |vertex: &[f64; 3], axis: usize| {
            ((vertex[axis] - low[axis]) / size).min(f64::from(cells)) as u64
        };
        let keys = mesh.vertices.iter().map(|vertex| {
            (0..3).fold(0, |key, axis| {
                key * u64::from(cells + 1) + along(vertex, axis)
            })
        });
        let mut keys: Vec<(u64, usize)> = keys.zip(0..).collect();
        keys.sort_unstable();
        let mut vertices: Vec<(u32, usize)> = Vec::with_capacity(keys.len());
        let mut cell_of = vec![0; keys.len()];
        let (mut cell, mut before) = (0, None);
        for (key, vertex) in keys {
            cell += u32::from(before.is_some_and(|before| before != key));
            before = Some(key);
            vertices.push((cell, vertex));
            cell_of[vertex] = cell;
        }
        let mut triangles: Vec<([u32; 3], usize, [u32; 3])> = Vec::new();
        for (number, corners) in mesh.triangles.iter().enumerate() {
            let corners = corners.map(|corner| cell_of[corner as usize]);
            let mut sorted = corners;
            sorted.sort_unstable();
            if sorted[0] != sorted[1] && sorted[1] != sorted[2] {
                triangles.push((sorted, number, corners));
            }
        }
        triangles.sort_unstable();
        // The first of several decides which side is outside.
        triangles.dedup_by_key(|(sorted, ..)| *sorted);
        Self {
            cells,
            vertices,
            triangles: triangles.into_iter().map(|(.., corners)| corners).collect(),
        }
    }

    /// Returns the mesh with one vertex for each cell.
    fn mesh(self, fine: &Mesh) -> Mesh {
        let of_cells = self.vertices.chunk_by(|(a, _), (b, _)| a == b);
        let nearest = of_cells.map(|cell| {
            let vertices = || cell.iter().map(|(_, vertex)| fine.vertices[*vertex]);
            let middle = [0, 1, 2]
                .map(|axis| vertices().map(|vertex| vertex[axis]).sum::<f64>() / cell.len() as f64);
            let away = |vertex: &[f64; 3]| {
                (0..3)
                    .map(|axis| (vertex[axis] - middle[axis]).powi(2))
                    .sum::<f64>()
            };
            vertices()
                .min_by(|a, b| away(a).total_cmp(&away(b)))
                .unwrap_or(middle)
        });
        Mesh {
            vertices: nearest.collect(),
            triangles: self.triangles,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sphere with a radius of 1 m.
    fn sphere(rings: u32) -> Mesh {
        use std::f64::consts::PI;
        let around = 2 * rings;
        let point = |ring: u32, step: u32| {
            let polar = PI * f64::from(ring) / f64::from(rings);
            let angle = PI * f64::from(step % around) / f64::from(rings);
            let across = libm::sin(polar);
            [
                across * libm::cos(angle),
                across * libm::sin(angle),
                libm::cos(polar),
            ]
        };
        let mut vertices = Vec::new();
        let mut triangles = Vec::new();
        for ring in 0..rings {
            for step in 0..around {
                let first = u32::try_from(vertices.len()).expect("few vertices");
                vertices.extend([
                    point(ring, step),
                    point(ring + 1, step),
                    point(ring + 1, step + 1),
                    point(ring, step + 1),
                ]);
                triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
            }
        }
        Mesh::new(vertices, triangles)
            .expect("it is a mesh")
            .welded()
    }

    #[test]
    fn a_clustered_mesh_keeps_its_form_and_its_limit() {
        let fine = sphere(100);
        assert!(fine.triangles.len() > 30_000);
        for most in [300, 2000, 10_000] {
            let coarse = fine.clustered(most);
            assert!(coarse.triangles.len() <= most, "{}", coarse.triangles.len());
            assert!(
                coarse.triangles.len() > most / 4,
                "{}",
                coarse.triangles.len()
            );
            let share = coarse.volume() / fine.volume();
            assert!(share > 0.9 && share < 1.02, "{most}: {share}");
            // Each vertex is one of the fine mesh.
            let radius = |vertex: &[f64; 3]| vertex.iter().map(|x| x * x).sum::<f64>().sqrt();
            assert!(
                coarse
                    .vertices
                    .iter()
                    .all(|vertex| (radius(vertex) - 1.0).abs() < 1e-9)
            );
            assert_eq!(coarse, fine.clustered(most));
        }
        assert_eq!(fine.clustered(100_000), fine);
        assert!(fine.clustered(0).triangles.is_empty());
    }
}
