//! A rigid body read from SDF or URDF, and its conversion to a model.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Point3, Translation3, Vector3};

use crate::foreign::frames::Frame;
use crate::foreign::solid_mass::SolidMass;
use actcheck_base::names;
use actcheck_data::{
    Inertia, MovingPart, ObjectModel, Part, PartJoint, Pose, SeenLink, SeenPart, Shape, Surface,
    bounds,
};

/// Density of a body without a mass: that of water, SDF's default. Unit: kg/m³.
const DENSITY: f64 = 1000.0;
/// Default friction coefficient, as in SDF.
pub(crate) const FRICTION: f64 = 1.0;
/// Largest distance of a supporting surface below the model's highest point. Unit: metres.
const TOP_DEPTH_M: f64 = 0.003;
/// Smallest side of a supporting surface. Unit: metres.
const SMALLEST_SURFACE_M: f64 = 0.15;
/// Share of its bounding rectangle that a mesh's top must fill to count as a surface.
const FULL: f64 = 0.95;

/// The part that a model has in scenes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Role {
    /// It moves, unless it is static.
    Object,
    /// It is a part of a world, where nothing moves: its joints stay as in the file.
    Furniture,
}

/// A model read from SDF or URDF.
pub(crate) struct SdfModel {
    pub(crate) body: Body,
    /// Frames of its links by their names, with the names of the bodies that carry them; empty in
    /// SDF, where a model that includes this one has its links.
    pub(crate) frames: BTreeMap<String, Frame>,
    /// Pose of the model's origin in the file.
    pub(crate) pose: Isometry3<f64>,
    /// Whether the file says that it never moves.
    pub(crate) is_static: bool,
    /// Digest of the file and its meshes.
    pub(crate) digest: String,
}

/// A rigid body. Frame: the file's own.
#[derive(Default)]
pub(crate) struct Body {
    pub(crate) parts: Vec<Part>,
    /// Its appearance, if visual shapes are read.
    pub(crate) seen: SeenLink,
    /// Masses of the links that state one.
    pub(crate) masses: Vec<Mass>,
    /// Whether a link with shapes has no mass.
    pub(crate) has_unknown_mass: bool,
    pub(crate) friction: Option<f64>,
    /// Whether a collision leaves its friction at the default.
    pub(crate) has_usual_friction: bool,
    pub(crate) restitution: Option<f64>,
    pub(crate) fixed: bool,
    /// Bodies that joints move; each after the one that carries it.
    pub(crate) moving: Vec<MovingBody>,
}

/// A body that a joint moves. Frame: the file's own.
pub(crate) struct MovingBody {
    pub(crate) name: String,
    pub(crate) body: Body,
    /// The moving body that carries it, by its index.
    pub(crate) on: Option<usize>,
    pub(crate) joint: PartJoint,
}

/// Mass of one link. Frame: the file's own.
pub(crate) struct Mass {
    pub(crate) kg: f64,
    pub(crate) com: Vector3<f64>,
    /// Inertia tensor about the centre of mass; `None` if it must be computed from the shapes.
    pub(crate) about_com: Option<Matrix3<f64>>,
}

impl Body {
    /// Converts the body to a model: places its origin at `pose`, then moves it so that its middle
    /// is above the origin and its lowest point at z = 0. The caller sets the category.
    pub(crate) fn into_model(
        self,
        name: &str,
        digest: String,
        pose: &Isometry3<f64>,
    ) -> ObjectModel {
        let (model_from_file, size) = self.frame(pose);
        let parts = self.placed(&model_from_file);
        let surface = surface(&parts, bounds(&parts).1.z);
        let by_volume = DENSITY * parts.iter().map(|part| part.shape.volume()).sum::<f64>();
        let stated: f64 = self.masses.iter().map(|mass| mass.kg).sum();
        let is_stated = !self.has_unknown_mass && stated > 0.0;
        ObjectModel {
            name: name.to_owned(),
            category: names::act("Object"),
            mass_kg: if is_stated { stated } else { by_volume },
            friction: self.friction.unwrap_or(FRICTION),
            restitution: self.restitution.unwrap_or(0.0),
            origin_m: model_from_file.translation.vector.into(),
            size_m: size.into(),
            inertia: if is_stated {
                self.inertia(&model_from_file)
            } else {
                None
            },
            parts,
            fixed: self.fixed,
            surface,
            moving: self
                .moving
                .into_iter()
                .map(|moving| moving.into_part(&model_from_file))
                .collect(),
            digest,
        }
    }

    /// Returns the appearance of the model at this pose, without the bodies that joints move; `None`
    /// if it looks like its collision shapes. Frame: the model's.
    pub(crate) fn seen_in_model(mut self, pose: &Isometry3<f64>) -> Option<Vec<SeenPart>> {
        let (model_from_file, _) = self.frame(pose);
        self.seen.transform(&model_from_file);
        self.seen.has_look.then_some(self.seen.parts)
    }

    /// The transform from the file's frame to that of a model at this pose, and its dimensions.
    fn frame(&self, pose: &Isometry3<f64>) -> (Isometry3<f64>, Vector3<f64>) {
        let everything: Vec<Part> = self.all().flat_map(|body| body.placed(pose)).collect();
        let (low, high) = bounds(&everything);
        let foot = Vector3::new((low.x + high.x) / 2.0, (low.y + high.y) / 2.0, low.z);
        (Translation3::from(-foot) * pose, high - low)
    }

