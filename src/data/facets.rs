//! The faces of meshes as convex polygons, and the connected components of meshes.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use crate::Mesh;

/// Faces whose normals differ by less than this are in one plane. Unit: cosine (about 0.6 degrees).
const SAME_COSINE: f64 = 0.99995;
/// Points this close to a plane are on it. Unit: metres.
const ON_PLANE_M: f64 = 1e-3;
/// Sine of the largest turn to the right in a polygon that counts as convex: rounding.
const STRAIGHT: f64 = 1e-6;
/// Triangles of a smaller area have no usable normal. Unit: square metres.
const LEAST_M2: f64 = 1e-8;

/// A flat convex polygon. Unit: metres.
#[derive(Debug, Clone, PartialEq)]
pub struct Face {
    /// Corners, counterclockwise seen from outside.
    pub corners: Vec<Vector3<f64>>,
    /// Unit vector that points outwards.
    pub normal: Vector3<f64>,
}

impl Face {
    /// Area. Unit: square metres.
    pub fn area(&self) -> f64 {
        let Some(first) = self.corners.first() else {
            return 0.0;
        };
        let doubled: Vector3<f64> = self
            .corners
            .windows(2)
            .map(|pair| (pair[0] - first).cross(&(pair[1] - first)))
            .sum();
        doubled.norm() / 2.0
    }

    /// Area divided by the longest side: about the width of a sliver. Unit: metres.
    pub fn width(&self) -> f64 {
        let next = self.corners.iter().cycle().skip(1);
        let longest = self
            .corners
            .iter()
            .zip(next)
            .map(|(a, b)| (b - a).norm())
            .fold(0.0, f64::max);
        if longest > 0.0 {
            self.area() / longest
        } else {
            0.0
        }
    }

    /// Cuts the polygon by a level plane. Returns the part below and the part above; one is `None`
    /// if all is on the other side.
    pub fn cut(&self, height_m: f64) -> [Option<Self>; 2] {
        [-1.0, 1.0].map(|side| {
            let above = |corner: &Vector3<f64>| side * (corner.z - height_m);
            let mut kept = Vec::new();
            for (a, b) in self.corners.iter().zip(self.corners.iter().cycle().skip(1)) {
                if above(a) >= 0.0 {
                    kept.push(*a);
                }
                if above(a) * above(b) < 0.0 {
                    kept.push(a + (b - a) * (above(a) / (above(a) - above(b))));
                }
            }
            let rises = kept.iter().any(|corner| above(corner) > ON_PLANE_M);
            (rises && kept.len() > 2).then_some(Self {
                corners: kept,
                normal: self.normal,
            })
        })
    }
}

impl Mesh {
    /// Splits the mesh into its connected components, in the order of their first triangles.
    pub fn components(&self) -> Vec<Self> {
        let welded = self.welded();
        let mut groups = Groups::new(welded.vertices.len());
        for [a, b, c] in &welded.triangles {
            groups.join(*a as usize, *b as usize);
            groups.join(*b as usize, *c as usize);
        }
        let mut order: Vec<usize> = Vec::new();
        let mut triangles: BTreeMap<usize, Vec<[u32; 3]>> = BTreeMap::new();
        for corners in &welded.triangles {
            let group = groups.first(corners[0] as usize);
            if !triangles.contains_key(&group) {
                order.push(group);
            }
            triangles.entry(group).or_default().push(*corners);
        }
        let of = |group| Self {
            vertices: welded.vertices.clone(),
            triangles: triangles.remove(&group).unwrap_or_default(),
        };
        order
            .into_iter()
            .map(of)
            .map(|mesh| mesh.without_loose_vertices())
            .collect()
    }

    /// Whether no point is in front of any face: a convex solid, or a flat one.
    pub fn is_convex(&self) -> bool {
        let points: Vec<Vector3<f64>> = self
            .vertices
            .iter()
            .map(|vertex| Vector3::from(*vertex))
            .collect();
        let outwards = self.outwards();
        self.triangles
            .iter()
            .filter_map(|corners| plane(&points, corners))
            .all(|(normal, at)| {
                points
                    .iter()
                    .all(|point| outwards * normal.dot(&(point - points[at])) <= ON_PLANE_M)
            })
    }

