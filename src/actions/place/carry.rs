//! Carrying an object: brings the hand close to the base and drives the base around obstacles.

use std::collections::BTreeSet;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use crate::memory::Held;
use crate::navigate::Size;
use crate::operator::{Interrupt, Operator};
use crate::place::slim::Load;
use crate::{navigate, plan};
use actcheck_data::Pose;
use actcheck_world::{SelfContact, Sighting, ik};

/// Distance between postures on a straight path of the hand. Unit: metres.
const STEP_M: f64 = 0.02;
/// Distance of the hand in front of the base's centre while carrying. Unit: metres. A base has a
/// radius of about 0.2 m, and a hand that holds a bowl reaches 0.1 m back.
const NEAR_M: f64 = 0.38;
/// Height of the hand while carrying, if the arm reaches that low. Unit: metres. The arm and its
/// load are then below the head's view and still above the base.
const LOW_M: f64 = 0.45;
/// How far the hand moves back, by the arm and the base together, before it moves down. Unit:
/// metres. The load then clears the edge of the furniture.
const BACK_M: f64 = 0.2;
/// Largest tilt of an object on the way to the driving posture, equal to its usual tilt in the
/// hand. Unit: radians.
const LEAN_RAD: f64 = 0.15;
/// A robot with a smaller radius can pass doors and approach tables without moving its load. Unit:
/// metres.
const SLIM_M: f64 = 0.45;
/// A posture must make the robot slimmer by this much. Unit: metres.
const SLIMMER_M: f64 = 0.03;
/// Places of the hand around the base's centre that may make the robot slim: ahead, and to either
/// side. Unit: metres.
const AHEAD_M: [f64; 5] = [0.1, 0.18, 0.26, 0.32, 0.38];
const ASIDE_M: [f64; 5] = [0.0, -0.15, 0.15, -0.3, 0.3];
/// Heights of the hand there above that of the folded arm. Unit: metres.
const HIGHER_M: [f64; 4] = [0.0, 0.15, 0.3, 0.45];
/// Headings of the hand there.
const N_HEADINGS: u32 = 8;
/// Room between the load and the robot's links other than the hand. Unit: metres.
const LOAD_ROOM_M: f64 = 0.04;
/// Number of postures checked per leg.
const N_CHECKS: u32 = 12;
/// Distance between the base's centre and the edge of a surface it looks at. Unit: metres. A head
/// at a height of one metre sees the near edge of a table from there, and an object in the hand is
/// clear of it.
const GAP_M: f64 = 0.69;

/// Postures that bring the hand close to the base and down, keeping its orientation. The base moves
/// back a little if the arm alone doesn't move back far enough. Empty for a fixed base.
pub fn fold(robot: &Operator<'_>) -> Vec<Vec<f64>> {
    let Some([x, y, _]) = robot.layout().base else {
        return Vec::new();
    };
    let start = robot.commanded().to_vec();
    let base = robot.base();
    let grasp = robot.kinematics().grasp(&start).translation.vector;
    let ahead = (base.inverse() * Point3::from(grasp)).x;
    let back = base.rotation * Vector3::new(-(ahead - NEAR_M).max(0.0), 0.0, 0.0);
    let mut path = straight(robot, &start, &back);
    let mut near = path.last().cloned().unwrap_or(start);
    let pulled = (robot.kinematics().grasp(&near).translation.vector - grasp).norm();
    let retreat = base.rotation * Vector3::new(-(BACK_M - pulled).max(0.0), 0.0, 0.0);
    near[x] += retreat.x;
    near[y] += retreat.y;
    path.push(near.clone());
    let height = robot.kinematics().grasp(&near).translation.vector.z;
    path.extend(straight(
        robot,
        &near,
        &Vector3::new(0.0, 0.0, -(height - LOW_M).max(0.0)),
    ));
    path
}

/// Postures that move the arm to its driving posture, to make the base with its load slim. If the
/// load would tilt on the way or the arm would collide with itself, to the slimmest posture that
/// keeps the load upright; empty if there is none.
///
/// The arm moves there directly, or with one joint last: an arm whose upper part is vertical turns
/// about it.
pub fn tuck(robot: &Operator<'_>, held: &Held) -> Vec<Vec<f64>> {
    let start = robot.commanded();
    let home = with_arm(robot, start, &robot.profile().home);
    let last = robot.layout().arm.iter().map(|last| {
        let mut before = home.clone();
        before[*last] = start[*last];
        vec![before, home.clone()]
    });
    let itself = SelfContact::new(robot.kinematics(), &[start.to_vec(), home.clone()]);
    let ways = std::iter::once(vec![home.clone()]).chain(last);
    let found = ways
        .into_iter()
        .find(|way| stays_upright(robot, held, &itself, way));
    found.or_else(|| slimmest(robot, held)).unwrap_or_default()
}

