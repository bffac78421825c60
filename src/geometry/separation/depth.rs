//! How deep two convex solids are in each other: the expanding polytope algorithm (G. van den
//! Bergen, 2001).

use nalgebra::Vector3;

use super::simplex::Simplex;
use super::{Corner, N_STEPS, Separation, SolidPair};

/// Error of a depth. Unit: metres. Round solids need many steps for less.
const TOLERANCE_M: f64 = 1e-6;
/// Least volume of the first tetrahedron relative to the cube of the longest edge.
const FLAT: f64 = 1e-9;

/// Faces with normals whose cosine is this near to 1 are parallel.
const PARALLEL: f64 = 1e-12;
/// Points this near to a plane are in it. Unit: metres. More than the rounding error.
const PLANE_M: f64 = 1e-12;

/// A whole polytope has about half as many faces after the last step. If there are more, rounding
/// errors have torn it, and their number doubles with each step.
const MOST_FACES: usize = 4 * N_STEPS;

/// A triangle of the polytope.
struct Face {
    corners: [usize; 3],
    /// Outward.
    normal: Vector3<f64>,
    /// Distance of its plane from the origin. Unit: metres.
    far_m: f64,
}

impl Face {
    /// Returns `None` if it has no area.
    fn new(all: &[Corner], corners: [usize; 3]) -> Option<Self> {
        let [a, b, c] = corners.map(|idx| all[idx].point);
        let normal = (b - a).cross(&(c - a)).try_normalize(f64::MIN_POSITIVE)?;
        Some(Self {
            corners,
            normal,
            far_m: normal.dot(&a),
        })
    }

    /// Whether a point is beyond the face or in its plane: a new face in the same plane could have
    /// no area.
    fn is_seen_from(&self, all: &[Corner], point: &Vector3<f64>) -> bool {
        (point - all[self.corners[0]].point).dot(&self.normal) > -PLANE_M
    }

    /// Weights of its corners for the point that is nearest to the origin; some are negative if
    /// that is beyond an edge.
    fn weights(&self, all: &[Corner]) -> [f64; 3] {
        let [a, b, c] = self
            .corners
            .map(|idx| all[idx].point - self.normal * self.far_m);
        let part = |from: Vector3<f64>, to: Vector3<f64>| from.cross(&to).dot(&self.normal);
        let parts = [part(b, c), part(c, a), part(a, b)];
        let sum: f64 = parts.iter().sum();
        parts.map(|part| part / sum)
    }

    /// The points of both solids with these weights; negative ones count as 0.
    fn points(&self, all: &[Corner], weights: [f64; 3]) -> [Vector3<f64>; 2] {
        let weights = weights.map(|weight| weight.max(0.0));
        let sum: f64 = weights.iter().sum();
        let of = |which: usize| {
            let corners = self.corners.iter().zip(weights);
            corners
                .map(|(idx, weight)| all[*idx].of[which] * (weight / sum))
                .sum()
        };
        [of(0), of(1)]
    }
}

/// Finds the direction in which two solids overlap least. `simplex`: corners with the origin in
/// them or at them. Returns `None` if they are flat.
pub(super) fn depth(solids: &SolidPair<'_>, simplex: &Simplex) -> Option<Separation> {
    let mut all = tetrahedron(solids, simplex)?;
    let mut faces: Vec<Face> = [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]
        .into_iter()
        .filter_map(|corners| Face::new(&all, corners))
        .collect();
    let mut edges: Vec<[usize; 2]> = Vec::new();
    for _ in 0..N_STEPS {
        let nearest = faces.iter().min_by(|a, b| a.far_m.total_cmp(&b.far_m))?;
        let corner = solids.corner(nearest.normal);
        let overlap_m = corner.point.dot(&nearest.normal);
        if overlap_m - nearest.far_m <= TOLERANCE_M {
            // The nearest point may be in another triangle of the same face of the solids.
            let near = faces
                .iter()
                .filter(|face| face.normal.dot(&nearest.normal) > 1.0 - PARALLEL);
            let around = near.map(|face| (face, face.weights(&all)));
            let least = |weights: &[f64; 3]| weights.iter().copied().fold(f64::INFINITY, f64::min);
            let (face, weights) = around.max_by(|a, b| least(&a.1).total_cmp(&least(&b.1)))?;
            let points = face.points(&all, weights);
            return Some(Separation {
                distance_m: -overlap_m,
                normal: nearest.normal,
                points,
            });
        }
        if all.iter().any(|known| known.point == corner.point) {
            return None;
        }
        edges.clear();
        faces.retain(|face| {
            let is_seen = face.is_seen_from(&all, &corner.point);
            if is_seen {
                edges.extend((0..3).map(|side| [face.corners[side], face.corners[(side + 1) % 3]]));
            }
            !is_seen
        });
        all.push(corner);
        let new = all.len() - 1;
        // The edges of the hole belong to one face that was seen.
        let rim = edges
            .iter()
            .filter(|[from, to]| !edges.contains(&[*to, *from]));
        faces.extend(rim.filter_map(|[from, to]| Face::new(&all, [*from, *to, new])));
        if faces.len() > MOST_FACES {
            return None;
        }
    }
    None
}

/// Four corners that are not in one plane, with the origin between them or at them, in right-handed
/// order.
fn tetrahedron(solids: &SolidPair<'_>, simplex: &Simplex) -> Option<Vec<Corner>> {
    let mut all: Vec<Corner> = simplex.corners().to_vec();
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    while all.len() < 4 {
        let edges: Vec<Vector3<f64>> = all[1..]
            .iter()
            .map(|corner| corner.point - all[0].point)
            .collect();
        let ways: Vec<Vector3<f64>> = match edges.as_slice() {
            [] => axes.to_vec(),
            [edge] => axes.iter().map(|axis| edge.cross(axis)).collect(),
            [one, other, ..] => vec![one.cross(other)],
        };
        let spread = |corner: &Corner| {
            let way = corner.point - all[0].point;
            match edges.as_slice() {
                [] => way.norm(),
                [edge] => edge.cross(&way).norm(),
                [one, other, ..] => one.cross(other).dot(&way).abs(),
            }
        };
        let both = ways
            .iter()
            .filter_map(|way| way.try_normalize(f64::MIN_POSITIVE))
            .flat_map(|way| [way, -way]);
        let found = both
            .map(|way| solids.corner(way))
            .max_by(|a, b| spread(a).total_cmp(&spread(b)))?;
        all.push(found);
    }
    let [a, b, c, d] = [0, 1, 2, 3].map(|idx| all[idx].point);
    let volume = (b - a).cross(&(c - a)).dot(&(d - a));
    let longest = [b - a, c - a, d - a]
        .iter()
        .map(Vector3::norm)
        .fold(0.0, f64::max);
    if volume.abs() <= FLAT * longest.powi(3) {
        return None;
    }
    // The first face looks away from the fourth corner.
    if volume > 0.0 {
        all.swap(1, 2);
    }
    Some(all)
}
