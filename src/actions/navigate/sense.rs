//! Turns pictures into evidence about obstacles on the floor.

use nalgebra::Point3;

use crate::navigate::grid::{Evidence, Grid};
use crate::operator::Operator;
use crate::route::length;
use actcheck_world::RobotBody;

/// Points below this are floor. Unit: metres. Four times the range noise at 3 m, seen at a slant.
/// The robot drives over lower objects.
const FLOOR_M: f64 = 0.05;
/// Clearance above the robot. Unit: metres.
const HEAD_ROOM_M: f64 = 0.05;
/// Points farther away are ignored until they are nearer. Unit: metres.
const FAR_M: f64 = 3.5;
/// Points closer to the robot's own shapes belong to the robot. Unit: metres. Allows for
/// calibration error and noise.
const OWN_M: f64 = 0.03;
/// Only every n-th pixel of every n-th row is used: cells are larger than the gaps.
const STRIDE: usize = 2;

/// The robot's current size.
#[derive(Debug, Clone, Copy)]
pub struct Size {
    /// Radius of the circle around the base's centre that contains the whole robot. Unit: metres.
    pub radius_m: f64,
    /// Unit: metres.
    pub height_m: f64,
}

impl Size {
    /// The size of the robot in its last commanded posture, including the held object.
    pub fn of(robot: &Operator<'_>) -> Self {
        Self::at(
            robot,
            robot.commanded(),
            &robot.kinematics().surface_points(OWN_M),
        )
    }

    /// The size of the robot in a posture, including the held object. `points` are on the surfaces
    /// of its links.
    pub fn at(robot: &Operator<'_>, posture: &[f64], points: &[(usize, Point3<f64>)]) -> Self {
        let kinematics = robot.kinematics();
        let links = kinematics.links(posture);
        let base = robot.base_of(posture).translation.vector;
        let mut size = Self {
            radius_m: 0.0,
            height_m: 0.0,
        };
        for (link, point) in points {
            let point = links[*link] * point;
            size.radius_m = size
                .radius_m
                .max(length(point.x - base.x, point.y - base.y));
            size.height_m = size.height_m.max(point.z);
        }
        if let Some(held) = &robot.memory().held {
            let hand = kinematics.grasp(posture).translation.vector;
            let [width, depth, height] = held.size_m;
            size.radius_m = size
                .radius_m
                .max(length(hand.x - base.x, hand.y - base.y) + length(width, depth) / 2.0);
            size.height_m = size.height_m.max(hand.z + height);
        }
        size
    }
}

/// Takes a picture and adds its evidence about the floor.
pub fn look(robot: &mut Operator<'_>, size: Size, grid: &mut Grid) {
    let positions = robot.observe().positions;
    let camera = robot.kinematics().camera(&positions);
    let own = RobotBody::new(robot.kinematics(), &positions);
    let base = robot.base_of(&positions).translation.vector;
    let image = robot.look_at_every(STRIDE);
    let mut evidence = Evidence::default();
    for row in (0..image.height).step_by(STRIDE) {
        for column in (0..image.width).step_by(STRIDE) {
            let Some(seen) = image.point(column, row) else {
                continue;
            };
            let point: Point3<f64> = camera * seen;
            let away = length(point.x - base.x, point.y - base.y);
            // Points within the robot's own circle belong to its load: any obstacle there would
            // already be in collision.
            if away > FAR_M || away < size.radius_m || point.z > size.height_m + HEAD_ROOM_M {
                continue;
            }
            let Some(cell) = grid.cell([point.x, point.y]) else {
                continue;
            };
            if point.z < FLOOR_M {
                evidence.add_floor(cell);
            } else if !own.is_near(&point, OWN_M) {
                evidence.add_thing(cell, point.z);
            }
        }
    }
    grid.learn(&evidence);
}