    /// Returns the surface as convex polygons: triangles in one plane are joined while the result
    /// is convex.
    ///
    /// Source: S. Hertel, K. Mehlhorn, Fast triangulation of simple polygons (1983), by length of
    /// the removed side.
    pub fn faces(&self) -> Vec<Face> {
        let mesh = self.one_sided();
        let points: Vec<Vector3<f64>> = mesh
            .vertices
            .iter()
            .map(|vertex| Vector3::from(*vertex))
            .collect();
        let outwards = mesh.outwards();
        let mut polygons: Vec<Polygon> = Vec::new();
        for corners in &mesh.triangles {
            let [a, b, c] = corners.map(|idx| idx as usize);
            if let Some((normal, _)) = plane(&points, corners) {
                let corners = if outwards < 0.0 {
                    vec![c, b, a]
                } else {
                    vec![a, b, c]
                };
                polygons.push(Polygon {
                    corners,
                    normal: normal * outwards,
                });
            }
        }
        let mut side_of: BTreeMap<[usize; 2], usize> = BTreeMap::new();
        for (idx, polygon) in polygons.iter().enumerate() {
            for side in polygon.sides() {
                side_of.entry(side).or_insert(idx);
            }
        }
        let length = |[a, b]: &[usize; 2]| (points[*b] - points[*a]).norm();
        let mut shared: Vec<[usize; 2]> = side_of
            .keys()
            .filter(|[a, b]| a < b && side_of.contains_key(&[*b, *a]))
            .copied()
            .collect();
        shared.sort_by(|one, other| length(other).total_cmp(&length(one)).then(one.cmp(other)));
        let mut groups = Groups::new(polygons.len());
        for [a, b] in shared {
            let [one, other] = [side_of[&[a, b]], side_of[&[b, a]]].map(|idx| groups.first(idx));
            if one == other {
                continue;
            }
            if let Some(joined) = polygons[one].joined(&polygons[other], [a, b], &points) {
                let kept = groups.join(one, other);
                polygons[kept] = joined;
            }
        }
        let kept = (0..polygons.len())
            .filter(|idx| groups.first(*idx) == *idx)
            .collect::<Vec<_>>();
        kept.into_iter()
            .map(|idx| polygons[idx].face(&points))
            .collect()
    }

    /// 1, or -1 if the triangles of a closed mesh face inwards.
    fn outwards(&self) -> f64 {
        let corner = |idx: u32| Vector3::from(self.vertices[idx as usize]);
        let sixfold = |[a, b, c]: &[u32; 3]| corner(*a).dot(&corner(*b).cross(&corner(*c)));
        if self.triangles.iter().map(sixfold).sum::<f64>() < 0.0 {
            -1.0
        } else {
            1.0
        }
    }

    fn without_loose_vertices(&self) -> Self {
        let mut numbers: BTreeMap<u32, u32> = BTreeMap::new();
        let mut vertices = Vec::new();
        let mut number = |idx: u32| {
            *numbers.entry(idx).or_insert_with(|| {
                vertices.push(self.vertices[idx as usize]);
                u32::try_from(vertices.len() - 1).unwrap_or(u32::MAX)
            })
        };
        let triangles = self
            .triangles
            .iter()
            .map(|corners| corners.map(&mut number))
            .collect();
        Self {
            vertices,
            triangles,
        }
    }
}

/// The unit normal of a triangle and its first corner, or `None` if it is too small.
fn plane(points: &[Vector3<f64>], [a, b, c]: &[u32; 3]) -> Option<(Vector3<f64>, usize)> {
    let [a, b, c] = [a, b, c].map(|idx| *idx as usize);
    let normal = (points[b] - points[a]).cross(&(points[c] - points[a]));
    (normal.norm() > 2.0 * LEAST_M2).then(|| (normal.normalize(), a))
}

/// A polygon by the indices of its corners.
#[derive(Debug, Clone)]
struct Polygon {
    corners: Vec<usize>,
    normal: Vector3<f64>,
}

