//! The shapes of bodies, their bounding boxes, and the distance of a point from them.

use actcheck_data::{Part, Pose, Shape};
use nalgebra::{Isometry3, Point3, Vector3};

use crate::Value;
use crate::reader::{At, Table};

/// Reads the shapes of a body. Frame: the body's.
pub(crate) fn read(at: &At<'_>) -> Option<Vec<Part>> {
    let parts: Vec<Option<Part>> = at.list("shapes").iter().map(read_part).collect();
    matches!(at.value(), Value::List(_)).then_some(())?;
    parts.into_iter().collect()
}

fn read_part(at: &At<'_>) -> Option<Part> {
    let known = [
        "kind",
        "size",
        "radius",
        "height",
        "points",
        "radius_low",
        "radius_high",
        "wall",
        "staves",
        "position",
        "rotation",
    ];
    let table = at.table(&known);
    let length = |key| positive(&table, key);
    let kind = table.required("kind")?;
    let shape = match kind.text()? {
        "box" => Shape::Box {
            size: table.required("size")?.vector()?,
        },
        "sphere" => Shape::Sphere {
            radius: length("radius")?,
        },
        "cylinder" => Shape::Cylinder {
            radius: length("radius")?,
            height: length("height")?,
        },
        "capsule" => Shape::Capsule {
            radius: length("radius")?,
            height: length("height")?,
        },
        "tube" => Shape::Tube {
            radius_low: length("radius_low")?,
            radius_high: length("radius_high")?,
            wall: length("wall")?,
            height: length("height")?,
            staves: staves(&table)?,
        },
        "hull" => hull(&table)?,
        _ => {
            let help = "write `box`, `sphere`, `cylinder`, `capsule`, `tube` or `hull`";
            kind.fault("J002", "it is not a kind of shape", help);
            return None;
        }
    };
    let position = table.get("position").map(|at| at.vector());
    let rotation = table.get("rotation").map(|at| at.rotation());
    Some(Part {
        pose: Pose {
            position: position.unwrap_or(Some(Pose::IDENTITY.position))?,
            rotation: rotation.unwrap_or(Some(Pose::IDENTITY.rotation))?,
        },
        shape,
    })
}

fn positive<'v>(table: &Table<'v>, key: &'v str) -> Option<f64> {
    let at = table.required(key)?;
    let length = at.amount()?;
    if length == 0.0 {
        at.fault("J002", "it must be greater than 0", "");
        return None;
    }
    Some(length)
}

/// The most boxes of which a tube is made.
const MOST_STAVES: u32 = 1_000;

fn staves(table: &Table<'_>) -> Option<u32> {
    let at = table.required("staves")?;
    let number = at.number()?;
    let staves = (3..=MOST_STAVES).find(|count| f64::from(*count) == number);
    if staves.is_none() {
        let message = format!("it must be a whole number from 3 to {MOST_STAVES}");
        at.fault("J002", &message, "");
    }
    staves
}

fn hull(table: &Table<'_>) -> Option<Shape> {
    let at = table.required("points")?;
    let points: Option<Vec<[f64; 3]>> = at.list("points").iter().map(At::vector).collect();
    let points = points?;
    if points.is_empty() {
        at.fault("J002", "a hull needs points", "");
        return None;
    }
    // The volume is for masses, which are given.
    Some(Shape::Hull {
        points,
        volume: 0.0,
    })
}

/// Returns the lowest and the highest corner of the box around a body. Unit: metres. Frame: world.
/// Returns `None` without parts.
pub(crate) fn bounds(parts: &[Part], pose: &Pose) -> Option<[[f64; 3]; 2]> {
    let at = pose.to_isometry();
    let placed = parts.iter().map(|part| Part {
        pose: Pose::from_isometry(&(at * part.pose.to_isometry())),
        shape: part.shape.clone(),
    });
    placed
        .map(|part| part.bounds())
        .map(|(low, high)| [low, high])
        .reduce(|[low, high], [lower, higher]| {
            let least = std::array::from_fn(|axis| f64::min(low[axis], lower[axis]));
            let most = std::array::from_fn(|axis| f64::max(high[axis], higher[axis]));
            [least, most]
        })
}

/// Returns the size of a body along its own axes. Unit: metres.
pub(crate) fn size(parts: &[Part]) -> Option<[f64; 3]> {
    let [low, high] = bounds(parts, &Pose::IDENTITY)?;
    Some(std::array::from_fn(|axis| high[axis] - low[axis]))
}

/// Returns the distance of a point from the surface of a body; negative inside. Unit: metres. Frame
/// of the point: world. Returns `None` without parts, and for hulls, whose faces are not known.
pub(crate) fn distance(parts: &[Part], pose: &Pose, point: [f64; 3]) -> Option<f64> {
    let from_world = pose.to_isometry().inverse();
    let point = from_world * Point3::from(point);
    parts
        .iter()
        .flat_map(Part::solids)
        .map(|part| distance_to(&part, &point))
        .reduce(|nearest, other| Some(f64::min(nearest?, other?)))
        .flatten()
}

fn distance_to(part: &Part, point: &Point3<f64>) -> Option<f64> {
    let at: Isometry3<f64> = part.pose.to_isometry();
    let point = at.inverse_transform_point(point).coords;
    match &part.shape {
        Shape::Box { size } => Some(outside(&(point.abs() - Vector3::from(*size) / 2.0))),
        Shape::Sphere { radius } => Some(point.norm() - radius),
        Shape::Cylinder { radius, height } => {
            let aside = point.xy().norm() - radius;
            let above = point.z.abs() - height / 2.0;
            Some(outside(&Vector3::new(aside, above, f64::NEG_INFINITY)))
        }
        Shape::Capsule { radius, height } => {
            let along = point.z.clamp(-height / 2.0, height / 2.0);
            Some((point - Vector3::new(0.0, 0.0, along)).norm() - radius)
        }
        Shape::Tube { .. } | Shape::Mesh { .. } | Shape::Hull { .. } => None,
    }
}

/// Returns the distance from a solid with these distances beyond its sides, which are at right
/// angles to each other.
fn outside(beyond: &Vector3<f64>) -> f64 {
    let way = beyond.sup(&Vector3::zeros()).norm();
    if way > 0.0 { way } else { beyond.max() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_exact_outside_and_inside() {
        let part = |shape| Part {
            pose: Pose {
                position: [1.0, 0.0, 0.0],
                ..Pose::IDENTITY
            },
            shape,
        };
        let size = [0.2, 0.4, 0.6];
        let (radius, height) = (0.1, 0.6);
        for (shape, point, wanted) in [
            (Shape::Box { size }, [1.0, 0.0, 0.0], -0.1),
            (Shape::Box { size }, [1.4, 0.6, 0.0], 0.5),
            (Shape::Box { size }, [1.0, 0.15, 0.0], -0.05),
            (Shape::Sphere { radius }, [1.0, 0.3, 0.4], 0.4),
            (Shape::Cylinder { radius, height }, [1.0, 0.4, 0.7], 0.5),
            (Shape::Cylinder { radius, height }, [1.0, 0.0, 0.28], -0.02),
            (Shape::Capsule { radius, height }, [1.0, 0.3, 0.7], 0.4),
        ] {
            let found = distance(&[part(shape.clone())], &Pose::IDENTITY, point);
            assert!(
                found.is_some_and(|found| (found - wanted).abs() < 1e-12),
                "{shape:?}: {found:?}"
            );
        }
    }
}
