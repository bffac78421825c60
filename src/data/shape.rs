//! Shapes that models are made of.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::{Mesh, Pose};

/// One shape of a model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Part {
    /// Pose of the shape's centre. Frame: the model's.
    pub pose: Pose,
    /// Geometry of the shape.
    pub shape: Shape,
}

/// The geometry of a part. Unit: metres.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Shape {
    /// A box by its full extents.
    Box {
        /// x, y, z.
        size: [f64; 3],
    },
    /// A cylinder about z.
    Cylinder {
        /// Radius.
        radius: f64,
        /// Full height.
        height: f64,
    },
    /// A sphere.
    Sphere {
        /// Radius.
        radius: f64,
    },
    /// A hollow wall about z, open above and below, as of a glass. Built from `staves` boxes.
    Tube {
        /// Outer radius at the lower rim.
        radius_low: f64,
        /// Outer radius at the upper rim.
        radius_high: f64,
        /// Thickness of the wall.
        wall: f64,
        /// Full height.
        height: f64,
        /// Number of boxes that approximate the wall.
        staves: u32,
    },
    /// A cylinder about z with a hemisphere on each end.
    Capsule {
        /// Radius of cylinder and hemispheres.
        radius: f64,
        /// Height of the cylinder, without the hemispheres.
        height: f64,
    },
    /// A closed mesh, not yet decomposed into convex solids. Code that needs a solid uses its
    /// convex hull.
    Mesh {
        /// The mesh.
        mesh: Mesh,
    },
    /// A convex hull of points: one piece of a decomposed mesh.
    Hull {
        /// Corners.
        points: Vec<[f64; 3]>,
        /// Unit: cubic metres.
        volume: f64,
    },
}

impl Shape {
    /// Volume of the material. Unit: cubic metres.
    pub fn volume(&self) -> f64 {
        use std::f64::consts::PI;
        match self {
            Self::Box { size: [x, y, z] } => x * y * z,
            Self::Cylinder { radius, height } => PI * radius * radius * height,
            Self::Sphere { radius } => 4.0 / 3.0 * PI * radius * radius * radius,
            Self::Capsule { radius, height } => {
                PI * radius * radius * (height + 4.0 / 3.0 * radius)
            }
            Self::Mesh { mesh } => mesh.volume(),
            Self::Hull { volume, .. } => *volume,
            Self::Tube { .. } => self.staves().iter().map(|stave| stave.shape.volume()).sum(),
        }
    }

    /// Returns the boxes of a tube in its own frame, or an empty list for other shapes.
    ///
    /// The outer edges of the boxes lie on the tube's outer radius, so the boxes never exceed it.
    pub(crate) fn staves(&self) -> Vec<Part> {
        let Self::Tube {
            radius_low,
            radius_high,
            wall,
            height,
            staves,
        } = *self
        else {
            return Vec::new();
        };
        let half_angle = std::f64::consts::PI / f64::from(staves);
        let slant = libm::atan2(radius_high - radius_low, height);
        let middle = (radius_low + radius_high) / 2.0;
        let width = 2.0 * middle * libm::sin(half_angle);
        let reach = middle * libm::cos(half_angle) - wall / 2.0;
        let size = [wall, width, height / libm::cos(slant)];
        let leaning = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), slant);
        (0..staves)
            .map(|idx| {
                let turned = UnitQuaternion::from_axis_angle(
                    &Vector3::z_axis(),
                    2.0 * half_angle * f64::from(idx),
                );
                let at = Isometry3::from_parts(
                    Translation3::from(turned * Vector3::new(reach, 0.0, 0.0)),
                    turned * leaning,
                );
                Part {
                    pose: Pose::from_isometry(&at),
                    shape: Self::Box { size },
                }
            })
            .collect()
    }
}

impl Shape {
    /// Scales the shape uniformly.
    #[must_use]
    pub fn sized(&self, by: f64) -> Self {
        match self {
            Self::Box { size } => Self::Box {
                size: size.map(|extent| extent * by),
            },
            Self::Cylinder { radius, height } => Self::Cylinder {
                radius: radius * by,
                height: height * by,
            },
            Self::Sphere { radius } => Self::Sphere {
                radius: radius * by,
            },
            Self::Capsule { radius, height } => Self::Capsule {
                radius: radius * by,
                height: height * by,
            },
            Self::Tube {
                radius_low,
                radius_high,
                wall,
                height,
                staves,
            } => Self::Tube {
                radius_low: radius_low * by,
                radius_high: radius_high * by,
                wall: wall * by,
                height: height * by,
                staves: *staves,
            },
            Self::Mesh { .. } | Self::Hull { .. } => self.scaled([by; 3]),
        }
    }

