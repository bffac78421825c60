//! Decomposes meshes into convex solids, between which the engine can find contacts.

use std::panic::{AssertUnwindSafe, catch_unwind};

use nalgebra::{Matrix3, Vector3};
use parry3d::math::Vector;
use parry3d::transformation::try_convex_hull;
use parry3d::transformation::vhacd::{VHACD, VHACDParameters};

use crate::convert::to_real;
use actcheck_base::Digest;
use actcheck_data::{Mesh, Shape};

/// Version of the algorithm: increment it if the same mesh and parameters give different solids.
const ALGORITHM: u32 = 1;
/// Voxels along the longest side of a mesh's bounding box. At 64, a voxel of a mug is 1.5 mm.
const RESOLUTION: u32 = 64;
/// Largest volume between a piece and its hull, as a share of the whole mesh's hull. 0.01 keeps a
/// mug open.
const CONCAVITY: f32 = 0.01;
/// Largest number of pieces: each costs time in every step of every run.
const MOST_HULLS: u32 = 32;
/// A mesh that fills this share of its hull counts as convex, up to rounding.
const CONVEX: f64 = 0.97;

/// Why a mesh has no convex decomposition.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DecompositionFault {
    /// It encloses no volume.
    #[error("its points lie in a plane")]
    Flat,
    /// The library fails on it.
    #[error("it can't be decomposed into convex solids")]
    Library,
}

/// Returns a key of a mesh's decomposition: a digest of the mesh, the parameters and the
/// algorithm's version.
pub fn decomposition_key(mesh: &Mesh) -> String {
    let mut digest = Digest::new();
    digest.update(mesh.digest().as_bytes());
    for number in [ALGORITHM, RESOLUTION, CONCAVITY.to_bits(), MOST_HULLS] {
        digest.update(&number.to_le_bytes());
    }
    digest.finish()
}

/// Decomposes a mesh into convex hulls in the mesh's frame. The result is deterministic, bit by
/// bit.
///
/// # Errors
/// [`DecompositionFault`] if its points lie in a plane or the library fails on it.
pub fn decompose(mesh: &Mesh) -> Result<Vec<Shape>, DecompositionFault> {
    let frame = Frame::around(mesh);
    let points: Vec<Vector> = mesh
        .vertices
        .iter()
        .map(|vertex| frame.inside(vertex))
        .collect();
    let whole = frame.hull(&points).ok_or(DecompositionFault::Flat)?;
    if mesh.volume() >= CONVEX * whole.volume() {
        return Ok(vec![whole]);
    }
    let pieces = catch_unwind(AssertUnwindSafe(|| pieces(&points, &mesh.triangles)))
        .map_err(|_| DecompositionFault::Library)?;
    // Slivers without a hull have no relevant volume.
    let hulls: Vec<Shape> = pieces
        .iter()
        .filter_map(|piece| frame.hull(piece))
        .collect();
    Ok(if hulls.is_empty() { vec![whole] } else { hulls })
}

/// Thickness of a sheet. Unit: metres. That of a sticker or a pane.
const SHEET_M: f64 = 1e-3;

/// Returns a thin solid for a mesh whose points lie in a plane, such as a carpet or a marker on a
/// robot. Returns `None` if they lie on a line.
pub fn sheet(mesh: &Mesh) -> Option<Shape> {
    let count = mesh.vertices.len().max(1) as f64;
    let points: Vec<Vector3<f64>> = mesh
        .vertices
        .iter()
        .map(|vertex| Vector3::from(*vertex))
        .collect();
    let middle = points.iter().sum::<Vector3<f64>>() / count;
    let spread: Matrix3<f64> = points
        .iter()
        .map(|point| (point - middle) * (point - middle).transpose())
        .sum();
    let axes = spread.symmetric_eigen();
    let normal = axes.eigenvectors.column(axes.eigenvalues.imin()) * (SHEET_M / 2.0);
    let vertices = points
        .iter()
        .flat_map(|point| [(point + normal).into(), (point - normal).into()])
        .collect();
    let thick = Mesh {
        vertices,
        triangles: Vec::new(),
    };
    let frame = Frame::around(&thick);
    let inside: Vec<Vector> = thick
        .vertices
        .iter()
        .map(|point| frame.inside(point))
        .collect();
    frame.hull(&inside)
}

