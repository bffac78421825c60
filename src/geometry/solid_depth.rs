//! The depth of two bodies in each other where both are solid.
//!
//! Convex pieces fill the hollows of the meshes that they represent: a fork that reaches into the
//! mouth of a hand is inside its hull, and touches nothing. Boxes, cylinders, spheres and capsules
//! are solid. Where a mesh is involved, the depth is the diameter of the largest ball that fits
//! into the material of both bodies, and at most the depth of their pieces.

use std::sync::{Arc, OnceLock};

use nalgebra::{Isometry3, Point3, Vector3};
use parry3d::math::Pose as EnginePose;
use parry3d::shape::SharedShape;

use crate::convert::{from_pose, from_vector, to_vector};
use crate::separation::{SeparationOutcome, SolidPair};
use actcheck_data::Mesh;

/// Depths below this are those of the pieces: no material is known so well. Unit: metres.
const KNOWN_M: f64 = 1e-3;
/// Points along each side of the box in which two pieces overlap.
const N_SIDE: u32 = 5;
/// Steps of the search from the best of these points.
const N_STEPS: u32 = 40;

/// A collision mesh of a body, as its file has it.
#[derive(Debug)]
pub struct Material {
    mesh: Arc<Mesh>,
    /// Factors of its axes.
    scale: [f64; 3],
    /// Its pose in the frame of the body.
    pose: Isometry3<f64>,
    scaled: OnceLock<Mesh>,
}

impl Material {
    /// Returns the material of a mesh with these factors of its axes, at this pose in the frame of
    /// its body.
    pub fn new(mesh: Arc<Mesh>, scale: [f64; 3], pose: Isometry3<f64>) -> Self {
        Self {
            mesh,
            scale,
            pose,
            scaled: OnceLock::new(),
        }
    }

    /// Returns the distance of a point in the frame of the body to the surface; negative outside.
    /// Unit: metres.
    ///
    /// Source: A. Jacobson et al., "Robust inside-outside segmentation using generalized winding
    /// numbers" (2013); the solid angle of a triangle is that of A. van Oosterom and J. Strackee
    /// (1983). Meshes with gaps or overlapping bodies have an inside, too.
    fn inside_m(&self, point: &Point3<f64>) -> f64 {
        let mesh = self.scaled.get_or_init(|| self.mesh.scaled(self.scale));
        let at = self.pose.inverse_transform_point(point).coords;
        let (mut solid_angle, mut nearest) = (0.0, f64::INFINITY);
        for corners in &mesh.triangles {
            let [a, b, c] = corners.map(|idx| Vector3::from(mesh.vertices[idx as usize]) - at);
            let (length_a, length_b, length_c) = (a.norm(), b.norm(), c.norm());
            let below = length_a * length_b * length_c
                + a.dot(&b) * length_c
                + b.dot(&c) * length_a
                + c.dot(&a) * length_b;
            solid_angle += 2.0 * libm::atan2(a.dot(&b.cross(&c)), below);
            nearest = nearest.min(from_origin_m([a, b, c]));
        }
        let is_inside = solid_angle.abs() > 2.0 * std::f64::consts::PI;
        if is_inside { nearest } else { -nearest }
    }
}

