//! Grasp candidates: hand poses computed from an object's perceived size.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use crate::operator::Operator;
use actcheck_world::Sighting;

/// Approach direction of the hand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Approach {
    /// Horizontal, for tall objects.
    Side,
    /// From above, for low objects.
    Top,
}

/// One grasp candidate.
#[derive(Debug, Clone, PartialEq)]
pub struct Grasp {
    /// Approach direction of the hand.
    pub approach: Approach,
    /// Pose of the grasp link when the fingers close. Frame: world, by the base's belief.
    pub pose: Isometry3<f64>,
    /// Heading of the base during the grasp. Unit: radians.
    pub heading: f64,
    /// Gap between the fingers during the approach. Unit: metres.
    pub opening_m: f64,
    /// Penalty of this candidate. Unit: that of a plan's cost, in which a metre of driving is 0.4.
    pub penalty: f64,
}

/// Objects at least this high are grasped from the side: the hand, 6 cm across, then clears the
/// surface. Unit: metres.
const TALL_M: f64 = 0.1;
/// Lowest and highest position of a horizontal hand above the foot: clear of the surface, and below
/// the upper part of objects, which is seldom as wide as the foot. Unit: metres.
const SIDE_HEIGHT_M: (f64, f64) = (0.055, 0.11);
/// How far below the top of the object the hand goes from above. Unit: metres.
pub(crate) const TOP_DEPTH_M: f64 = 0.03;
/// Lowest position of the grasp link from above: the fingers reach 2.5 cm further. Unit: metres.
const TOP_LOWEST_M: f64 = 0.0275;
/// Total room that the widest opening leaves beside an object, both sides together. Unit: metres.
/// The smaller one is for objects that are too wide for the other in every direction: an error of
/// the percept by half of it lets a finger come down on them.
const LEAST_ROOM_M: f64 = 0.01;
pub(crate) const TIGHT_ROOM_M: f64 = 0.0025;
/// Room that a jaw that moves against a fixed one leaves beside an object on its way there. Unit:
/// metres.
const JAW_ROOM_M: f64 = 0.045;
/// Objects whose sides differ by less are treated as round. Unit: metres. Perceived sizes are off
/// by some millimetres.
const ROUND_M: f64 = 0.015;
/// Downward pitch of a slanted hand, used where a hand that points straight down is out of reach.
/// Unit: radians. Steep enough for the palm to clear the object.
const SLANT_RAD: f64 = 0.95;
/// Penalty of a slanted hand: equal to half a metre of driving.
const SLANT_PENALTY: f64 = 0.2;
/// Penalty for grasping a tall object from above, or a low one from the side.
const UNUSUAL_PENALTY: f64 = 0.1;
/// How much of an object must rise above a horizontal hand. Unit: metres.
const SIDE_ABOVE_M: f64 = 0.01;
/// Number of headings tried around an object.
const N_HEADINGS: u32 = 24;

/// How wide the hand opens before an object. Unit: metres. A jaw that moves against a fixed one
/// swings far out, and needs no more than some room; other hands open as wide as they can.
pub(crate) fn opening_before_m(thing: &Sighting, robot: &Operator<'_>) -> f64 {
    let most_m = robot.profile().hand.max_opening_m;
    let [width, depth, _] = thing.size_m;
    match robot.layout().gripper.has_fixed_jaw() {
        true => most_m.min(width.max(depth) + JAW_ROOM_M),
        false => most_m,
    }
}

/// The least room that a gripper with this opening leaves beside an object. Unit: metres.
pub(crate) fn room_m(thing: &Sighting, max_opening_m: f64) -> f64 {
    if is_tight(thing, max_opening_m) {
        TIGHT_ROOM_M
    } else {
        LEAST_ROOM_M
    }
}

/// Whether an object is nearly as wide in every direction as the gripper opens, or wider.
pub(crate) fn is_tight(thing: &Sighting, max_opening_m: f64) -> bool {
    let [width, depth, _] = thing.size_m;
    let narrowest_m = if is_round(thing) {
        width.max(depth)
    } else {
        width.min(depth)
    };
    narrowest_m + LEAST_ROOM_M > max_opening_m
}

/// All usual grasps of an object for a gripper with this opening. Empty if the object is too wide
/// in every direction.
pub fn grasps(thing: &Sighting, max_opening_m: f64) -> Vec<Grasp> {
    let tall = thing.size_m[2] >= TALL_M;
    let ways = headings(thing).flat_map(|heading| {
        if tall {
            vec![from_side(thing, heading)]
        } else {
            from_above(thing, heading)
        }
    });
    fitting(thing, max_opening_m, ways)
}