/// Directions in which the corners of a simplified hull are the outermost ones.
const DIRECTIONS: u32 = 96;

/// Returns a hull with fewer corners: the outermost ones in evenly spread directions. Links of
/// robots are often scanned or rounded surfaces with thousands of corners, and each costs time in
/// every distance query. Returns other shapes unchanged.
#[must_use]
pub fn simplified(shape: &Shape) -> Shape {
    let Shape::Hull { points, .. } = shape else {
        return shape.clone();
    };
    if points.len() <= DIRECTIONS as usize {
        return shape.clone();
    }
    let turn = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let mut kept: Vec<usize> = Vec::new();
    for number in 0..DIRECTIONS {
        let z = 1.0 - (2.0 * f64::from(number) + 1.0) / f64::from(DIRECTIONS);
        let (across, angle) = ((1.0 - z * z).sqrt(), turn * f64::from(number));
        let direction = [across * libm::cos(angle), across * libm::sin(angle), z];
        let along = |idx: usize| {
            (0..3)
                .map(|axis| direction[axis] * points[idx][axis])
                .sum::<f64>()
        };
        kept.extend((0..points.len()).max_by(|a, b| along(*a).total_cmp(&along(*b))));
    }
    kept.sort_unstable();
    kept.dedup();
    let points: Vec<[f64; 3]> = kept.into_iter().map(|idx| points[idx]).collect();
    let reduced = Mesh {
        triangles: Vec::new(),
        vertices: points,
    };
    let frame = Frame::around(&reduced);
    let inside: Vec<Vector> = reduced
        .vertices
        .iter()
        .map(|point| frame.inside(point))
        .collect();
    frame.hull(&inside).unwrap_or_else(|| shape.clone())
}

/// The corners and the triangles of a convex hull, by the index of corners.
pub type HullSurface = (Vec<[f64; 3]>, Vec<[u32; 3]>);

/// Returns the surface of the convex hull of points, or `None` if they lie in a plane.
pub fn hull_surface(points: &[[f64; 3]]) -> Option<HullSurface> {
    let frame = Frame::around(&Mesh {
        vertices: points.to_vec(),
        triangles: Vec::new(),
    });
    let inside: Vec<Vector> = points.iter().map(|point| frame.inside(point)).collect();
    let (corners, triangles) = catch_unwind(AssertUnwindSafe(|| try_convex_hull(&inside).ok()))
        .ok()
        .flatten()?;
    Some((
        corners.iter().map(|corner| frame.outside(corner)).collect(),
        triangles,
    ))
}

/// Returns the points of the surface within each piece.
fn pieces(points: &[Vector], triangles: &[[u32; 3]]) -> Vec<Vec<Vector>> {
    let parameters = VHACDParameters {
        resolution: RESOLUTION,
        concavity: CONCAVITY,
        max_convex_hulls: MOST_HULLS,
        ..VHACDParameters::default()
    };
    VHACD::decompose(&parameters, points, triangles, true)
        .compute_primitive_intersections(points, triangles)
}

/// Normalises meshes to a box of side 1 about the origin, so that the library's tolerances are
/// relative to the size.
struct Frame {
    middle: [f64; 3],
    side: f64,
}

impl Frame {
    fn around(mesh: &Mesh) -> Self {
        let extreme = |pick: fn(f64, f64) -> f64, start: f64| {
            mesh.vertices.iter().fold([start; 3], |best, v| {
                [0, 1, 2].map(|axis| pick(best[axis], v[axis]))
            })
        };
        let (low, high) = (
            extreme(f64::min, f64::INFINITY),
            extreme(f64::max, f64::NEG_INFINITY),
        );
        let side = [0, 1, 2]
            .map(|axis| high[axis] - low[axis])
            .into_iter()
            .fold(f64::MIN_POSITIVE, f64::max);
        Self {
            middle: [0, 1, 2].map(|axis| (low[axis] + high[axis]) / 2.0),
            side,
        }
    }

    fn inside(&self, point: &[f64; 3]) -> Vector {
        let [x, y, z] =
            [0, 1, 2].map(|axis| to_real((point[axis] - self.middle[axis]) / self.side));
        Vector::new(x, y, z)
    }

