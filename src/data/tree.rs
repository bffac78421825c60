//! The typed tree of a model file: every reader of robots yields it, whatever the format.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Matrix3, Vector3};

use crate::{Colour, Mesh, Shape};
use actcheck_base::SourceSpan;

/// The links and joints of a model, as its file states them. Names of links and of joints are
/// unique.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ModelTree {
    /// Name of the model.
    pub name: String,
    /// Links in the file's order.
    pub links: Vec<TreeLink>,
    /// Joints in the file's order.
    pub joints: Vec<TreeJoint>,
    /// Pairs of links that pass through each other because the file says so.
    pub passing: Vec<[String; 2]>,
    /// Meshes that the file itself contains, by the names under which shapes refer to them.
    pub inline_meshes: BTreeMap<String, Mesh>,
}

/// A link: a rigid body, or a frame if it has neither mass nor shapes.
#[derive(Debug, Clone, PartialEq)]
pub struct TreeLink {
    /// Name.
    pub name: String,
    /// Its mass as the file states it.
    pub inertial: Option<TreeInertial>,
    /// Shapes that collide.
    pub solids: Vec<TreeSolid>,
    /// Shapes that are only seen.
    pub visuals: Vec<TreeSolid>,
    /// The element of the link.
    pub place: SourceSpan,
}

/// The mass of a link. Frame: the link's.
#[derive(Debug, Clone, PartialEq)]
pub struct TreeInertial {
    /// Pose of the frame along whose axes the moments are; its origin is the centre of mass.
    pub pose: Isometry3<f64>,
    /// Unit: kilograms.
    pub kg: f64,
    /// Inertia tensor about the centre of mass, along the axes of `pose`. Unit: kg·m².
    pub about_com: Matrix3<f64>,
    /// The element that states the mass.
    pub place: SourceSpan,
    /// The element that states the moments.
    pub moments_place: Option<SourceSpan>,
}

/// A shape of a link.
#[derive(Debug, Clone, PartialEq)]
pub struct TreeSolid {
    /// Pose of its middle, or of the origin of its mesh. Frame: the link's.
    pub pose: Isometry3<f64>,
    /// Form and size.
    pub geometry: TreeGeometry,
    /// The basis of its share in the mass of a link without `inertial`; `None` if it has none.
    pub matter: Option<Matter>,
    /// Sliding friction coefficient.
    pub friction: Option<f64>,
    /// The colour that the model's file gives it.
    pub colour: Option<TreeColour>,
    /// The element of the shape.
    pub place: SourceSpan,
}

/// The colour of a shape.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TreeColour {
    /// The colour of all of it.
    Whole(Colour),
    /// The colour of parts without one of their own in the file of a mesh.
    Rest(Colour),
    /// It is invisible.
    Clear,
}

/// The basis of a mass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Matter {
    /// How much of it there is.
    pub amount: Amount,
    /// Where it is.
    pub spread: Spread,
}

/// The amount of a mass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Amount {
    /// Unit: kilograms.
    Mass(f64),
    /// Unit: kg/m³, or kg/m² of a surface.
    Density(f64),
}

/// The parts of a shape that a mass is spread over.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Spread {
    /// All of it. In a mesh, triangles that are turned inwards count as the others.
    #[default]
    Inside,
    /// As [`Spread::Inside`], but triangles of a mesh that are turned inwards count as hollows.
    Exact,
    /// The convex hull of a mesh.
    Hull,
    /// Its surface.
    Shell,
}

/// Form and size of a shape. Unit: metres.
#[derive(Debug, Clone, PartialEq)]
pub enum TreeGeometry {
    /// A box.
    Box {
        /// Full extents along x, y, z.
        size: [f64; 3],
    },
    /// A cylinder about z.
    Cylinder {
        /// Radius.
        radius: f64,
        /// Full height.
        length: f64,
    },
    /// A sphere.
    Sphere {
        /// Radius.
        radius: f64,
    },
    /// A cylinder about z with a hemisphere on each end.
    Capsule {
        /// Radius of cylinder and hemispheres.
        radius: f64,
        /// Height of the cylinder, without the hemispheres.
        length: f64,
    },
    /// An ellipsoid.
    Ellipsoid {
        /// Half axes along x, y, z.
        radii: [f64; 3],
    },
    /// A mesh.
    Mesh {
        /// Its file as the model names it, or a name in [`ModelTree::inline_meshes`].
        file: String,
        /// Factors along x, y, z.
        scale: [f64; 3],
    },
}

/// The kind of motion of a joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TreeMotion {
    /// It does not move.
    Fixed,
    /// It turns about its axis within limits.
    Revolute,
    /// It turns about its axis without limits.
    Continuous,
    /// It slides along its axis.
    Prismatic,
    /// It moves the whole model over the floor.
    Planar,
    /// It moves the whole model freely.
    Floating,
    /// Another kind, which has been reported as a fault.
    Unknown,
}

