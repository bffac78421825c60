//! Angles of unit quaternions.

/// Heading: angle of the rotated x axis about the vertical. Unit: radians in (−π, π]. Shape: x, y,
/// z, w.
pub fn yaw_of([x, y, z, w]: [f64; 4]) -> f64 {
    libm::atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
}

/// Angle between the rotated z axis and the vertical. Unit: radians in [0, π]. Shape: x, y, z, w.
pub fn tilt_of([x, y, _, _]: [f64; 4]) -> f64 {
    libm::acos((1.0 - 2.0 * (x * x + y * y)).clamp(-1.0, 1.0))
}
