//! Models of objects and furniture.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::{Part, PartJoint, Pose, Shape};

/// Smallest difference of positions and angles that counts for the form of a vessel. Units: metres
/// and radians.
const ROUGHLY: f64 = 2e-3;

/// A rigid object or piece of furniture, made of shapes. Joints may move further parts of it.
///
/// Frame: the model's own, z up, in its upright pose; the origin is on the ground below its middle.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectModel {
    /// Name in configurations; the file's name without its extension.
    pub name: String,
    /// Its class in the ontology: an IRI.
    pub category: String,
    /// Unit: kilograms.
    pub mass_kg: f64,
    /// Sliding friction coefficient against a surface of the same friction.
    pub friction: f64,
    /// Coefficient of restitution in [0, 1].
    pub restitution: f64,
    /// Position of the file's origin in the model's frame; nonzero only for SDF and URDF models.
    /// Unit: metres.
    pub origin_m: [f64; 3],
    /// Outer dimensions in the upright pose. Unit: metres. Shape: x, y, z.
    pub size_m: [f64; 3],
    /// Shapes of the model. The mass is distributed by their volumes.
    pub parts: Vec<Part>,
    /// Whether it is static.
    pub fixed: bool,
    /// Centre of mass and moments of inertia from its file; if `None`, the parts have a uniform
    /// density.
    pub inertia: Option<Inertia>,
    /// For furniture: the flat rectangle on top that can hold objects.
    pub surface: Option<Surface>,
    /// Parts that joints move, such as drawers and doors. Their shapes and masses are not among
    /// those above; the outer dimensions contain them.
    pub moving: Vec<MovingPart>,
    /// Digest of the model's files.
    pub digest: String,
}

/// A part of a model that a joint moves.
#[derive(Debug, Clone, PartialEq)]
pub struct MovingPart {
    /// Name, unique in the model.
    pub name: String,
    /// Its shapes and mass. It has no moving parts of its own.
    pub model: Arc<ObjectModel>,
    /// Pose of its origin while its joint is at 0. Frame: the whole model's.
    pub pose: Pose,
    /// The part that carries it, by its index; `None` if the model itself does.
    pub on: Option<usize>,
    /// How it moves. Frame: the whole model's, while all joints are at 0.
    pub joint: PartJoint,
}

/// The wall of an open, upright vessel around the middle of a model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rim {
    /// Outer radius at the upper end. Unit: metres.
    pub radius_m: f64,
    /// Height of the upper end. Unit: metres.
    pub top_m: f64,
    /// How much the radius grows per metre of height.
    pub slope: f64,
    /// Thickness of the wall. Unit: metres.
    pub wall_m: f64,
    /// Height of the floor inside. Unit: metres.
    pub floor_m: f64,
}

/// Mass distribution of a model. Frame: the model's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Inertia {
    /// Centre of mass. Unit: metres.
    pub com_m: [f64; 3],
    /// Inertia tensor about the centre of mass for the model's mass, row by row. Unit: kg·m².
    pub about_com: [[f64; 3]; 3],
}

/// A horizontal rectangle that can hold objects. Frame: the model's, centred on its origin.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Surface {
    /// Height above the ground. Unit: metres.
    pub height_m: f64,
    /// Extent. Unit: metres. Shape: x, y.
    pub size_m: [f64; 2],
}

impl Part {
    /// Returns the convex solids of the part: the boxes of a tube, or the part itself. Frame: the
    /// model's.
    pub fn solids(&self) -> Vec<Self> {
        let Shape::Tube { .. } = self.shape else {
            return vec![self.clone()];
        };
        let outer = self.pose.to_isometry();
        let placed = |pose: &Pose| Pose::from_isometry(&(outer * pose.to_isometry()));
        self.shape
            .staves()
            .into_iter()
            .map(|stave| Self {
                pose: placed(&stave.pose),
                shape: stave.shape,
            })
            .collect()
    }
}

impl ObjectModel {
    /// Returns the convex solids of the model. Frame: the model's.
    pub fn solids(&self) -> Vec<Part> {
        self.parts.iter().flat_map(Part::solids).collect()
    }

    /// Returns the convex solids of the model and of its moving parts, with all joints at 0. Frame:
    /// the model's.
    pub fn all_solids(&self) -> Vec<Part> {
        let of_part = |part: &MovingPart| -> Vec<Part> {
            let at = part.pose.to_isometry();
            let placed = |pose: &Pose| Pose::from_isometry(&(at * pose.to_isometry()));
            part.model
                .solids()
                .into_iter()
                .map(|solid| Part {
                    pose: placed(&solid.pose),
                    ..solid
                })
                .collect()
        };
        self.solids()
            .into_iter()
            .chain(self.moving.iter().flat_map(of_part))
            .collect()
    }

    /// Returns the rim of an open vessel: an upright wall around the middle that reaches up to the
    /// top, with nothing above its floor.
    pub fn rim(&self) -> Option<Rim> {
        let is_central = |part: &Part| {
            let at = part.pose.to_isometry();
            at.rotation.angle() < ROUGHLY && at.translation.vector.xy().norm() < ROUGHLY
        };
        let of = |(idx, part): (usize, &Part)| {
            let Shape::Tube {
                radius_low,
                radius_high,
                wall,
                height,
                ..
            } = part.shape
            else {
                return None;
            };
            let top_m = part.bounds().1[2];
            let others = self
                .parts
                .iter()
                .enumerate()
                .filter(|(other, _)| *other != idx);
            let floor_m = others
                .map(|(_, other)| other.bounds().1[2])
                .fold(0.0, f64::max);
            let is_open = top_m > self.size_m[2] - ROUGHLY && floor_m < top_m / 2.0;
            let slope = (radius_high - radius_low) / height;
            (is_central(part) && is_open).then_some(Rim {
                radius_m: radius_high,
                top_m,
                slope,
                wall_m: wall,
                floor_m,
            })
        };
        self.parts.iter().enumerate().find_map(of)
    }

    /// Scales the model uniformly; the mass stays the same.
    #[must_use]
    pub fn scaled(&self, by: f64) -> Self {
        let placed = |pose: &Pose| Pose {
            position: pose.position.map(|x| x * by),
            rotation: pose.rotation,
        };
        let surface = |surface: Surface| Surface {
            height_m: surface.height_m * by,
            size_m: surface.size_m.map(|extent| extent * by),
        };
        let inertia = |inertia: Inertia| Inertia {
            com_m: inertia.com_m.map(|x| x * by),
            about_com: inertia
                .about_com
                .map(|row| row.map(|moment| moment * by * by)),
        };
        Self {
            size_m: self.size_m.map(|extent| extent * by),
            origin_m: self.origin_m.map(|x| x * by),
            parts: self
                .parts
                .iter()
                .map(|part| Part {
                    pose: placed(&part.pose),
                    shape: part.shape.sized(by),
                })
                .collect(),
            surface: self.surface.map(surface),
            inertia: self.inertia.map(inertia),
            moving: self
                .moving
                .iter()
                .map(|part| MovingPart {
                    name: part.name.clone(),
                    model: Arc::new(part.model.scaled(by)),
                    pose: placed(&part.pose),
                    on: part.on,
                    joint: part.joint.scaled(by),
                })
                .collect(),
            ..self.clone()
        }
    }

    /// Volume of the material. Unit: cubic metres.
    pub fn volume(&self) -> f64 {
        self.parts.iter().map(|part| part.shape.volume()).sum()
    }
}
