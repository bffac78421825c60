//! Shapes between the fingers, which would keep every object out: markers of the middle of a grasp,
//! and coarse shapes that include the fingers.

use std::ops::Range;

use nalgebra::{Isometry3, Vector3};
use parry3d::math::Pose as EnginePose;
use parry3d::query::distance;
use parry3d::shape::SharedShape;

use crate::description::RobotModel;
use crate::kinematics::motion;
use actcheck_data::{Part, bounds};
use actcheck_geometry::{convex_shape, to_vector};

/// Greatest distance of a marker from the grasp frame, and its greatest size. Units: metres.
const NEAR_M: f64 = 0.05;
const SMALL_M: f64 = 0.03;
/// A shape this far from all others of its body is not attached to it. Unit: metres.
const APART_M: f32 = 0.002;

/// Returns the names of the URDF links with shapes between the two fingers.
pub(crate) fn between_fingers(
    model: &RobotModel,
    fingers: [usize; 2],
    grasp: (usize, Isometry3<f64>),
) -> Vec<String> {
    let mut found = afloat(model, grasp);
    let around = around(model, fingers, grasp)
        .into_iter()
        .filter(|name| !found.contains(name));
    found.extend(around.collect::<Vec<_>>());
    found
}

/// The URDF links that carry the hand, or are part of it, and have a shape around the origin of the
/// grasp frame.
fn around(
    model: &RobotModel,
    fingers: [usize; 2],
    (body, frame): (usize, Isometry3<f64>),
) -> Vec<String> {
    // The pose of the grasp frame in that of each link towards the root, with all joints at 0.
    let (mut link, mut at) = (body, frame);
    let mut frames = vec![(link, at)];
    while let Some(joint) = link.checked_sub(1).map(|idx| &model.joints[idx]) {
        at = joint.origin * motion(joint, 0.0_f64.clamp(joint.lower, joint.upper)) * at;
        link = joint.parent;
        frames.push((link, at));
    }
    let contains = |solid: &Part, place: Vector3<f64>| {
        convex_shape(solid)
            .is_some_and(|(shape, pose)| shape.contains_point(&pose, to_vector(&place)))
    };
    let is_around = |of: usize, own: Range<usize>| {
        let place = frames
            .iter()
            .find(|(link, _)| *link == of)
            .map(|(_, at)| at.translation.vector);
        place.is_some_and(|place| {
            model.links[of].solids[own]
                .iter()
                .any(|solid| contains(solid, place))
        })
    };
    let shapes = model
        .shapes_of_links()
        .filter(|(_, of, _)| !fingers.contains(of));
    shapes
        .filter(|(_, of, own)| is_around(*of, own.clone()))
        .map(|(name, ..)| name.to_owned())
        .collect()
}

/// The URDF links whose shapes are small, near the grasp frame, and attached to nothing.
fn afloat(model: &RobotModel, (body, frame): (usize, Isometry3<f64>)) -> Vec<String> {
    let solids = &model.links[body].solids;
    type Placed = (SharedShape, EnginePose);
    let all: Vec<Option<Placed>> = solids.iter().map(convex_shape).collect();
    let apart = |(one, at): &Placed, (other, other_at): &Placed| {
        let found = distance(at, one.as_ref(), other_at, other.as_ref());
        found.is_ok_and(|found| found.distance > APART_M)
    };
    let shapes = model
        .shapes_of_links()
        .filter(|(_, of, own)| *of == body && own.len() < solids.len());
    let floating = shapes.filter(|(_, _, own)| {
        let (low, high) = bounds(&solids[own.clone()]);
        let (low, high) = (Vector3::from(low), Vector3::from(high));
        let off = (low + high) / 2.0 - frame.translation.vector;
        let others = all
            .iter()
            .enumerate()
            .filter(|(idx, _)| !own.contains(idx))
            .filter_map(|(_, other)| other.as_ref());
        off.norm() < NEAR_M
            && (high - low).max() < SMALL_M
            && others.into_iter().all(|other| {
                all[own.clone()]
                    .iter()
                    .flatten()
                    .all(|one| apart(one, other))
            })
    });
    floating.map(|(name, ..)| name.to_owned()).collect()
}