/// Grasps from the side, from above and slanted, regardless of the object's height: for fixed arms,
/// and for cases where the usual grasps are not free. The fingers close across the heading.
pub fn all_grasps(thing: &Sighting, max_opening_m: f64) -> Vec<Grasp> {
    let tall = thing.size_m[2] >= TALL_M;
    let ways = headings(thing).flat_map(|heading| {
        let mut ways = vec![straight_down(thing, heading), slanted(thing, heading)];
        if thing.size_m[2] >= SIDE_HEIGHT_M.0 + SIDE_ABOVE_M {
            ways.push(from_side(thing, heading));
        }
        for (_, grasp) in &mut ways {
            let usual = tall == (grasp.approach == Approach::Side);
            grasp.penalty += if usual { 0.0 } else { UNUSUAL_PENALTY };
        }
        ways
    });
    fitting(thing, max_opening_m, ways)
}

/// The headings tried around an object; around one with corners, those along its sides are among
/// them.
fn headings(thing: &Sighting) -> impl Iterator<Item = f64> {
    let first = if thing.angular { thing.pose.yaw() } else { 0.0 };
    (0..N_HEADINGS)
        .map(move |idx| first + std::f64::consts::TAU * f64::from(idx) / f64::from(N_HEADINGS))
}

/// The same grasps with the hand turned over: rolled by half a turn, which is the same for the
/// object, but not for the arm.
pub(crate) fn rolled(grasps: &[Grasp]) -> Vec<Grasp> {
    let over = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    grasps
        .iter()
        .map(|grasp| Grasp {
            pose: grasp.pose * over,
            ..grasp.clone()
        })
        .collect()
}

/// Moves the hand so that the object is in the middle of the gap when the fingers have nearly
/// closed on it. This differs from the grasp frame if only one finger moves.
pub fn centred(grasps: Vec<Grasp>, thing: &Sighting, robot: &Operator<'_>) -> Vec<Grasp> {
    let gripper = &robot.layout().gripper;
    let moved = grasps.into_iter().map(|grasp| {
        let across = grasp.pose.rotation * Vector3::y();
        let width = width_across(thing, libm::atan2(-across.x, across.y));
        let middle = gripper.middle_m((width + LEAST_ROOM_M).min(grasp.opening_m));
        match middle == 0.0 {
            true => grasp,
            false => Grasp {
                pose: grasp.pose * Translation3::new(0.0, -middle, 0.0),
                ..grasp
            },
        }
    });
    moved.collect()
}

/// The grasps for which the gripper opens wide enough.
fn fitting(
    thing: &Sighting,
    max_opening_m: f64,
    ways: impl Iterator<Item = (f64, Grasp)>,
) -> Vec<Grasp> {
    let room_m = room_m(thing, max_opening_m);
    ways.filter(|(across, _)| width_across(thing, *across) + room_m <= max_opening_m)
        .map(|(_, grasp)| Grasp {
            opening_m: max_opening_m,
            ..grasp
        })
        .collect()
}

/// The horizontal grasp from one heading, with the heading across which the fingers close.
fn from_side(thing: &Sighting, heading: f64) -> (f64, Grasp) {
    let height = (thing.size_m[2] / 2.0).clamp(SIDE_HEIGHT_M.0, SIDE_HEIGHT_M.1);
    let pose = hand(thing, height, heading, 0.0);
    (
        heading,
        Grasp {
            approach: Approach::Side,
            pose,
            heading,
            opening_m: 0.0,
            penalty: 0.0,
        },
    )
}

/// The grasps from above with the base at one heading, each with the heading across which the
/// fingers close.
fn from_above(thing: &Sighting, heading: f64) -> Vec<(f64, Grasp)> {
    let turned = |eighth: u32| {
        let (across, grasp) = straight_down(
            thing,
            heading + std::f64::consts::FRAC_PI_4 * f64::from(eighth),
        );
        (across, Grasp { heading, ..grasp })
    };
    (0..4)
        .map(turned)
        .chain([slanted(thing, heading)])
        .collect()
}

fn straight_down(thing: &Sighting, heading: f64) -> (f64, Grasp) {
    downwards(thing, heading, std::f64::consts::FRAC_PI_2, 0.0)
}

fn slanted(thing: &Sighting, heading: f64) -> (f64, Grasp) {
    downwards(thing, heading, SLANT_RAD, SLANT_PENALTY)
}

fn downwards(thing: &Sighting, heading: f64, pitch: f64, penalty: f64) -> (f64, Grasp) {
    let height = (thing.size_m[2] - TOP_DEPTH_M).max(TOP_LOWEST_M);
    let pose = hand(thing, height, heading, pitch);
    (
        heading,
        Grasp {
            approach: Approach::Top,
            pose,
            heading,
            opening_m: 0.0,
            penalty,
        },
    )
}

