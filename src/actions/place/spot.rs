//! Chooses free spots on a surface, and hand poses for setting an object down there.

use nalgebra::{Point2, Point3, Vector3};

use crate::grasp::{Approach, Grasp};
use crate::memory::Held;
use crate::route::length;
use actcheck_data::{PerceivedPlane, Pose};
use actcheck_world::Sighting;

/// Grid spacing of candidate spots. Unit: metres.
const STEP_M: f64 = 0.03;
/// Clearance that an object needs to the edge and to other objects. Unit: metres. Twice the error
/// of vision.
const LEAST_ROOM_M: f64 = 0.03;
/// More clearance than this brings no benefit. Unit: metres. A finger and the error of vision.
const AMPLE_ROOM_M: f64 = 0.08;
/// Clearance that offsets one metre of distance. No unit: both are metres.
const DISTANCE_SHARE: f64 = 0.05;
/// Number of spots tried, and the distance between them. Unit of the distance: metres.
const N_SPOTS: usize = 6;
const APART_M: f64 = 0.1;
/// Number of headings tried for each spot.
const N_HEADINGS: u32 = 24;
/// Penalty added for each next spot in order. Unit: that of a plan's cost.
const SPOT_PENALTY: f64 = 0.03;
/// How much wider than the object the fingers open to release it. Unit: metres.
pub const RELEASE_M: f64 = 0.04;
/// Height of the object above its spot when the hand arrives. Unit: metres.
const HIGH_M: f64 = 0.17;
/// Objects whose sides differ by less are treated as round. Unit: metres.
const ROUND_M: f64 = 0.015;

/// Points of a surface where an object of this radius is clear of the edge and of other objects,
/// the best first. Frame: world, by the base's belief.
pub fn spots(
    plane: &PerceivedPlane,
    things: &[Sighting],
    radius: f64,
    from: &Point3<f64>,
) -> Vec<Point3<f64>> {
    let world_from_plane = plane.pose.to_isometry();
    let [length_m, width_m] = plane.size_m;
    let mut found: Vec<(f64, Point3<f64>)> = Vec::new();
    for u in steps(length_m) {
        for v in steps(width_m) {
            let spot = world_from_plane * Point3::new(u, v, 0.0);
            let edge = (length_m / 2.0 - u.abs()).min(width_m / 2.0 - v.abs());
            let room = things
                .iter()
                .map(|thing| gap(thing, &spot))
                .fold(edge, f64::min)
                - radius;
            if room >= LEAST_ROOM_M {
                let way = length(spot.x - from.x, spot.y - from.y);
                found.push((DISTANCE_SHARE * way - room.min(AMPLE_ROOM_M), spot));
            }
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut chosen: Vec<Point3<f64>> = Vec::new();
    for (_, spot) in found {
        if chosen.len() < N_SPOTS && chosen.iter().all(|other| (other - spot).norm() >= APART_M) {
            chosen.push(spot);
        }
    }
    chosen
}

/// Offsets from the centre along a whole side.
fn steps(extent: f64) -> impl Iterator<Item = f64> {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a surface is a few metres long"
    )]
    let n_steps = (extent / 2.0 / STEP_M).floor().clamp(0.0, 1000.0) as i32;
    (-n_steps..=n_steps).map(|step| f64::from(step) * STEP_M)
}

/// Horizontal distance from a point to the outline of an object. Unit: metres.
fn gap(thing: &Sighting, point: &Point3<f64>) -> f64 {
    let [x, y, _] = thing.pose.position;
    length(point.x - x, point.y - y) - radius(thing.size_m)
}

/// Radius of the vertical cylinder around an object: half of its diagonal, or of its side if it
/// appears to be round.
pub fn radius([width, depth, _]: [f64; 3]) -> f64 {
    if (width - depth).abs() < ROUND_M {
        width.max(depth) / 2.0
    } else {
        length(width, depth) / 2.0
    }
}

/// All hand poses for setting the held object down on one of the spots. The hand comes from above,
/// regardless of how it grasped the object.
pub fn ways(held: &Held, spots: &[Point3<f64>], max_opening_m: f64) -> Vec<Grasp> {
    let headings =
        (0..N_HEADINGS).map(|idx| std::f64::consts::TAU * f64::from(idx) / f64::from(N_HEADINGS));
    let yaw = Pose::from_isometry(&held.foot).yaw();
    let opening_m = (held.opening_m + RELEASE_M).min(max_opening_m);
    let way = |(idx, spot): (usize, &Point3<f64>), heading: f64| {
        let foot =
            Pose::upright([spot.x, spot.y, spot.z], yaw + heading - held.heading).to_isometry();
        let penalty = SPOT_PENALTY * idx as f64;
        Grasp {
            approach: Approach::Top,
            pose: foot * held.grasp_from_foot,
            heading,
            opening_m,
            penalty,
        }
    };
    spots
        .iter()
        .enumerate()
        .flat_map(|spot| headings.clone().map(move |heading| way(spot, heading)))
        .collect()
}

