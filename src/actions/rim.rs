//! Grasps of open vessels at their rim: one finger inside, one outside, for those that are too wide
//! for the hand.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

use crate::grasp::{Approach, Grasp, hand};
use actcheck_data::Rim;
use actcheck_world::Sighting;

/// Height of the fingertips above the floor inside. Unit: metres.
const ABOVE_FLOOR_M: f64 = 0.009;
/// How far the fingers reach beyond the grasp frame. Unit: metres.
const REACH_M: f64 = 0.025;
/// Greatest depth of the fingertips below the rim: the palm stays above it. Unit: metres.
const DEEPEST_M: f64 = 0.055;
/// Room beside each finger before it closes. Unit: metres.
const ROOM_M: f64 = 0.01;
/// Thickness of a finger. Unit: metres.
const FINGER_M: f64 = 0.015;
/// Number of headings of the base around the vessel.
const N_HEADINGS: u32 = 24;
/// Places on the rim relative to the one nearest to the base, each with its penalty. Unit: radians.
const PLACES: [(f64, f64); 5] = [
    (0.0, 0.0),
    (FRAC_PI_4, 0.02),
    (-FRAC_PI_4, 0.02),
    (FRAC_PI_2, 0.05),
    (-FRAC_PI_2, 0.05),
];

/// How a hand with this opening fits on a rim.
struct RimFit {
    /// Height of the fingertips.
    tip_m: f64,
    /// Distance of the middle between the fingers from the axis of the vessel.
    middle_m: f64,
    opening_m: f64,
}

/// Returns `None` if a finger does not fit inside.
fn fit(rim: &Rim, max_opening_m: f64) -> Option<RimFit> {
    let tip_m = (rim.floor_m + ABOVE_FLOOR_M).max(rim.top_m - DEEPEST_M);
    let inner_at = |height: f64| rim.radius_m - rim.slope * (rim.top_m - height) - rim.wall_m;
    // A slanted wall touches the inner finger at its tip, and the outer one at the upper end.
    let (inside, outside) = (inner_at(tip_m).min(inner_at(rim.top_m)), rim.radius_m);
    let middle_m = f64::midpoint(inside, outside);
    // Each finger is half of the opening away from the middle: the inner one must not meet the wall
    // opposite.
    let opening_m = max_opening_m.min(2.0 * (middle_m + inside - FINGER_M - ROOM_M));
    let fits = tip_m <= rim.top_m - REACH_M / 2.0 && opening_m >= outside - inside + 2.0 * ROOM_M;
    fits.then_some(RimFit {
        tip_m,
        middle_m,
        opening_m,
    })
}

/// Returns the gap between the fingers before they take a rim. Returns `None` if they can't. Unit:
/// metres.
pub(crate) fn opening_m(rim: &Rim, max_opening_m: f64) -> Option<f64> {
    fit(rim, max_opening_m).map(|fit| fit.opening_m)
}

/// All grasps of a vessel at its rim, with the hand pointing straight down. Empty if a finger does
/// not fit inside.
pub(crate) fn grasps(thing: &Sighting, rim: &Rim, max_opening_m: f64) -> Vec<Grasp> {
    let Some(RimFit {
        tip_m,
        middle_m,
        opening_m,
    }) = fit(rim, max_opening_m)
    else {
        return Vec::new();
    };
    let headings = (0..N_HEADINGS).map(|idx| TAU * f64::from(idx) / f64::from(N_HEADINGS));
    let at = |heading: f64| {
        PLACES.into_iter().flat_map(move |(aside, penalty)| {
            let place = heading + PI + aside;
            // The fingers close along the radius; the hand may be turned over.
            [FRAC_PI_2, -FRAC_PI_2].map(|quarter| {
                let mut pose = hand(thing, tip_m + REACH_M, place + quarter, FRAC_PI_2);
                pose.translation.vector.x += middle_m * libm::cos(place);
                pose.translation.vector.y += middle_m * libm::sin(place);
                Grasp {
                    approach: Approach::Top,
                    pose,
                    heading,
                    opening_m,
                    penalty,
                }
            })
        })
    };
    headings.flat_map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::Pose;
    use nalgebra::{Point3, Vector3};

    const BOWL: Rim = Rim {
        radius_m: 0.08,
        top_m: 0.065,
        slope: 35.0 / 65.0,
        wall_m: 0.005,
        floor_m: 0.006,
    };

    #[test]
    fn one_finger_is_inside_the_wall_and_one_outside() {
        let thing = Sighting {
            id: "bowl_1".to_owned(),
            pose: Pose::upright([1.0, 0.5, 0.4], 0.0),
            size_m: [0.16, 0.16, 0.065],
            furniture: false,
            angular: false,
        };
        let all = grasps(&thing, &BOWL, 0.135);
        assert_eq!(all.len(), 240);
        for grasp in all {
            assert!(
                (grasp.pose * Vector3::x()).z < -0.999,
                "the hand points down"
            );
            let radii = [-0.5, 0.5].map(|side| {
                let tip = grasp.pose * Point3::new(REACH_M, side * grasp.opening_m, 0.0);
                assert!(
                    (tip.z - 0.415).abs() < 1e-9,
                    "the tips are above the floor inside"
                );
                (tip.xy().coords - nalgebra::Vector2::new(1.0, 0.5)).norm()
            });
            let [inner, outer] = [radii[0].min(radii[1]), radii[0].max(radii[1])];
            // The wall at the tips is 48 to 53 mm from the axis.
            assert!(inner < 0.047 && outer > 0.08, "{inner} {outer}");
        }
    }

    #[test]
    fn plates_and_narrow_vessels_are_not_taken_at_the_rim() {
        assert!(opening_m(&BOWL, 0.08).is_some());
        assert!(
            opening_m(&BOWL, 0.04).is_none(),
            "the hand opens too little"
        );
        let plate = Rim {
            radius_m: 0.105,
            top_m: 0.022,
            slope: 25.0 / 18.0,
            wall_m: 0.005,
            floor_m: 0.008,
        };
        assert!(
            opening_m(&plate, 0.135).is_none(),
            "the fingers would slip off its slope"
        );
        let bottle = Rim {
            radius_m: 0.015,
            top_m: 0.2,
            slope: 0.0,
            wall_m: 0.003,
            floor_m: 0.005,
        };
        assert!(opening_m(&bottle, 0.135).is_none(), "no finger fits inside");
    }
}
