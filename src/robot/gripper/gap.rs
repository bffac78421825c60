//! The gap between two fingers: the distance of their inner surfaces at the grasp frame.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Vector3};
use parry3d::bounding_volume::{Aabb, BoundingVolume as _};
use parry3d::math::{Pose as EnginePose, Real, Vector as EngineVector};
use parry3d::query::Ray;
use parry3d::shape::{ConvexPolyhedron, SharedShape};

use crate::description::RobotModel;
use crate::kinematics::motion;
use actcheck_data::Part;
use actcheck_geometry::{Hull, convex_shape, to_real, to_vector};

/// Distances from the grasp frame along the fingers at which their surfaces are measured. Unit:
/// metres.
const ALONG_M: [f64; 5] = [-0.01, -0.005, 0.0, 0.005, 0.01];
/// The same for the direction of the fingers' width. Fingertips are seldom narrower than 1 cm.
const ACROSS_M: [f64; 5] = [-0.008, -0.004, 0.0, 0.004, 0.008];
/// Surfaces that differ by less than this are flat. Unit: metres.
const FLAT_M: f64 = 0.0015;
/// Distance from which surfaces are measured: beyond any finger. Unit: metres.
const AWAY_M: f64 = 0.5;

/// Slack of the box around a solid, for rounding. Unit: metres.
const BOX_SLACK_M: f32 = 1e-4;
/// Radius of a cylinder around all rays of a gap, with a slack for rounding: they are parallel.
/// Unit: metres.
const BEAM_M: f32 = 0.013;

/// Where the inner surfaces of the fingers are, along the y axis of the grasp frame. Unit: metres.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Gap {
    pub(crate) left_m: f64,
    pub(crate) right_m: f64,
}

impl Gap {
    /// Distance between the surfaces; negative where they overlap.
    pub(crate) fn width_m(&self) -> f64 {
        self.left_m - self.right_m
    }

    /// The middle between the surfaces.
    pub(crate) fn middle_m(&self) -> f64 {
        f64::midpoint(self.left_m, self.right_m)
    }

    /// This gap at share 0 and another at share 1.
    pub(crate) fn towards(&self, other: &Self, share: f64) -> Self {
        let between = |from: f64, to: f64| from + share * (to - from);
        Self {
            left_m: between(self.left_m, other.left_m),
            right_m: between(self.right_m, other.right_m),
        }
    }
}

/// The parts that a set of joints moves.
pub(crate) struct Moving {
    /// Whether they move the grasp frame.
    pub(crate) grasp_frame: bool,
    /// Those that move the left and the right finger, from the finger inwards.
    pub(crate) fingers: [Vec<usize>; 2],
}

/// The shapes of a link in its frame.
#[derive(Debug)]
pub(crate) struct Surface {
    solids: Vec<BoxedShape>,
}

