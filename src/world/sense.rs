//! Perception of objects: ground truth with noise, relative to the robot's pose estimate.
//!
//! Every random sample is a recorded choice, `sense.*`.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::bodies::Bodies;
use crate::drive::Drive;
use crate::object::Object;
use actcheck_data::{ChoiceName, Choices, Pose, SightingAxis};

/// Tilt beyond which an object counts as lying: it is then seen as its upright bounding box. Unit:
/// radians.
const LYING_RAD: f64 = 0.3;
/// Smallest perceived dimension, whatever the noise. Unit: metres.
const SMALLEST_M: f64 = 0.005;

/// One perceived object. Frame: world, by the base's believed pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Sighting {
    /// Id of the object.
    pub id: String,
    /// Upright pose, with the origin at its foot.
    pub pose: Pose,
    /// Dimensions along its own axes. Unit: metres.
    pub size_m: [f64; 3],
    /// Whether it is furniture, which is static and on the robot's map.
    pub furniture: bool,
    /// Whether the hand can take it only across its sides, because it is a box whose corners don't
    /// fit between the fingers.
    pub angular: bool,
}

/// Returns all objects with the true poses of their own frames, whose origins are at their
/// feet.
pub(super) fn truth(bodies: &Bodies) -> Vec<Sighting> {
    let objects = bodies.objects.iter().map(|object| Sighting {
        id: object.id.clone(),
        pose: Pose::from_isometry(&bodies.pose_of(object)),
        size_m: object.model.size_m,
        furniture: object.fixed,
        angular: false,
    });
    objects.collect()
}

/// Returns the furniture of the floor plan, without noise; it is off only by the error of the
/// robot's pose estimate. Static objects that are not on the map must be perceived.
pub(super) fn known_furniture(bodies: &Bodies) -> Vec<Sighting> {
    let on_map = bodies.objects.iter().filter(|object| object.on_map);
    let as_built = on_map.map(|object| {
        let (foot, size_m) = foot(bodies, object, &object.placed);
        Sighting {
            id: object.id.clone(),
            pose: Pose::from_isometry(&foot),
            size_m,
            furniture: true,
            angular: false,
        }
    });
    as_built.collect()
}

/// Perceives one object. Returns `None` if there is no such id.
pub(super) fn perceive(
    bodies: &Bodies,
    drive: &Drive,
    id: &str,
    choices: &mut Choices,
) -> Option<Sighting> {
    let idx = bodies.index_of(id)?;
    let object = &bodies.objects[idx];
    let (true_pose, true_size) = foot(bodies, object, &drive.shown(bodies, idx));
    let mut draw =
        |axis: SightingAxis, sigma: f64| choices.normal(ChoiceName::sighting(id, axis), sigma);
    let sensing = drive.sensing();
    let shift = Vector3::new(
        draw(SightingAxis::X, sensing.position_noise_m),
        draw(SightingAxis::Y, sensing.position_noise_m),
        draw(SightingAxis::Z, sensing.height_noise_m),
    );
    let turn = draw(SightingAxis::Yaw, sensing.yaw_noise_rad);
    let sides = [
        SightingAxis::Width,
        SightingAxis::Depth,
        SightingAxis::Height,
    ];
    let size_noise = sides.map(|side| draw(side, sensing.size_noise_m));
    let seen = Isometry3::from_parts(
        Translation3::from(true_pose.translation.vector + shift),
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn) * true_pose.rotation,
    );
    let mut size_m = true_size;
    for (size, noise) in size_m.iter_mut().zip(size_noise) {
        *size = (*size + noise).max(SMALLEST_M);
    }
    let pose = Pose::from_isometry(&drive.believed_pose(&seen));
    Some(Sighting {
        id: id.to_owned(),
        pose,
        size_m,
        furniture: object.on_map,
        angular: false,
    })
}

/// Returns the upright pose of an object's foot, and its size along the axes of that pose.
fn foot(bodies: &Bodies, object: &Object, pose: &Isometry3<f64>) -> (Isometry3<f64>, [f64; 3]) {
    let plain = Pose::from_isometry(pose);
    if plain.tilt() <= LYING_RAD {
        return (
            Pose::upright(plain.position, plain.yaw()).to_isometry(),
            object.model.size_m,
        );
    }
    let (low, high) = bodies.aabb(object);
    let middle = [(low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0, low[2]];
    (
        Pose::upright(middle, 0.0).to_isometry(),
        [high[0] - low[0], high[1] - low[1], high[2] - low[2]],
    )
}
