//! Poses as plain data, and the conversions that more than one stage needs.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use actcheck_base::{tilt_of, yaw_of};

/// Position and orientation of a body. Frame: world, unless the field's name states another.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Unit: metres. Shape: x, y, z; z is up.
    pub position: [f64; 3],
    /// Unit quaternion. Shape: x, y, z, w.
    pub rotation: [f64; 4],
}

impl Pose {
    /// The origin without rotation.
    pub const IDENTITY: Self = Self {
        position: [0.0; 3],
        rotation: [0.0, 0.0, 0.0, 1.0],
    };

    /// Returns an upright pose. Units: metres, radians about the vertical.
    pub fn upright(position: [f64; 3], yaw: f64) -> Self {
        let (sin, cos) = (libm::sin(yaw / 2.0), libm::cos(yaw / 2.0));
        Self {
            position,
            rotation: [0.0, 0.0, sin, cos],
        }
    }

    /// Returns the heading: the angle of the pose's x axis about the vertical. Unit: radians in
    /// (−π, π].
    pub fn yaw(&self) -> f64 {
        yaw_of(self.rotation)
    }

    /// Returns the angle between the pose's z axis and the vertical. Unit: radians in [0, π].
    pub fn tilt(&self) -> f64 {
        tilt_of(self.rotation)
    }

    /// Converts the pose to a nalgebra transform.
    pub fn to_isometry(&self) -> Isometry3<f64> {
        let [x, y, z, w] = self.rotation;
        Isometry3::from_parts(
            Translation3::from(Vector3::from(self.position)),
            UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)),
        )
    }

    /// Converts a nalgebra transform to a pose.
    pub fn from_isometry(isometry: &Isometry3<f64>) -> Self {
        let q = isometry.rotation.quaternion();
        Self {
            position: isometry.translation.vector.into(),
            rotation: [q.i, q.j, q.k, q.w],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn yaw_and_tilt_are_recovered() {
        let pose = Pose::upright([1.0, 2.0, 3.0], 0.7);
        assert!((pose.yaw() - 0.7).abs() < 1e-12);
        assert!(pose.tilt() < 1e-7);
        assert_eq!(
            Pose::from_isometry(&pose.to_isometry()).position,
            pose.position
        );
        let lying = Pose {
            position: [0.0; 3],
            rotation: [(0.5f64).sqrt(), 0.0, 0.0, (0.5f64).sqrt()],
        };
        assert!((lying.tilt() - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
    }
}
