//! The robot's base frame, true and believed.

use actcheck_data::RobotState;

/// Returns a point of the world in the frame of a base. Unit: metres. Shape: ahead, to the left.
pub(super) fn from_base([x, y, heading]: [f64; 3], point: [f64; 2]) -> [f64; 2] {
    turned([point[0] - x, point[1] - y], -heading)
}

/// Returns a vector after a rotation. Unit: radians, counter-clockwise.
pub(super) fn turned([x, y]: [f64; 2], radians: f64) -> [f64; 2] {
    let (sin, cos) = libm::sincos(radians);
    [cos * x - sin * y, sin * x + cos * y]
}

/// Returns the errors of a believed base pose. Units: metres, radians.
pub(super) fn belief_error(robot: &RobotState) -> [f64; 2] {
    let ([x, y, heading], [bx, by, believed]) = (robot.base_true, robot.base_believed);
    let turn = libm::remainder(believed - heading, std::f64::consts::TAU);
    [libm::hypot(bx - x, by - y), turn.abs()]
}
