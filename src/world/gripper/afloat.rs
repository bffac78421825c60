//! Shapes that float between the fingers: markers of the middle of a grasp, which would keep every object out.

use nalgebra::{Isometry3, Vector3};
use parry3d::query::distance;
use rapier3d::prelude::Collider;

use crate::description::RobotModel;
use crate::engine::{Owner, collider};
use actcheck_data::bounds;

/// Greatest distance of a marker from the grasp frame, and its greatest size. Units: metres.
const NEAR_M: f64 = 0.05;
const SMALL_M: f64 = 0.03;
/// A shape this far from all others of its body is not attached to it. Unit: metres.
const APART_M: f32 = 0.002;

/// Returns the URDF links whose shapes are small, near the grasp frame, and attached to nothing.
pub(crate) fn afloat(model: &RobotModel, (body, frame): (usize, Isometry3<f64>)) -> Vec<String> {
    let solids = &model.links[body].solids;
    let all: Vec<Option<Collider>> =
        solids.iter().map(|solid| Some(collider(solid, Owner::Floor, 0.0, 0.0)?.build())).collect();
    let apart = |one: &Collider, other: &Collider| {
        let found = distance(one.position(), one.shape(), other.position(), other.shape());
        found.is_ok_and(|found| found.distance > APART_M)
    };
    let shapes = model.shapes_of_links().filter(|(_, of, own)| *of == body && own.len() < solids.len());
    let floating = shapes.filter(|(_, _, own)| {
        let (low, high) = bounds(&solids[own.clone()]);
        let (low, high) = (Vector3::from(low), Vector3::from(high));
        let off = (low + high) / 2.0 - frame.translation.vector;
        let others =
            all.iter().enumerate().filter(|(idx, _)| !own.contains(idx)).filter_map(|(_, other)| other.as_ref());
        off.norm() < NEAR_M
            && (high - low).max() < SMALL_M
            && others.into_iter().all(|other| all[own.clone()].iter().flatten().all(|one| apart(one, other)))
    });
    floating.map(|(name, ..)| name.to_owned()).collect()
}
