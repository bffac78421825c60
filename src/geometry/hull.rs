//! A convex hull whose corners are packed for the processor's vector instructions.
//!
//! The library goes through the corners of a hull one by one. A robot whose meshes were split has
//! hundreds of hulls, and a fifth of the time of its runs went into the boxes around them and their
//! outermost corners. A sweep of a fast link also asks for the centre of mass and the thickness of
//! each of its hulls, which the library calculates anew each time. The results here are the
//! library's, bit for bit, but for rounding errors of the boxes.

use std::sync::{Arc, Mutex, OnceLock};

use crate::neighbours::Neighbours;
use parry3d::bounding_volume::{Aabb, BoundingSphere, BoundingVolume};
use parry3d::mass_properties::MassProperties;
use parry3d::math::{Matrix, Pose, Real, Vector};
use parry3d::query::{PointProjection, PointQuery, Ray, RayCast, RayIntersection};
use parry3d::shape::{
    ConvexPolyhedron, FeatureId, PolygonalFeature, PolygonalFeatureMap, Shape, ShapeType,
    SubShapeId, SupportMap, TypedShape,
};

/// Number of corners that are looked at together.
const LANES: usize = 8;
/// Half of them.
const HALF: usize = LANES / 2;

/// Margin of the box around a hull that remembers the shapes around it. Unit: metres.
const ROOMY_M: Real = 1e-3;
/// Error of a corner's place in 32 bits. Unit: metres.
const ROUNDING_M: Real = 1e-5;

/// A convex hull. Its clones share the corners.
pub struct Hull {
    solid: Arc<HullData>,
    /// The box around it at the pose for which it was last calculated. Most hulls are at rest for
    /// many steps. With a memory, the box is relative to the middle of its bounding ball.
    last: Mutex<Option<(Pose, Aabb)>>,
    /// The shapes around it, if it remembers them.
    pub neighbours: Option<Neighbours>,
}

/// A convex hull in its own frame.
struct HullData {
    hull: ConvexPolyhedron,
    /// The corners of the hull in their order: the coordinates x, y and z of [`LANES`] at a time.
    /// The last ones are copies of the first.
    corners: Vec<[[Real; LANES]; 3]>,
    bounds: Aabb,
    ball: BoundingSphere,
    thickness: Real,
    /// Its mass properties at a density of 1 kg/m³, once they are known.
    unit_mass: OnceLock<MassProperties>,
}

impl Clone for Hull {
    fn clone(&self) -> Self {
        let neighbours = self.neighbours.as_ref().map(|_| Neighbours::default());
        Self {
            solid: Arc::clone(&self.solid),
            last: Mutex::new(None),
            neighbours,
        }
    }
}

impl Hull {
    /// Returns the hull of points, or `None` if they lie in a plane.
    pub fn of(points: &[Vector]) -> Option<Self> {
        let hull = ConvexPolyhedron::from_convex_hull(points)?;
        let first = *hull.points().first()?;
        let pack = |chunk: &[Vector]| {
            [0, 1, 2]
                .map(|axis| std::array::from_fn(|lane| chunk.get(lane).unwrap_or(&first)[axis]))
        };
        let corners = hull.points().chunks(LANES).map(pack).collect();
        let (bounds, ball) = (
            hull.compute_local_aabb(),
            hull.compute_local_bounding_sphere(),
        );
        let thickness = hull.ccd_thickness();
        let solid = HullData {
            hull,
            corners,
            bounds,
            ball,
            thickness,
            unit_mass: OnceLock::new(),
        };
        Some(Self {
            solid: Arc::new(solid),
            last: Mutex::new(None),
            neighbours: None,
        })
    }

    /// Returns the same hull, which remembers the shapes around it.
    pub fn with_memory(&self) -> Self {
        Self {
            neighbours: Some(Neighbours::default()),
            ..self.clone()
        }
    }

    /// Returns the library's hull.
    pub fn polyhedron(&self) -> &ConvexPolyhedron {
        &self.solid.hull
    }

    /// Returns a box around it at a pose that is too large by at most twice [`ROOMY_M`]. It moves
    /// with the hull until this has turned so far that its corners may have left the margin.
    fn roomy_bounds(&self, pose: &Pose) -> Aabb {
        let ball = &self.solid.ball;
        let middle = pose.transform_point(ball.center);
        let around = || {
            let exact = self.solid.bounds_at(pose);
            Aabb::new(exact.mins - middle, exact.maxs - middle).loosened(ROOMY_M)
        };
        // Another thread has it if it is locked.
        let Ok(mut last) = self.last.try_lock() else {
            return around().translated(middle);
        };
        let is_near = |known: &Pose| {
            2.0 * (known.rotation.inverse() * pose.rotation).xyz().length() * ball.radius
                < ROOMY_M - ROUNDING_M
        };
        let bounds = match *last {
            Some((known, bounds)) if is_near(&known) => bounds,
            _ => last.insert((*pose, around())).1,
        };
        bounds.translated(middle)
    }

