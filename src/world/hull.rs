//! A convex hull whose corners are packed for the processor's vector instructions.
//!
//! The library goes through the corners of a hull one by one. A robot whose meshes were split has hundreds of hulls, and a fifth of
//! the time of its runs went into the boxes around them and their outermost corners. The results here are the library's, bit for
//! bit, on processors for which it uses the same formulas.

use parry3d::bounding_volume::{Aabb, BoundingSphere};
use parry3d::mass_properties::MassProperties;
use parry3d::math::{Pose, Real, Vector};
use parry3d::query::{PointProjection, PointQuery, Ray, RayCast, RayIntersection};
use parry3d::shape::{
    ConvexPolyhedron, FeatureId, PolygonalFeature, PolygonalFeatureMap, Shape, ShapeType, SubShapeId, SupportMap,
    TypedShape,
};

/// Number of corners that are looked at together.
const LANES: usize = 8;
/// Half of them.
const HALF: usize = LANES / 2;

/// A convex hull.
#[derive(Clone)]
pub(crate) struct Hull {
    hull: ConvexPolyhedron,
    /// The corners of the hull in their order: the coordinates x, y and z of [`LANES`] at a time. The last ones are copies of the
    /// first.
    corners: Vec<[[Real; LANES]; 3]>,
}

impl Hull {
    /// Returns the hull of points, or `None` if they lie in a plane.
    pub(crate) fn of(points: &[Vector]) -> Option<Self> {
        let hull = ConvexPolyhedron::from_convex_hull(points)?;
        let first = *hull.points().first()?;
        let pack = |chunk: &[Vector]| {
            [0, 1, 2].map(|axis| std::array::from_fn(|lane| chunk.get(lane).unwrap_or(&first)[axis]))
        };
        let corners = hull.points().chunks(LANES).map(pack).collect();
        Some(Self { hull, corners })
    }

    /// Returns the library's hull.
    pub(crate) fn polyhedron(&self) -> &ConvexPolyhedron {
        &self.hull
    }

    /// Returns the index of the corner that is farthest along a direction: the first one of equal ones.
    fn outermost(&self, direction: Vector) -> usize {
        // Half of the corners of a chunk at a time: fewer candidates remain in the end.
        let mut best = [Real::NEG_INFINITY; HALF];
        let mut at = [0_u32; HALF];
        for (chunk, [x, y, z]) in (0_u32..).step_by(2).zip(&self.corners) {
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

impl SupportMap for Hull {
    fn local_support_point(&self, direction: Vector) -> Vector {
        self.hull.points()[self.outermost(direction)]
    }
}

impl PolygonalFeatureMap for Hull {
    fn local_support_feature(&self, direction: Vector, feature: &mut PolygonalFeature) {
        self.hull.local_support_feature(direction, feature);
    }

    fn is_convex_polyhedron(&self) -> bool {
        true
    }
}

impl RayCast for Hull {
    fn cast_local_ray_and_get_normal(&self, ray: &Ray, most: Real, solid: bool) -> Option<RayIntersection> {
        self.hull.cast_local_ray_and_get_normal(ray, most, solid)
    }
}

impl PointQuery for Hull {
    fn project_local_point(&self, point: Vector, solid: bool) -> PointProjection {
        self.hull.project_local_point(point, solid)
    }

    fn project_local_point_and_get_feature(&self, point: Vector) -> (PointProjection, FeatureId) {
        self.hull.project_local_point_and_get_feature(point)
    }
}

impl Shape for Hull {
    fn compute_local_aabb(&self) -> Aabb {
        self.hull.compute_local_aabb()
    }

    fn compute_local_bounding_sphere(&self) -> BoundingSphere {
        self.hull.compute_local_bounding_sphere()
    }

    fn clone_dyn(&self) -> Box<dyn Shape> {
        Box::new(self.clone())
    }

    fn scale_dyn(&self, scale: Vector, subdivisions: u32) -> Option<Box<dyn Shape>> {
        self.hull.scale_dyn(scale, subdivisions)
    }

    fn compute_aabb(&self, pose: &Pose) -> Aabb {
        let [i, j, k, w] = pose.rotation.to_array();
        // The rotation of a vector v by a quaternion (b, w): (w² - b²) v + 2 (v·b) b + 2 w (b × v).
        let (scale, twice_w) = (w * w - (i * i + j * j + k * k), w * 2.0);
        let (mut low, mut high) = ([[Real::INFINITY; LANES]; 3], [[Real::NEG_INFINITY; LANES]; 3]);
        for [x, y, z] in &self.corners {
            for lane in 0..LANES {
                let (x, y, z) = (x[lane], y[lane], z[lane]);
                let along = (x * i + y * j + z * k) * 2.0;
                let turned = [
                    x * scale + i * along + (j * z - y * k) * twice_w,
                    y * scale + j * along + (k * x - z * i) * twice_w,
                    z * scale + k * along + (i * y - x * j) * twice_w,
                ];
                for axis in 0..3 {
                    let (at, least, most) = (turned[axis], low[axis][lane], high[axis][lane]);
                    low[axis][lane] = if at < least { at } else { least };
                    high[axis][lane] = if at > most { at } else { most };
                }
            }
        }
        let least = low.map(|lanes| lanes.into_iter().fold(Real::INFINITY, Real::min));
        let most = high.map(|lanes| lanes.into_iter().fold(Real::NEG_INFINITY, Real::max));
        Aabb::new(Vector::from_array(least) + pose.translation, Vector::from_array(most) + pose.translation)
    }

    fn mass_properties(&self, density: Real) -> MassProperties {
        self.hull.mass_properties(density)
    }

    fn shape_type(&self) -> ShapeType {
        self.hull.shape_type()
    }

    fn as_typed_shape(&self) -> TypedShape<'_> {
        self.hull.as_typed_shape()
    }

    fn ccd_thickness(&self) -> Real {
        self.hull.ccd_thickness()
    }

    fn ccd_angular_thickness(&self) -> Real {
        self.hull.ccd_angular_thickness()
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

    fn feature_normal_at_point(&self, part: SubShapeId, feature: FeatureId, point: Vector) -> Option<Vector> {
        self.hull.feature_normal_at_point(part, feature, point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::Choices;
    use rapier3d::math::Rotation;

    /// Hulls of up to 60 points, some with corners in a plane, as boxes have.
    fn hull(choices: &mut Choices, trial: usize) -> Hull {
        let n_points = 8 + trial % 53;
        let mut number = || choices.real("at".into(), -1.0, 1.0, 0.0);
        let points: Vec<Vector> = (0..n_points)
            .map(|_| {
                let at =
                    [number(), number(), number()].map(|at| if trial.is_multiple_of(3) { at.signum() } else { at });
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
            let direction = *axes.get(trial % 11).unwrap_or(&Vector::new(number(), number(), number()));
            assert_eq!(hull.local_support_point(direction), theirs.local_support_point(direction), "trial {trial}");
            let rotation = Rotation::from_xyzw(number(), number(), number(), number()).normalize();
            let pose = Pose::from_parts(Vector::new(number(), number(), number()), rotation);
            let (one, other) = (hull.compute_aabb(&pose), theirs.compute_aabb(&pose));
            assert!((one.mins - other.mins).length() + (one.maxs - other.maxs).length() < 1e-6, "trial {trial}");
            #[cfg(target_arch = "x86_64")]
            assert_eq!((one.mins, one.maxs), (other.mins, other.maxs), "trial {trial}");
        }
    }
}
