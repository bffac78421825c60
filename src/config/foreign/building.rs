//! Splits a building into solids that are obstacles of their own, so that a robot can be inside.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use crate::foreign::world::{FARTHEST_M, LOW_M};
use actcheck_data::{Face, Mesh, ObjectModel, Part, Pose, Shape};

/// Largest number of solids of a building that become pieces of their own: each is perceived on its
/// own.
pub(super) const MOST_SOLIDS: usize = 600;
/// Shortest length and width of a model that may be around the robot. Unit: metres.
const ROOM_M: f64 = 2.5;
/// Shortest length and width of a part of a building that may be around the robot, or around a
/// passage. Unit: metres.
const NICHE_M: f64 = 1.0;
/// Walls are cut here, so that the lintel of a door is not in the way on the map. Unit: metres. The
/// height of a door.
const DOOR_M: f64 = 2.0;
/// Solids that begin higher are left out: no robot gets there. Unit: metres.
const CEILING_M: f64 = 2.6;
/// Thickness of a face, inwards. Unit: metres. Much thicker than a robot moves in a step.
const THICKNESS_M: f64 = 0.02;
/// Narrower faces are left out. Unit: metres. The faces beside them are as thick as that.
const SLIVER_M: f64 = 0.01;
/// A component of a smaller volume, as a share of that of a cube with its longest side, is a sheet
/// or a line. A strip of 10 m by 5 cm by 2 cm is thicker.
const THIN: f64 = 1e-5;
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
    /// Too small for a building, or one convex solid.
    Whole,
    Solids(Vec<Solid>),
    /// A building of too many solids, and how many.
    TooMany(usize),
}

/// Splits a model at a pose, if it is so large that it may be around the robot. The faces of a mesh
/// that is not convex become plates, without those below the floor and above all robots.
pub(super) fn solids(model: &ObjectModel, at: &Isometry3<f64>) -> Split {
    if !is_large(model) {
        return Split::Whole;
    }
    // The doors of a building stay as in the file.
    let moving = model.moving.iter().flat_map(|part| {
        let from_part = part.pose.to_isometry();
        let placed =
            move |solid: &Part| Pose::from_isometry(&(from_part * solid.pose.to_isometry()));
        part.model.parts.iter().map(move |solid| Part {
            pose: placed(solid),
            ..solid.clone()
        })
    });
    let parts: Vec<Part> = model.parts.iter().cloned().chain(moving).collect();
    let n_triangles: usize = parts
        .iter()
        .filter_map(|part| mesh_of(&part.shape))
        .map(|mesh| mesh.triangles.len())
        .sum();
    if n_triangles > MOST_TRIANGLES {
        return Split::TooMany(n_triangles);
    }
    if let [only] = &parts[..]
        && mesh_of(&only.shape).is_none_or(|mesh| mesh.components().len() == 1 && mesh.is_convex())
    {
        return Split::Whole;
    }
    let solids: Vec<Solid> = parts.into_iter().flat_map(|part| split(part, at)).collect();
    if solids.len() > MOST_SOLIDS {
        Split::TooMany(solids.len())
    } else {
        Split::Solids(solids)
    }
}

/// Whether a model may be around the robot, or below it.
pub(super) fn is_large(model: &ObjectModel) -> bool {
    model.size_m[..2].iter().all(|extent| *extent > ROOM_M)
}

/// Whether at least half of a model's top is level, as that of a floor is.
pub(super) fn is_level(model: &ObjectModel) -> bool {
    let [length, width, height] = model.size_m;
    let area = |part: &Part| match mesh_of(&part.shape) {
        Some(mesh) => {
            let at = part.pose.to_isometry();
            mesh.top(height, LOW_M, |point| (at * Point3::from(*point)).coords)
                .area
        }
        None => {
            let (low, high) = part.bounds();
            if high[2] >= height - LOW_M {
                (high[0] - low[0]) * (high[1] - low[1])
            } else {
                0.0
            }
        }
    };
    model.parts.iter().map(area).sum::<f64>() >= length * width / 2.0
}

