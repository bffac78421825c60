//! Computes the faces of convex solids and of tubes.

use std::f64::consts::TAU;

use nalgebra::{Point3, Vector3};

use actcheck_data::convex_hull;

/// Points closer than this to a plane are considered on it. Unit: metres.
const FLAT_M: f64 = 1e-6;
/// Maximum number of corners used. Traces have at most 26 per solid.
const MOST_CORNERS: usize = 64;
/// Number of sides that approximate a circle.
const AROUND: u32 = 32;

/// A planar face: its outward normal and its corners, counter-clockwise seen from outside.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Face {
    /// Unit vector.
    pub normal: Vector3<f64>,
    /// Unit: metres.
    pub corners: Vec<Point3<f64>>,
}

/// Computes the faces of the convex hull: all planes through three points with no point beyond
/// them. Coplanar points give two faces, collinear points none.
///
/// The complexity is O(n⁴).
pub(super) fn faces(points: &[[f64; 3]]) -> Vec<Face> {
    let finite = points
        .iter()
        .filter(|point| point.iter().all(|value| value.is_finite()));
    let points: Vec<Point3<f64>> = finite
        .take(MOST_CORNERS)
        .map(|point| Point3::from(*point))
        .collect();
    let mut faces: Vec<Face> = Vec::new();
    for (i, a) in points.iter().enumerate() {
        for (j, b) in points.iter().enumerate().skip(i + 1) {
            for c in points.iter().skip(j + 1) {
                let Some(normal) = (b - a).cross(&(c - a)).try_normalize(1e-12) else {
                    continue;
                };
                for normal in [normal, -normal] {
                    let reach = normal.dot(&a.coords);
                    let known = faces.iter().any(|face| is_same(face, &normal, reach));
                    if !known
                        && points
                            .iter()
                            .all(|point| normal.dot(&point.coords) <= reach + FLAT_M)
                    {
                        faces.extend(face(&points, normal, reach));
                    }
                }
            }
        }
    }
    faces
}

/// The face of the points that are farthest along a normal. Returns `None` if it has fewer than
/// three corners.
fn face(points: &[Point3<f64>], normal: Vector3<f64>, reach: f64) -> Option<Face> {
    let on = points
        .iter()
        .filter(|point| normal.dot(&point.coords) >= reach - FLAT_M);
    let corners = around(&on.copied().collect::<Vec<_>>(), &normal);
    (corners.len() > 2).then_some(Face { normal, corners })
}

fn is_same(face: &Face, normal: &Vector3<f64>, reach: f64) -> bool {
    let corner = face
        .corners
        .first()
        .map_or(f64::NAN, |corner| normal.dot(&corner.coords));
    face.normal.dot(normal) > 1.0 - 1e-6 && (corner - reach).abs() < 10.0 * FLAT_M
}

/// Corners of the convex hull of coplanar points, counter-clockwise seen from the side to which the
/// normal points.
fn around(points: &[Point3<f64>], normal: &Vector3<f64>) -> Vec<Point3<f64>> {
    let Some(first) = points.first() else {
        return Vec::new();
    };
    let Some(u) = points
        .iter()
        .find_map(|point| (point - first).try_normalize(FLAT_M))
    else {
        return Vec::new();
    };
    let v = normal.cross(&u);
    let flat = points
        .iter()
        .map(|point| [(point - first).dot(&u), (point - first).dot(&v)]);
    convex_hull(flat)
        .into_iter()
        .map(|[x, y]| first + u * x + v * y)
        .collect()
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Corners of a box.
    fn corners([x, y, z]: [f64; 3]) -> Vec<[f64; 3]> {
        (0..8)
            .map(|idx| {
                [
                    x * f64::from(idx & 1),
                    y * f64::from(idx >> 1 & 1),
                    z * f64::from(idx >> 2),
                ]
            })
            .collect()
    }

    /// Volume enclosed by the faces, and their area. Both are wrong if a face is missing,
    /// duplicated or inverted.
    fn measured(faces: &[Face]) -> (f64, f64) {
        let triangles = faces.iter().flat_map(|face| {
            face.corners[1..]
                .windows(2)
                .map(|pair| (face.corners[0], pair[0], pair[1]))
        });
        triangles.fold((0.0, 0.0), |(volume, area), (a, b, c)| {
            let turned = (b - a).cross(&(c - a));
            (
                volume + a.coords.dot(&turned) / 6.0,
                area + turned.norm() / 2.0,
            )
        })
    }

    #[test]
    fn a_box_has_six_faces_that_enclose_it() {
        let mut points = corners([1.0, 2.0, 3.0]);
        points.extend([[0.5, 1.0, 1.5], [0.5, 1.0, 0.0], [f64::NAN, 0.0, 0.0]]);
        let faces = faces(&points);
        let (volume, area) = measured(&faces);
        assert_eq!(faces.len(), 6);
        assert!(
            (volume - 6.0).abs() < 1e-9 && (area - 22.0).abs() < 1e-9,
            "{volume} {area}"
        );
    }

    #[test]
    fn coplanar_points_give_two_faces_and_collinear_ones_none() {
        let flat: Vec<[f64; 3]> = corners([1.0, 1.0, 0.0])[..4].to_vec();
        let two_sides = faces(&flat);
        let (volume, area) = measured(&two_sides);
        assert_eq!(two_sides.len(), 2);
        assert!(volume.abs() < 1e-9 && (area - 2.0).abs() < 1e-9);
        assert!(faces(&[[0.0; 3], [1.0; 3], [2.0; 3]]).is_empty() && faces(&[]).is_empty());
    }
}
