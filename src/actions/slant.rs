//! Grasps of objects that the usual grasps don't reach: the hand slants at many angles and comes as
//! close to the surface as its own shape allows.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, TAU};

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use crate::grasp::{
    Approach, Grasp, TOP_DEPTH_M, centred, hand, is_round, opening_before_m, room_m, width_across,
};
use crate::motion::moved_links;
use crate::operator::Operator;
use crate::plan::FURNITURE_CLEAR_M;
use actcheck_world::{Cluster, JointKind, Sighting, Sphere, sphere_tree};

/// Downward pitches of the hand, from straight down to nearly level. Unit: radians.
const PITCHES_RAD: [f64; 7] = [FRAC_PI_2, 1.3, 1.1, 0.95, 0.75, 0.55, 0.4];
/// Pitches tried where the hand's heading differs from that of the base.
const TURNED_PITCHES_RAD: [f64; 4] = [FRAC_PI_2, 1.2, 0.9, 0.6];
/// Distance of the hand from the surface: the planner's least, and the error of inverse kinematics.
/// Unit: metres.
const CLEAR_M: f64 = FURNITURE_CLEAR_M + 0.0015;
/// Distance of the hand from the object before the fingers close. Unit: metres.
const BESIDE_M: f64 = 0.003;
/// Number of hand headings, the first along the object.
const N_HEADINGS: u32 = 24;
/// Penalty per radian between the hand and the vertical.
const SLANT_COST: f64 = 0.2;
/// The same for flat objects, which a slanted hand holds with less of its fingers.
const FLAT_SLANT_COST: f64 = 1.5;
/// How far from the middle of an object, towards the hand, it is grasped if the palm does not fit
/// over it. Unit: metres.
const SHIFTS_M: [f64; 3] = [0.0, 0.02, 0.04];
/// Least length of the object beyond the grasp frame. Unit: metres. Half the width of a finger.
const HELD_M: f64 = 0.012;
/// Penalty per metre of that shift.
const SHIFT_COST: f64 = 2.0;
/// Penalty of fingers at 45 degrees to the sides of an object that is not round: it turns between
/// them.
const CORNER_COST: f64 = 0.4;
/// Penalty per radian between the headings of hand and base.
const TURNED_COST: f64 = 0.1;
/// Spacing of the points on the hand. Unit: metres.
const SPACING_M: f64 = 0.02;

/// Openings at which turning fingers are looked at while they close: their tips swing out. Shares
/// of the widest.
const CLOSING: [f64; 4] = [0.8, 0.6, 0.4, 0.2];

/// Number of points that are looked at together.
const CLUSTER: usize = 8;
/// Rounding error of heights. Unit: metres.
const ROUNDING_M: f64 = 1e-9;

/// Points on the hand, in the frame of the grasp.
pub(crate) struct Hand {
    /// Of the open hand.
    open: Vec<Point3<f64>>,
    /// The same, and those of fingers that turn while they close.
    swept: Swept,
}

/// Points in clusters, each with its place in the list that they were made from.
struct Swept {
    points: Vec<(usize, Point3<f64>)>,
    clusters: Vec<Cluster>,
}

impl Swept {
    fn new(points: impl Iterator<Item = Point3<f64>>) -> Self {
        let mut points: Vec<(usize, Point3<f64>)> = points.enumerate().collect();
        let clusters = sphere_tree(&mut points, CLUSTER, |(_, point)| Sphere {
            middle: *point,
            radius: 0.0,
        });
        Self { points, clusters }
    }

    /// The lowest point with the hand turned like this: the first one of equally low ones.
    fn lowest(&self, turn: &UnitQuaternion<f64>) -> Vector3<f64> {
        let mut lowest: Option<(usize, Vector3<f64>)> = None;
        let mut idx = 0;
        while let Some(cluster) = self.clusters.get(idx) {
            let least_m =
                (turn * cluster.around.middle.coords).z - cluster.around.radius - ROUNDING_M;
            if lowest.is_some_and(|(_, lowest)| least_m > lowest.z) {
                idx = cluster.next;
                continue;
            }
            let turned = self.points[cluster.things.clone()]
                .iter()
                .map(|(place, point)| (*place, turn * point.coords));
            lowest = lowest
                .into_iter()
                .chain(turned)
                .min_by(|a, b| a.1.z.total_cmp(&b.1.z).then(a.0.cmp(&b.0)));
            idx += 1;
        }
        lowest.map(|(_, point)| point).unwrap_or_default()
    }
}

