//! Picking with a suction cup: where the lip may lie on an object, and how the hand finds the
//! surface by its vacuum.
//!
//! Never: knows whether a seal exists other than by the pressure of the vacuum.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, TAU};

use nalgebra::{Translation3, Vector3};

use crate::grasp::{Approach, Grasp, hand, is_round};
use crate::grip::feels;
use crate::operator::{Interrupt, Operator};
use crate::pick::failed;
use crate::pick_fault::PickFault;
use crate::place::{Touch, straight};
use actcheck_data::{ActionReport, Pose, Suction};
use actcheck_world::Sighting;

/// Number of headings of the base tried around an object.
const N_HEADINGS: u32 = 24;
/// Turns of a cup that points down, relative to the base. They differ for the arm only.
const TURNS_RAD: [f64; 4] = [0.0, FRAC_PI_4, FRAC_PI_2, -FRAC_PI_2];
/// Least height of the middle of a level cup above the foot of an object: half of the hand's width.
/// Unit: metres.
const SIDE_LOWEST_M: f64 = 0.055;
/// Penalty for a side, where friction carries the object and its weight peels the lip off: more
/// than those of all obstacles, so that a side is only used if no top is reachable.
const SIDE_PENALTY: f64 = 4.0;
/// How far the hand goes on where it does not find the surface. Unit: metres. Three times the error
/// of perceived heights.
const DEEPER_M: f64 = 0.03;
/// The last part of the approach, in which the hand is slow: as long as that way, and the error of
/// inverse kinematics. Unit: metres.
const SLOW_M: f64 = 0.032;
/// Mean speed of the slow hand. Unit: m/s. At it, the arm stops within the way that a soft lip
/// gives.
const SLOW_M_S: f64 = 0.02;
/// Time for the hand to come to rest before it feels for the surface. Unit: seconds.
const REST_SECS: f64 = 0.3;
/// How far the hand backs off a surface on which the cup does not seal. Unit: metres.
const BACK_M: f64 = 0.02;
/// Directions across the axis of the cup in which it is tried again: part of the lip may have been
/// beyond an edge.
const BESIDE: [[f64; 2]; 4] = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]];
/// Distance of these trials from the first one, as a share of the cup's radius.
const BESIDE_SHARE: f64 = 0.5;

/// All poses of a cup on the perceived surfaces of an object: on its top, and on the sides of one
/// that is not round.
///
/// # Errors
/// [`PickFault::TooSmall`] if the object is too small for the cup.
pub fn grasps(thing: &Sighting, cup: &Suction) -> Result<Vec<Grasp>, PickFault> {
    let (across, [width, depth, height]) = (2.0 * cup.radius_m, thing.size_m);
    let mut found = Vec::new();
    if width.min(depth) >= across {
        found.extend((0..N_HEADINGS).flat_map(|idx| {
            let heading = TAU * f64::from(idx) / f64::from(N_HEADINGS);
            TURNS_RAD.map(|turn| on_top(thing, cup, heading, turn))
        }));
    }
    if !is_round(thing) && height >= SIDE_LOWEST_M + cup.radius_m {
        let sides = [(0.0, width, depth), (FRAC_PI_2, depth, width)];
        let wide_enough = sides.into_iter().filter(|(_, _, face)| *face >= across);
        found.extend(wide_enough.flat_map(|(turn, thickness, _)| {
            let heading = thing.pose.yaw() + turn;
            [heading, heading + std::f64::consts::PI]
                .map(|heading| on_side(thing, cup, heading, thickness))
        }));
    }
    if found.is_empty() {
        let [narrow_cm, cup_cm] = [width.min(depth), across].map(|size| size * 100.0);
        return Err(PickFault::TooSmall {
            id: thing.id.clone(),
            narrow_cm,
            cup_cm,
        });
    }
    Ok(found)
}