/// The way to the posture with the load upright near the base that makes the robot slimmest. `None`
/// if it is slim already, or for a fixed base.
fn slimmest(robot: &Operator<'_>, held: &Held) -> Option<Vec<Vec<f64>>> {
    let (kinematics, layout, start) = (robot.kinematics(), robot.layout(), robot.commanded());
    layout.base?;
    let points = kinematics.surface_points(LOAD_ROOM_M);
    let mut radius_m = Size::at(robot, start, &points).radius_m;
    if radius_m < SLIM_M {
        return None;
    }
    let base = robot.base_of(start);
    let hand = base.inverse() * kinematics.grasp(start);
    let itself = SelfContact::new(kinematics, &[start.to_vec()]);
    let mut mobility = vec![0.0; start.len()];
    layout.arm.iter().for_each(|joint| mobility[*joint] = 1.0);
    let touching = links_at_load(robot, held, start, &points);
    let (mut best, mut hands) = (None, Vec::new());
    for ([ahead, aside], higher) in AHEAD_M
        .into_iter()
        .flat_map(|ahead| ASIDE_M.map(|aside| [ahead, aside]))
        .flat_map(|place| HIGHER_M.map(|higher| (place, higher)))
    {
        let place = Translation3::new(ahead, aside, hand.translation.z + higher);
        for turn in 0..N_HEADINGS {
            let angle = std::f64::consts::TAU * f64::from(turn) / f64::from(N_HEADINGS);
            let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle) * hand.rotation;
            let target = base * Isometry3::from_parts(place, turned);
            hands.push(target);
            let reach = ik::IkRequest {
                target,
                mobility: mobility.clone(),
            };
            let Some(posture) = ik::solve(kinematics, start, &reach) else {
                continue;
            };
            let size = Size::at(robot, &posture, &points);
            if size.radius_m + SLIMMER_M < radius_m
                && links_at_load(robot, held, &posture, &points).is_subset(&touching)
                && stays_upright(robot, held, &itself, std::slice::from_ref(&posture))
            {
                (radius_m, best) = (size.radius_m, Some(posture));
            }
        }
    }
    if radius_m >= SLIM_M {
        // In one move, the load would tilt or the arm would collide with the robot.
        let load = Load {
            kinematics,
            arm: &layout.arm,
            start,
            itself: &itself,
            is_clear: &|posture| links_at_load(robot, held, posture, &points).is_subset(&touching),
            is_slim: &|posture| Size::at(robot, posture, &points).radius_m < SLIM_M,
        };
        if let Some(way) = load.way(&hands) {
            return Some(way);
        }
    }
    best.map(|posture| vec![posture])
}

/// The links with a point in the box around the load in a posture.
fn links_at_load(
    robot: &Operator<'_>,
    held: &Held,
    posture: &[f64],
    points: &[(usize, Point3<f64>)],
) -> BTreeSet<usize> {
    let kinematics = robot.kinematics();
    let links = kinematics.links(posture);
    let foot = kinematics.grasp(posture) * held.grasp_from_foot.inverse();
    let [width, depth, height] = held.size_m;
    let is_near = |point: &Point3<f64>| {
        let inside = foot.inverse() * point;
        let [off_x, off_y] = [inside.x.abs() - width / 2.0, inside.y.abs() - depth / 2.0];
        off_x.max(off_y).max(inside.z - height).max(-inside.z) < LOAD_ROOM_M
    };
    points
        .iter()
        .filter(|(link, point)| is_near(&(links[*link] * point)))
        .map(|(link, _)| *link)
        .collect()
}

/// The way back from the driving posture to the posture before, with the base at its current pose.
pub fn untuck(robot: &Operator<'_>, tucked: &[Vec<f64>], before: &[f64]) -> Vec<Vec<f64>> {
    let arm = &robot.layout().arm;
    let values = |posture: &[f64]| {
        arm.iter()
            .map(|joint| posture[*joint])
            .collect::<Vec<f64>>()
    };
    let back = tucked
        .iter()
        .rev()
        .skip(1)
        .map(Vec::as_slice)
        .chain((!tucked.is_empty()).then_some(before));
    back.map(|posture| with_arm(robot, robot.commanded(), &values(posture)))
        .collect()
}

/// A posture with other positions of the arm's joints.
fn with_arm(robot: &Operator<'_>, posture: &[f64], values: &[f64]) -> Vec<f64> {
    let mut posture = posture.to_vec();
    for (joint, value) in robot.layout().arm.iter().zip(values) {
        posture[*joint] = *value;
    }
    robot.kinematics().follow(&mut posture);
    posture
}