impl Hand {
    /// The hand of a robot, open for an object.
    pub(crate) fn new(thing: &Sighting, robot: &Operator<'_>) -> Self {
        let (kinematics, layout) = (robot.kinematics(), robot.layout());
        let is_hand = moved_links(kinematics, layout.arm.last().copied().as_slice());
        let mut points = kinematics.surface_points(SPACING_M);
        points.retain(|(link, _)| is_hand[*link]);
        let at = |opening_m: f64| -> Vec<Point3<f64>> {
            let mut posture = robot.commanded().to_vec();
            layout.gripper.set(&mut posture, opening_m);
            let links = kinematics.links(&posture);
            let from_world = kinematics.grasp(&posture).inverse();
            points
                .iter()
                .map(|(link, point)| from_world * links[*link] * point)
                .collect()
        };
        let open = at(opening_before_m(thing, robot));
        let closing = closing_m(robot).into_iter().flat_map(at);
        Self {
            swept: Swept::new(open.iter().copied().chain(closing)),
            open,
        }
    }

    /// Height of the grasp frame above the lowest point of a hand, and how far ahead of it that
    /// point is. Unit: metres.
    fn lowest(&self, turned: &Isometry3<f64>, ahead: &Vector3<f64>) -> (f64, f64) {
        let lowest = self.swept.lowest(&turned.rotation);
        (-lowest.z, lowest.dot(ahead))
    }

    /// Whether the hand at a pose is clear of the object, also on the way straight down to it.
    pub(crate) fn is_beside(&self, pose: &Isometry3<f64>, thing: &Sighting) -> bool {
        let from_world = thing.pose.to_isometry().inverse() * pose;
        let [width, depth, height] = thing.size_m;
        let is_over = |point: &Point3<f64>| match is_round(thing) {
            true => {
                point.x * point.x + point.y * point.y < (width.max(depth) / 2.0 + BESIDE_M).powi(2)
            }
            false => {
                point.x.abs() < width / 2.0 + BESIDE_M && point.y.abs() < depth / 2.0 + BESIDE_M
            }
        };
        self.open
            .iter()
            .map(|point| from_world * point)
            .all(|point| point.z > height + BESIDE_M || !is_over(&point))
    }
}

/// Openings of fingers that turn, on their way from the widest to nearly closed. Empty for fingers
/// that slide, which do not come closer to the surface. Unit: metres.
pub(crate) fn closing_m(robot: &Operator<'_>) -> Vec<f64> {
    let joints = robot.kinematics().joints();
    let turns = robot
        .layout()
        .gripper
        .joints()
        .any(|idx| joints[idx].kind == JointKind::Revolute);
    let widest_m = robot.profile().hand.max_opening_m;
    CLOSING
        .into_iter()
        .filter(|_| turns)
        .map(|share| share * widest_m)
        .collect()
}

/// Grasps with the hand ahead of the base, at many slants.
pub(crate) fn ahead(thing: &Sighting, hand: &Hand, robot: &Operator<'_>) -> Vec<Grasp> {
    all(thing, hand, robot, (&PITCHES_RAD, &[0.0]))
}

/// Grasps with the hand turned relative to the base.
pub(crate) fn aside(thing: &Sighting, hand: &Hand, robot: &Operator<'_>) -> Vec<Grasp> {
    all(
        thing,
        hand,
        robot,
        (
            &TURNED_PITCHES_RAD,
            &[FRAC_PI_4, -FRAC_PI_4, FRAC_PI_2, -FRAC_PI_2],
        ),
    )
}

