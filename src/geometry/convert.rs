//! Conversions between the types of nalgebra, in 64 bits, and those of the library of shapes and of the engine, in 32 bits.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use parry3d::math::{Pose as EnginePose, Rotation as EngineRotation, Vector as EngineVector};

/// Converts a vector for the engine, which computes in 32 bits.
#[expect(
    clippy::cast_possible_truncation,
    reason = "the engine computes in 32 bits"
)]
pub fn to_vector(v: &Vector3<f64>) -> EngineVector {
    EngineVector::new(v.x as f32, v.y as f32, v.z as f32)
}

/// Converts a vector from the engine.
pub fn from_vector(v: EngineVector) -> Vector3<f64> {
    Vector3::new(f64::from(v.x), f64::from(v.y), f64::from(v.z))
}

/// Converts a pose for the engine.
#[expect(
    clippy::cast_possible_truncation,
    reason = "the engine computes in 32 bits"
)]
pub fn to_pose(pose: &Isometry3<f64>) -> EnginePose {
    let q = pose.rotation.quaternion();
    let rotation =
        EngineRotation::from_xyzw(q.i as f32, q.j as f32, q.k as f32, q.w as f32).normalize();
    EnginePose::from_parts(to_vector(&pose.translation.vector), rotation)
}

/// Converts a pose from the engine.
pub fn from_pose(pose: &EnginePose) -> Isometry3<f64> {
    let [x, y, z, w] = pose.rotation.to_array().map(f64::from);
    Isometry3::from_parts(
        Translation3::from(from_vector(pose.translation)),
        UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)),
    )
}

/// Converts a number for the engine.
#[expect(
    clippy::cast_possible_truncation,
    reason = "the engine computes in 32 bits"
)]
pub fn to_real(value: f64) -> f32 {
    value as f32
}
