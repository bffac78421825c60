//! The surface of a finger's link, for rays.

use parry3d::bounding_volume::{Aabb, BoundingVolume as _};
use parry3d::math::{Pose as EnginePose, Real, Vector as EngineVector};
use parry3d::query::Ray;
use parry3d::shape::{ConvexPolyhedron, SharedShape};

use actcheck_data::Part;
use actcheck_geometry::{Hull, convex_shape};

/// Slack of the box around a solid, for rounding. Unit: metres.
const BOX_SLACK_M: f32 = 1e-4;
/// Radius of a cylinder around all rays of a gap, with a slack for rounding: they are parallel.
/// Unit: metres.
const BEAM_M: f32 = 0.013;

/// The shapes of a link in its frame.
#[derive(Debug)]
pub(crate) struct Surface {
    pub(super) solids: Vec<BoxedShape>,
}

/// A shape with the box around it.
#[derive(Debug)]
pub(super) struct BoxedShape {
    around: Aabb,
    pub(super) shape: SharedShape,
    pub(super) pose: EnginePose,
    /// The faces of a shape that is a convex hull.
    faces: Option<Vec<HalfSpace>>,
}

/// The half space behind a face of a hull, in the frame of the hull.
#[derive(Debug, Clone, Copy)]
struct HalfSpace {
    outwards: EngineVector,
    /// Unit: metres.
    offset: Real,
}

impl Surface {
    pub(crate) fn of(solids: &[Part]) -> Self {
        let shapes = solids.iter().filter_map(convex_shape);
        Self {
            solids: shapes
                .map(|(shape, pose)| BoxedShape::new(shape, pose))
                .collect(),
        }
    }
}

impl BoxedShape {
    fn new(shape: SharedShape, pose: EnginePose) -> Self {
        let face = |hull: &ConvexPolyhedron, outwards: EngineVector| {
            let along = hull.points().iter().map(|point| outwards.dot(*point));
            HalfSpace {
                outwards,
                offset: along.fold(Real::NEG_INFINITY, Real::max),
            }
        };
        let hull = shape.as_shape::<Hull>().map(Hull::polyhedron);
        let faces = hull.map(|hull| {
            hull.faces()
                .iter()
                .map(|one| face(hull, one.normal))
                .collect()
        });
        Self {
            around: shape.compute_aabb(&pose).loosened(BOX_SLACK_M),
            faces,
            shape,
            pose,
        }
    }

    /// Whether this solid may be in a cylinder around rays: the ball around its box is. The axis
    /// begins at `origin`, and its direction has the length 1.
    pub(super) fn may_be_in(&self, origin: EngineVector, direction: EngineVector) -> bool {
        let way = self.around.center() - origin;
        let aside = way - direction * direction.dot(way);
        let near = self.around.half_extents().length() + BEAM_M;
        aside.length_squared() <= near * near
    }

    /// Whether a ray meets the box around this solid within `most`. A direction along a plane of
    /// the box gives infinite distances.
    fn meets_box(&self, ray: &Ray, most: Real) -> bool {
        let inverse = ray.dir.recip();
        let one = (self.around.mins - ray.origin) * inverse;
        let other = (self.around.maxs - ray.origin) * inverse;
        let enters = one.min(other).max_element().max(0.0);
        let leaves = one.max(other).min_element().min(most);
        enters <= leaves
    }

    /// Distance along a ray in the frame of the link to this solid, if it is less than `most`: 0
    /// inside. The ray is cut off at each face of a hull, which takes a tenth of the time of the
    /// library's search.
    pub(super) fn hit(&self, ray: &Ray, most: Real) -> Option<Real> {
        if !self.meets_box(ray, most) {
            return None;
        }
        let Some(faces) = &self.faces else {
            return self.shape.cast_ray(&self.pose, ray, most, true);
        };
        let ray = ray.inverse_transform_by(&self.pose);
        let (mut enters, mut leaves) = (0.0, most);
        for face in faces {
            let (behind, along) = (
                face.offset - face.outwards.dot(ray.origin),
                face.outwards.dot(ray.dir),
            );
            if along < 0.0 {
                enters = Real::max(enters, behind / along);
            } else if along > 0.0 {
                leaves = Real::min(leaves, behind / along);
            } else if behind < 0.0 {
                return None;
            }
        }
        (enters <= leaves).then_some(enters)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::{Pose, Shape};
    use actcheck_geometry::to_vector;
    use nalgebra::Vector3;

    /// The planes through any three points that have all others on one side: outward normal and
    /// offset.
    fn planes(points: &[Vector3<f64>]) -> Vec<(Vector3<f64>, f64)> {
        let mut found = Vec::new();
        for (a, first) in points.iter().enumerate() {
            for (b, second) in points.iter().enumerate().skip(a + 1) {
                for third in points.iter().skip(b + 1) {
                    let normal = (second - first).cross(&(third - first)).normalize();
                    for outwards in [normal, -normal] {
                        let offset = outwards.dot(first);
                        if points
                            .iter()
                            .all(|point| outwards.dot(point) <= offset + 1e-9)
                        {
                            found.push((outwards, offset));
                        }
                    }
                }
            }
        }
        found
    }

    /// The library's ray cast ends up to a centimetre before such a hull.
    #[test]
    fn rays_meet_hulls_where_they_begin() {
        let at = |n: u32| libm::sin(f64::from(n * n) * 12.9898) * 0.03;
        let points: Vec<[f64; 3]> = (0..60)
            .map(|n| [at(n), at(n + 1000), 2.0 * at(n + 2000)])
            .collect();
        let planes = planes(
            &points
                .iter()
                .map(|point| Vector3::from(*point))
                .collect::<Vec<_>>(),
        );
        let part = Part {
            pose: Pose::IDENTITY,
            shape: Shape::Hull {
                points,
                volume: 1e-5,
            },
        };
        let surface = Surface::of(&[part]);
        let mut hits = 0;
        for trial in 0..500 {
            let origin = Vector3::new(0.2, at(trial), at(trial + 500));
            let direction = Vector3::new(-1.0, at(trial + 700), at(trial + 900)).normalize();
            let (mut enters, mut leaves) = (0.0f64, 1.0f64);
            for (outwards, offset) in &planes {
                let along = outwards.dot(&direction);
                let end = (offset - outwards.dot(&origin)) / along;
                if along < 0.0 {
                    enters = enters.max(end)
                } else {
                    leaves = leaves.min(end)
                }
            }
            let found =
                surface.solids[0].hit(&Ray::new(to_vector(&origin), to_vector(&direction)), 1.0);
            match found {
                Some(found) => assert!(
                    (f64::from(found) - enters).abs() < 5e-4,
                    "trial {trial}: {found} {enters}"
                ),
                None => assert!(leaves < enters + 5e-4, "trial {trial}: {enters} {leaves}"),
            }
            hits += usize::from(found.is_some());
        }
        assert!((100..450).contains(&hits), "{hits}");
    }
}