impl Polygon {
    fn sides(&self) -> impl Iterator<Item = [usize; 2]> + '_ {
        self.corners
            .iter()
            .zip(self.corners.iter().cycle().skip(1))
            .map(|(a, b)| [*a, *b])
    }

    /// Joins two polygons at the side from `a` to `b` of the first one, if they are in one plane
    /// and the result is convex.
    fn joined(&self, other: &Self, [a, b]: [usize; 2], points: &[Vector3<f64>]) -> Option<Self> {
        let on_plane =
            |corner: &usize| self.normal.dot(&(points[*corner] - points[a])).abs() <= ON_PLANE_M;
        if self.normal.dot(&other.normal) < SAME_COSINE || !other.corners.iter().all(on_plane) {
            return None;
        }
        let mut corners = from(&self.corners, b)?;
        corners.extend(from(&other.corners, a)?);
        // Both ends of the side are there twice; where the polygons share more sides, the path goes
        // there and back.
        loop {
            let n = corners.len();
            let at = |idx: usize| corners[idx % n];
            if let Some(idx) = (0..n).find(|idx| at(*idx) == at(idx + 1)) {
                corners.remove(idx);
            } else if let Some(idx) = (0..n).find(|idx| n > 2 && at(*idx) == at(idx + 2)) {
                corners.remove((idx + 1) % n);
            } else {
                break;
            }
        }
        let joined = Self {
            corners,
            normal: self.normal,
        };
        joined.is_convex(points).then_some(joined)
    }

    fn is_convex(&self, points: &[Vector3<f64>]) -> bool {
        let n = self.corners.len();
        let at = |idx: usize| points[self.corners[idx % n]];
        n > 2
            && (0..n).all(|idx| {
                let (before, after) = (at(idx + 1) - at(idx), at(idx + 2) - at(idx + 1));
                let turn = before.cross(&after).dot(&self.normal) / (before.norm() * after.norm());
                turn > STRAIGHT || (turn >= -STRAIGHT && before.dot(&after) > 0.0)
            })
    }

    /// The polygon without the corners on its sides.
    fn face(&self, points: &[Vector3<f64>]) -> Face {
        let n = self.corners.len();
        let at = |idx: usize| points[self.corners[idx % n]];
        let turns = |idx: &usize| {
            let (before, after) = (at(*idx) - at(idx + n - 1), at(idx + 1) - at(*idx));
            before.cross(&after).dot(&self.normal) > STRAIGHT * before.norm() * after.norm()
        };
        Face {
            corners: (0..n).filter(turns).map(at).collect(),
            normal: self.normal,
        }
    }
}

/// A closed path from a corner on.
fn from(corners: &[usize], first: usize) -> Option<Vec<usize>> {
    let at = corners.iter().position(|corner| *corner == first)?;
    Some([&corners[at..], &corners[..at]].concat())
}

/// Disjoint sets of numbers; each is known by its lowest number.
struct Groups {
    parent: Vec<usize>,
}

impl Groups {
    fn new(count: usize) -> Self {
        Self {
            parent: (0..count).collect(),
        }
    }

    fn first(&mut self, mut idx: usize) -> usize {
        while self.parent[idx] != idx {
            self.parent[idx] = self.parent[self.parent[idx]];
            idx = self.parent[idx];
        }
        idx
    }

