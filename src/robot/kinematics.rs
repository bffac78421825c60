//! Forward kinematics, the grasp Jacobian and gravity compensation.

use std::collections::BTreeSet;
use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3, Vector6};

use crate::Gripper;
use crate::description::{Joint, JointKind, Link, RobotModel};
use crate::inertia::Dynamics;
use actcheck_data::{Part, Shape};
use actcheck_geometry::BodySolids;

/// Gravitational acceleration. Unit: m/s².
pub const GRAVITY: f64 = 9.81;

/// Least cosine between a vertical axis and the vertical.
const VERTICAL: f64 = 0.999;

/// Place of a camera.
#[derive(Debug, Clone, Copy)]
pub enum Mount {
    /// On a merged link, with the pose in its frame.
    Link(usize, Isometry3<f64>),
    /// Beside the robot, with the pose in the world.
    World(Isometry3<f64>),
}

/// A robot's geometry for skills, without physics or ground truth.
#[derive(Debug, Clone)]
pub struct Kinematics {
    model: Arc<RobotModel>,
    /// Pose of the root. Frame: world.
    root: Isometry3<f64>,
    grasp: (usize, Isometry3<f64>),
    /// The joints between the root and the grasp link, in this order.
    path: Vec<usize>,
    camera: Mount,
    /// Pairs of links that pass through each other, with the smaller index first.
    passing: BTreeSet<(usize, usize)>,
    /// Links of the hand: only its own joints move them against each other.
    hand: BTreeSet<usize>,
    /// Joints that carry the hand and mimic others, as those of a telescope: the joint, its leader,
    /// factor and offset.
    followers: Vec<(usize, usize, f64, f64)>,
}

impl Kinematics {
    /// Creates the geometry of a robot with its root at `root`. `grasp` is the merged link and the
    /// pose in its frame.
    pub(crate) fn new(
        model: Arc<RobotModel>,
        root: Isometry3<f64>,
        grasp: (usize, Isometry3<f64>),
        camera: Mount,
    ) -> Self {
        let path = path_to(&model, grasp.0);
        let (passing, hand, followers) = (BTreeSet::new(), BTreeSet::new(), Vec::new());
        Self {
            model,
            root,
            grasp,
            path,
            camera,
            passing,
            hand,
            followers,
        }
    }

    /// The same geometry with joints that follow others, if they carry the hand.
    pub(crate) fn with_followers(self, gripper: &Gripper) -> Self {
        let joints = &self.model.joints;
        let parent = |joint: &usize| joints[*joint].parent.checked_sub(1);
        let path = std::iter::successors(self.grasp.0.checked_sub(1), parent)
            .filter(|idx| !gripper.contains(*idx));
        let followers = path.filter_map(|idx| {
            joints[idx]
                .mimic
                .map(|(leader, factor, offset)| (idx, leader, factor, offset))
        });
        let followers = followers.collect();
        Self { followers, ..self }
    }

    /// Sets joints that carry the hand and follow others to the positions of these.
    pub fn follow(&self, positions: &mut [f64]) {
        for (joint, leader, factor, offset) in &self.followers {
            if let Some(at) = positions.get(*leader).map(|at| factor * at + offset)
                && let Some(position) = positions.get_mut(*joint)
            {
                *position = at;
            }
        }
    }

    /// Returns the joints that carry the hand and follow a joint, with their factors.
    pub fn followers_of(&self, joint: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let of = move |follower: &&(usize, usize, f64, f64)| follower.1 == joint;
        self.followers
            .iter()
            .filter(of)
            .map(|(follower, _, factor, _)| (*follower, *factor))
    }

    /// The same geometry with pairs of links that pass through each other, and the links of the
    /// hand.
    pub(crate) fn with_passing(
        self,
        passing: BTreeSet<(usize, usize)>,
        hand: BTreeSet<usize>,
    ) -> Self {
        Self {
            passing,
            hand,
            ..self
        }
    }

    /// Returns whether two links belong to the hand: an arm that moves does not bring them
    /// together.
    pub fn are_of_hand(&self, first: usize, second: usize) -> bool {
        self.hand.contains(&first) && self.hand.contains(&second)
    }

    /// Returns whether two links pass through each other.
    pub fn pass(&self, first: usize, second: usize) -> bool {
        self.passing
            .contains(&(first.min(second), first.max(second)))
    }

    /// Returns the pose of the root. Frame: world.
    pub fn root(&self) -> &Isometry3<f64> {
        &self.root
    }

    /// The joints, in the order of positions.
    pub fn joints(&self) -> &[Joint] {
        &self.model.joints
    }

    /// Returns the URDF name of a link, by its index in [`Kinematics::links`].
    pub fn link_name(&self, link: usize) -> &str {
        self.model
            .links
            .get(link)
            .map_or("", |link| link.name.as_str())
    }

