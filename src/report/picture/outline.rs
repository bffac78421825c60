//! Outlines of bodies in a view: the convex hull of each part.

use std::f64::consts::{PI, TAU};

use nalgebra::{Isometry3, Point3};

use crate::picture::window::{Bounds, Window};
use actcheck_data::{Part, Shape, convex_hull};

/// Number of corners that approximate a circle.
const AROUND: u32 = 28;

/// Silhouette of a body: one polygon for each part. Unit: pixels.
pub(super) fn silhouette(
    parts: &[Part],
    pose: &Isometry3<f64>,
    window: &Window,
) -> Vec<Vec<[f64; 2]>> {
    let seen = parts.iter().map(|part| {
        let placed = pose * part.pose.to_isometry();
        convex_hull(
            corners(&part.shape)
                .iter()
                .map(|corner| window.pixel((placed * corner).coords.into())),
        )
    });
    seen.filter(|polygon| polygon.len() > 2).collect()
}

/// The box around some shapes at a pose; `None` if there are none. Frame: world.
pub(super) fn bounds_of(parts: &[Part], pose: &Isometry3<f64>) -> Option<Bounds> {
    let points = parts.iter().flat_map(|part| {
        let placed = pose * part.pose.to_isometry();
        corners(&part.shape)
            .into_iter()
            .map(move |corner| Bounds::point((placed * corner).coords.into()))
    });
    Bounds::union(points)
}

/// Number of corners of a round shape in each of the circles that they are on.
pub(super) const fn corners_around() -> usize {
    AROUND as usize
}

/// Points whose convex hull is the shape, within a few percent. Frame: shape.
pub(super) fn corners(shape: &Shape) -> Vec<Point3<f64>> {
    match shape {
        Shape::Box { size } => {
            let [x, y, z] = size.map(|extent| extent / 2.0);
            let signs = [-1.0, 1.0];
            let pairs = signs.iter().flat_map(|a| signs.iter().map(move |b| (a, b)));
            pairs
                .flat_map(|(a, b)| signs.iter().map(move |c| Point3::new(x * a, y * b, z * c)))
                .collect()
        }
        Shape::Cylinder { radius, height } => {
            rings([(*radius, -height / 2.0), (*radius, height / 2.0)])
        }
        Shape::Tube {
            radius_low,
            radius_high,
            height,
            ..
        } => rings([(*radius_low, -height / 2.0), (*radius_high, height / 2.0)]),
        Shape::Sphere { radius } => {
            rings(latitudes().map(|(cos, sin)| (radius * cos, radius * sin)))
        }
        Shape::Capsule { radius, height } => {
            let ends = [-height / 2.0, height / 2.0];
            rings(ends.into_iter().flat_map(|end| {
                latitudes().map(move |(cos, sin)| (radius * cos, end + radius * sin))
            }))
        }
        Shape::Hull { points, .. } => points.iter().map(|point| Point3::from(*point)).collect(),
        // Traces contain no meshes: see `Form`.
        Shape::Mesh { .. } => Vec::new(),
    }
}

/// Cosines and sines of the latitudes, from pole to pole.
fn latitudes() -> impl Iterator<Item = (f64, f64)> {
    (0..=8)
        .map(|step| PI * (f64::from(step) / 8.0 - 0.5))
        .map(|angle| (libm::cos(angle), libm::sin(angle)))
}

/// Points on circles around z, given their radii and heights.
fn rings(circles: impl IntoIterator<Item = (f64, f64)>) -> Vec<Point3<f64>> {
    let turns = || (0..AROUND).map(|idx| TAU * f64::from(idx) / f64::from(AROUND));
    let ring = |(radius, z)| {
        turns().map(move |a| Point3::new(radius * libm::cos(a), radius * libm::sin(a), z))
    };
    circles.into_iter().flat_map(ring).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_span_the_extent_of_the_shape() {
        let reach = |shape: &Shape| {
            corners(shape)
                .iter()
                .map(|point| point.coords.abs().max())
                .fold(0.0, f64::max)
        };
        let expected = [
            (
                Shape::Box {
                    size: [0.2, 0.4, 0.6],
                },
                0.3,
            ),
            (
                Shape::Cylinder {
                    radius: 0.4,
                    height: 0.2,
                },
                0.4,
            ),
            (Shape::Sphere { radius: 0.25 }, 0.25),
            (
                Shape::Capsule {
                    radius: 0.1,
                    height: 0.4,
                },
                0.3,
            ),
        ];
        for (shape, far) in expected {
            assert!(
                (reach(&shape) - far).abs() < 1e-12,
                "{shape:?}: {}",
                reach(&shape)
            );
        }
    }
}