/// A joint between two links.
#[derive(Debug, Clone, PartialEq)]
pub struct TreeJoint {
    /// Name.
    pub name: String,
    /// Its kind of motion.
    pub motion: TreeMotion,
    /// Name of the link that carries it.
    pub parent: String,
    /// Name of the link that it moves.
    pub child: String,
    /// Pose of the child link at position 0. Frame: the parent link's.
    pub origin: Isometry3<f64>,
    /// Direction of the motion. Frame: the child link's. Its length is not 0.
    pub axis: Vector3<f64>,
    /// Lower limit. Unit: metres or radians.
    pub lower: f64,
    /// Upper limit. Unit: metres or radians.
    pub upper: f64,
    /// Largest force or torque; 0 if it is unknown. Unit: newtons or newton metres.
    pub effort: f64,
    /// Largest velocity; 0 if it is unknown. Unit: m/s or rad/s.
    pub velocity: f64,
    /// Viscous friction. Unit: N·s/m or N·m·s/rad.
    pub damping: f64,
    /// Dry friction. Unit: newtons or newton metres.
    pub friction: f64,
    /// The joint that it follows.
    pub mimic: Option<TreeMimic>,
    /// The element of the joint.
    pub place: SourceSpan,
}

/// A coupling: a joint is at `factor` times the position of its leader plus `offset`.
#[derive(Debug, Clone, PartialEq)]
pub struct TreeMimic {
    /// Name of the joint that leads.
    pub leader: String,
    /// Units of the follower per unit of the leader.
    pub factor: f64,
    /// Position of the follower where the leader is at 0. Unit: metres or radians.
    pub offset: f64,
    /// The element that states the coupling.
    pub place: SourceSpan,
}

/// Number of points around an ellipsoid; from pole to pole, it has half as many.
const AROUND: u32 = 24;

impl TreeGeometry {
    /// Returns the shape of a primitive; `None` for a mesh. An ellipsoid is the hull of points on
    /// it.
    pub fn solid(&self) -> Option<Shape> {
        Some(match self {
            Self::Box { size } => Shape::Box { size: *size },
            Self::Cylinder { radius, length } => Shape::Cylinder {
                radius: *radius,
                height: *length,
            },
            Self::Sphere { radius } => Shape::Sphere { radius: *radius },
            Self::Capsule { radius, length } => Shape::Capsule {
                radius: *radius,
                height: *length,
            },
            Self::Ellipsoid { radii } => ellipsoid(*radii),
            Self::Mesh { .. } => return None,
        })
    }
}

fn ellipsoid(radii: [f64; 3]) -> Shape {
    use std::f64::consts::PI;
    let rings = AROUND / 2;
    let mut points = vec![[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
    for ring in 1..rings {
        let polar = PI * f64::from(ring) / f64::from(rings);
        points.extend((0..AROUND).map(|step| {
            let angle = 2.0 * PI * f64::from(step) / f64::from(AROUND);
            let across = libm::sin(polar);
            [
                across * libm::cos(angle),
                across * libm::sin(angle),
                libm::cos(polar),
            ]
        }));
    }
    let scaled = |point: [f64; 3]| [0, 1, 2].map(|axis| point[axis] * radii[axis]);
    Shape::Hull {
        points: points.into_iter().map(scaled).collect(),
        volume: 4.0 / 3.0 * PI * radii.iter().product::<f64>(),
    }
}

impl TreeMotion {
    /// Whether the joint can move one link relative to another.
    pub fn moves(self) -> bool {
        matches!(
            self,
            Self::Revolute | Self::Continuous | Self::Prismatic | Self::Unknown
        )
    }
}

impl TreeLink {
    /// A link without mass and shapes.
    pub fn frame(name: String, place: SourceSpan) -> Self {
        Self {
            name,
            inertial: None,
            solids: Vec::new(),
            visuals: Vec::new(),
            place,
        }
    }
}

impl TreeJoint {
    /// A joint that fixes a link to another at a pose in its frame.
    pub fn fixed(
        name: String,
        [parent, child]: [&str; 2],
        origin: Isometry3<f64>,
        place: SourceSpan,
    ) -> Self {
        Self {
            name,
            motion: TreeMotion::Fixed,
            parent: parent.to_owned(),
            child: child.to_owned(),
            origin,
            axis: Vector3::x(),
            lower: 0.0,
            upper: 0.0,
            effort: 0.0,
            velocity: 0.0,
            damping: 0.0,
            friction: 0.0,
            mimic: None,
            place,
        }
    }
}

impl ModelTree {
    /// Returns a link by its name.
    pub fn link(&self, name: &str) -> Option<&TreeLink> {
        self.links.iter().find(|link| link.name == name)
    }

    /// Returns a joint by its name.
    pub fn joint(&self, name: &str) -> Option<&TreeJoint> {
        self.joints.iter().find(|joint| joint.name == name)
    }
}