/// Distance of a triangle from the origin. Unit: metres.
fn from_origin_m([a, b, c]: [Vector3<f64>; 3]) -> f64 {
    let normal = (b - a).cross(&(c - a));
    let is_over =
        |from: Vector3<f64>, to: Vector3<f64>| (to - from).cross(&-from).dot(&normal) >= 0.0;
    if normal.norm() > 0.0 && is_over(a, b) && is_over(b, c) && is_over(c, a) {
        return (a.dot(&normal) / normal.norm()).abs();
    }
    let edge = |from: Vector3<f64>, to: Vector3<f64>| {
        let way = to - from;
        let share = (-from.dot(&way) / way.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        (from + way * share).norm()
    };
    edge(a, b).min(edge(b, c)).min(edge(c, a))
}

/// A convex piece of a body.
#[derive(Clone, Copy)]
pub struct Piece<'a> {
    /// Its shape.
    pub shape: &'a SharedShape,
    /// Its pose in the frame that all pieces have in common.
    pub pose: EnginePose,
    /// The mesh that it is a piece of, with the pose of its body; `None` if it is solid.
    pub material: Option<(&'a Material, Isometry3<f64>)>,
}

impl Piece<'_> {
    /// Returns how deep a point in the common frame is in the material; negative
    /// outside. Unit: metres.
    fn inside_m(&self, point: &Point3<f64>) -> f64 {
        let found = self
            .shape
            .project_point(&self.pose, to_vector(&point.coords), false);
        let from_surface = (from_vector(found.point) - point.coords).norm();
        match &self.material {
            _ if !found.is_inside => -from_surface,
            Some((material, pose)) => material.inside_m(&pose.inverse_transform_point(point)),
            None => from_surface,
        }
    }

    /// Returns the depth of two pieces, with the middle of the overlap; `None` if they are apart.
    /// Unit: metres.
    fn overlap(&self, other: &Self) -> Option<(f64, Point3<f64>)> {
        let (one, two) = (self.shape.as_support_map()?, other.shape.as_support_map()?);
        let b_in_a = self.pose.inv_mul(&other.pose);
        let towards = from_vector(b_in_a.translation)
            .try_normalize(0.0)
            .unwrap_or_else(Vector3::x);
        match SolidPair::new(&b_in_a, one, two).separation(towards, KNOWN_M) {
            SeparationOutcome::Near(found) if found.distance_m < 0.0 => {
                let middle = Point3::from((found.points[0] + found.points[1]) / 2.0);
                Some((-found.distance_m, from_pose(&self.pose) * middle))
            }
            _ => None,
        }
    }

    /// Returns the diameter of the largest ball in the material of both pieces that the search
    /// finds from this point and from others in the overlap. Unit: metres.
    fn common_ball_m(&self, other: &Self, middle: Point3<f64>) -> f64 {
        let depth = |point: &Point3<f64>| self.inside_m(point).min(other.inside_m(point));
        let boxes = [self, other].map(|piece| piece.shape.compute_aabb(&piece.pose));
        let low = from_vector(boxes[0].mins).sup(&from_vector(boxes[1].mins));
        let size = from_vector(boxes[0].maxs).inf(&from_vector(boxes[1].maxs)) - low;
        let share = |idx: u32| (f64::from(idx) + 0.5) / f64::from(N_SIDE);
        let mut best = (depth(&middle), middle);
        for idx in 0..N_SIDE.pow(3) {
            let shares = Vector3::new(
                share(idx % N_SIDE),
                share(idx / N_SIDE % N_SIDE),
                share(idx / N_SIDE.pow(2)),
            );
            let point = Point3::from(low + size.component_mul(&shares));
            let found = depth(&point);
            if found > best.0 {
                best = (found, point);
            }
        }
        let mut step = size / f64::from(N_SIDE);
        for _ in 0..N_STEPS {
            let ways = (0..6).map(|way| {
                let along = if way % 2 == 0 { 1.0 } else { -1.0 };
                let mut shift = Vector3::zeros();
                shift[way / 2] = along * step[way / 2];
                best.1 + shift
            });
            let better = ways
                .map(|point| (depth(&point), point))
                .max_by(|a, b| a.0.total_cmp(&b.0));
            match better.filter(|better| better.0 > best.0) {
                Some(better) => best = better,
                None => step /= 2.0,
            }
        }
        2.0 * best.0.max(0.0)
    }
}