fn all(
    thing: &Sighting,
    hand: &Hand,
    robot: &Operator<'_>,
    (pitches, turns): (&[f64], &[f64]),
) -> Vec<Grasp> {
    if robot.has_cup() {
        // A slanted cup does not lie on the surface.
        return Vec::new();
    }
    let along = thing.pose.yaw();
    let only = robot
        .kinematics()
        .only_pitch(&robot.layout().arm, robot.commanded());
    let pitches = only.as_ref().map_or(pitches, std::slice::from_ref);
    let (mut found, opening_m) = (Vec::new(), opening_before_m(thing, robot));
    for idx in 0..N_HEADINGS {
        let heading = along + TAU * f64::from(idx) / f64::from(N_HEADINGS);
        if width_across(thing, heading) + room_m(thing, opening_m) > opening_m {
            continue;
        }
        for pitch in pitches {
            let Some(grasp) = at(thing, hand, robot, (heading, *pitch)) else {
                continue;
            };
            found.extend(turns.iter().map(|turn| Grasp {
                heading: heading + turn,
                penalty: grasp.penalty + TURNED_COST * turn.abs(),
                ..grasp.clone()
            }));
        }
    }
    centred(found, thing, robot)
}

/// The grasp with this heading and downward pitch of the hand; `None` if the hand would touch the
/// object.
fn at(
    thing: &Sighting,
    shape: &Hand,
    robot: &Operator<'_>,
    (heading, pitch): (f64, f64),
) -> Option<Grasp> {
    let level = hand(thing, 0.0, heading, pitch);
    let forward = Vector3::new(libm::cos(heading), libm::sin(heading), 0.0);
    let (lowest_m, ahead_m) = shape.lowest(&level, &forward);
    let top = thing.size_m[2];
    let height = (top - TOP_DEPTH_M).max(lowest_m + CLEAR_M);
    // Only the fingertips reach an object below the grasp frame: its middle belongs between them.
    let is_flat = top < height;
    let tips = if is_flat { ahead_m } else { 0.0 };
    let pose = |back_m: f64| {
        Translation3::from(forward * -(tips + back_m)) * hand(thing, height, heading, pitch)
    };
    let half = width_across(thing, heading + FRAC_PI_2) / 2.0;
    let mut shifts = SHIFTS_M
        .into_iter()
        .filter(|back_m| *back_m == 0.0 || *back_m + HELD_M <= half);
    let back_m = shifts.find(|back_m| shape.is_beside(&pose(*back_m), thing))?;
    let askew = if is_round(thing) {
        0.0
    } else {
        libm::sin(2.0 * (heading - thing.pose.yaw())).abs()
    };
    let slant_cost = if is_flat { FLAT_SLANT_COST } else { SLANT_COST };
    let penalty = slant_cost * (FRAC_PI_2 - pitch) + CORNER_COST * askew + SHIFT_COST * back_m;
    let pose = pose(back_m);
    let opening_m = opening_before_m(thing, robot);
    Some(Grasp {
        approach: Approach::Top,
        pose,
        heading,
        opening_m,
        penalty,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Clusters never change which point is found, also if several are equally low.
    #[test]
    fn the_lowest_point_is_the_first_of_the_lowest() {
        let at = |n: u32| libm::sin(f64::from(n * n) * 12.9898);
        for trial in 0..200 {
            let of =
                |n: u32| Point3::new(at(n), at(n + 50), (at(n + 99) * 4.0).round() / 4.0) * 0.1;
            let points: Vec<Point3<f64>> = (trial..2 * trial).map(of).collect();
            let turn = match trial % 3 {
                0 => UnitQuaternion::identity(),
                _ => {
                    UnitQuaternion::from_euler_angles(at(trial), 1.5 * at(trial + 1), at(trial + 2))
                }
            };
            let all = points.iter().map(|point| turn * point.coords);
            let plain = all.min_by(|a, b| a.z.total_cmp(&b.z)).unwrap_or_default();
            assert_eq!(
                Swept::new(points.iter().copied()).lowest(&turn),
                plain,
                "trial {trial}"
            );
        }
    }
}
