//! Pictures as evidence of what stands on the floor.

use nalgebra::Point3;

use crate::actions::navigate::grid::{Evidence, Grid};
use crate::actions::operator::Operator;
use crate::actions::route::length;
use crate::world::OwnBody;

/// What is lower is floor. Unit: metres. Range noise at 3 m, seen at a slant, four times. Lower things are run over.
const FLOOR_M: f64 = 0.05;
/// Room above the robot. Unit: metres.
const HEAD_ROOM_M: f64 = 0.05;
/// What is farther is looked at again when it is nearer. Unit: metres.
const FAR_M: f64 = 3.5;
/// What is nearer to the robot's own shapes is itself. Unit: metres. Calibration and noise.
const OWN_M: f64 = 0.03;
/// Of the pixels of a picture every so many in a row and in a column count: cells are larger than their gaps.
const STRIDE: usize = 2;

/// Size of the robot as it is at the moment.
#[derive(Debug, Clone, Copy)]
pub struct Size {
    /// Of the circle around the base's middle that holds everything. Unit: metres.
    pub radius_m: f64,
    /// Unit: metres.
    pub height_m: f64,
}

impl Size {
    /// The size of the robot as it was last told to be, with what it holds.
    pub fn of(robot: &Operator<'_>) -> Self {
        let kinematics = robot.kinematics();
        let links = kinematics.links(robot.commanded());
        let base = robot.base_of(robot.commanded()).translation.vector;
        let mut size = Self { radius_m: 0.0, height_m: 0.0 };
        for (link, point) in kinematics.surface_points(OWN_M) {
            let point = links[link] * point;
            size.radius_m = size.radius_m.max(length(point.x - base.x, point.y - base.y));
            size.height_m = size.height_m.max(point.z);
        }
        if let Some(held) = &robot.memory().held {
            let hand = kinematics.grasp(robot.commanded()).translation.vector;
            let [width, depth, height] = held.size_m;
            size.radius_m = size.radius_m.max(length(hand.x - base.x, hand.y - base.y) + length(width, depth) / 2.0);
            size.height_m = size.height_m.max(hand.z + height);
        }
        size
    }
}

/// Takes a picture and notes what it shows of the floor.
pub fn look(robot: &mut Operator<'_>, size: Size, grid: &mut Grid) {
    let positions = robot.observe().positions;
    let camera = robot.kinematics().camera(&positions);
    let own = OwnBody::new(robot.kinematics(), &positions);
    let base = robot.base_of(&positions).translation.vector;
    let image = robot.look();
    let mut evidence = Evidence::default();
    for row in (0..image.height).step_by(STRIDE) {
        for column in (0..image.width).step_by(STRIDE) {
            let Some(seen) = image.point(column, row) else { continue };
            let point: Point3<f64> = camera * seen;
            let away = length(point.x - base.x, point.y - base.y);
            // What is within its own circle it would stand in already: that is what it carries.
            if away > FAR_M || away < size.radius_m || point.z > size.height_m + HEAD_ROOM_M {
                continue;
            }
            let Some(cell) = grid.cell([point.x, point.y]) else { continue };
            if point.z < FLOOR_M {
                evidence.add_floor(cell);
            } else if !own.is_near(&point, OWN_M) {
                evidence.add_thing(cell, point.z);
            }
        }
    }
    grid.learn(&evidence);
}