    /// Samples points on the robot's collision shapes, at most about `spacing` apart. Returns each
    /// with the index of its link, in the link's frame. Unit: metres.
    pub fn surface_points(&self, spacing: f64) -> Vec<(usize, Point3<f64>)> {
        let links = self.model.links.iter().enumerate();
        links
            .flat_map(|(idx, link)| {
                link.points(spacing)
                    .iter()
                    .map(|point| (idx, *point))
                    .collect::<Vec<_>>()
            })
            .collect()
    }

    /// Returns the poses of all links. Shape: one more than `positions`.
    pub fn links(&self, positions: &[f64]) -> Vec<Isometry3<f64>> {
        let mut poses = Vec::with_capacity(self.model.links.len());
        poses.push(self.root);
        for (joint, position) in self.model.joints.iter().zip(positions) {
            poses.push(poses[joint.parent] * joint.origin * motion(joint, *position));
        }
        poses
    }

    /// Returns the pose of one link.
    fn link(&self, link: usize, positions: &[f64]) -> Isometry3<f64> {
        self.along(&path_to(&self.model, link), positions)
    }

    /// Returns the pose of the link at the end of a path.
    fn along(&self, path: &[usize], positions: &[f64]) -> Isometry3<f64> {
        path.iter().fold(self.root, |parent, idx| {
            self.moved(&parent, *idx, positions)
        })
    }

    /// The pose of the link that a joint moves, from that of its parent.
    fn moved(&self, parent: &Isometry3<f64>, idx: usize, positions: &[f64]) -> Isometry3<f64> {
        let joint = &self.model.joints[idx];
        parent * joint.origin * motion(joint, positions[idx])
    }

    /// Returns the pose of the grasp link.
    pub fn grasp(&self, positions: &[f64]) -> Isometry3<f64> {
        self.along(&self.path, positions) * self.grasp.1
    }

    /// Returns the pose of the camera: x forwards, z up in the image.
    pub fn camera(&self, positions: &[f64]) -> Isometry3<f64> {
        match self.camera {
            Mount::Link(link, pose) => self.link(link, positions) * pose,
            Mount::World(pose) => pose,
        }
    }

    /// Returns the link that the camera is on, unless it is beside the robot.
    pub fn camera_link(&self) -> Option<usize> {
        match self.camera {
            Mount::Link(link, _) => Some(link),
            Mount::World(_) => None,
        }
    }

    /// Returns the nearest ancestor link with shapes. (Stages of a mobile base have none.)
    pub fn solid_parent(&self, mut link: usize) -> Option<usize> {
        while link > 0 {
            link = self.model.joints[link - 1].parent;
            if !self.model.links[link].solids.is_empty() {
                return Some(link);
            }
        }
        None
    }

    /// Returns the shapes of each link for collisions with other links.
    pub(crate) fn forms(&self) -> impl Iterator<Item = Arc<BodySolids>> {
        self.model.links.iter().map(Link::form)
    }

    /// Returns the collision shapes of each link, in its frame.
    pub(crate) fn solids_of_links(&self) -> impl Iterator<Item = &[Part]> {
        self.model.links.iter().map(|link| link.solids.as_slice())
    }

    /// Returns all collision shapes with their poses.
    pub(crate) fn solids(&self, positions: &[f64]) -> Vec<(Isometry3<f64>, Shape)> {
        let links = self.model.links.iter().zip(self.links(positions));
        links
            .flat_map(|(link, pose)| {
                link.solids
                    .iter()
                    .map(move |solid| (pose * solid.pose.to_isometry(), solid.shape.clone()))
            })
            .collect()
    }

    /// Returns the pose and the Jacobian of the grasp link; joints that follow others move with
    /// these. Shape: 6 × joints, linear above angular.
    pub fn grasp_jacobian(&self, positions: &[f64]) -> (Isometry3<f64>, Vec<Vector6<f64>>) {
        let mut jacobian = vec![Vector6::zeros(); self.model.joints.len()];
        let grasp = self.fill_jacobian(positions, &mut jacobian);
        (grasp, jacobian)
    }

    /// As [`Kinematics::grasp_jacobian`], into columns that were made for the same joints: 0 or an
    /// earlier Jacobian.
    pub(crate) fn fill_jacobian(
        &self,
        positions: &[f64],
        jacobian: &mut [Vector6<f64>],
    ) -> Isometry3<f64> {
        let mut pose = self.root;
        for idx in &self.path {
            let joint = &self.model.joints[*idx];
            let frame = pose * joint.origin;
            // The axis and a point on it, until the place of the grasp is known.
            let (axis, point) = (
                frame.rotation * joint.axis.into_inner(),
                frame.translation.vector,
            );
            jacobian[*idx] = Vector6::new(point.x, point.y, point.z, axis.x, axis.y, axis.z);
            pose = frame * motion(joint, positions[*idx]);
        }
        let grasp = pose * self.grasp.1;
        for idx in &self.path {
            let [px, py, pz, ax, ay, az]: [f64; 6] = jacobian[*idx].into();
            let (point, axis) = (Vector3::new(px, py, pz), Vector3::new(ax, ay, az));
            let (linear, angular) = match self.model.joints[*idx].kind {
                JointKind::Prismatic => (axis, Vector3::zeros()),
                JointKind::Revolute => (axis.cross(&(grasp.translation.vector - point)), axis),
            };
            jacobian[*idx] = Vector6::new(
                linear.x, linear.y, linear.z, angular.x, angular.y, angular.z,
            );
        }
        for (_, leader, ..) in self
            .followers
            .iter()
            .filter(|(_, leader, ..)| !self.path.contains(leader))
        {
            jacobian[*leader] = Vector6::zeros();
        }
        for (joint, leader, factor, _) in &self.followers {
            let moved = jacobian[*joint] * *factor;
            jacobian[*leader] += moved;
        }
        grasp
    }

