//! Splits a building into solids that are obstacles of their own, so that a robot can be inside.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use crate::foreign::world::LOW_M;
use actcheck_data::{Face, Mesh, ObjectModel, Part, Pose, Shape};

/// Largest number of solids of a building that become pieces of their own: each is perceived on its own.
pub(super) const MOST_SOLIDS: usize = 400;
/// Shortest length and width of a model that may be around the robot. Unit: metres.
const ROOM_M: f64 = 2.5;
/// Shortest length and width of a part of a building that may be around the robot, or around a passage. Unit: metres.
const NICHE_M: f64 = 1.0;
/// Walls are cut here, so that the lintel of a door is not in the way on the map. Unit: metres. The height of a door.
const DOOR_M: f64 = 2.0;
/// Solids that begin higher are left out: no robot gets there. Unit: metres.
const CEILING_M: f64 = 2.6;
/// Thickness of a face, inwards. Unit: metres. Much thicker than a robot moves in a step.
const THICKNESS_M: f64 = 0.02;
/// Narrower faces are left out. Unit: metres. The faces beside them are as thick as that.
const SLIVER_M: f64 = 0.01;
/// Meshes with more triangles are not split: scanned surfaces.
const MOST_TRIANGLES: usize = 20_000;

/// A solid of a building.
pub(super) struct Solid {
    /// Frame: that of `at`.
    pub(super) part: Part,
    /// Frame: world.
    pub(super) at: Isometry3<f64>,
}

/// The result of splitting.
pub(super) enum Split {
    /// It is not a building: too small, or one convex solid.
    Whole,
    Solids(Vec<Solid>),
    /// A building of too many solids, and how many.
    TooMany(usize),
}

/// Splits a model at a pose, if it is so large that it may be around the robot. The faces of a mesh that is not convex become
/// plates, without those below the floor and above all robots.
pub(super) fn solids(model: &ObjectModel, at: &Isometry3<f64>) -> Split {
    if !is_large(model) {
        return Split::Whole;
    }
    // The doors of a building stay as in the file.
    let moving = model.moving.iter().flat_map(|part| {
        let from_part = part.pose.to_isometry();
        let placed = move |solid: &Part| Pose::from_isometry(&(from_part * solid.pose.to_isometry()));
        part.model.parts.iter().map(move |solid| Part { pose: placed(solid), ..solid.clone() })
    });
    let parts: Vec<Part> = model.parts.iter().cloned().chain(moving).collect();
    let n_triangles: usize =
        parts.iter().filter_map(|part| mesh_of(&part.shape)).map(|mesh| mesh.triangles.len()).sum();
    if n_triangles > MOST_TRIANGLES {
        return Split::TooMany(n_triangles);
    }
    let solids: Vec<Solid> = parts.into_iter().flat_map(|part| split(part, at)).collect();
    match solids.len() {
        0 | 1 => Split::Whole,
        count if count > MOST_SOLIDS => Split::TooMany(count),
        _ => Split::Solids(solids),
    }
}

/// Whether a model may be around the robot, or below it.
pub(super) fn is_large(model: &ObjectModel) -> bool {
    model.size_m[..2].iter().all(|extent| *extent > ROOM_M)
}

fn mesh_of(shape: &Shape) -> Option<&Mesh> {
    match shape {
        Shape::Mesh { mesh } => Some(mesh),
        _ => None,
    }
}

/// The solids of a part of a building that is at a pose.
fn split(part: Part, at: &Isometry3<f64>) -> Vec<Solid> {
    let Shape::Mesh { mesh } = &part.shape else { return vec![Solid { part, at: *at }] };
    let from_mesh = at * part.pose.to_isometry();
    let components = mesh.components().into_iter();
    components
        .flat_map(|mesh| {
            let whole = Part { pose: part.pose, shape: Shape::Mesh { mesh: mesh.clone() } };
            let (low, high) = whole.bounds();
            let is_open = [0, 1].iter().all(|axis| high[*axis] - low[*axis] > NICHE_M);
            if !is_open || mesh.is_convex() {
                vec![Solid { part: whole, at: *at }]
            } else {
                plates(&mesh, &from_mesh, at)
            }
        })
        .collect()
}

/// The faces of a mesh as plates.
fn plates(mesh: &Mesh, from_mesh: &Isometry3<f64>, at: &Isometry3<f64>) -> Vec<Solid> {
    let faces = mesh.faces().into_iter().map(|face| Face {
        corners: face.corners.iter().map(|corner| (from_mesh * Point3::from(*corner)).coords).collect(),
        normal: from_mesh * face.normal,
    });
    let pieces = faces.flat_map(|face| face.cut(DOOR_M)).flatten();
    let heights = |face: &Face| {
        face.corners
            .iter()
            .map(|corner| corner.z)
            .fold((f64::MAX, f64::MIN), |(low, high), z| (low.min(z), high.max(z)))
    };
    let relevant =
        pieces.filter(|face| face.width() >= SLIVER_M && heights(face).0 < CEILING_M && heights(face).1 >= LOW_M);
    relevant.map(|face| plate(&face, at)).collect()
}

/// A face as a plate, in a frame whose x axis is horizontal and across it: its box on the map is thin.
fn plate(face: &Face, at: &Isometry3<f64>) -> Solid {
    let is_level = face.normal.xy().norm() < 1e-3;
    let heading = if is_level { Pose::from_isometry(at).yaw() } else { libm::atan2(face.normal.y, face.normal.x) };
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading);
    let at = Isometry3::from_parts(Translation3::from(face.corners[0]), turn);
    let back = face.corners.iter().map(|corner| corner - face.normal * THICKNESS_M);
    let points =
        face.corners.iter().copied().chain(back).map(|point| at.inverse_transform_point(&Point3::from(point)).into());
    let shape = Shape::Hull { points: points.collect(), volume: face.area() * THICKNESS_M };
    Solid { part: Part { pose: Pose::IDENTITY, shape }, at }
}
