//! Perception of objects: ground truth with noise, relative to the robot's pose estimate.
//!
//! Every random sample is a recorded choice, `sense.*`.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::World;
use crate::object::Object;
use actcheck_data::{ChoiceName, Choices, PlanarAxis, Pose, SightingAxis};

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

impl World {
    /// Samples the base's initial pose estimate. Its error stays constant while the base moves,
    /// unless the odometry drifts.
    pub fn localise(&mut self, choices: &mut Choices) {
        let mut draw =
            |axis: PlanarAxis, sigma: f64| choices.normal(ChoiceName::Localisation(axis), sigma);
        let x = draw(PlanarAxis::X, self.sensing.localisation_noise_m);
        let y = draw(PlanarAxis::Y, self.sensing.localisation_noise_m);
        let turn = draw(PlanarAxis::Heading, self.sensing.heading_noise_rad);
        let [base_x, base_y, heading] = self.base_true();
        let truth = Pose::upright([base_x, base_y, 0.0], heading).to_isometry();
        let believed = Pose::upright([base_x + x, base_y + y, 0.0], heading + turn).to_isometry();
        self.believed_from_true = believed * truth.inverse();
        self.begin_tracking();
    }

    /// Returns all objects with the true poses of their own frames, whose origins are at their
    /// feet.
    pub fn truth(&self) -> Vec<Sighting> {
        let objects = self.objects.iter().map(|object| Sighting {
            id: object.id.clone(),
            pose: Pose::from_isometry(&self.pose_of(object)),
            size_m: object.model.size_m,
            furniture: object.fixed,
            angular: false,
        });
        objects.collect()
    }

    /// Returns the ids of all objects, in scene order.
    pub fn visible(&self) -> Vec<String> {
        self.objects
            .iter()
            .map(|object| object.id.clone())
            .collect()
    }

    /// Returns the furniture of the floor plan, without noise; it is off only by the error of the
    /// robot's pose estimate. Static objects that are not on the map must be perceived.
    pub fn known_furniture(&self) -> Vec<Sighting> {
        let on_map = self.objects.iter().filter(|object| object.on_map);
        let as_built = on_map.map(|object| {
            let (foot, size_m) = self.foot(object, &object.placed);
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

    /// Returns [`World::known_furniture`], or `None` if the scene's world has no map.
    pub fn map_of_furniture(&self) -> Option<Vec<Sighting>> {
        self.has_map.then(|| self.known_furniture())
    }

    /// Perceives one object. Returns `None` if there is no such id.
    pub fn perceive(&self, id: &str, choices: &mut Choices) -> Option<Sighting> {
        let idx = self.objects.iter().position(|object| object.id == id)?;
        let object = &self.objects[idx];
        let (true_pose, true_size) = self.foot(object, &self.shown(idx));
        let mut draw =
            |axis: SightingAxis, sigma: f64| choices.normal(ChoiceName::sighting(id, axis), sigma);
        let sensing = &self.sensing;
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
        let pose = Pose::from_isometry(&(self.believed_from_true * seen));
        Some(Sighting {
            id: id.to_owned(),
            pose,
            size_m,
            furniture: object.on_map,
            angular: false,
        })
    }

    /// Returns the gap between the fingers, measured with noise. Unit: metres.
    pub fn feel_opening(&self, choices: &mut Choices) -> f64 {
        self.observe().gripper_opening_m
            + choices.normal(ChoiceName::Gripper, self.sensing.gripper_noise_m)
    }

    /// Returns the upright pose of an object's foot, and its size along the axes of that pose.
    fn foot(&self, object: &Object, pose: &Isometry3<f64>) -> (Isometry3<f64>, [f64; 3]) {
        let plain = Pose::from_isometry(pose);
        if plain.tilt() <= LYING_RAD {
            return (
                Pose::upright(plain.position, plain.yaw()).to_isometry(),
                object.model.size_m,
            );
        }
        let (low, high) = self.aabb(object);
        let middle = [(low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0, low[2]];
        (
            Pose::upright(middle, 0.0).to_isometry(),
            [high[0] - low[0], high[1] - low[1], high[2] - low[2]],
        )
    }
}