/// The poses of a lip on the middle of the top and of each side of an upright object of this size,
/// if they are as wide as the cup. Frame: the object's, with the origin at its foot.
pub fn lips_on(size_m: [f64; 3], cup: &Suction) -> Vec<Pose> {
    let thing = Sighting {
        id: String::new(),
        pose: Pose::IDENTITY,
        size_m,
        furniture: false,
        angular: false,
    };
    let mut found: Vec<Grasp> = grasps(&thing, cup).unwrap_or_default();
    // The headings of a lip on the top make no difference.
    let first_top = found
        .iter()
        .position(|grasp| grasp.approach == Approach::Top);
    let mut idx = 0;
    found.retain(|grasp| {
        idx += 1;
        grasp.approach == Approach::Side || Some(idx - 1) == first_top
    });
    found
        .iter()
        .map(|grasp| Pose::from_isometry(&grasp.pose))
        .collect()
}

/// The cup on the middle of an object's top, with the base at one heading and the hand turned
/// relative to it.
fn on_top(thing: &Sighting, cup: &Suction, heading: f64, turn: f64) -> Grasp {
    let pose = hand(thing, thing.size_m[2], heading + turn, FRAC_PI_2);
    Grasp {
        approach: Approach::Top,
        pose,
        heading,
        opening_m: 2.0 * cup.radius_m,
        penalty: 0.0,
    }
}

/// The cup on the middle of a side, at the height of the object's middle if the hand is then clear
/// of the surface.
fn on_side(thing: &Sighting, cup: &Suction, heading: f64, thickness: f64) -> Grasp {
    let height = (thing.size_m[2] / 2.0).max(SIDE_LOWEST_M);
    let back = Vector3::new(libm::cos(heading), libm::sin(heading), 0.0) * (-thickness / 2.0);
    let pose = Translation3::from(back) * hand(thing, height, heading, 0.0);
    Grasp {
        approach: Approach::Side,
        pose,
        heading,
        opening_m: 2.0 * cup.radius_m,
        penalty: SIDE_PENALTY,
    }
}

/// Moves along the approach with the vacuum on, slowly near the expected surface, until the cup
/// feels a seal or the arm feels something below the hand; some centimetres further if it feels
/// neither. Without a seal, it tries beside this place.
///
/// # Errors
/// [`Interrupt`] if the action has to end.
pub fn approach(
    path: &[Vec<f64>],
    least_secs: f64,
    cup: &Suction,
    robot: &mut Operator<'_>,
) -> Result<(), Interrupt> {
    descend(path, least_secs, robot)?;
    let lip = |robot: &Operator<'_>| robot.kinematics().grasp(robot.commanded());
    let first = lip(robot);
    let axis = first.rotation * Vector3::x();
    for [y, z] in BESIDE {
        robot.wait(REST_SECS)?;
        if feels(robot) {
            break;
        }
        let back = straight(robot, robot.commanded(), &(axis * -BACK_M));
        robot.follow(&back, 0.0)?;
        let beside = first.rotation * Vector3::new(0.0, y, z) * (BESIDE_SHARE * cup.radius_m);
        let over =
            first.translation.vector + beside - axis * BACK_M - lip(robot).translation.vector;
        let across = straight(robot, robot.commanded(), &over);
        robot.follow(&across, 0.0)?;
        robot.wait(REST_SECS)?;
        let mut touch = Touch::new(robot);
        let down = straight(robot, robot.commanded(), &(axis * (2.0 * BACK_M)));
        robot.follow_until(&down, 2.0 * BACK_M / SLOW_M_S, |robot| {
            feels(robot) || touch.felt(robot)
        })?;
    }
    Ok(())
}