/// Returns how deep two bodies are in each other where both are solid; 0 if they are apart. Unit:
/// metres. All pieces have their poses in one frame.
pub fn solid_depth_m(first: &[Piece<'_>], second: &[Piece<'_>]) -> f64 {
    let boxed = |pieces: &[Piece<'_>]| -> Vec<_> {
        pieces
            .iter()
            .map(|piece| piece.shape.compute_aabb(&piece.pose))
            .collect()
    };
    let (boxes_first, boxes_second) = (boxed(first), boxed(second));
    let mut deepest = 0.0f64;
    for (one, its_box) in first.iter().zip(&boxes_first) {
        for (other, other_box) in second.iter().zip(&boxes_second) {
            let is_near = its_box.mins.cmple(other_box.maxs).all()
                && other_box.mins.cmple(its_box.maxs).all();
            let Some((depth, middle)) = is_near.then(|| one.overlap(other)).flatten() else {
                continue;
            };
            if depth <= deepest {
                continue;
            }
            let are_solid = one.material.is_none() && other.material.is_none();
            let found = match depth > KNOWN_M && !are_solid {
                true => one.common_ball_m(other, middle).min(depth),
                false => depth,
            };
            deepest = deepest.max(found);
        }
    }
    deepest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::convert::to_pose;

    /// A closed mesh: a profile in x and z, and its copy at this y.
    fn prism(profile: &[[f64; 2]], width: f64) -> Mesh {
        let count = u32::try_from(profile.len()).expect("it is short");
        let at = |y: f64| profile.iter().map(move |[x, z]| [*x, y, *z]);
        let vertices: Vec<[f64; 3]> = at(0.0).chain(at(width)).collect();
        let mut triangles = Vec::new();
        // The profiles here can be divided into triangles around their first corner.
        for corner in 1..count - 1 {
            triangles.extend([
                [0, corner, corner + 1],
                [count, count + corner + 1, count + corner],
            ]);
        }
        for side in 0..count {
            let next = (side + 1) % count;
            triangles.extend([
                [side, side + count, next + count],
                [side, next + count, next],
            ]);
        }
        Mesh::new(vertices, triangles).expect("the mesh is valid")
    }

    fn piece(shape: &SharedShape, at: [f64; 3]) -> Piece<'_> {
        Piece {
            shape,
            pose: to_pose(&Isometry3::translation(at[0], at[1], at[2])),
            material: None,
        }
    }

    #[test]
    fn the_inside_of_a_mesh_is_found_and_its_distance_is_exact() {
        let angle = [
            [0.0, 0.0],
            [0.2, 0.0],
            [0.2, 0.1],
            [0.1, 0.1],
            [0.1, 0.2],
            [0.0, 0.2],
        ];
        let material = Material::new(
            Arc::new(prism(&angle, 0.1)),
            [1.0, 2.0, 1.0],
            Isometry3::translation(1.0, 0.0, 0.0),
        );
        let inside = |x: f64, y: f64, z: f64| material.inside_m(&Point3::new(1.0 + x, y, z));
        for (point, expected) in [
            ([0.05, 0.1, 0.05], 0.05),
            ([0.15, 0.1, 0.05], 0.05),
            ([0.15, 0.1, 0.15], -0.05),
            ([0.05, 0.19, 0.05], 0.01),
            ([0.3, 0.1, 0.05], -0.1),
        ] {
            let [x, y, z] = point;
            assert!(
                (inside(x, y, z) - expected).abs() < 1e-9,
                "{point:?}: {}",
                inside(x, y, z)
            );
        }
    }

    /// A rod in the notch of an L is inside its hull. In the L itself, it is as deep as the hulls
    /// say.
    #[test]
    fn a_hollow_that_a_hull_fills_is_not_solid() {
        let angle = [
            [0.0, 0.0],
            [0.2, 0.0],
            [0.2, 0.05],
            [0.05, 0.05],
            [0.05, 0.2],
            [0.0, 0.2],
        ];
        let mesh = Arc::new(prism(&angle, 0.1));
        let hull = crate::hull::Hull::of(
            &mesh
                .vertices
                .iter()
                .map(|at| to_vector(&Vector3::from(*at)))
                .collect::<Vec<_>>(),
        );
        let hull = SharedShape::new(hull.expect("it is not flat"));
        let material = Material::new(mesh, [1.0; 3], Isometry3::identity());
        let whole = Piece {
            material: Some((&material, Isometry3::identity())),
            ..piece(&hull, [0.0; 3])
        };
        let rod = SharedShape::cuboid(0.01, 0.1, 0.01);
        for (at, least_m, most_m) in [
            ([0.09, 0.05, 0.09], 0.0, 0.0),
            ([0.15, 0.05, 0.025], 0.015, 0.021),
            ([0.15, 0.05, 0.055], 0.0045, 0.0055),
        ] {
            let rod = piece(&rod, at);
            let (depth, middle) = whole.overlap(&rod).expect("it is in the hull");
            assert!(depth > 0.005, "{at:?}: {depth}");
            let found = whole.common_ball_m(&rod, middle).min(depth);
            assert!(
                (least_m..=most_m).contains(&found),
                "{at:?}: {found} of {depth}"
            );
        }
    }
}
