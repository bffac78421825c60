//! 3D geometry functions, an extension: a file that uses them must declare the prefix. Units:
//! metres and radians.

use crate::builtins::Value;
use crate::model::values::{Number, double_term};
use actcheck_base::{Term, tilt_of, yaw_of};

/// Namespace of the geometry built-ins.
pub(crate) const GEO3D: &str = "https://w3id.org/actcheck/geo3d#";

fn numbers<const N: usize>(args: &[Value<'_>]) -> Option<[f64; N]> {
    let mut out = [0.0; N];
    for (slot, arg) in out.iter_mut().zip(args) {
        *slot = Number::of(arg)?.double();
    }
    (args.len() == N).then_some(out)
}

fn finite(value: f64) -> Option<Term> {
    value.is_finite().then(|| double_term(value))
}

fn length(x: f64, y: f64, z: f64) -> f64 {
    libm::sqrt(x * x + y * y + z * z)
}

/// Distance between two points: x1, y1, z1, x2, y2, z2.
pub(super) fn distance(args: &[Value<'_>]) -> Option<Term> {
    let [x1, y1, z1, x2, y2, z2] = numbers(args)?;
    finite(length(x2 - x1, y2 - y1, z2 - z1))
}

/// Distance between two points in the plane: x1, y1, x2, y2.
pub(super) fn distance2d(args: &[Value<'_>]) -> Option<Term> {
    let [x1, y1, x2, y2] = numbers(args)?;
    finite(length(x2 - x1, y2 - y1, 0.0))
}

/// Length of a vector: x, y, z.
pub(super) fn norm(args: &[Value<'_>]) -> Option<Term> {
    let [x, y, z] = numbers(args)?;
    finite(length(x, y, z))
}

/// Dot product of two vectors: x1, y1, z1, x2, y2, z2.
pub(super) fn dot(args: &[Value<'_>]) -> Option<Term> {
    let [x1, y1, z1, x2, y2, z2] = numbers(args)?;
    finite(x1 * x2 + y1 * y2 + z1 * z2)
}

/// Angle between two vectors, in [0, π]. Returns `None` if a vector has zero length.
pub(super) fn angle(args: &[Value<'_>]) -> Option<Term> {
    let [x1, y1, z1, x2, y2, z2] = numbers(args)?;
    let (dot, cross) = (
        x1 * x2 + y1 * y2 + z1 * z2,
        length(y1 * z2 - z1 * y2, z1 * x2 - x1 * z2, x1 * y2 - y1 * x2),
    );
    let lengths = length(x1, y1, z1) * length(x2, y2, z2);
    if lengths > 0.0 {
        finite(libm::atan2(cross, dot))
    } else {
        None
    }
}

/// Signed difference from one heading to another, wrapped to (−π, π].
pub(super) fn angle_difference(args: &[Value<'_>]) -> Option<Term> {
    let [from, to] = numbers(args)?;
    let turn = libm::remainder(to - from, std::f64::consts::TAU);
    finite(if turn <= -std::f64::consts::PI {
        std::f64::consts::PI
    } else {
        turn
    })
}

/// Angle of the rotation between two unit quaternions (x, y, z, w each), in [0, π].
pub(super) fn rotation(args: &[Value<'_>]) -> Option<Term> {
    let [x1, y1, z1, w1, x2, y2, z2, w2] = numbers(args)?;
    let dot = (x1 * x2 + y1 * y2 + z1 * z2 + w1 * w2).abs();
    finite(2.0 * libm::acos(dot.min(1.0)))
}

/// Yaw of a unit quaternion's x axis about the vertical: x, y, z, w.
pub(super) fn yaw(args: &[Value<'_>]) -> Option<Term> {
    finite(yaw_of(numbers(args)?))
}

/// Angle between a unit quaternion's z axis and the vertical: x, y, z, w.
pub(super) fn tilt(args: &[Value<'_>]) -> Option<Term> {
    finite(tilt_of(numbers(args)?))
}

/// Whether a point (x, y, z) is in an axis-aligned box (min x, y, z, max x, y, z), including its
/// faces.
pub(super) fn inside_box(args: &[Value<'_>]) -> Option<Term> {
    let [x, y, z, x0, y0, z0, x1, y1, z1] = numbers(args)?;
    let inside = (x0..=x1).contains(&x) && (y0..=y1).contains(&y) && (z0..=z1).contains(&z);
    Some(Term::Boolean(inside))
}

/// Gap between two intervals; negative if they overlap.
fn gap(low1: f64, high1: f64, low2: f64, high2: f64) -> f64 {
    (low2 - high1).max(low1 - high2)
}

/// Distance between two axis-aligned boxes (min and max corner each); 0 if they overlap.
pub(super) fn box_distance(args: &[Value<'_>]) -> Option<Term> {
    let [ax0, ay0, az0, ax1, ay1, az1, bx0, by0, bz0, bx1, by1, bz1] = numbers(args)?;
    let (x, y, z) = (
        gap(ax0, ax1, bx0, bx1),
        gap(ay0, ay1, by0, by1),
        gap(az0, az1, bz0, bz1),
    );
    finite(length(x.max(0.0), y.max(0.0), z.max(0.0)))
}

/// Whether two axis-aligned boxes (min and max corner each) have a point in common.
pub(super) fn boxes_overlap(args: &[Value<'_>]) -> Option<Term> {
    let [ax0, ay0, az0, ax1, ay1, az1, bx0, by0, bz0, bx1, by1, bz1] = numbers(args)?;
    let gaps = [
        gap(ax0, ax1, bx0, bx1),
        gap(ay0, ay1, by0, by1),
        gap(az0, az1, bz0, bz1),
    ];
    Some(Term::Boolean(gaps.into_iter().all(|gap| gap <= 0.0)))
}

/// Area of the intersection of two axis-aligned rectangles: min x, y, max x, y each. Unit: m².
pub(super) fn overlap_area(args: &[Value<'_>]) -> Option<Term> {
    let [ax0, ay0, ax1, ay1, bx0, by0, bx1, by1] = numbers(args)?;
    finite((-gap(ax0, ax1, bx0, bx1)).max(0.0) * (-gap(ay0, ay1, by0, by1)).max(0.0))
}

/// Converts radians to degrees, for messages.
pub(super) fn degrees(args: &[Value<'_>]) -> Option<Term> {
    let [radians] = numbers(args)?;
    finite(radians.to_degrees())
}