/// The first part of [`approach`]: until a seal, a touch or the end of the way.
fn descend(path: &[Vec<f64>], least_secs: f64, robot: &mut Operator<'_>) -> Result<(), Interrupt> {
    robot.wait(REST_SECS)?;
    robot.set_opening(0.0);
    let Some(end) = path.last() else {
        return Ok(());
    };
    let lip = robot.kinematics().grasp(end);
    let way_m = |robot: &Operator<'_>, posture: &[f64]| {
        (robot.kinematics().grasp(posture).translation.vector - lip.translation.vector).norm()
    };
    let slow = path
        .iter()
        .position(|posture| way_m(robot, posture) < SLOW_M)
        .unwrap_or_default();
    let (fast, slow) = path.split_at(slow);
    let mut touch = Touch::new(robot);
    if robot.follow_until(fast, least_secs, |robot| feels(robot) || touch.felt(robot))? {
        return Ok(());
    }
    let deeper = straight(robot, end, &(lip.rotation * Vector3::x() * DEEPER_M));
    let slow = [slow, &deeper].concat();
    let secs = (way_m(robot, robot.commanded()) + DEEPER_M) / SLOW_M_S;
    robot.follow_until(&slow, secs, |robot| feels(robot) || touch.felt(robot))?;
    Ok(())
}

/// Reports whether the cup holds the object, by its vacuum.
pub fn report(robot: &Operator<'_>, cup: &Suction, target: &str, sealed: bool) -> ActionReport {
    if !sealed {
        return failed(format!("the suction cup did not seal on {target}"));
    }
    if robot.felt_slip() || !feels(robot) {
        return failed(broken(robot, cup, target));
    }
    ActionReport {
        succeeded: true,
        message: format!("holds {target} by the seal of its suction cup"),
    }
}

/// A sentence about a seal that broke, with the load that the arm felt before.
pub fn broken(robot: &Operator<'_>, cup: &Suction, target: &str) -> String {
    let (load_n, force_n) = (robot.felt_load_n(), cup.force_n);
    format!(
        "the seal on {target} broke: the arm carried {load_n:.0} N, the cup holds {force_n:.0} N of pull"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const CUP: Suction = Suction {
        force_n: 40.0,
        radius_m: 0.02,
        friction: 0.5,
    };

    fn thing(size_m: [f64; 3]) -> Sighting {
        Sighting {
            id: "t".to_owned(),
            pose: Pose::upright([1.0, 0.5, 0.7], 0.4),
            size_m,
            furniture: false,
            angular: false,
        }
    }

    #[test]
    fn the_lip_is_parallel_to_the_surface_at_every_grasp() {
        let found = grasps(&thing([0.3, 0.2, 0.16]), &CUP).expect("the box is large");
        assert_eq!(found.len(), 24 * 4 + 4);
        for grasp in &found {
            let from_foot = thing([0.3; 3]).pose.to_isometry().inverse() * grasp.pose;
            let (axis, lip) = (
                from_foot.rotation * Vector3::x(),
                from_foot.translation.vector,
            );
            match grasp.approach {
                Approach::Top => {
                    assert!(
                        (axis + Vector3::z()).norm() < 1e-9
                            && (lip - Vector3::z() * 0.16).norm() < 1e-9
                    );
                }
                Approach::Side => {
                    let half = Vector3::new(0.15, 0.1, 0.0).component_mul(&axis);
                    assert!(
                        (lip + half - Vector3::z() * 0.08).norm() < 1e-9,
                        "{lip} along {axis}"
                    );
                }
            }
        }
    }

    #[test]
    fn an_object_smaller_than_the_cup_is_refused_with_both_sizes() {
        let refused = grasps(&thing([0.03, 0.03, 0.2]), &CUP).expect_err("it is narrow");
        assert_eq!(
            refused.to_string(),
            "t is too small for the suction cup: its top is 3.0 cm across, the cup 4.0 cm"
        );
        let sides = grasps(&thing([0.03, 0.3, 0.2]), &CUP).expect("two of its sides are wide");
        assert!(
            sides.iter().all(|grasp| grasp.approach == Approach::Side) && sides.len() == 2,
            "{}",
            sides.len()
        );
    }
}
