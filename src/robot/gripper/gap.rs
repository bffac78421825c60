//! The gap between two fingers: the distance of their inner surfaces at the grasp frame.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Vector3};
use parry3d::query::Ray;

use crate::description::RobotModel;
use crate::gripper::surface::{BoxedShape, Surface};
use crate::kinematics::motion;
use actcheck_geometry::{to_real, to_vector};

/// Distances from the grasp frame along the fingers at which their surfaces are measured. Unit:
/// metres.
const ALONG_M: [f64; 5] = [-0.01, -0.005, 0.0, 0.005, 0.01];
/// The same for the direction of the fingers' width. Fingertips are seldom narrower than 1 cm.
const ACROSS_M: [f64; 5] = [-0.008, -0.004, 0.0, 0.004, 0.008];
/// Surfaces that differ by less than this are flat. Unit: metres.
const FLAT_M: f64 = 0.0015;
/// Distance from which surfaces are measured: beyond any finger. Unit: metres.
const AWAY_M: f64 = 0.5;

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