/// Whether the hand holds the object from the side and therefore has to withdraw horizontally.
pub fn is_level(held: &Held) -> bool {
    let forward = (held.foot * held.grasp_from_foot).rotation * Vector3::x();
    forward.z > -0.5
}

/// Raises obstacles by the part of the held object that hangs below the hand and, if the hand
/// withdraws horizontally, by the height at which it comes in.
pub fn heightened(things: &[Sighting], held: &Held) -> Vec<Sighting> {
    let below = held.grasp_from_foot.translation.vector.z.max(0.0);
    let by = if is_level(held) {
        below + HIGH_M
    } else {
        below
    };
    let higher = |thing: &Sighting| {
        let [width, depth, height] = thing.size_m;
        Sighting {
            size_m: [
                width,
                depth,
                if thing.furniture { height } else { height + by },
            ],
            ..thing.clone()
        }
    };
    things.iter().map(higher).collect()
}

/// The spot nearest to this position of the hand. Returns `None` if there are no spots.
pub fn nearest(spots: &[Point3<f64>], to: &Point2<f64>) -> Option<Point3<f64>> {
    let far = |spot: &Point3<f64>| length(spot.x - to.x, spot.y - to.y);
    spots
        .iter()
        .min_by(|a, b| far(a).total_cmp(&far(b)))
        .copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> PerceivedPlane {
        PerceivedPlane {
            pose: Pose::upright([1.0, 0.5, 0.7], 0.6),
            size_m: [0.6, 0.5],
        }
    }

    fn thing(position: [f64; 3], size_m: [f64; 3]) -> Sighting {
        Sighting {
            id: "t".to_owned(),
            pose: Pose::upright(position, 0.0),
            size_m,
            furniture: false,
            angular: false,
        }
    }

    #[test]
    fn spots_keep_clear_of_the_edge_and_of_other_objects() {
        let others = [
            thing([1.0, 0.5, 0.7], [0.1, 0.1, 0.1]),
            thing([1.15, 0.6, 0.7], [0.2, 0.05, 0.1]),
        ];
        let found = spots(&table(), &others, 0.045, &Point3::new(0.0, 0.0, 0.0));
        assert!(!found.is_empty() && found.len() <= N_SPOTS);
        let from_world = table().pose.to_isometry().inverse();
        for spot in &found {
            let local = from_world * spot;
            assert!(
                local.x.abs() <= 0.3 - 0.075 + 1e-9
                    && local.y.abs() <= 0.25 - 0.075 + 1e-9
                    && local.z.abs() < 1e-9
            );
            assert!(
                others.iter().all(|other| gap(other, spot) >= 0.075 - 1e-9),
                "{spot}"
            );
        }
        assert_eq!(
            spots(
                &table(),
                &[thing([1.0, 0.5, 0.7], [0.6, 0.6, 0.1])],
                0.045,
                &Point3::origin()
            ),
            []
        );
    }

    #[test]
    fn the_held_object_stays_upright_at_every_spot() {
        let foot = Pose::upright([0.0, 0.0, 0.7], 0.3).to_isometry();
        let grasp = Pose::upright([0.0, 0.0, 0.77], 1.0).to_isometry();
        let grasp_from_foot = foot.inverse() * grasp;
        let held = Held {
            id: "g".into(),
            size_m: [0.09, 0.09, 0.15],
            foot,
            grasp_from_foot,
            heading: 1.0,
            opening_m: 0.08,
            wall_m: None,
        };
        assert!(is_level(&held));
        let found = ways(&held, &[Point3::new(2.0, 1.0, 0.4)], 0.135);
        assert_eq!(found.len(), N_HEADINGS as usize);
        for way in found {
            let pose = Pose::from_isometry(&way.pose);
            assert!(
                (pose.position[2] - 0.47).abs() < 1e-9 && pose.tilt() < 1e-6,
                "{pose:?}"
            );
            assert!(
                libm::cos(pose.yaw() - way.heading) > 1.0 - 1e-9,
                "hand and base must have the same heading"
            );
            assert!((way.opening_m - 0.12).abs() < 1e-9);
        }
    }
}
