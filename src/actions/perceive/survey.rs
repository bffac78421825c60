//! A second look at a known surface: its exact pose and the objects on it.

use nalgebra::{Point3, Vector3};

use crate::memory::{furniture, sighting};
use crate::operator::{Interrupt, Operator};
use crate::perceive::interpret::Surface;
use crate::perceive::sight::Sight;
use actcheck_data::{KnownKind, PerceivedPlane, PerceivedThing, Pose};
use actcheck_world::Sighting;

/// Largest number of pictures.
const MOST_VIEWS: usize = 5;
/// How far the surface may extend beyond its expected outline, and differ from its expected height.
/// Unit: metres. The position error that a heading error causes on a map, and three times a
/// detector's noise.
const OFF_M: f64 = 0.15;
/// An object seen farther from its expected position is a different one. Unit: metres. Twice the
/// correction of the belief after a few metres of driving.
const ASTRAY_M: f64 = 0.25;

/// A surface as perceived, and the objects on it.
pub struct Survey {
    /// The surface.
    pub plane: PerceivedPlane,
    /// The objects on it.
    pub things: Vec<Sighting>,
}

impl Survey {
    /// A survey from a piece of furniture that was seen as a whole: its top, and all known objects.
    pub fn of(furniture: &Sighting, things: Vec<Sighting>) -> Self {
        let [x, y, z] = furniture.pose.position;
        let [width, depth, height] = furniture.size_m;
        let pose = Pose::upright([x, y, z + height], furniture.pose.yaw());
        Self {
            plane: PerceivedPlane {
                pose,
                size_m: [width, depth],
            },
            things,
        }
    }
}

/// Looks at a surface that should be the top of a piece of furniture. Returns `None` if no surface
/// is found.
///
/// # Errors
/// [`Interrupt`] if the action has to end.
pub fn survey(expected: &Sighting, robot: &mut Operator<'_>) -> Result<Option<Survey>, Interrupt> {
    let mut sight = Sight::default();
    let find = |points: &[Point3<f64>]| Surface::find(&near(points, expected));
    let mut found = None;
    for point in places(expected) {
        robot.begin("look at the surface");
        sight.add_look_at(&point, robot)?;
        found = find(&sight.points);
        if found.is_some() {
            break;
        }
    }
    let Some(surface) = found else {
        return Ok(None);
    };
    let surface = sight.take_in(surface, MOST_VIEWS, find, robot)?;
    let things = surface.things(&sight.points, &sight.eye(), robot.known_kinds());
    let things = things
        .iter()
        .enumerate()
        .map(|(idx, thing)| sighting(format!("thing_{}", idx + 1), thing));
    Ok(Some(Survey {
        plane: surface.perceived(),
        things: things.collect(),
    }))
}

/// Looks once more at an object on a surface and returns its current pose by the base's belief,
/// which drifts while driving. Returns `None` if no object of this kind is seen near the expected
/// position.
///
/// # Errors
/// [`Interrupt`] if the action has to end.
pub fn look_again(
    expected: &Sighting,
    kind: &KnownKind,
    plane: &PerceivedPlane,
    robot: &mut Operator<'_>,
) -> Result<Option<Sighting>, Interrupt> {
    let mut sight = Sight::default();
    let foot = Vector3::from(expected.pose.position);
    sight.add_look_at(
        &Point3::from(foot + Vector3::z() * (expected.size_m[2] / 2.0)),
        robot,
    )?;
    let top = furniture("surface", plane);
    let Some(surface) = Surface::find(&near(&sight.points, &top)) else {
        return Ok(None);
    };
    let things = surface.things(&sight.points, &sight.eye(), robot.known_kinds());
    let off = |thing: &PerceivedThing| (Vector3::from(thing.pose.position) - foot).norm();
    let alike = things
        .iter()
        .filter(|thing| thing.category.as_ref() == Some(&kind.category));
    let nearest = alike
        .filter(|thing| off(thing) < ASTRAY_M)
        .min_by(|a, b| off(a).total_cmp(&off(b)));
    Ok(nearest.map(|thing| sighting(expected.id.clone(), thing)))
}

/// Points to look at on the top of a piece of furniture: its centre, then halfway to each corner in
/// case something is in the way.
fn places(expected: &Sighting) -> impl Iterator<Item = Point3<f64>> {
    let ([width, depth, height], pose) = (expected.size_m, expected.pose.to_isometry());
    let shares = [
        (0.0, 0.0),
        (-0.25, 0.25),
        (-0.25, -0.25),
        (0.25, 0.25),
        (0.25, -0.25),
    ];
    shares
        .into_iter()
        .map(move |(along, across)| pose * Point3::new(along * width, across * depth, height))
}

/// The points that may belong to the top of a piece of furniture.
pub(super) fn near(points: &[Point3<f64>], expected: &Sighting) -> Vec<Point3<f64>> {
    let [width, depth, height] = expected.size_m;
    let from_world = expected.pose.to_isometry().inverse();
    let belongs = |point: &&Point3<f64>| {
        let local = from_world * **point;
        local.x.abs() <= width / 2.0 + OFF_M
            && local.y.abs() <= depth / 2.0 + OFF_M
            && (local.z - height).abs() <= OFF_M
    };
    points.iter().filter(belongs).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_beside_or_far_below_a_table_top_are_not_part_of_it() {
        let pose = Pose::upright([1.0, 0.0, 0.0], std::f64::consts::FRAC_PI_2);
        let table = Sighting {
            id: "t".to_owned(),
            pose,
            size_m: [1.2, 0.8, 0.74],
            furniture: true,
            angular: false,
        };
        // Turned by 90 degrees, it is 0.8 m long along x and 1.2 m along y.
        let points = [
            [1.5, 0.7, 0.7],
            [1.0, 0.0, 0.88],
            [1.6, 0.0, 0.74],
            [1.0, 0.8, 0.74],
            [1.0, 0.0, 0.5],
        ];
        let kept = near(&points.map(Point3::from), &table);
        assert_eq!(
            kept,
            points[..2]
                .iter()
                .copied()
                .map(Point3::from)
                .collect::<Vec<_>>()
        );
    }
}