fn mesh_of(shape: &Shape) -> Option<&Mesh> {
    match shape {
        Shape::Mesh { mesh } => Some(mesh),
        _ => None,
    }
}

/// The solids of a part of a building that is at a pose.
fn split(part: Part, at: &Isometry3<f64>) -> Vec<Solid> {
    let Shape::Mesh { mesh } = &part.shape else {
        return vec![Solid { part, at: *at }];
    };
    let from_mesh = at * part.pose.to_isometry();
    let components = mesh.components().into_iter();
    components
        .flat_map(|mesh| {
            let whole = Part {
                pose: part.pose,
                shape: Shape::Mesh { mesh: mesh.clone() },
            };
            let (low, high) = whole.bounds();
            let sides = [0, 1, 2].map(|axis| high[axis] - low[axis]);
            let is_thin = volume_within(&mesh)
                < THIN * sides.iter().fold(0.0, |most, side| side.max(most)).powi(3);
            let is_open = [0, 1].iter().all(|axis| sides[*axis] > NICHE_M);
            if !is_thin && (!is_open || mesh.is_convex()) {
                vec![Solid {
                    part: whole,
                    at: *at,
                }]
            } else {
                plates(&mesh, &from_mesh, at)
            }
        })
        .collect()
}

/// Volume of a mesh that may be open: of the pyramids from its middle to its triangles. 0 if it is
/// flat. Unit: cubic metres.
fn volume_within(mesh: &Mesh) -> f64 {
    let points = || mesh.vertices.iter().map(|vertex| Vector3::from(*vertex));
    let middle = points().sum::<Vector3<f64>>() / mesh.vertices.len().max(1) as f64;
    let vertices = points().map(|point| (point - middle).into()).collect();
    Mesh {
        vertices,
        triangles: mesh.triangles.clone(),
    }
    .volume()
}

/// The faces of a mesh as plates.
fn plates(mesh: &Mesh, from_mesh: &Isometry3<f64>, at: &Isometry3<f64>) -> Vec<Solid> {
    let faces = mesh.faces().into_iter().map(|face| Face {
        corners: face
            .corners
            .iter()
            .map(|corner| (from_mesh * Point3::from(*corner)).coords)
            .collect(),
        normal: from_mesh * face.normal,
    });
    let pieces = faces.flat_map(|face| face.cut(DOOR_M)).flatten();
    let relevant = pieces.filter(|face| face.width() >= SLIVER_M && is_within_reach(face));
    relevant.map(|face| plate(&face, at)).collect()
}

/// Whether a robot can get to a face: it is above the floor, below the ceiling, and not beyond the
/// end of the floor.
fn is_within_reach(face: &Face) -> bool {
    let (mut low, mut high) = (face.corners[0], face.corners[0]);
    for corner in &face.corners {
        (low, high) = (low.inf(corner), high.sup(corner));
    }
    let nearest = Vector3::zeros().sup(&low).inf(&high);
    low.z < CEILING_M && high.z >= LOW_M && libm::hypot(nearest.x, nearest.y) < FARTHEST_M
}

/// A face as a plate, in a frame whose x axis is horizontal and across it: its box on the map is
/// thin.
fn plate(face: &Face, at: &Isometry3<f64>) -> Solid {
    let is_level = face.normal.xy().norm() < 1e-3;
    let heading = if is_level {
        Pose::from_isometry(at).yaw()
    } else {
        libm::atan2(face.normal.y, face.normal.x)
    };
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading);
    let at = Isometry3::from_parts(Translation3::from(face.corners[0]), turn);
    let back = face
        .corners
        .iter()
        .map(|corner| corner - face.normal * THICKNESS_M);
    let points = face
        .corners
        .iter()
        .copied()
        .chain(back)
        .map(|point| at.inverse_transform_point(&Point3::from(point)).into());
    let shape = Shape::Hull {
        points: points.collect(),
        volume: face.area() * THICKNESS_M,
    };
    Solid {
        part: Part {
            pose: Pose::IDENTITY,
            shape,
        },
        at,
    }
}
