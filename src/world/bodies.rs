//! The bodies of a simulation: those of the objects, of the robot and of the floor in the physics
//! engine, and their clock. Every part of the world reads them; only the engine steps them.
//!
//! Never: knows a part of the world, or a mechanism that moves bodies.

use std::collections::BTreeSet;

use nalgebra::{Isometry3, Vector3};
use parry3d::bounding_volume::Aabb;
use rapier3d::prelude::{Collider, PhysicsWorld, RigidBody, RigidBodyHandle};

use crate::object::Object;
use crate::physics::{Owner, SHELL};
use crate::robot::SimulatedRobot;
use actcheck_data::Pose;
use actcheck_geometry::{from_pose, from_vector};

/// The bodies of a simulation, and its clock.
pub(super) struct Bodies {
    pub(super) physics: PhysicsWorld,
    pub(super) objects: Vec<Object>,
    pub(super) robot: SimulatedRobot,
    /// A fixed body for the joints of objects to the floor.
    pub(super) floor: RigidBodyHandle,
    /// The objects that have left the world, by their index.
    pub(super) left: BTreeSet<usize>,
    pub(super) clock: Clock,
}

/// Counts the steps of a simulation.
#[derive(Debug, Clone, Copy)]
pub(super) struct Clock {
    pub(super) n_steps: u64,
    pub(super) steps_per_tick: u32,
    pub(super) steps_per_second: u32,
}

impl Clock {
    /// Returns the length of a control tick. Unit: seconds.
    pub(super) fn tick_secs(&self) -> f64 {
        f64::from(self.steps_per_tick) / f64::from(self.steps_per_second)
    }
}

impl Bodies {
    /// Returns the simulated time since the scene was built. Unit: seconds.
    pub(super) fn time_secs(&self) -> f64 {
        self.clock.n_steps as f64 / f64::from(self.clock.steps_per_second)
    }

    /// Returns the length of a control tick. Unit: seconds.
    pub(super) fn tick_secs(&self) -> f64 {
        self.clock.tick_secs()
    }

    /// Returns the index of the object with this id, or `None` if there is none.
    pub(super) fn index_of(&self, id: &str) -> Option<usize> {
        self.objects.iter().position(|object| object.id == id)
    }

    /// Returns the name of an owner in contacts.
    pub(super) fn name_of(&self, owner: Owner) -> String {
        match owner {
            Owner::Floor => "floor".to_owned(),
            Owner::Object(idx) => self
                .objects
                .get(idx)
                .map_or_else(String::new, |object| object.id.clone()),
            Owner::Link(idx) => {
                let link = self
                    .robot
                    .model
                    .links
                    .get(idx)
                    .map_or("", |link| link.name.as_str());
                format!("robot/{link}")
            }
        }
    }

    /// Returns the true pose of an object.
    pub(super) fn pose_of(&self, object: &Object) -> Isometry3<f64> {
        self.physics
            .bodies
            .get(object.body)
            .map_or(object.placed, |body| from_pose(body.position()))
    }

    /// Returns the pose of a link in the frame of another one.
    pub(super) fn pose_between(&self, first: usize, second: usize) -> Option<Isometry3<f64>> {
        let pose = |link: usize| {
            self.physics
                .bodies
                .get(self.robot.bodies[link])
                .map(|body| from_pose(body.position()))
        };
        Some(pose(first)?.inverse() * pose(second)?)
    }

    /// Returns the true base pose: x, y, heading.
    pub(super) fn base_true(&self) -> [f64; 3] {
        match self.robot.layout.base {
            Some(base) => {
                let positions = self.robot.state().0;
                base.map(|idx| positions[idx])
            }
            None => {
                let pose = Pose::from_isometry(&self.robot.kinematics.links(&[])[0]);
                [pose.position[0], pose.position[1], pose.yaw()]
            }
        }
    }

    /// Returns the largest speed of an object's points. Unit: m/s.
    pub(super) fn speed_of(&self, object: &Object) -> Option<f64> {
        let body = self.physics.bodies.get(object.body)?;
        let size = Vector3::from(object.model.size_m).norm();
        Some(from_vector(body.linvel()).norm() + from_vector(body.angvel()).norm() * size)
    }

    /// Returns whether an object is fixed or asleep.
    pub(super) fn rests(&self, object: &Object) -> bool {
        self.physics
            .bodies
            .get(object.body)
            .is_none_or(|body| body.is_fixed() || body.is_sleeping())
    }

    /// Returns whether an object is fixed now: furniture is, unless it slides.
    pub(super) fn is_fixed(&self, object: &Object) -> bool {
        self.physics
            .bodies
            .get(object.body)
            .is_none_or(RigidBody::is_fixed)
    }

    /// Returns whether an object has left the world.
    pub(super) fn has_left(&self, object: usize) -> bool {
        self.left.contains(&object)
    }

    /// Returns the colliders of a body, without shells.
    pub(super) fn colliders_of(&self, body: RigidBodyHandle) -> impl Iterator<Item = &Collider> {
        let handles = self
            .physics
            .bodies
            .get(body)
            .map(RigidBody::colliders)
            .unwrap_or_default();
        let colliders = handles
            .iter()
            .filter_map(|handle| self.physics.colliders.get(*handle));
        colliders.filter(|collider| collider.user_data & SHELL == 0)
    }

    /// Returns the colliders of a body with their boxes.
    pub(super) fn boxed(&self, body: RigidBodyHandle) -> impl Iterator<Item = (&Collider, Aabb)> {
        self.colliders_of(body)
            .map(|collider| (collider, collider.compute_aabb()))
    }

    /// Returns the bounding box of an object's shapes. Unit: metres. Frame: world.
    pub(super) fn aabb(&self, object: &Object) -> ([f64; 3], [f64; 3]) {
        let mut low = [f64::INFINITY; 3];
        let mut high = [f64::NEG_INFINITY; 3];
        let colliders = self
            .physics
            .bodies
            .get(object.body)
            .map(RigidBody::colliders);
        for handle in colliders.unwrap_or_default() {
            let Some(collider) = self.physics.colliders.get(*handle) else {
                continue;
            };
            let aabb = collider.compute_aabb();
            let (mins, maxs) = (aabb.mins.to_array(), aabb.maxs.to_array());
            for axis in 0..3 {
                low[axis] = low[axis].min(f64::from(mins[axis]));
                high[axis] = high[axis].max(f64::from(maxs[axis]));
            }
        }
        (low, high)
    }

    /// Returns how far a part is off the axis of its joint. Returns `None` if it is not a part.
    /// Unit: metres.
    pub(super) fn off_its_joint_m(&self, object: &Object) -> Option<f64> {
        let attachment = object.attached.as_ref()?;
        let carrier = self.pose_of(&self.objects[attachment.to]);
        Some(attachment.off_axis_m(&carrier, &self.pose_of(object)))
    }

    /// Returns the position of the joint of an object that is a part of another one. Units: metres
    /// or radians.
    pub(super) fn part_position(&self, object: &Object) -> Option<f64> {
        let attachment = object.attached.as_ref()?;
        let carrier = self.pose_of(&self.objects[attachment.to]);
        Some(attachment.position(&carrier, &self.pose_of(object)))
    }
}
