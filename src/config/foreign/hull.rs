//! The convex hull of points, for meshes that a file states by their vertices alone.

use std::collections::BTreeMap;

use nalgebra::Vector3;

/// Distances below this share of the points' extent count as 0.
const FLAT: f64 = 1e-9;

/// Returns the triangles of the convex hull of points, turned outwards, by the points' indices.
/// Returns no triangles if all points are in one plane.
///
/// Source: Barber, Dobkin and Huhdanpaa, "The quickhull algorithm for convex hulls" (1996).
pub(crate) fn convex_hull(points: &[[f64; 3]]) -> Vec<[u32; 3]> {
    let Some(first) = tetrahedron(points) else {
        return Vec::new();
    };
    let mut hull = Growing::new(points, first);
    while let Some(face) = hull.waiting.pop() {
        hull.grow(face);
    }
    let faces = hull.faces.into_iter().filter(|face| face.is_there);
    faces.map(|face| face.corners).collect()
}

/// A triangle of a hull that grows.
struct Face {
    corners: [u32; 3],
    /// Its length is 0 for a triangle without an area: it sees no point.
    normal: Vector3<f64>,
    /// The points above it that are not in the hull yet; each point is above one face at most.
    above: Vec<u32>,
    is_there: bool,
}

/// A hull to which one point after another is added: the triangles that it sees are replaced by
/// those between it and their outline.
struct Growing<'a> {
    points: &'a [[f64; 3]],
    /// Smaller heights count as 0. Unit: metres.
    flat: f64,
    faces: Vec<Face>,
    /// Each edge, in the direction in which its face has it, with the index of this face.
    edges: BTreeMap<[u32; 2], usize>,
    /// Faces with points above them.
    waiting: Vec<usize>,
}

impl<'a> Growing<'a> {
    fn new(points: &'a [[f64; 3]], first: [u32; 4]) -> Self {
        let mut hull = Self {
            points,
            flat: 0.0,
            faces: Vec::new(),
            edges: BTreeMap::new(),
            waiting: Vec::new(),
        };
        let all = 0..u32::try_from(points.len()).unwrap_or(u32::MAX);
        let extent = all
            .clone()
            .map(|idx| (hull.at(idx) - hull.at(first[0])).norm());
        hull.flat = FLAT * extent.fold(0.0, f64::max);
        let middle = first.iter().map(|idx| hull.at(*idx)).sum::<Vector3<f64>>() / 4.0;
        let [a, b, c, d] = first;
        let start = hull.faces.len();
        for [a, b, c] in [[a, b, c], [a, b, d], [a, c, d], [b, c, d]] {
            let normal = (hull.at(b) - hull.at(a)).cross(&(hull.at(c) - hull.at(a)));
            let is_inwards = normal.dot(&(middle - hull.at(a))) > 0.0;
            hull.add(if is_inwards { [a, c, b] } else { [a, b, c] });
        }
        hull.share(all, start);
        hull
    }

    fn at(&self, idx: u32) -> Vector3<f64> {
        Vector3::from(self.points[idx as usize])
    }

    fn add(&mut self, corners: [u32; 3]) {
        let [a, b, c] = corners;
        let normal = (self.at(b) - self.at(a)).cross(&(self.at(c) - self.at(a)));
        for edge in [[a, b], [b, c], [c, a]] {
            self.edges.insert(edge, self.faces.len());
        }
        self.faces.push(Face {
            corners,
            normal: normal.try_normalize(0.0).unwrap_or_default(),
            above: Vec::new(),
            is_there: true,
        });
    }

    /// Height of a point above a face.
    fn height(&self, face: usize, point: u32) -> f64 {
        let Face {
            corners, normal, ..
        } = &self.faces[face];
        normal.dot(&(self.at(point) - self.at(corners[0])))
    }

    /// Gives each point to the first face from `start` on that sees it.
    fn share(&mut self, points: impl IntoIterator<Item = u32>, start: usize) {
        for point in points {
            let sees = |face: &usize| self.height(*face, point) > self.flat;
            if let Some(face) = (start..self.faces.len()).find(sees) {
                self.faces[face].above.push(point);
            }
        }
        let is_waiting = |face: &usize| !self.faces[*face].above.is_empty();
        self.waiting
            .extend((start..self.faces.len()).filter(is_waiting));
    }

    /// Adds the highest point above a face.
    fn grow(&mut self, face: usize) {
        let above = &self.faces[face].above;
        let height = |point: &u32| self.height(face, *point);
        let highest = above
            .iter()
            .copied()
            .max_by(|one, other| height(one).total_cmp(&height(other)));
        let Some(point) = highest else { return };
        let (mut seen, mut outline) = (vec![face], Vec::new());
        self.faces[face].is_there = false;
        let mut next = 0;
        while let Some(face) = seen.get(next).copied() {
            next += 1;
            let [a, b, c] = self.faces[face].corners;
            for [a, b] in [[a, b], [b, c], [c, a]] {
                let Some(beyond) = self.edges.get(&[b, a]).copied() else {
                    continue;
                };
                if !self.faces[beyond].is_there {
                    continue;
                }
                if self.height(beyond, point) > self.flat {
                    self.faces[beyond].is_there = false;
                    seen.push(beyond);
                } else {
                    outline.push([a, b]);
                }
            }
        }
        let orphans: Vec<u32> = seen
            .iter()
            .flat_map(|face| std::mem::take(&mut self.faces[*face].above))
            .collect();
        let start = self.faces.len();
        for [a, b] in outline {
            self.add([a, b, point]);
        }
        self.share(orphans, start);
    }
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
    use crate::foreign::files_for_tests::ball;
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

    /// A hundred thousand points on a ball, and as many on the steps of a grid.
    #[test]
    fn hulls_of_many_points_are_found_in_a_second() {
        let start = std::time::Instant::now();
        let n = 100_000;
        let grid: Vec<[f64; 3]> = (0..n)
            .map(|idx| [idx % 50, idx / 50 % 50, idx / 2_500].map(f64::from))
            .collect();
        for (points, volume) in [
            (ball(n), 4.0 / 3.0 * std::f64::consts::PI),
            (grid, 49.0 * 49.0 * 39.0),
        ] {
            let mesh = Mesh::new(points.clone(), convex_hull(&points)).expect("it is a mesh");
            assert!(
                (mesh.volume() / volume - 1.0).abs() < 1e-3,
                "{}",
                mesh.volume()
            );
        }
        assert!(
            start.elapsed().as_secs_f64() < 20.0,
            "{:?}",
            start.elapsed()
        );
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