    /// Returns the index of the corner that is farthest along a direction: the first one of equal
    /// ones.
    fn outermost(&self, direction: Vector) -> usize {
        // Half of the corners of a chunk at a time: fewer candidates remain in the end.
        let mut best = [Real::NEG_INFINITY; HALF];
        let mut at = [0_u32; HALF];
        for (chunk, [x, y, z]) in (0_u32..).step_by(2).zip(&self.solid.corners) {
            for half in 0..2_u32 {
                for lane in 0..HALF {
                    let idx = half as usize * HALF + lane;
                    let along = x[idx] * direction.x + y[idx] * direction.y + z[idx] * direction.z;
                    let is_beyond = along > best[lane];
                    best[lane] = if is_beyond { along } else { best[lane] };
                    at[lane] = if is_beyond { chunk + half } else { at[lane] };
                }
            }
        }
        let mut outermost = (best[0], at[0] as usize * HALF);
        for lane in 1..HALF {
            let found = (best[lane], at[lane] as usize * HALF + lane);
            if found.0 > outermost.0 || (found.0 == outermost.0 && found.1 < outermost.1) {
                outermost = found;
            }
        }
        outermost.1
    }
}

impl HullData {
    /// Returns the box around it at a pose.
    fn bounds_at(&self, pose: &Pose) -> Aabb {
        let turn = Matrix::from_quat(pose.rotation);
        let rows = [turn.row(0), turn.row(1), turn.row(2)].map(|row| row.to_array());
        let (mut low, mut high) = (
            [[Real::INFINITY; LANES]; 3],
            [[Real::NEG_INFINITY; LANES]; 3],
        );
        for [x, y, z] in &self.corners {
            for lane in 0..LANES {
                let (x, y, z) = (x[lane], y[lane], z[lane]);
                let turned = rows.map(|[i, j, k]| i * x + j * y + k * z);
                for axis in 0..3 {
                    let (at, least, most) = (turned[axis], low[axis][lane], high[axis][lane]);
                    low[axis][lane] = if at < least { at } else { least };
                    high[axis][lane] = if at > most { at } else { most };
                }
            }
        }
        let least = low.map(|lanes| lanes.into_iter().fold(Real::INFINITY, Real::min));
        let most = high.map(|lanes| lanes.into_iter().fold(Real::NEG_INFINITY, Real::max));
        Aabb::new(
            Vector::from_array(least) + pose.translation,
            Vector::from_array(most) + pose.translation,
        )
    }
}

impl SupportMap for Hull {
    fn local_support_point(&self, direction: Vector) -> Vector {
        self.solid.hull.points()[self.outermost(direction)]
    }
}

impl PolygonalFeatureMap for Hull {
    fn local_support_feature(&self, direction: Vector, feature: &mut PolygonalFeature) {
        self.solid.hull.local_support_feature(direction, feature);
    }

    fn is_convex_polyhedron(&self) -> bool {
        true
    }
}

impl RayCast for Hull {
    fn cast_local_ray_and_get_normal(
        &self,
        ray: &Ray,
        most: Real,
        solid: bool,
    ) -> Option<RayIntersection> {
        self.solid
            .hull
            .cast_local_ray_and_get_normal(ray, most, solid)
    }
}

impl PointQuery for Hull {
    fn project_local_point(&self, point: Vector, solid: bool) -> PointProjection {
        self.solid.hull.project_local_point(point, solid)
    }

    fn project_local_point_and_get_feature(&self, point: Vector) -> (PointProjection, FeatureId) {
        self.solid.hull.project_local_point_and_get_feature(point)
    }
}

impl Shape for Hull {
    fn compute_local_aabb(&self) -> Aabb {
        self.solid.bounds
    }

    fn compute_local_bounding_sphere(&self) -> BoundingSphere {
        self.solid.ball
    }

    fn clone_dyn(&self) -> Box<dyn Shape> {
        Box::new(self.clone())
    }

    fn scale_dyn(&self, scale: Vector, subdivisions: u32) -> Option<Box<dyn Shape>> {
        self.solid.hull.scale_dyn(scale, subdivisions)
    }

    fn compute_aabb(&self, pose: &Pose) -> Aabb {
        if self.neighbours.is_some() {
            return self.roomy_bounds(pose);
        }
        // Another thread has it if it is locked.
        let Ok(mut last) = self.last.try_lock() else {
            return self.solid.bounds_at(pose);
        };
        match *last {
            Some((known, bounds)) if known == *pose => bounds,
            _ => last.insert((*pose, self.solid.bounds_at(pose))).1,
        }
    }

    fn mass_properties(&self, density: Real) -> MassProperties {
        let of = || self.solid.hull.mass_properties(density);
        if density.to_bits() == Real::to_bits(1.0) {
            *self.solid.unit_mass.get_or_init(of)
        } else {
            of()
        }
    }

    fn shape_type(&self) -> ShapeType {
        self.solid.hull.shape_type()
    }