    /// Joins two sets, and returns the number by which the result is known.
    fn join(&mut self, one: usize, other: usize) -> usize {
        let [one, other] = [one, other].map(|idx| self.first(idx));
        let (kept, gone) = (one.min(other), one.max(other));
        self.parent[gone] = kept;
        kept
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wall 4 m long, 3 m high and 0.2 m thick along x, with a door 1 m wide and 2.1 m high in
    /// its middle.
    fn wall_with_door() -> Mesh {
        let outline = [
            [0.0, 0.0],
            [1.5, 0.0],
            [1.5, 2.1],
            [2.5, 2.1],
            [2.5, 0.0],
            [4.0, 0.0],
            [4.0, 3.0],
            [0.0, 3.0],
        ];
        let front = [
            [0, 1, 2],
            [0, 2, 7],
            [7, 2, 6],
            [2, 3, 6],
            [3, 4, 5],
            [3, 5, 6],
        ];
        let vertices = [0.0, 0.2]
            .iter()
            .flat_map(|y| outline.iter().map(|[x, z]| [*x, *y, *z]))
            .collect::<Vec<[f64; 3]>>();
        let mut triangles: Vec<[u32; 3]> = front.to_vec();
        triangles.extend(front.iter().map(|[a, b, c]| [c + 8, b + 8, a + 8]));
        for a in 0..8 {
            let b = (a + 1) % 8;
            triangles.extend([[a, a + 8, b], [b, a + 8, b + 8]]);
        }
        Mesh::new(vertices, triangles).expect("the mesh is valid")
    }

    #[test]
    fn faces_are_convex_and_have_the_area_of_the_surface() {
        let wall = wall_with_door();
        assert!(!wall.is_convex() && wall.components().len() == 1);
        let faces = wall.faces();
        let side = 4.0 * 3.0 - 1.0 * 2.1;
        let around = 0.2 * (4.0 + 3.0 + 3.0 + 2.0 * 1.5 + 2.0 * 2.1 + 1.0);
        let area: f64 = faces.iter().map(Face::area).sum();
        assert!((area - 2.0 * side - around).abs() < 1e-9, "{area}");
        // Three for each side of the wall, and eight around it.
        assert_eq!(faces.len(), 14, "{faces:?}");
        let inside = Vector3::new(0.7, 0.1, 1.0);
        for face in faces
            .iter()
            .filter(|face| face.corners[0].x < 1.0 || face.normal.y != 0.0)
        {
            let towards = face.normal.dot(&(face.corners[0] - inside));
            assert!(towards > 0.0, "{face:?}");
        }
    }

    #[test]
    fn triangles_that_face_inwards_are_turned() {
        let wall = wall_with_door();
        let inwards = Mesh {
            triangles: wall
                .triangles
                .iter()
                .map(|[a, b, c]| [*c, *b, *a])
                .collect(),
            ..wall.clone()
        };
        assert_eq!(wall.faces().len(), inwards.faces().len());
        assert!(
            inwards
                .faces()
                .iter()
                .any(|face| face.normal.y < -0.9 && face.corners[0].y == 0.0)
        );
    }

    #[test]
    fn faces_are_cut_at_a_height() {
        let corners = [[0.0, 0.0], [2.0, 0.0], [2.0, 3.0], [0.0, 3.0]]
            .map(|[x, z]| Vector3::new(x, 0.0, z))
            .to_vec();
        let wall = Face {
            corners,
            normal: -Vector3::y(),
        };
        let [below, above] = wall
            .cut(2.0)
            .map(|face| face.expect("the plane cuts the wall"));
        assert!((below.area() - 4.0).abs() < 1e-12 && (above.area() - 2.0).abs() < 1e-12);
        assert!(below.corners.iter().all(|corner| corner.z <= 2.0));
        let [below, above] = wall.cut(3.0);
        assert!(below.is_some() && above.is_none());
        assert!((wall.width() - 2.0).abs() < 1e-12);
    }

    #[test]
    fn components_are_found_and_boxes_are_convex() {
        let wall = wall_with_door();
        let further = wall.vertices.iter().map(|[x, y, z]| [x + 9.0, *y, *z]);
        let vertices: Vec<[f64; 3]> = wall.vertices.iter().copied().chain(further).collect();
        let more = wall
            .triangles
            .iter()
            .map(|corners| corners.map(|idx| idx + 16));
        let both = Mesh {
            vertices,
            triangles: wall.triangles.iter().copied().chain(more).collect(),
        };
        let parts = both.components();
        assert_eq!(parts.len(), 2);
        for part in &parts {
            assert!(
                (part.volume() - wall.volume()).abs() < 1e-9 && part.vertices.len() == 16,
                "{part:?}"
            );
        }
        let tetrahedron = [
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
        ];
        let mesh = Mesh::new(
            tetrahedron.to_vec(),
            vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
        );
        assert!(mesh.expect("the mesh is valid").is_convex());
    }
}
