//! Creates snapshots of the true state.

use std::collections::BTreeSet;

use nalgebra::Point3;

use crate::World;
use crate::engine::Owner;
use crate::object::Object;
use actcheck_data::{BodyState, LinkState, Pose, RobotState, Snapshot};
use actcheck_geometry::from_vector;

/// Share of a body's weight that a contact must carry for the body to rest on it. Low enough for
/// several supports.
const CARRIED_SHARE: f64 = 0.1;

impl World {
    /// Returns the true state of the world.
    pub fn snapshot(&self) -> Snapshot {
        let pairs = self.pairs();
        let robot = self.robot_state(&pairs);
        let grasp = Point3::from(robot.gripper.position);
        let bodies = self.objects.iter().enumerate().map(|(idx, object)| {
            let grasp_distance_m = (!object.fixed).then(|| self.distance_to(object, &grasp));
            BodyState {
                grasp_distance_m,
                ..self.body(idx, object, &pairs)
            }
        });
        Snapshot {
            time_secs: self.time_secs(),
            bodies: bodies.collect(),
            robot,
        }
    }

    fn pairs(&self) -> Vec<ContactPair> {
        self.touches()
            .into_iter()
            .map(|((first, second), touch)| ContactPair {
                first,
                second,
                lift_on_second_n: touch.force_n.z,
            })
            .collect()
    }

    fn body(&self, idx: usize, object: &Object, pairs: &[ContactPair]) -> BodyState {
        let pose = self.pose_of(object);
        let mut touching = BTreeSet::new();
        let mut carriers = BTreeSet::new();
        let enough = CARRIED_SHARE * object.mass_kg * actcheck_robot::GRAVITY;
        for pair in pairs {
            let (other, lift) = match (pair.first, pair.second) {
                (other, Owner::Object(own)) if own == idx => (other, pair.lift_on_second_n),
                (Owner::Object(own), other) if own == idx => (other, -pair.lift_on_second_n),
                _ => continue,
            };
            let name = self.thing(other);
            if lift > enough {
                carriers.insert(name.clone());
            }
            touching.insert(name);
        }
        if let Some(attached) = object.attached.as_ref().filter(|_| !self.has_left(idx)) {
            carriers.insert(self.objects[attached.to].id.clone());
        }
        let (aabb_min, aabb_max) = self.aabb(object);
        let body = self.engine.bodies.get(object.body);
        let velocities = body.map(|body| {
            let linear = from_vector(body.velocity_at_point(body.translation()));
            (linear.into(), from_vector(body.angvel()).into())
        });
        let (linear_velocity, angular_velocity) = velocities.unwrap_or_default();
        BodyState {
            id: object.id.clone(),
            model: object.model.name.clone(),
            category: object.model.category.clone(),
            fixed: object.fixed,
            pose: Pose::from_isometry(&pose),
            linear_velocity,
            angular_velocity,
            aabb_min,
            aabb_max,
            mass_kg: object.mass_kg,
            friction: object.friction,
            restitution: object.restitution,
            touches: touching.into_iter().collect(),
            rests_on: carriers.into_iter().collect(),
            asleep: body.is_some_and(rapier3d::prelude::RigidBody::is_sleeping)
                || self.has_left(idx),
            size_m: object.model.size_m,
            grasp_distance_m: None,
            part: object.attached.as_ref().and_then(|attached| {
                Some((
                    self.objects[attached.whole].id.clone(),
                    self.part_position(object)?,
                ))
            }),
            left_world: self.has_left(idx),
        }
    }

    /// Returns the bounding box of an object's shapes. Unit: metres. Frame: world.
    pub(super) fn aabb(&self, object: &Object) -> ([f64; 3], [f64; 3]) {
        let mut low = [f64::INFINITY; 3];
        let mut high = [f64::NEG_INFINITY; 3];
        let colliders = self
            .engine
            .bodies
            .get(object.body)
            .map(rapier3d::prelude::RigidBody::colliders);
        for handle in colliders.unwrap_or_default() {
            let Some(collider) = self.engine.colliders.get(*handle) else {
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

    fn robot_state(&self, pairs: &[ContactPair]) -> RobotState {
        let joints = self.robot.joint_states();
        let positions: Vec<f64> = joints.iter().map(|joint| joint.position).collect();
        let touched_by = |finger: &[usize]| -> Vec<String> {
            let objects = pairs
                .iter()
                .filter_map(|pair| match (pair.first, pair.second) {
                    (Owner::Object(idx), Owner::Link(own)) if finger.contains(&own) => {
                        Some(self.thing(Owner::Object(idx)))
                    }
                    _ => None,
                });
            let sorted: BTreeSet<String> = objects.collect();
            sorted.into_iter().collect()
        };
        let base_true = self.base_true();
        let [left, right] = &self.robot.fingers;
        RobotState {
            base_true,
            base_believed: self.believed(base_true),
            gripper: Pose::from_isometry(&self.robot.kinematics.grasp(&positions)),
            gripper_opening_m: self.opening_m(&positions),
            left_touches: touched_by(left),
            right_touches: touched_by(right),
            joints,
            links: self.link_states(&positions),
            cup: self.cup_state(),
        }
    }

    fn link_states(&self, positions: &[f64]) -> Vec<LinkState> {
        let poses = self.robot.kinematics.links(positions);
        let links = self.robot.model.links.iter().zip(poses);
        links
            .map(|(link, pose)| LinkState {
                name: link.name.clone(),
                pose: Pose::from_isometry(&pose),
            })
            .collect()
    }

    /// Returns the name of an owner in snapshots; all links are `robot`.
    fn thing(&self, owner: Owner) -> String {
        match owner {
            Owner::Link(_) => "robot".to_owned(),
            other => self.name_of(other),
        }
    }
}

/// Two owners in contact, ordered: floor, objects, links.
struct ContactPair {
    first: Owner,
    second: Owner,
    /// Upward force of the first on the second. Unit: newtons.
    lift_on_second_n: f64,
}
