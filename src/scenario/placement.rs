//! Where on a surface an object may stand.

use std::sync::Arc;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::config::{ObjectModel, Surface};

/// Distance that every object keeps from the edge: what is nearer falls when it is brushed.
const EDGE_MARGIN_M: f64 = 0.01;
/// The target stands no further than this behind the edge that the robot faces. Arms of mobile manipulators reach about
/// 0.6 m beyond their base.
const REACH_M: f64 = 0.6;
/// The target stands no further than this to the side: beyond, the robot would have to start somewhere else.
const SIDE_M: f64 = 0.35;

/// A rectangle for the origin of an object. Frame: world, with the surface's middle at the origin. Unit: metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Area {
    pub(super) x: (f64, f64),
    pub(super) y: (f64, f64),
}

/// How an object is set down.
pub(super) struct Stance {
    /// Extent on the surface, not turned. Unit: metres. Shape: x, y.
    size_m: [f64; 2],
    /// Pose of the model's origin. Frame: its foot, on the surface below its middle.
    pub(super) foot_from_model: Isometry3<f64>,
}

/// Upright, as its model is.
pub(super) fn standing(model: &ObjectModel) -> Stance {
    Stance { size_m: [model.size_m[0], model.size_m[1]], foot_from_model: Isometry3::identity() }
}

/// On its side: what points up upright points along y.
pub(super) fn lying(model: &ObjectModel) -> Stance {
    let [length, width, height] = model.size_m;
    // A quarter turn about x brings z to −y and y to z.
    let turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::FRAC_PI_2);
    let shift = Translation3::new(0.0, height / 2.0, width / 2.0);
    Stance { size_m: [length, height], foot_from_model: Isometry3::from_parts(shift, turn) }
}

/// Where an object turned by `yaw` can be wholly on a surface; nothing where it can't.
pub(super) fn area(surface: &Surface, stance: &Stance, yaw: f64) -> Option<Area> {
    let [length, width] = stance.size_m;
    let (sin, cos) = (libm::sin(yaw).abs(), libm::cos(yaw).abs());
    let [half_x, half_y] = [length * cos + width * sin, length * sin + width * cos].map(|extent| extent / 2.0);
    let room = |extent: f64, half: f64| Some(extent / 2.0 - EDGE_MARGIN_M - half).filter(|room| *room >= 0.0);
    let (x, y) = (room(surface.size_m[0], half_x)?, room(surface.size_m[1], half_y)?);
    Some(Area { x: (-x, x), y: (-y, y) })
}

/// The part of an area that the robot, which stands on the negative x side, can be asked to reach into.
pub(super) fn reachable(area: Area, surface: &Surface) -> Area {
    let farthest = -surface.size_m[0] / 2.0 + REACH_M;
    let nearest = area.x.0;
    Area { x: (nearest, area.x.1.min(farthest).max(nearest)), y: (area.y.0.max(-SIDE_M), area.y.1.min(SIDE_M)) }
}

/// Whether an object fits on a surface at all, along the edges or across.
pub(super) fn fits(surface: &Surface, model: &Arc<ObjectModel>) -> bool {
    let stance = standing(model);
    area(surface, &stance, 0.0).is_some() || area(surface, &stance, std::f64::consts::FRAC_PI_2).is_some()
}
