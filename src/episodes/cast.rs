//! Which bodies of an episode are which things of a scene.

use std::collections::BTreeSet;

use actcheck_data::Pose;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use crate::Model;

/// The things of a scene, the robot, and the owner of each body.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Cast {
    /// Objects and furniture, in the order of their ids.
    pub things: Vec<Thing>,
    /// Indices of the robot's bodies, ascending.
    pub links: Vec<usize>,
    /// Index of the body whose pose is the robot's base; `None` without a robot.
    pub base: Option<usize>,
    /// The robot's hand; `None` if it is unknown.
    pub hand: Option<Hand>,
    /// The owner of each body of the model.
    pub owners: Vec<Owner>,
}

/// An object or a piece of furniture: a rigid group of bodies.
#[derive(Debug, Clone, PartialEq)]
pub struct Thing {
    /// Id in the scene.
    pub id: String,
    /// IRI of its class.
    pub category: String,
    /// Index of the body whose pose is that of the thing.
    pub root: usize,
    /// Indices of its bodies, among them the root.
    pub bodies: Vec<usize>,
    /// Whether it can't move.
    pub fixed: bool,
    /// Rotation of the thing's frame, whose z axis is up while it is upright, in the root's frame.
    pub upright: UnitQuaternion<f64>,
    /// The thing that it is a part of, if a joint attaches it to another one.
    pub part: Option<Part>,
}

/// The attachment of a thing to another one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Part {
    /// Index of the whole among the things.
    pub of: usize,
    /// Index of the joint's position among the scalar joints.
    pub joint: usize,
}

/// The robot's hand.
#[derive(Debug, Clone, PartialEq)]
pub struct Hand {
    /// Index of the body that carries the point between the fingertips.
    pub body: usize,
    /// Pose of that point. Frame: the body's.
    pub at: Pose,
    /// Indices of the bodies of each finger, left and right.
    pub fingers: [BTreeSet<usize>; 2],
    /// Indices among the scalar joints whose positions add up to the gap between the fingers.
    pub opening: Vec<usize>,
}

/// The owner of a body.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Owner {
    /// The floor, walls, and everything else that is part of the world itself.
    Floor,
    /// A thing, by its index.
    Thing(usize),
    /// A link of the robot, by the index of its body.
    Link(usize),
}

impl Cast {
    /// Returns the name of an owner, as contacts have it.
    pub(crate) fn name(&self, owner: Owner, model: &Model) -> String {
        match owner {
            Owner::Floor => "floor".to_owned(),
            Owner::Thing(idx) => self.things[idx].id.clone(),
            Owner::Link(body) => link_name(&model.bodies[body].name),
        }
    }

    /// Returns the id of a thing by its id or by the name of one of its bodies, or `None`.
    pub(crate) fn id_of<'n>(&'n self, name: &'n str, model: &Model) -> Option<&'n str> {
        if self.thing(name).is_some() {
            return Some(name);
        }
        let body = model.bodies.iter().position(|body| body.name == name)?;
        match self.owners.get(body)? {
            Owner::Thing(thing) => Some(&self.things[*thing].id),
            _ => None,
        }
    }

    /// Returns the index of a thing by its id, or `None`.
    pub fn thing(&self, id: &str) -> Option<usize> {
        self.things.iter().position(|thing| thing.id == id)
    }

    /// Whether a link belongs to the hand.
    pub(crate) fn is_of_hand(&self, body: usize) -> bool {
        self.hand.as_ref().is_some_and(|hand| {
            hand.body == body || hand.fingers.iter().any(|finger| finger.contains(&body))
        })
    }
}

impl Thing {
    /// Returns the pose of the thing's frame.
    pub(crate) fn pose(&self, poses: &[Pose]) -> Isometry3<f64> {
        let root = poses
            .get(self.root)
            .map_or_else(Isometry3::identity, Pose::to_isometry);
        Isometry3::from_parts(root.translation, root.rotation * self.upright)
    }
}

/// Returns the name of a link, as it appears in a trace. Models that actcheck wrote have it already.
pub(crate) fn link_name(body: &str) -> String {
    if body.starts_with("robot/") {
        body.to_owned()
    } else {
        format!("robot/{body}")
    }
}

/// Returns the rotation of a frame whose z axis is the axis of a body that is nearest to the
/// vertical in this pose. Frame: the body's.
///
/// Many models have another axis than z along the vertical of the upright object.
pub(crate) fn upright_in(pose: &Pose) -> UnitQuaternion<f64> {
    let up = pose.to_isometry().rotation.inverse() * Vector3::z();
    let axis = up.iamax();
    let mut nearest = Vector3::zeros();
    nearest[axis] = up[axis].signum();
    UnitQuaternion::rotation_between(&Vector3::z(), &nearest).unwrap_or_else(|| {
        UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_upright_frame_has_the_vertical_axis_of_the_first_state() {
        let tipped = |axis, angle| {
            let turn = UnitQuaternion::from_axis_angle(&axis, angle);
            Pose::from_isometry(&Isometry3::from_parts(Default::default(), turn))
        };
        for (pose, expected) in [
            (Pose::IDENTITY, Vector3::z()),
            (tipped(Vector3::x_axis(), 1.5), Vector3::y()),
            (tipped(Vector3::x_axis(), 0.4), Vector3::z()),
            (tipped(Vector3::x_axis(), 3.0), -Vector3::z()),
            (tipped(Vector3::y_axis(), 1.7), -Vector3::x()),
        ] {
            let axis = upright_in(&pose) * Vector3::z();
            assert!((axis - expected).norm() < 1e-9, "{pose:?}: {axis}");
        }
    }
}