    /// Returns the downward pitch of the hand if no joint of the arm changes it, because all that
    /// turn are vertical. Unit: radians.
    pub fn only_pitch(&self, arm: &[usize], positions: &[f64]) -> Option<f64> {
        let links = self.links(positions);
        let keeps_pitch = |idx: &usize| {
            let joint = &self.model.joints[*idx];
            let axis =
                links[joint.parent].rotation * (joint.origin.rotation * joint.axis.into_inner());
            joint.kind == JointKind::Prismatic || axis.z.abs() > VERTICAL
        };
        let ahead = self.grasp(positions).rotation * Vector3::x();
        arm.iter()
            .all(keeps_pitch)
            .then(|| libm::asin((-ahead.z).clamp(-1.0, 1.0)))
    }

    /// Returns the forces and torques that compensate gravity. Units: newtons or newton metres.
    /// Shape: one per joint.
    pub fn holding_efforts(&self, positions: &[f64]) -> Vec<f64> {
        self.holding_efforts_at(&self.links(positions))
    }

    /// Returns the efforts that a motion needs with the joints at these positions and velocities.
    pub fn dynamics(&self, positions: &[f64], velocities: &[f64]) -> Dynamics {
        Dynamics::new(&self.model, &self.links(positions), velocities)
    }

    /// As [`Kinematics::holding_efforts`], with the links at these poses.
    pub fn holding_efforts_at(&self, poses: &[Isometry3<f64>]) -> Vec<f64> {
        holding_efforts(&self.model, poses)
    }
}

/// The joints between the root and a link, in this order.
fn path_to(model: &RobotModel, link: usize) -> Vec<usize> {
    let parent = |idx: &usize| model.joints[*idx].parent.checked_sub(1);
    let mut path: Vec<usize> = std::iter::successors(link.checked_sub(1), parent).collect();
    path.reverse();
    path
}

/// Returns the forces and torques that compensate gravity, with the links at these poses. Units:
/// newtons or newton metres. Shape: one per joint.
pub(crate) fn holding_efforts(model: &RobotModel, poses: &[Isometry3<f64>]) -> Vec<f64> {
    // Mass and first moment of each subtree, accumulated from the leaves: children come after their
    // parents.
    let mut weights: Vec<(f64, Vector3<f64>)> = model
        .links
        .iter()
        .zip(poses)
        .map(|(link, pose)| {
            (
                link.mass,
                (pose * Point3::from(link.com)).coords * link.mass,
            )
        })
        .collect();
    let mut efforts = vec![0.0; model.joints.len()];
    for (idx, joint) in model.joints.iter().enumerate().rev() {
        let (mass, moment) = weights[idx + 1];
        let (axis, point) = axis_in_world(joint, poses);
        let up = Vector3::z() * GRAVITY;
        efforts[idx] = match joint.kind {
            JointKind::Prismatic => axis.dot(&up) * mass,
            JointKind::Revolute => axis.dot(&(moment - point * mass).cross(&up)),
        };
        weights[joint.parent].0 += mass;
        weights[joint.parent].1 += moment;
    }
    efforts
}

pub(crate) fn motion(joint: &Joint, position: f64) -> Isometry3<f64> {
    match joint.kind {
        JointKind::Prismatic => Isometry3::from_parts(
            Translation3::from(joint.axis.into_inner() * position),
            UnitQuaternion::identity(),
        ),
        JointKind::Revolute => Isometry3::from_parts(
            Translation3::identity(),
            UnitQuaternion::from_axis_angle(&joint.axis, position),
        ),
    }
}

/// Returns the direction of a joint's axis and a point on it. Frame: world.
pub fn axis_in_world(joint: &Joint, poses: &[Isometry3<f64>]) -> (Vector3<f64>, Vector3<f64>) {
    axis_from(joint, &poses[joint.parent])
}

/// As [`axis_in_world`], from the pose of the parent.
fn axis_from(joint: &Joint, parent: &Isometry3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let frame = parent * joint.origin;
    (
        frame.rotation * joint.axis.into_inner(),
        frame.translation.vector,
    )
}
