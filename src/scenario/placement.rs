//! The part of a surface on which an object may be placed.

use std::sync::Arc;

use nalgebra::{Isometry3, Point2, Translation3, UnitQuaternion, Vector3, distance};

use actcheck_data::{ObjectModel, Surface};

/// Minimum distance of objects from the edge: a nearer one falls off when it is touched. Unit:
/// metres.
const EDGE_MARGIN_M: f64 = 0.01;
/// Maximum distance of the target from the edge that the robot faces. Arms of mobile manipulators
/// reach about 0.6 m beyond their base. Unit: metres.
const REACH_M: f64 = 0.6;
/// Maximum lateral offset of the target: beyond it, the robot would need another start. Unit:
/// metres.
const SIDE_M: f64 = 0.35;

/// A rectangle for the origin of an object. Frame: world, with the surface's centre at the origin.
/// Unit: metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Area {
    pub(super) x: (f64, f64),
    pub(super) y: (f64, f64),
}

/// The stance of an object: upright or on its side.
pub(super) struct Stance {
    /// Extent on the surface at yaw 0. Unit: metres. Shape: x, y.
    size_m: [f64; 2],
    /// Pose of the model's origin. Frame: its foot, on the surface below its centre.
    pub(super) foot_from_model: Isometry3<f64>,
}

/// The upright stance of a model.
pub(super) fn standing(model: &ObjectModel) -> Stance {
    Stance {
        size_m: [model.size_m[0], model.size_m[1]],
        foot_from_model: Isometry3::identity(),
    }
}

/// The stance of a model on its side: its z axis along y.
pub(super) fn lying(model: &ObjectModel) -> Stance {
    let [length, width, height] = model.size_m;
    // A quarter turn about x brings z to −y and y to z.
    let turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::FRAC_PI_2);
    let shift = Translation3::new(0.0, height / 2.0, width / 2.0);
    Stance {
        size_m: [length, height],
        foot_from_model: Isometry3::from_parts(shift, turn),
    }
}

/// Returns the area in which an object with this yaw does not overhang the surface, or `None` if it
/// is too large.
pub(super) fn area(surface: &Surface, stance: &Stance, yaw: f64) -> Option<Area> {
    let [length, width] = stance.size_m;
    let (sin, cos) = (libm::sin(yaw).abs(), libm::cos(yaw).abs());
    let [half_x, half_y] =
        [length * cos + width * sin, length * sin + width * cos].map(|extent| extent / 2.0);
    let room = |extent: f64, half: f64| {
        Some(extent / 2.0 - EDGE_MARGIN_M - half).filter(|room| *room >= 0.0)
    };
    let (x, y) = (
        room(surface.size_m[0], half_x)?,
        room(surface.size_m[1], half_y)?,
    );
    Some(Area {
        x: (-x, x),
        y: (-y, y),
    })
}

/// The part of an area within reach of the robot, which is on the negative x side.
pub(super) fn reachable(area: Area, surface: &Surface) -> Area {
    let farthest = -surface.size_m[0] / 2.0 + REACH_M;
    let nearest = area.x.0;
    Area {
        x: (nearest, area.x.1.min(farthest).max(nearest)),
        y: (area.y.0.max(-SIDE_M), area.y.1.min(SIDE_M)),
    }
}

/// The places within reach of a fixed arm. Frame: that of the surface. Unit: metres.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reach {
    /// The root of the arm.
    pub(super) root: Point2<f64>,
    /// Its heading. Unit: radians.
    pub(super) heading: f64,
    /// Distances from the root, nearest and farthest.
    pub(super) limits: [f64; 2],
}

impl Reach {
    /// The part of an area in the square around the farthest places.
    pub(super) fn clip(&self, area: Area) -> Area {
        let side = |(low, high): (f64, f64), at: f64| {
            let (low, high) = (low.max(at - self.limits[1]), high.min(at + self.limits[1]));
            (low, high.max(low))
        };
        Area {
            x: side(area.x, self.root.x),
            y: side(area.y, self.root.y),
        }
    }

    /// Whether a place is neither too near nor too far.
    pub(super) fn holds(&self, place: [f64; 2]) -> bool {
        let from_root = distance(&self.root, &Point2::from(place));
        (self.limits[0]..=self.limits[1]).contains(&from_root)
    }

    /// The place in the middle of the range, straight ahead.
    pub(super) fn middle(&self) -> [f64; 2] {
        let ahead = f64::midpoint(self.limits[0], self.limits[1]);
        [
            self.root.x + ahead * libm::cos(self.heading),
            self.root.y + ahead * libm::sin(self.heading),
        ]
    }
}

/// Whether an object fits on a surface at yaw 0 or 90°.
pub(super) fn fits(surface: &Surface, model: &Arc<ObjectModel>) -> bool {
    let stance = standing(model);
    area(surface, &stance, 0.0).is_some()
        || area(surface, &stance, std::f64::consts::FRAC_PI_2).is_some()
}