    fn as_typed_shape(&self) -> TypedShape<'_> {
        self.solid.hull.as_typed_shape()
    }

    fn ccd_thickness(&self) -> Real {
        self.solid.thickness
    }

    fn ccd_angular_thickness(&self) -> Real {
        self.solid.hull.ccd_angular_thickness()
    }

    fn is_convex(&self) -> bool {
        true
    }

    fn as_support_map(&self) -> Option<&dyn SupportMap> {
        Some(self)
    }

    fn as_polygonal_feature_map(&self) -> Option<(&dyn PolygonalFeatureMap, Real)> {
        Some((self, 0.0))
    }

    fn feature_normal_at_point(
        &self,
        part: SubShapeId,
        feature: FeatureId,
        point: Vector,
    ) -> Option<Vector> {
        self.solid
            .hull
            .feature_normal_at_point(part, feature, point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::Choices;
    use parry3d::math::Rotation;

    /// Hulls of up to 60 points, some with corners in a plane, as boxes have.
    fn hull(choices: &mut Choices, trial: usize) -> Hull {
        let n_points = 8 + trial % 53;
        let mut number = || choices.real("at".into(), -1.0, 1.0, 0.0);
        let points: Vec<Vector> = (0..n_points)
            .map(|_| {
                let at = [number(), number(), number()].map(|at| {
                    if trial.is_multiple_of(3) {
                        at.signum()
                    } else {
                        at
                    }
                });
                crate::convert::to_vector(&at.into())
            })
            .collect();
        Hull::of(&points).expect("the points are not in a plane")
    }

    #[test]
    fn outermost_corners_and_boxes_are_those_of_the_library() {
        let mut choices = Choices::random(3, 0);
        for trial in 0..400 {
            let hull = hull(&mut choices, trial);
            let theirs = hull.polyhedron();
            let mut number = || crate::convert::to_real(choices.real("at".into(), -1.0, 1.0, 0.0));
            let axes = [Vector::X, -Vector::X, Vector::Y, -Vector::Z, Vector::ZERO];
            let direction =
                *axes
                    .get(trial % 11)
                    .unwrap_or(&Vector::new(number(), number(), number()));
            assert_eq!(
                hull.local_support_point(direction),
                theirs.local_support_point(direction),
                "trial {trial}"
            );
            let rotation = Rotation::from_xyzw(number(), number(), number(), number()).normalize();
            let pose = Pose::from_parts(Vector::new(number(), number(), number()), rotation);
            let (one, other) = (hull.compute_aabb(&pose), theirs.compute_aabb(&pose));
            assert_eq!(hull.compute_aabb(&pose), one, "a known box, trial {trial}");
            let of_mass = |shape: &dyn Shape, density: Real| {
                let found = shape.mass_properties(density);
                (found.inv_mass, found.local_com, found.inv_principal_inertia)
            };
            for density in [1.0, 1.0, 700.0] {
                assert_eq!(
                    of_mass(&hull, density),
                    of_mass(theirs, density),
                    "trial {trial}"
                );
            }
            assert_eq!(
                hull.ccd_thickness().to_bits(),
                theirs.ccd_thickness().to_bits(),
                "trial {trial}"
            );
            // A few of the last bits of coordinates up to 3.
            assert!(
                (one.mins - other.mins).length() + (one.maxs - other.maxs).length() < 4e-6,
                "trial {trial}"
            );
        }
    }

    /// A link that turns slowly: its box is not found anew in each step.
    #[test]
    fn the_box_of_a_hull_with_a_memory_is_a_little_too_large() {
        let mut choices = Choices::random(5, 0);
        let mut n_kept = 0;
        for trial in 0..40 {
            let plain = hull(&mut choices, trial);
            let known = plain.with_memory();
            let mut number =
                |most: f64| crate::convert::to_real(choices.real("at".into(), -most, most, 0.0));
            let turn = Vector::new(number(1.0), number(1.0), number(1.0));
            let way = Vector::new(number(1.0), number(1.0), number(1.0));
            let mut last = None;
            for step in 0..200_u16 {
                let share = Real::from(step) / 200.0;
                let pose =
                    Pose::from_parts(way * share, Rotation::from_scaled_axis(turn * share * 0.05));
                let (exact, roomy) = (plain.compute_aabb(&pose), known.compute_aabb(&pose));
                assert!(roomy.contains(&exact), "trial {trial}, step {step}");
                let most = (exact.mins - roomy.mins)
                    .max(roomy.maxs - exact.maxs)
                    .max_element();
                assert!(
                    most < 2.0 * ROOMY_M + 1e-5,
                    "{most} m in trial {trial}, step {step}"
                );
                let size = roomy.maxs - roomy.mins;
                n_kept +=
                    usize::from(last.is_some_and(|last: Vector| (last - size).length() < 1e-6));
                last = Some(size);
            }
        }
        assert!(n_kept > 2000, "kept {n_kept} times of 8000");
    }
}
