//! The convex hull of points, for meshes that a file states by their vertices alone.

use std::collections::BTreeSet;

use nalgebra::Vector3;

/// Distances below this share of the points' extent count as 0.
const FLAT: f64 = 1e-9;

/// Returns the triangles of the convex hull of points, turned outwards, by the points' indices.
/// Returns no triangles if all points are in one plane.
///
/// One point after another is added: the triangles that it sees are replaced by those between it
/// and their outline.
pub(crate) fn convex_hull(points: &[[f64; 3]]) -> Vec<[u32; 3]> {
    let at = |idx: u32| Vector3::from(points[idx as usize]);
    let n_points = u32::try_from(points.len()).unwrap_or(u32::MAX);
    let Some(first) = tetrahedron(points) else {
        return Vec::new();
    };
    let extent = (0..n_points).map(|idx| (at(idx) - at(first[0])).norm());
    let flat = FLAT * extent.fold(0.0, f64::max);
    let middle = first.iter().map(|idx| at(*idx)).sum::<Vector3<f64>>() / 4.0;
    let height = |[a, b, c]: [u32; 3], point: Vector3<f64>| {
        let normal = (at(b) - at(a)).cross(&(at(c) - at(a)));
        let length = normal.norm();
        if length > 0.0 {
            normal.dot(&(point - at(a))) / length
        } else {
            0.0
        }
    };
    let [a, b, c, d] = first;
    let outwards = |[a, b, c]: [u32; 3]| {
        if height([a, b, c], middle) > 0.0 {
            [a, c, b]
        } else {
            [a, b, c]
        }
    };
    let mut faces: Vec<[u32; 3]> = [[a, b, c], [a, b, d], [a, c, d], [b, c, d]]
        .map(outwards)
        .to_vec();
    for point in 0..n_points {
        let (seen, hidden): (Vec<[u32; 3]>, Vec<[u32; 3]>) = faces
            .iter()
            .partition(|face| height(**face, at(point)) > flat);
        if seen.is_empty() {
            continue;
        }
        let edges: BTreeSet<(u32, u32)> = seen
            .iter()
            .flat_map(|[a, b, c]| [(*a, *b), (*b, *c), (*c, *a)])
            .collect();
        let outline = edges.iter().filter(|(a, b)| !edges.contains(&(*b, *a)));
        faces = hidden;
        faces.extend(outline.map(|(a, b)| [*a, *b, point]));
    }
    faces
}

/// Returns four points that are not in one plane, as far apart as is easily found.
fn tetrahedron(points: &[[f64; 3]]) -> Option<[u32; 4]> {
    let at = |idx: usize| Vector3::from(points[idx]);
    let farthest = |from: &dyn Fn(Vector3<f64>) -> f64| {
        (0..points.len()).max_by(|a, b| from(at(*a)).total_cmp(&from(at(*b))))
    };
    let a = farthest(&|point| -point.x)?;
    let b = farthest(&|point| (point - at(a)).norm())?;
    let along = (at(b) - at(a)).try_normalize(0.0)?;
    let from_line = |point: Vector3<f64>| (point - at(a)).cross(&along).norm();
    let c = farthest(&from_line)?;
    let normal = (at(c) - at(a)).cross(&along).try_normalize(0.0)?;
    let from_plane = |point: Vector3<f64>| (point - at(a)).dot(&normal).abs();
    let d = farthest(&from_plane)?;
    let extent = (at(b) - at(a)).norm();
    let is_solid = from_line(at(c)) > FLAT * extent && from_plane(at(d)) > FLAT * extent;
    let indices = [a, b, c, d].map(|idx| u32::try_from(idx).unwrap_or(u32::MAX));
    is_solid.then_some(indices)
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::Mesh;

    #[test]
    fn the_hull_of_a_cube_with_points_inside_is_the_cube() {
        let mut points: Vec<[f64; 3]> = (0..8)
            .map(|idx| [0, 1, 2].map(|axis| f64::from(idx >> axis & 1)))
            .collect();
        points.push([0.5, 0.5, 0.5]);
        points.push([0.5, 0.5, 1.0]);
        let mesh = Mesh::new(points.clone(), convex_hull(&points)).expect("it is a mesh");
        assert!((mesh.volume() - 1.0).abs() < 1e-12, "{}", mesh.volume());
    }

    #[test]
    fn flat_points_have_no_hull() {
        for points in [
            vec![],
            vec![[0.0; 3]; 5],
            vec![
                [0.0, 0.0, 0.0],
                [1.0, 0.0, 0.0],
                [0.0, 1.0, 0.0],
                [1.0, 1.0, 0.0],
            ],
        ] {
            assert!(convex_hull(&points).is_empty());
        }
    }
}