/// Pose of the grasp link at a height above an object's foot, with this heading and downward pitch.
pub(crate) fn hand(thing: &Sighting, height: f64, heading: f64, pitch: f64) -> Isometry3<f64> {
    let [x, y, z] = thing.pose.position;
    let (sin, cos) = (libm::sin(heading), libm::cos(heading));
    let forward = Vector3::new(
        cos * libm::cos(pitch),
        sin * libm::cos(pitch),
        -libm::sin(pitch),
    );
    let left = Vector3::new(-sin, cos, 0.0);
    let axes = Matrix3::from_columns(&[forward, left, forward.cross(&left)]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    Isometry3::from_parts(Translation3::new(x, y, z + height), rotation)
}

/// Whether an object is treated as round: its sides are about equally long, and its corners fit
/// between the fingers.
pub(crate) fn is_round(thing: &Sighting) -> bool {
    let [width, depth, _] = thing.size_m;
    !thing.angular && (width - depth).abs() < ROUND_M
}

/// Whether an object that the robot knows as a box has corners that don't fit between the fingers.
pub(crate) fn is_angular(thing: &Sighting, robot: &Operator<'_>) -> bool {
    let [width, depth, _] = thing.size_m;
    let fits = width.hypot(depth) + LEAST_ROOM_M <= robot.profile().hand.max_opening_m;
    !fits && robot.kind_of(&thing.id).is_some_and(|kind| kind.is_box)
}

/// Width of an object across the fingers of a hand with this heading. Unit: metres.
pub(crate) fn width_across(thing: &Sighting, heading: f64) -> f64 {
    let [width, depth, _] = thing.size_m;
    if is_round(thing) {
        return width.max(depth);
    }
    let turn = heading - thing.pose.yaw();
    width * libm::sin(turn).abs() + depth * libm::cos(turn).abs()
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::Pose;

    fn thing(size_m: [f64; 3]) -> Sighting {
        Sighting {
            id: "t".to_owned(),
            pose: Pose::upright([1.0, 0.0, 0.7], 0.4),
            size_m,
            furniture: false,
            angular: false,
        }
    }

    #[test]
    fn low_objects_are_grasped_from_above_and_tall_ones_from_the_side() {
        assert!(
            grasps(&thing([0.08, 0.08, 0.146]), 0.135)
                .iter()
                .all(|g| g.approach == Approach::Side)
        );
        assert!(
            grasps(&thing([0.099, 0.077, 0.085]), 0.135)
                .iter()
                .all(|g| g.approach == Approach::Top)
        );
        assert_eq!(grasps(&thing([0.16, 0.16, 0.065]), 0.135), []);
    }

    #[test]
    fn a_fixed_arm_tries_all_approaches_for_all_objects() {
        let of = |size_m: [f64; 3], approach: Approach| {
            let found = all_grasps(&thing(size_m), 0.135);
            let penalties: Vec<f64> = found
                .iter()
                .filter(|g| g.approach == approach)
                .map(|g| g.penalty)
                .collect();
            (
                penalties.len(),
                penalties.iter().copied().fold(f64::INFINITY, f64::min),
            )
        };
        assert_eq!(of([0.08, 0.08, 0.146], Approach::Side), (24, 0.0));
        assert_eq!(
            of([0.08, 0.08, 0.146], Approach::Top),
            (48, UNUSUAL_PENALTY)
        );
        assert_eq!(
            of([0.08, 0.08, 0.085], Approach::Side),
            (24, UNUSUAL_PENALTY)
        );
        assert_eq!(of([0.08, 0.08, 0.085], Approach::Top), (48, 0.0));
        // Too flat for a level hand.
        assert_eq!(of([0.08, 0.08, 0.02], Approach::Side).0, 0);
    }

    #[test]
    fn an_object_that_hardly_fits_is_grasped_with_less_room() {
        let (can, opening_m) = (thing([0.066, 0.066, 0.12]), 0.069);
        assert_eq!(grasps(&can, opening_m).len(), 24);
        assert_eq!(all_grasps(&can, opening_m).len(), 72);
        assert_eq!(grasps(&can, 0.068), []);
        // Wider across its corners, it is grasped only where the usual room is left.
        let block = thing([0.05, 0.075, 0.12]);
        assert!(grasps(&block, 0.069).len() < grasps(&block, 0.085).len());
    }

    #[test]
    fn a_cube_whose_corners_do_not_fit_is_grasped_across_its_sides() {
        let cube = thing([0.05, 0.05, 0.05]);
        assert!(
            grasps(&cube, 0.06).len() > 24,
            "a round object is grasped from everywhere"
        );
        let found = grasps(
            &Sighting {
                angular: true,
                ..cube
            },
            0.06,
        );
        assert!(found.len() >= 4);
        for grasp in found {
            let across = grasp.pose.rotation * Vector3::y();
            let turn = libm::atan2(-across.x, across.y) - 0.4;
            assert!(
                libm::sin(2.0 * turn).abs() < 1e-6,
                "the fingers close {turn} rad aside of a side"
            );
        }
    }

    #[test]
    fn a_flat_box_is_grasped_across_its_narrow_side() {
        let found = grasps(&thing([0.2, 0.05, 0.15]), 0.135);
        assert!(!found.is_empty());
        for grasp in found {
            let across = grasp.pose.rotation * Vector3::y();
            let along = Vector3::new(libm::cos(0.4), libm::sin(0.4), 0.0);
            assert!(
                across.dot(&along).abs() < 0.5,
                "the fingers would have to span the long side"
            );
        }
    }
}