/// Whether the load stays upright along a path from the current posture without self-collision of
/// the arm.
fn stays_upright(
    robot: &Operator<'_>,
    held: &Held,
    itself: &SelfContact,
    way: &[Vec<f64>],
) -> bool {
    let kinematics = robot.kinematics();
    let fits = |posture: &[f64]| {
        let foot = kinematics.grasp(posture) * held.grasp_from_foot.inverse();
        (foot.rotation * Vector3::z()).angle(&Vector3::z()) <= LEAN_RAD
            && !itself.touches(&kinematics.links(posture))
    };
    let from = std::iter::once(robot.commanded()).chain(way.iter().map(Vec::as_slice));
    from.zip(way).all(|(from, to)| {
        (0..=N_CHECKS).all(|step| {
            let share = f64::from(step) / f64::from(N_CHECKS);
            fits(
                &from
                    .iter()
                    .zip(to)
                    .map(|(a, b)| a + (b - a) * share)
                    .collect::<Vec<f64>>(),
            )
        })
    })
}

/// Postures on a straight path of the hand with fixed orientation and a fixed base, as far as the
/// arm reaches without colliding with the robot.
pub fn straight(robot: &Operator<'_>, from: &[f64], by: &Vector3<f64>) -> Vec<Vec<f64>> {
    let (kinematics, layout) = (robot.kinematics(), robot.layout());
    let mut mobility = vec![0.0; from.len()];
    for idx in &layout.arm {
        mobility[*idx] = 1.0;
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a few dozen steps"
    )]
    let n_steps = (by.norm() / STEP_M).ceil().clamp(0.0, 100.0) as usize;
    let start = kinematics.grasp(from);
    let itself = SelfContact::new(kinematics, &[from.to_vec()]);
    let mut path: Vec<Vec<f64>> = Vec::with_capacity(n_steps);
    for step in 1..=n_steps {
        let mut target = start;
        target.translation.vector += by * (step as f64 / n_steps as f64);
        let seed = path.last().map_or(from, Vec::as_slice);
        let Some(posture) = ik::solve(
            kinematics,
            seed,
            &ik::IkRequest {
                target,
                mobility: mobility.clone(),
            },
        ) else {
            break;
        };
        if itself.touches(&kinematics.links(&posture)) {
            break;
        }
        path.push(posture);
    }
    path
}

/// Drives in front of a piece of furniture: to its front if there is a path, otherwise to another
/// side. If the robot perceived its surroundings earlier, it looks ahead as on every drive;
/// otherwise it relies on the abstract detector. Returns the reason if it did not get there. A
/// robot with a fixed base is always there.
///
/// # Errors
/// [`Interrupt`] if the action has to end.
pub fn drive_before(
    furniture: &Sighting,
    others: &[Sighting],
    robot: &mut Operator<'_>,
) -> Result<Option<String>, Interrupt> {
    let mut reason = (robot.layout().base.is_some()).then(|| "no free path was found".to_owned());
    let looks = robot.memory().perceived.is_some();
    for stand in stands(furniture) {
        if reason.is_none() {
            break;
        }
        if looks {
            reason = navigate::drive_to(stand, robot)?;
        } else if let Some(way) = plan::drive(robot, stand, others) {
            robot.follow(&way, 0.0)?;
            reason = None;
        }
    }
    Ok(reason)
}

/// Base poses facing each of the four sides of a piece of furniture: front, left and right, back.
fn stands(furniture: &Sighting) -> [[f64; 3]; 4] {
    let [x, y, _] = furniture.pose.position;
    let [width, depth, _] = furniture.size_m;
    [(0.0, width), (1.0, depth), (3.0, depth), (2.0, width)].map(|(quarters, across)| {
        let heading = Pose::yaw(&furniture.pose) + quarters * std::f64::consts::FRAC_PI_2;
        let away = across / 2.0 + GAP_M;
        [
            x - libm::cos(heading) * away,
            y - libm::sin(heading) * away,
            heading,
        ]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_base_poses_face_each_side_of_the_table() {
        let pose = Pose::upright([2.0, 1.0, 0.0], std::f64::consts::FRAC_PI_2);
        let shelf = Sighting {
            id: "s".to_owned(),
            pose,
            size_m: [0.4, 1.0, 0.8],
            furniture: true,
            angular: false,
        };
        for ([x, y, heading], across) in stands(&shelf).into_iter().zip([0.4, 1.0, 1.0, 0.4]) {
            let (dx, dy) = (2.0 - x, 1.0 - y);
            assert!((dx.hypot(dy) - across / 2.0 - GAP_M).abs() < 1e-9);
            let gaze = [libm::cos(heading), libm::sin(heading)];
            assert!(
                (gaze[0] * dx + gaze[1] * dy - dx.hypot(dy)).abs() < 1e-9,
                "the base must face the middle"
            );
        }
        // The front of furniture is its negative x side.
        assert!((stands(&shelf)[0][1] - (1.0 - 0.2 - GAP_M)).abs() < 1e-9);
    }
}
