//! Where on a surface a thing can stand, and how the hand that holds it gets there.

use nalgebra::{Point2, Point3, Vector3};

use crate::actions::PerceivedPlane;
use crate::actions::grasp::{Approach, Grasp};
use crate::actions::memory::Held;
use crate::actions::route::length;
use crate::base::Pose;
use crate::world::Sighting;

/// Distance between places that are looked at. Unit: metres.
const STEP_M: f64 = 0.03;
/// Room that a thing needs to the edge and to others. Unit: metres. What sight is off by, twice.
const LEAST_ROOM_M: f64 = 0.03;
/// Room that is as good as any more. Unit: metres. A finger and what sight is off by.
const AMPLE_ROOM_M: f64 = 0.08;
/// How much room a metre less of a way is worth. No unit: both are metres.
const DISTANCE_SHARE: f64 = 0.05;
/// Places that are tried, and how far apart they are. Unit of the distance: metres.
const N_SPOTS: usize = 6;
const APART_M: f64 = 0.1;
/// Directions from which each is tried.
const N_HEADINGS: u32 = 24;
/// What speaks against a spot that is next in order. Unit: that of a plan's cost.
const SPOT_PENALTY: f64 = 0.03;
/// How much wider than what they hold fingers open to let it go. Unit: metres.
pub const RELEASE_M: f64 = 0.04;
/// How high above its spot a thing is when the hand comes in. Unit: metres.
const HIGH_M: f64 = 0.17;
/// Sides that differ by less are taken for those of a round body. Unit: metres.
const ROUND_M: f64 = 0.015;

