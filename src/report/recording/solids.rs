//! Draws bodies with the viewer's own solids, and with a mesh for all other shapes.

use nalgebra::{Isometry3, Point3, Translation3};
use re_sdk_types::AsComponents;
use re_sdk_types::archetypes::{Boxes3D, Capsules3D, Cylinders3D, Ellipsoids3D};
use re_sdk_types::components::{Color, FillMode};
use re_sdk_types::datatypes::Quaternion;

use crate::faces::{faces, tube};
use crate::look::Look;
use crate::recording::mesh::Mesh;
use actcheck_data::{BodyState, Part, Pose, Shape};

/// Solids of one kind: sizes, centres and orientations. Frame: body.
#[derive(Debug)]
struct Solids<const N: usize> {
    sizes: Vec<[f32; N]>,
    middles: Vec<[f32; 3]>,
    turns: Vec<Quaternion>,
}

impl<const N: usize> Default for Solids<N> {
    fn default() -> Self {
        Self {
            sizes: Vec::new(),
            middles: Vec::new(),
            turns: Vec::new(),
        }
    }
}

impl<const N: usize> Solids<N> {
    fn add(&mut self, at: &Isometry3<f64>, size: [f64; N]) {
        self.sizes.push(size.map(|value| value as f32));
        self.middles.push(position(at));
        self.turns.push(turn(at));
    }

    fn column(&self, idx: usize) -> Vec<f32> {
        self.sizes
            .iter()
            .filter_map(|size| size.get(idx).copied())
            .collect()
    }
}

/// Parts of a body, by kind of solid.
#[derive(Debug, Default)]
pub(super) struct Drawn {
    boxes: Solids<3>,
    cylinders: Solids<2>,
    capsules: Solids<2>,
    spheres: Solids<1>,
    mesh: Mesh,
}

impl Drawn {
    /// Draws the parts of a body.
    pub fn of(parts: &[Part]) -> Self {
        let mut drawn = Self::default();
        parts.iter().for_each(|part| drawn.add(part));
        drawn
    }

    /// Draws the bounding box of a body without a shape. Frame: world axes, relative to the body's
    /// origin.
    pub fn around(body: &BodyState) -> Self {
        let middle = [0, 1, 2].map(|axis| {
            f64::midpoint(body.aabb_max[axis], body.aabb_min[axis]) - body.pose.position[axis]
        });
        let mut drawn = Self::default();
        drawn.box_at(
            &Pose {
                position: middle,
                ..Pose::IDENTITY
            },
            [0, 1, 2].map(|axis| body.aabb_max[axis] - body.aabb_min[axis]),
        );
        drawn
    }

    /// Adds a box, given the pose of its centre.
    pub fn box_at(&mut self, pose: &Pose, size: [f64; 3]) {
        self.boxes.add(&pose.to_isometry(), size);
    }

    fn add(&mut self, part: &Part) {
        let at = part.pose.to_isometry();
        match &part.shape {
            Shape::Box { size } => self.boxes.add(&at, *size),
            Shape::Cylinder { radius, height } => self.cylinders.add(&at, [*height, *radius]),
            // The origin of the viewer's capsules is the centre of their lower hemisphere.
            Shape::Capsule { radius, height } => {
                self.capsules.add(
                    &(at * Translation3::new(0.0, 0.0, -height / 2.0)),
                    [*height, *radius],
                );
            }
            Shape::Sphere { radius } => self.spheres.add(&at, [*radius]),
            Shape::Tube {
                radius_low,
                radius_high,
                wall,
                height,
                ..
            } => {
                self.mesh
                    .add(&tube(*radius_low, *radius_high, *wall, *height), &at);
            }
            Shape::Hull { points, .. } => self.mesh.add(&faces(points), &at),
            // Traces only contain the outermost points of a mesh.
            Shape::Mesh { mesh } => self.mesh.add(&faces(&mesh.vertices), &at),
        }
    }

    /// Returns the boxes as wireframes, for objects that are not physically present (percepts).
    pub fn boxes(self, look: Look) -> Boxes3D {
        let fill = if look.filled {
            FillMode::Solid
        } else {
            FillMode::MajorWireframe
        };
        Boxes3D::from_centers_and_sizes(self.boxes.middles, self.boxes.sizes)
            .with_quaternions(self.boxes.turns)
            .with_colors([Color::from(look.rgba)])
            .with_fill_mode(fill)
    }

    /// Returns the components to record.
    pub fn recorded(mut self, look: Look) -> Vec<Box<dyn AsComponents>> {
        let fill = if look.filled {
            FillMode::Solid
        } else {
            FillMode::MajorWireframe
        };
        let colour = [Color::from(look.rgba)];
        let mut all: Vec<Box<dyn AsComponents>> = Vec::new();
        let Self {
            cylinders,
            capsules,
            spheres,
            ..
        } = &self;
        if !cylinders.sizes.is_empty() {
            let made =
                Cylinders3D::from_lengths_and_radii(cylinders.column(0), cylinders.column(1));
            let placed = made
                .with_centers(cylinders.middles.clone())
                .with_quaternions(cylinders.turns.clone());
            all.push(Box::new(placed.with_colors(colour).with_fill_mode(fill)));
        }
        if !capsules.sizes.is_empty() {
            let made = Capsules3D::from_lengths_and_radii(capsules.column(0), capsules.column(1));
            let placed = made
                .with_translations(capsules.middles.clone())
                .with_quaternions(capsules.turns.clone());
            all.push(Box::new(placed.with_colors(colour).with_fill_mode(fill)));
        }
        if !spheres.sizes.is_empty() {
            let made =
                Ellipsoids3D::from_centers_and_radii(spheres.middles.clone(), spheres.column(0));
            all.push(Box::new(made.with_colors(colour).with_fill_mode(fill)));
        }
        if let Some(mesh) = std::mem::take(&mut self.mesh).drawn(look.rgba) {
            all.push(Box::new(mesh));
        }
        if !self.boxes.sizes.is_empty() {
            all.push(Box::new(self.boxes(look)));
        }
        all
    }
}

/// Unit: metres.
fn position(at: &Isometry3<f64>) -> [f32; 3] {
    (at * Point3::origin())
        .coords
        .map(|value| value as f32)
        .into()
}

fn turn(at: &Isometry3<f64>) -> Quaternion {
    Quaternion::from_xyzw(at.rotation.coords.map(|value| value as f32).into())
}