    /// Adds the solids and masses of a body that moves with this one. The material is that of the
    /// first.
    pub(crate) fn add(&mut self, other: Self) {
        self.parts.extend(other.parts);
        self.seen.add(other.seen);
        self.masses.extend(other.masses);
        self.has_unknown_mass |= other.has_unknown_mass;
        self.has_usual_friction |= other.has_usual_friction;
        self.friction = self.friction.or(other.friction);
        self.restitution = self.restitution.or(other.restitution);
    }

    /// Moves solids and masses from one frame to another. Bodies that joints move stay.
    pub(crate) fn transform(&mut self, by: &Isometry3<f64>) {
        let turn = by.rotation.to_rotation_matrix();
        self.parts = self.placed(by);
        self.seen.transform(by);
        for mass in &mut self.masses {
            mass.com = (by * Point3::from(mass.com)).coords;
            mass.about_com = mass
                .about_com
                .map(|moments| turn.matrix() * moments * turn.matrix().transpose());
        }
    }

    /// The body and all that joints move.
    fn all(&self) -> impl Iterator<Item = &Self> {
        std::iter::once(self).chain(self.moving.iter().map(|moving| &moving.body))
    }

    fn placed(&self, at: &Isometry3<f64>) -> Vec<Part> {
        let moved = |part: &Part| Part {
            pose: Pose::from_isometry(&(at * part.pose.to_isometry())),
            shape: part.shape.clone(),
        };
        self.parts.iter().map(moved).collect()
    }

    /// Combines the links' inertia tensors about the common centre of mass; `None` if one of them
    /// must be computed from the shapes.
    fn inertia(&self, model_from_file: &Isometry3<f64>) -> Option<Inertia> {
        let masses = self.masses.iter().map(|mass| {
            Some(SolidMass {
                kg: mass.kg,
                com: mass.com,
                about_com: mass.about_com?,
            })
        });
        let masses = masses.collect::<Option<Vec<SolidMass>>>()?;
        let SolidMass { com, about_com, .. } = SolidMass::together(&masses).moved(model_from_file);
        Some(Inertia {
            com_m: com.into(),
            about_com: [0, 1, 2].map(|row| [0, 1, 2].map(|column| about_com[(row, column)])),
        })
    }
}

impl MovingBody {
    fn into_part(self, model_from_file: &Isometry3<f64>) -> MovingPart {
        let model = self
            .body
            .into_model(&self.name, String::new(), model_from_file);
        let part_from_model =
            Translation3::from(Vector3::from(model.origin_m) - model_from_file.translation.vector);
        let axis = model_from_file.rotation * Vector3::from(self.joint.axis);
        let anchor = model_from_file * Point3::from(self.joint.anchor_m);
        MovingPart {
            name: self.name,
            model: Arc::new(model),
            pose: Pose::from_isometry(&part_from_model.inverse().into()),
            on: self.on,
            joint: PartJoint {
                axis: axis.into(),
                anchor_m: anchor.coords.into(),
                ..self.joint
            },
        }
    }
}

/// Whether an inertia tensor is physically possible: principal moments are positive, and none
/// exceeds the sum of the other two.
pub(crate) fn is_possible(moments: &Matrix3<f64>) -> bool {
    let principal = moments.symmetric_eigenvalues();
    let (sum, most) = (principal.sum(), principal.max());
    // The largest moment of a flat body equals the sum of the others; the tolerance allows for
    // rounded numbers.
    principal.min() > 0.0 && most <= 1.02 * (sum - most)
}

/// Returns the largest level rectangle on top, centred on the origin; `None` if all are too small
/// to hold objects.
fn surface(parts: &[Part], top_m: f64) -> Option<Surface> {
    let rectangles = parts.iter().filter_map(|part| top_rectangle(part, top_m));
    let centred = rectangles.map(|(low, high)| [0, 1].map(|axis| 2.0 * high[axis].min(-low[axis])));
    let wide =
        centred.filter(|size: &[f64; 2]| size.iter().all(|extent| *extent >= SMALLEST_SURFACE_M));
    let largest = wide.max_by(|a, b| (a[0] * a[1]).total_cmp(&(b[0] * b[1])))?;
    Some(Surface {
        height_m: top_m,
        size_m: largest,
    })
}

/// Returns the axis-aligned rectangle of a part's level top: lowest and highest x and y.
fn top_rectangle(part: &Part, top_m: f64) -> Option<([f64; 2], [f64; 2])> {
    let at = part.pose.to_isometry();
    let (low, high) = part.bounds();
    if high[2] < top_m - TOP_DEPTH_M {
        return None;
    }
    let whole = ([low[0], low[1]], [high[0], high[1]]);
    let is_upright = |axis: Vector3<f64>| (at.rotation * axis).z.abs() > 0.999;
    match &part.shape {
        Shape::Box { .. } => {
            // Each of its axes is parallel to one of the model's.
            let is_straight = |axis: Vector3<f64>| (at.rotation * axis).abs().max() > 0.999;
            [Vector3::x(), Vector3::y(), Vector3::z()]
                .into_iter()
                .all(is_straight)
                .then_some(whole)
        }
        Shape::Cylinder { radius, .. } if is_upright(Vector3::z()) => {
            // The largest square inside the disc.
            let half = radius * std::f64::consts::FRAC_1_SQRT_2;
            let [x, y, _] = part.pose.position;
            Some(([x - half, y - half], [x + half, y + half]))
        }
        Shape::Mesh { mesh } => {
            let top = mesh.top(top_m, TOP_DEPTH_M, |point| {
                (at * Point3::from(*point)).coords
            });
            let around = (top.high[0] - top.low[0]) * (top.high[1] - top.low[1]);
            (top.area > 0.0 && top.area >= FULL * around).then_some((top.low, top.high))
        }
        _ => None,
    }
}