/// A shape with the box around it.
#[derive(Debug)]
struct BoxedShape {
    around: Aabb,
    shape: SharedShape,
    pose: EnginePose,
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
    fn may_be_in(&self, origin: EngineVector, direction: EngineVector) -> bool {
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
    fn hit(&self, ray: &Ray, most: Real) -> Option<Real> {
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

/// Measures the gap between the fingers of a model.
pub(crate) struct Probe<'a> {
    model: &'a RobotModel,
    links: [usize; 2],
    grasp: (usize, Isometry3<f64>),
    surfaces: [Arc<Surface>; 2],
}

impl<'a> Probe<'a> {
    pub(crate) fn new(
        model: &'a RobotModel,
        links: [usize; 2],
        grasp: (usize, Isometry3<f64>),
    ) -> Self {
        Self {
            model,
            links,
            grasp,
            surfaces: links.map(|link| model.links[link].surface()),
        }
    }

    /// The links of the fingertips, left and right.
    pub(crate) fn links(&self) -> [usize; 2] {
        self.links
    }

    /// Returns the parts that these joints move.
    pub(crate) fn moving(&self, joints: &[usize]) -> Moving {
        let above = |link: usize| -> Vec<usize> {
            let parent = |joint: &usize| self.model.joints[*joint].parent.checked_sub(1);
            std::iter::successors(link.checked_sub(1), parent)
                .filter(|joint| joints.contains(joint))
                .collect()
        };
        Moving {
            grasp_frame: !above(self.grasp.0).is_empty(),
            fingers: self.links.map(above),
        }
    }

    /// Measures the gap at these joint positions. Returns `None` if a finger has no surface at the
    /// grasp frame.
    pub(crate) fn gap(&self, positions: &[f64]) -> Option<Gap> {
        let grasp = self.pose(self.grasp.0, positions) * self.grasp.1;
        let [left, right] = [0, 1].map(|side| {
            // The left finger's inner surface is its lowest along y, the right finger's its
            // highest.
            let sign = if side == 0 { 1.0 } else { -1.0 };
            let from_grasp = self.pose(self.links[side], positions).inverse() * grasp;
            self.nearest_hit(side, &from_grasp, Self::rays(&from_grasp, sign))
                .map(|along| sign * (along - AWAY_M))
        });
        Some(Gap {
            left_m: left?,
            right_m: right?,
        })
    }

    /// Returns the share of the measured length along the fingers at which their gap is nearly the
    /// smallest: 1 if the grasp frame is in the middle of two parallel pads.
    pub(crate) fn flat_share(&self, positions: &[f64]) -> f64 {
        let grasp = self.pose(self.grasp.0, positions) * self.grasp.1;
        let width = |row: usize| -> Option<f64> {
            let [left, right] = [0, 1].map(|side| {
                let sign = if side == 0 { 1.0 } else { -1.0 };
                let from_grasp = self.pose(self.links[side], positions).inverse() * grasp;
                let rays = Self::rays(&from_grasp, sign)
                    .skip(row * ACROSS_M.len())
                    .take(ACROSS_M.len());
                self.nearest_hit(side, &from_grasp, rays)
                    .map(|along| along - AWAY_M)
            });
            Some(left? + right?)
        };
        let widths: Vec<Option<f64>> = (0..ALONG_M.len()).map(width).collect();
        let least = widths
            .iter()
            .flatten()
            .copied()
            .fold(f64::INFINITY, f64::min);
        let flat = widths
            .iter()
            .flatten()
            .filter(|width| **width < least + FLAT_M)
            .count();
        flat as f64 / ALONG_M.len() as f64
    }

    fn rays(from_grasp: &Isometry3<f64>, sign: f64) -> impl Iterator<Item = Ray> + '_ {
        let direction = from_grasp.rotation * Vector3::new(0.0, sign, 0.0);
        ALONG_M.into_iter().flat_map(move |x| {
            ACROSS_M.into_iter().map(move |z| {
                let origin = from_grasp * Point3::new(x, -sign * AWAY_M, z);
                Ray::new(to_vector(&origin.coords), to_vector(&direction))
            })
        })
    }

    /// The least distance to a finger's surface along one of these rays of the grasp frame, in the
    /// frame of its link.
    fn nearest_hit(
        &self,
        side: usize,
        from_grasp: &Isometry3<f64>,
        rays: impl Iterator<Item = Ray>,
    ) -> Option<f64> {
        let farthest = to_real(2.0 * AWAY_M);
        let (at, along) = (
            to_vector(&from_grasp.translation.vector),
            to_vector(&(from_grasp.rotation * Vector3::y())),
        );
        let near: Vec<&BoxedShape> = self.surfaces[side]
            .solids
            .iter()
            .filter(|solid| solid.may_be_in(at, along))
            .collect();
        // Solids whose box begins beyond the nearest one so far need no look.
        let nearest = rays.fold(farthest, |nearest, ray| {
            near.iter().fold(nearest, |nearest, solid| {
                solid.hit(&ray, nearest).unwrap_or(nearest).min(nearest)
            })
        });
        (nearest < farthest).then_some(f64::from(nearest))
    }

    /// A finger: its link, and the link's pose in the grasp frame at these joint positions.
    pub(crate) fn finger(&self, side: usize, positions: &[f64]) -> (usize, Isometry3<f64>) {
        let grasp = self.pose(self.grasp.0, positions) * self.grasp.1;
        (
            self.links[side],
            grasp.inverse() * self.pose(self.links[side], positions),
        )
    }

    /// Returns the point of a link that is nearest to the origin of the grasp frame, in that frame;
    /// `None` if the link has no shape. Unit: metres.
    pub(super) fn nearest(&self, link: usize, positions: &[f64]) -> Option<Vector3<f64>> {
        let grasp = self.pose(self.grasp.0, positions) * self.grasp.1;
        let from_grasp = grasp.inverse() * self.pose(link, positions);
        let origin = to_vector(&from_grasp.inverse().translation.vector);
        let surface = self.model.links[link].surface();
        let nearest = |solid: &BoxedShape| {
            let at = solid.shape.project_point(&solid.pose, origin, true).point;
            (from_grasp * Point3::new(f64::from(at.x), f64::from(at.y), f64::from(at.z))).coords
        };
        surface
            .solids
            .iter()
            .map(nearest)
            .min_by(|a, b| a.norm().total_cmp(&b.norm()))
    }

    /// Pose of a link in the frame of the root, with the other joints at 0.
    fn pose(&self, link: usize, positions: &[f64]) -> Isometry3<f64> {
        let mut pose = Isometry3::identity();
        let mut at = link;
        while let Some(idx) = at.checked_sub(1) {
            let joint = &self.model.joints[idx];
            pose = joint.origin * motion(joint, positions.get(idx).copied().unwrap_or(0.0)) * pose;
            at = joint.parent;
        }
        pose
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::{Pose, Shape};

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
