//! What the robot sees: truth with noise, through its own idea of where it stands.
//!
//! Every draw is a recorded choice named `sense.*`.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::base::{Choices, Pose};
use crate::world::World;
use crate::world::simulation::Object;

/// Tilt beyond which an object counts as lying: it is then seen as the upright box around it. Unit: radians.
const LYING_RAD: f64 = 0.3;
/// No object is seen smaller than this, whatever the noise. Unit: metres.
const SMALLEST_M: f64 = 0.005;

/// One object as it is seen. Frame: world, by the base's belief.
#[derive(Debug, Clone, PartialEq)]
pub struct Sighting {
    /// Id of the object.
    pub id: String,
    /// Pose of its foot.
    pub pose: Pose,
    /// Dimensions along its own axes. Unit: metres.
    pub size_m: [f64; 3],
    /// Whether it is furniture, which the robot knows from its map to stand still.
    pub furniture: bool,
}

impl World {
    /// Draws where the base believes that it stands. The error stays as it is while the base moves, unless its odometry
    /// drifts.
    pub fn localise(&mut self, choices: &mut Choices) {
        let x = choices.normal("sense.localisation.x", self.sensing.localisation_noise_m);
        let y = choices.normal("sense.localisation.y", self.sensing.localisation_noise_m);
        let turn = choices.normal("sense.localisation.heading", self.sensing.heading_noise_rad);
        let [base_x, base_y, heading] = self.base_true();
        let truth = Pose::upright([base_x, base_y, 0.0], heading).to_isometry();
        let believed = Pose::upright([base_x + x, base_y + y, 0.0], heading + turn).to_isometry();
        self.believed_from_true = believed * truth.inverse();
        self.begin_tracking();
    }

    /// Where everything truly is: poses of the objects' own frames, which stand on their feet.
    pub fn truth(&self) -> Vec<Sighting> {
        let objects = self.objects.iter().map(|object| Sighting {
            id: object.id.clone(),
            pose: Pose::from_isometry(&self.pose_of(object)),
            size_m: object.model.size_m,
            furniture: object.fixed,
        });
        objects.collect()
    }

    /// Ids of everything that can be seen, in scene order.
    pub fn visible(&self) -> Vec<String> {
        self.objects.iter().map(|object| object.id.clone()).collect()
    }

    /// Everything that the floor plan has: without noise, and off by as much as the robot is wrong about where it stands itself.
    /// What stands for good and is on no map is for the robot's eyes.
    pub fn known_furniture(&self) -> Vec<Sighting> {
        let on_map = self.objects.iter().filter(|object| object.on_map);
        let as_built = on_map.map(|object| {
            let (foot, size_m) = self.foot(object, &object.placed);
            Sighting { id: object.id.clone(), pose: Pose::from_isometry(&foot), size_m, furniture: true }
        });
        as_built.collect()
    }

    /// The same, where the scene lies in a world that has a map. Nothing without one.
    pub fn map_of_furniture(&self) -> Option<Vec<Sighting>> {
        self.has_map.then(|| self.known_furniture())
    }

    /// Looks at one object; nothing if there is none of that id.
    pub fn perceive(&self, id: &str, choices: &mut Choices) -> Option<Sighting> {
        let idx = self.objects.iter().position(|object| object.id == id)?;
        let object = &self.objects[idx];
        let (true_pose, true_size) = self.foot(object, &self.shown(idx));
        let mut draw = |what: &str, sigma: f64| choices.normal(&format!("sense.{id}.{what}"), sigma);
        let sensing = &self.sensing;
        let shift = Vector3::new(
            draw("x", sensing.position_noise_m),
            draw("y", sensing.position_noise_m),
            draw("z", sensing.height_noise_m),
        );
        let turn = draw("yaw", sensing.yaw_noise_rad);
        let size_noise = ["width", "depth", "height"].map(|side| draw(side, sensing.size_noise_m));
        let seen = Isometry3::from_parts(
            Translation3::from(true_pose.translation.vector + shift),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn) * true_pose.rotation,
        );
        let mut size_m = true_size;
        for (size, noise) in size_m.iter_mut().zip(size_noise) {
            *size = (*size + noise).max(SMALLEST_M);
        }
        let pose = Pose::from_isometry(&(self.believed_from_true * seen));
        Some(Sighting { id: id.to_owned(), pose, size_m, furniture: object.on_map })
    }

    /// Gap between the fingers as a noisy sensor gives it. Unit: metres.
    pub fn feel_opening(&self, choices: &mut Choices) -> f64 {
        self.observe().gripper_opening_m + choices.normal("sense.gripper", self.sensing.gripper_noise_m)
    }

    /// Upright pose of an object's foot and its size along the axes of that pose.
    fn foot(&self, object: &Object, pose: &Isometry3<f64>) -> (Isometry3<f64>, [f64; 3]) {
        let plain = Pose::from_isometry(pose);
        if plain.tilt() <= LYING_RAD {
            return (Pose::upright(plain.position, plain.yaw()).to_isometry(), object.model.size_m);
        }
        let (low, high) = self.aabb(object);
        let middle = [(low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0, low[2]];
        (Pose::upright(middle, 0.0).to_isometry(), [high[0] - low[0], high[1] - low[1], high[2] - low[2]])
    }
}