    fn outside(&self, point: &Vector) -> [f64; 3] {
        let point = [point.x, point.y, point.z].map(f64::from);
        [0, 1, 2].map(|axis| point[axis] * self.side + self.middle[axis])
    }

    /// Computes the convex hull of points. Returns `None` if they lie in a plane.
    fn hull(&self, points: &[Vector]) -> Option<Shape> {
        let (corners, triangles) = catch_unwind(AssertUnwindSafe(|| try_convex_hull(points).ok()))
            .ok()
            .flatten()?;
        let corners: Vec<[f64; 3]> = corners.iter().map(|corner| self.outside(corner)).collect();
        let volume = Mesh::new(corners, triangles)
            .ok()
            .map(|mesh| (mesh.volume(), mesh.welded().vertices));
        let (volume, points) = volume?;
        // A millionth of the box: thinner than any relevant sheet.
        (volume > 1e-6 * self.side.powi(3)).then_some(Shape::Hull { points, volume })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An L shape: two boxes of 1 × 1 × 1 and 1 × 1 × 2, side by side, as one mesh.
    fn angle() -> Mesh {
        let profile = [
            [0.0, 0.0],
            [2.0, 0.0],
            [2.0, 1.0],
            [1.0, 1.0],
            [1.0, 2.0],
            [0.0, 2.0],
        ];
        let at = |y: f64| profile.map(|[x, z]| [x, y, z]);
        let vertices: Vec<[f64; 3]> = at(0.0).into_iter().chain(at(1.0)).collect();
        let cap = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]];
        let mut triangles: Vec<[u32; 3]> = cap.to_vec();
        triangles.extend(cap.map(|[a, b, c]| [a + 6, c + 6, b + 6]));
        for side in 0..6 {
            let next = (side + 1) % 6;
            triangles.extend([[side, side + 6, next + 6], [side, next + 6, next]]);
        }
        Mesh::new(vertices, triangles).expect("the mesh is valid")
    }

    #[test]
    fn an_l_shape_becomes_two_solids_deterministically() {
        let solids = decompose(&angle()).expect("the mesh can be decomposed");
        assert!((2..=8).contains(&solids.len()), "{}", solids.len());
        let volume: f64 = solids.iter().map(Shape::volume).sum();
        assert!((volume - 3.0).abs() < 0.1, "{volume}");
        assert_eq!(
            solids,
            decompose(&angle()).expect("the mesh can be decomposed")
        );
        assert_eq!(decomposition_key(&angle()), decomposition_key(&angle()));
    }

    /// A ball of a thousand corners keeps its extent with a tenth of them; a hull of few corners is
    /// not changed.
    #[test]
    fn a_simplified_hull_has_fewer_corners_and_nearly_the_same_size() {
        let ball = |count: u32| {
            let at = |number: u32| {
                let (z, angle) = (
                    1.0 - (2.0 * f64::from(number) + 1.0) / f64::from(count),
                    2.4 * f64::from(number),
                );
                let across = (1.0 - z * z).sqrt();
                [across * libm::cos(angle), across * libm::sin(angle), z]
            };
            Shape::Hull {
                points: (0..count).map(at).collect(),
                volume: 4.0,
            }
        };
        let Shape::Hull { points, volume } = simplified(&ball(1000)) else {
            panic!("it is a hull")
        };
        assert!(
            points.len() <= DIRECTIONS as usize && volume > 0.9 * 4.18,
            "{} {volume}",
            points.len()
        );
        assert_eq!(simplified(&ball(20)), ball(20));
    }

    #[test]
    fn a_convex_mesh_is_one_solid_and_a_flat_one_none() {
        let corners = vec![
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
        ];
        let tetrahedron = Mesh::new(corners, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
            .expect("the mesh is valid");
        assert_eq!(
            decompose(&tetrahedron)
                .expect("the mesh can be decomposed")
                .len(),
            1
        );
        let flat = Mesh::new(
            vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            vec![[0, 1, 2]],
        )
        .expect("the mesh is valid");
        assert!(decompose(&flat).is_err());
        let volume = sheet(&flat).expect("it becomes a thin solid").volume();
        assert!((volume - 0.5 * SHEET_M).abs() < 1e-6, "{volume}");
    }
}
