//! The simulated tree of a robot: movable links and joints.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use nalgebra::{Isometry3, Matrix3, Point3, Unit, Vector3};

use crate::RobotError;
use crate::counterweight::BalancedJoint;
use crate::gripper::Surface;
use actcheck_base::did_you_mean;
use actcheck_data::Part;
use actcheck_geometry::{BodySolids, Material, spread};

/// The type of a joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JointKind {
    /// Slides along its axis. Units: metres and newtons.
    Prismatic,
    /// Rotates about its axis. Units: radians and newton metres.
    Revolute,
}

/// A movable joint. The joint with index `i` moves the link with index `i + 1`.
#[derive(Debug, Clone)]
pub struct Joint {
    /// Name in the URDF.
    pub name: String,
    /// Type.
    pub kind: JointKind,
    /// Index of the parent link.
    pub parent: usize,
    /// Pose of the joint at position 0, in the frame of its parent link.
    pub origin: Isometry3<f64>,
    /// Axis direction in the joint's frame.
    pub axis: Unit<Vector3<f64>>,
    /// Lower limit of the position.
    pub lower: f64,
    /// Upper limit of the position.
    pub upper: f64,
    /// Largest force or torque.
    pub effort: f64,
    /// Largest velocity: the joint's limit, or less if its motor can't reach that against its
    /// viscous friction.
    pub velocity: f64,
    /// Viscous friction.
    pub damping: f64,
    /// Index of the joint that this one mimics, with factor and offset.
    pub mimic: Option<(usize, f64, f64)>,
}

/// A movable link, merged with all links fixed to it.
#[derive(Debug, Clone)]
pub struct Link {
    /// Name of the URDF link that the joint moves.
    pub name: String,
    /// Unit: kilograms.
    pub mass: f64,
    /// Centre of mass in the link's frame.
    pub com: Vector3<f64>,
    /// Inertia tensor about the centre of mass, along the link's axes. Unit: kg·m².
    pub inertia: Matrix3<f64>,
    /// Collision shapes in the link's frame.
    pub solids: Vec<Part>,
    /// The meshes that some of the shapes are pieces of, with the indices of these.
    pub(crate) materials: Vec<(Range<usize>, Arc<Material>)>,
    /// The same shapes for measurements, built when they are first needed.
    surface: OnceLock<Arc<Surface>>,
    /// The same shapes for collisions with other links.
    form: OnceLock<Arc<BodySolids>>,
    /// Points on the same shapes.
    points: Arc<Mutex<PointsBySpacing>>,
}

/// Points on a link, by the bits of their spacing: plans ask for the same few spacings again and
/// again.
type PointsBySpacing = BTreeMap<u64, Arc<[Point3<f64>]>>;

impl Link {
    /// Returns a link without mass and shapes.
    pub(crate) fn empty(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            mass: 0.0,
            com: Vector3::zeros(),
            inertia: Matrix3::zeros(),
            solids: Vec::new(),
            materials: Vec::new(),
            surface: OnceLock::new(),
            form: OnceLock::new(),
            points: Arc::default(),
        }
    }

    /// Returns points on its shapes, at most about `spacing` apart, in the link's frame. Unit:
    /// metres.
    pub(crate) fn points(&self, spacing: f64) -> Arc<[Point3<f64>]> {
        let of = |solid: &Part| {
            let pose = solid.pose.to_isometry();
            spread(&solid.shape, spacing)
                .into_iter()
                .map(move |point| pose * point)
        };
        let mut known = self.points.lock().unwrap_or_else(PoisonError::into_inner);
        Arc::clone(
            known
                .entry(spacing.to_bits())
                .or_insert_with(|| self.solids.iter().flat_map(of).collect()),
        )
    }

    /// Returns its shapes for measurements.
    pub(crate) fn surface(&self) -> Arc<Surface> {
        Arc::clone(
            self.surface
                .get_or_init(|| Arc::new(Surface::of(&self.solids))),
        )
    }

    /// Returns its shapes for collisions with other links.
    pub fn form(&self) -> Arc<BodySolids> {
        Arc::clone(
            self.form
                .get_or_init(|| Arc::new(BodySolids::new(&self.solids))),
        )
    }
}

/// The robot's links and joints. Parents come before their children.
#[derive(Debug, Clone)]
pub struct RobotModel {
    /// `links[0]` is the root.
    pub links: Vec<Link>,
    /// One less than `links`.
    pub joints: Vec<Joint>,
    /// For every URDF link: the index of the link that it was merged into, and its pose in that
    /// link's frame.
    pub(crate) frames: BTreeMap<String, (usize, Isometry3<f64>)>,
    /// For every URDF link with shapes: the link that it was merged into, and its solids there.
    pub(crate) shapes: BTreeMap<String, (usize, Range<usize>)>,
    /// Whether a joint lets the whole robot move freely: its legs or wheels are on the floor.
    pub(crate) floats: bool,
    /// The joint that the file lets lead a mechanism, by the joint that leads it here.
    pub(crate) own_leaders: BTreeMap<usize, usize>,
    /// Links that pass through each other because the file says so, with the smaller index first.
    pub(crate) passing: BTreeSet<(usize, usize)>,
    /// Names of its movable joints that are rigid here, for messages.
    pub(crate) rigid: Vec<String>,
    /// Joints that can't hold the arm's weight by their motors alone.
    pub(crate) balanced: Vec<BalancedJoint>,
    /// Names of joints with a role whose largest effort is unknown.
    pub(crate) assumed: Vec<String>,
    /// The same for those whose largest speed is 0.
    pub(crate) assumed_speeds: Vec<String>,
    /// The URDF's name, for messages.
    pub(crate) name: String,
}

impl RobotModel {
    /// Returns the index of a joint by its name.
    ///
    /// # Errors
    /// [`RobotError::Missing`] with the nearest name.
    pub fn joint(&self, joint: &str) -> Result<usize, RobotError> {
        self.joints
            .iter()
            .position(|known| known.name == joint)
            .ok_or_else(|| RobotError::Missing {
                name: self.name.clone(),
                kind: "movable joint",
                missing: joint.to_owned(),
                help: did_you_mean(
                    joint,
                    self.joints
                        .iter()
                        .map(|known| &known.name)
                        .chain(&self.rigid)
                        .map(String::as_str),
                ),
            })
    }

    /// All URDF links, each with the link that it was merged into and its pose in that link's
    /// frame, by name.
    pub(crate) fn frames(&self) -> impl Iterator<Item = (&str, &(usize, Isometry3<f64>))> {
        self.frames
            .iter()
            .map(|(name, frame)| (name.as_str(), frame))
    }

    /// All URDF links with shapes, each with the link that it was merged into and its solids there,
    /// by name.
    pub(crate) fn shapes_of_links(&self) -> impl Iterator<Item = (&str, usize, Range<usize>)> {
        self.shapes
            .iter()
            .map(|(name, (link, solids))| (name.as_str(), *link, solids.clone()))
    }

    /// Returns the index of the link that a URDF link was merged into, and its pose in that link's
    /// frame.
    ///
    /// # Errors
    /// [`RobotError::Missing`] with the nearest name.
    pub fn frame(&self, link: &str) -> Result<(usize, Isometry3<f64>), RobotError> {
        self.frames
            .get(link)
            .copied()
            .ok_or_else(|| RobotError::Missing {
                name: self.name.clone(),
                kind: "link",
                missing: link.to_owned(),
                help: did_you_mean(link, self.frames.keys().map(String::as_str)),
            })
    }
}