/// Points of a surface where a thing of a radius can stand clear of the edge and of what is there, the best first. Frame: world,
/// by the base's belief.
pub fn spots(plane: &PerceivedPlane, things: &[Sighting], radius: f64, from: &Point3<f64>) -> Vec<Point3<f64>> {
    let world_from_plane = plane.pose.to_isometry();
    let [length_m, width_m] = plane.size_m;
    let mut found: Vec<(f64, Point3<f64>)> = Vec::new();
    for u in steps(length_m) {
        for v in steps(width_m) {
            let spot = world_from_plane * Point3::new(u, v, 0.0);
            let edge = (length_m / 2.0 - u.abs()).min(width_m / 2.0 - v.abs());
            let room = things.iter().map(|thing| gap(thing, &spot)).fold(edge, f64::min) - radius;
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

/// Offsets from the middle, over a whole side.
fn steps(extent: f64) -> impl Iterator<Item = f64> {
    #[expect(clippy::cast_possible_truncation, reason = "a surface is a few metres long")]
    let n_steps = (extent / 2.0 / STEP_M).floor().clamp(0.0, 1000.0) as i32;
    (-n_steps..=n_steps).map(|step| f64::from(step) * STEP_M)
}

/// Level distance from a point to the outline of a thing. Unit: metres.
fn gap(thing: &Sighting, point: &Point3<f64>) -> f64 {
    let [x, y, _] = thing.pose.position;
    length(point.x - x, point.y - y) - radius(thing.size_m)
}

/// Radius of the upright cylinder around a thing: half of its diagonal, or of its side if it seems to be round.
pub fn radius([width, depth, _]: [f64; 3]) -> f64 {
    if (width - depth).abs() < ROUND_M { width.max(depth) / 2.0 } else { length(width, depth) / 2.0 }
}

/// Every way of a hand to set what it holds down on one of some spots: from above, whatever way it took it.
pub fn ways(held: &Held, spots: &[Point3<f64>], max_opening_m: f64) -> Vec<Grasp> {
    let headings = (0..N_HEADINGS).map(|idx| std::f64::consts::TAU * f64::from(idx) / f64::from(N_HEADINGS));
    let yaw = Pose::from_isometry(&held.foot).yaw();
    let opening_m = (held.opening_m + RELEASE_M).min(max_opening_m);
    let way = |(idx, spot): (usize, &Point3<f64>), heading: f64| {
        let foot = Pose::upright([spot.x, spot.y, spot.z], yaw + heading - held.heading).to_isometry();
        let penalty = SPOT_PENALTY * idx as f64;
        Grasp { approach: Approach::Top, pose: foot * held.grasp_from_foot, heading, opening_m, penalty }
    };
    spots.iter().enumerate().flat_map(|spot| headings.clone().map(move |heading| way(spot, heading))).collect()
}

/// Whether the hand holds a thing from the side, so that it has to leave it level.
pub fn is_level(held: &Held) -> bool {
    let forward = (held.foot * held.grasp_from_foot).rotation * Vector3::x();
    forward.z > -0.5
}

/// Things as high as they are to a hand that comes in high with something hanging below it, and that, where it holds it from
/// the side, leaves low.
pub fn heightened(things: &[Sighting], held: &Held) -> Vec<Sighting> {
    let below = held.grasp_from_foot.translation.vector.z.max(0.0);
    let by = if is_level(held) { below + HIGH_M } else { below };
    let higher = |thing: &Sighting| {
        let [width, depth, height] = thing.size_m;
        Sighting { size_m: [width, depth, if thing.furniture { height } else { height + by }], ..thing.clone() }
    };
    things.iter().map(higher).collect()
}

/// The spot below a hand that was to go to one of some: the nearest.
pub fn nearest(spots: &[Point3<f64>], to: &Point2<f64>) -> Option<Point3<f64>> {
    let far = |spot: &Point3<f64>| length(spot.x - to.x, spot.y - to.y);
    spots.iter().min_by(|a, b| far(a).total_cmp(&far(b))).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> PerceivedPlane {
        PerceivedPlane { pose: Pose::upright([1.0, 0.5, 0.7], 0.6), size_m: [0.6, 0.5] }
    }

    fn thing(position: [f64; 3], size_m: [f64; 3]) -> Sighting {
        Sighting { id: "t".to_owned(), pose: Pose::upright(position, 0.0), size_m, furniture: false }
    }

    #[test]
    fn spots_are_clear_of_the_edge_and_of_what_stands_there() {
        let others = [thing([1.0, 0.5, 0.7], [0.1, 0.1, 0.1]), thing([1.15, 0.6, 0.7], [0.2, 0.05, 0.1])];
        let found = spots(&table(), &others, 0.045, &Point3::new(0.0, 0.0, 0.0));
        assert!(!found.is_empty() && found.len() <= N_SPOTS);
        let from_world = table().pose.to_isometry().inverse();
        for spot in &found {
            let local = from_world * spot;
            assert!(
                local.x.abs() <= 0.3 - 0.075 + 1e-9 && local.y.abs() <= 0.25 - 0.075 + 1e-9 && local.z.abs() < 1e-9
            );
            assert!(others.iter().all(|other| gap(other, spot) >= 0.075 - 1e-9), "{spot}");
        }
        assert_eq!(spots(&table(), &[thing([1.0, 0.5, 0.7], [0.6, 0.6, 0.1])], 0.045, &Point3::origin()), []);
    }

    #[test]
    fn the_hand_keeps_what_it_holds_upright_wherever_it_goes() {
        let foot = Pose::upright([0.0, 0.0, 0.7], 0.3).to_isometry();
        let grasp = Pose::upright([0.0, 0.0, 0.77], 1.0).to_isometry();
        let grasp_from_foot = foot.inverse() * grasp;
        let held =
            Held { id: "g".into(), size_m: [0.09, 0.09, 0.15], foot, grasp_from_foot, heading: 1.0, opening_m: 0.08 };
        assert!(is_level(&held));
        let found = ways(&held, &[Point3::new(2.0, 1.0, 0.4)], 0.135);
        assert_eq!(found.len(), N_HEADINGS as usize);
        for way in found {
            let pose = Pose::from_isometry(&way.pose);
            assert!((pose.position[2] - 0.47).abs() < 1e-9 && pose.tilt() < 1e-6, "{pose:?}");
            assert!(libm::cos(pose.yaw() - way.heading) > 1.0 - 1e-9, "the hand heads where the base does");
            assert!((way.opening_m - 0.12).abs() < 1e-9);
        }
    }
}