    /// Scales each axis of a mesh or hull; returns other shapes unchanged.
    #[must_use]
    pub fn scaled(&self, scale: [f64; 3]) -> Self {
        match self {
            Self::Mesh { mesh } => Self::Mesh {
                mesh: mesh.scaled(scale),
            },
            Self::Hull { points, volume } => {
                let [x, y, z] = scale;
                let points = points
                    .iter()
                    .map(|point| [point[0] * x, point[1] * y, point[2] * z])
                    .collect();
                Self::Hull {
                    points,
                    volume: volume * (x * y * z).abs(),
                }
            }
            other => other.clone(),
        }
    }
}

impl Part {
    /// Returns the axis-aligned bounding box in the model's frame: lowest and highest corner.
    pub fn bounds(&self) -> ([f64; 3], [f64; 3]) {
        bounds_of(&self.shape, &self.pose.to_isometry())
    }

    /// Returns the axis-aligned bounding box in the frame of this pose of the model.
    pub fn bounds_at(&self, model: &Isometry3<f64>) -> ([f64; 3], [f64; 3]) {
        bounds_of(&self.shape, &(model * self.pose.to_isometry()))
    }
}

fn bounds_of(shape: &Shape, at: &Isometry3<f64>) -> ([f64; 3], [f64; 3]) {
    let centre = at.translation.vector;
    // Extents along the frame's axes of a unit segment along the shape's z axis, and of a unit
    // disc across it.
    let along = (at.rotation * Vector3::z()).abs();
    let across = along.map(|cosine| (1.0 - cosine * cosine).max(0.0).sqrt());
    let reach = match shape {
        Shape::Box { size } => {
            at.rotation.to_rotation_matrix().matrix().abs() * (Vector3::from(*size) / 2.0)
        }
        Shape::Cylinder { radius, height } => along * (height / 2.0) + across * *radius,
        Shape::Sphere { radius } => Vector3::repeat(*radius),
        Shape::Capsule { radius, height } => along * (height / 2.0) + Vector3::repeat(*radius),
        Shape::Tube {
            radius_low,
            radius_high,
            height,
            ..
        } => along * (height / 2.0) + across * radius_low.max(*radius_high),
        Shape::Mesh { mesh } => return around(at, &mesh.vertices),
        Shape::Hull { points, .. } => return around(at, points),
    };
    ((centre - reach).into(), (centre + reach).into())
}

fn around(at: &Isometry3<f64>, points: &[[f64; 3]]) -> ([f64; 3], [f64; 3]) {
    let (mut low, mut high) = (
        Vector3::repeat(f64::INFINITY),
        Vector3::repeat(f64::NEG_INFINITY),
    );
    for point in points {
        let point = (at * Point3::from(*point)).coords;
        (low, high) = (low.inf(&point), high.sup(&point));
    }
    (low.into(), high.into())
}

/// Returns the bounding box of several parts; inverted (infinite lows, negative infinite highs) if
/// there are none.
pub fn bounds(parts: &[Part]) -> (Vector3<f64>, Vector3<f64>) {
    let nothing = (
        Vector3::repeat(f64::INFINITY),
        Vector3::repeat(f64::NEG_INFINITY),
    );
    parts.iter().fold(nothing, |(low, high), part| {
        let (lowest, highest) = part.bounds();
        (
            low.inf(&Vector3::from(lowest)),
            high.sup(&Vector3::from(highest)),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bounding_box_of_a_lying_cylinder_is_exact() {
        let lying = Isometry3::from_parts(
            Translation3::new(1.0, 0.0, 0.0),
            UnitQuaternion::from_euler_angles(std::f64::consts::FRAC_PI_2, 0.0, 0.0),
        );
        let part = Part {
            pose: Pose::from_isometry(&lying),
            shape: Shape::Cylinder {
                radius: 0.1,
                height: 1.0,
            },
        };
        let (low, high) = part.bounds();
        for (found, expected) in low
            .into_iter()
            .chain(high)
            .zip([0.9, -0.5, -0.1, 1.1, 0.5, 0.1])
        {
            assert!((found - expected).abs() < 1e-9, "{low:?} {high:?}");
        }
    }
}
