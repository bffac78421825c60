//! Arms that are too short to reach over the edge of a table: they are mounted on it.

use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

use nalgebra::{Point3, Vector3};

use super::GraspFrame;
use super::postures::{Search, Standing, hand};
use crate::RobotError;
use crate::description::RobotModel;
use crate::ik::IkRequest;
use actcheck_data::RobotRoles;

/// Longest arm that is mounted on the surface. Unit: metres. In front of a table, an arm has a
/// quarter of a metre before it.
const SHORT_M: f64 = 0.65;
/// Heights of the hand that takes a small object from above, and one as tall as a can, and how far
/// it lifts them. Unit: metres.
const LOW_M: f64 = 0.03;
const TALL_M: f64 = 0.1;
const LIFT_M: f64 = 0.06;
/// Downward pitches of a hand that takes an object from above. Unit: radians.
const PITCHES_RAD: [f64; 12] = [
    FRAC_PI_2, 1.5, 1.4, 1.3, 1.2, 1.1, 1.0, 0.9, 0.8, 0.7, 0.6, 0.5,
];
/// The same for a hand that takes a tall object, also level.
const TALL_PITCHES_RAD: [f64; 6] = [FRAC_PI_2, 1.2, 0.9, 0.6, 0.3, 0.0];
/// Spacing of the distances that are tried. Unit: metres.
const STEP_M: f64 = 0.01;
/// Random seeds for each distance, besides the postures of the profile.
const N_SEEDS: usize = 6;

/// The place of an arm on the surface.
pub(super) struct OnSurface {
    /// Height of its root above the surface. Unit: metres.
    pub(super) height_m: f64,
    /// Rotation of its root about the vertical. Unit: radians.
    pub(super) turned_rad: f64,
}

/// Returns the place of a short arm on the surface: with its lowest shape there, so that it works
/// along the x axis. Returns `None` if the arm is not short.
pub(super) fn on_surface(
    roles: RobotRoles<'_>,
    model: &Arc<RobotModel>,
    grasp: GraspFrame,
    lowest_m: f64,
    notes: &mut BTreeMap<&'static str, String>,
) -> Result<Option<OnSurface>, RobotError> {
    let standing = Standing::new(roles, model, grasp)?;
    let (search, samples) = standing.search();
    if search.arm_reach().1 > SHORT_M {
        return Ok(None);
    }
    let mut place = OnSurface {
        height_m: (-lowest_m * 1e3).round() / 1e3,
        turned_rad: roles.core.mount_turned_rad,
    };
    notes.remove("mount_height_m");
    notes.insert(
        "mount",
        "the arm is too short to reach over the edge of a table".to_owned(),
    );
    let quarters = search
        .bearing(&samples)
        .map_or(0.0, |bearing| (bearing / FRAC_PI_2).round());
    if quarters != 0.0 {
        place.turned_rad = -(quarters * FRAC_PI_2 * 1e4).round() / 1e4;
        notes.insert(
            "mount_turned_rad",
            "the middle of the arm's range then points forwards".to_owned(),
        );
    }
    Ok(Some(place))
}

/// Measures at which distances from its root the arm takes objects from above.
pub(super) fn reach_m(
    roles: RobotRoles<'_>,
    postures: &[Vec<f64>],
    model: &Arc<RobotModel>,
    grasp: GraspFrame,
    notes: &mut BTreeMap<&'static str, String>,
) -> Result<Option<[f64; 2]>, RobotError> {
    let standing = Standing::new(roles, model, grasp)?;
    let (mut search, _) = standing.search();
    notes.insert(
        "reach_m",
        "where the hand takes low objects from above and tall ones, and lifts them".to_owned(),
    );
    Ok(distances(&mut search, postures))
}

/// The nearest and farthest of these distances.
fn distances(search: &mut Search<'_>, postures: &[Vec<f64>]) -> Option<[f64; 2]> {
    let (shoulder, length) = search.arm_reach();
    let mut seeds: Vec<Vec<f64>> = postures
        .iter()
        .map(|posture| search.with_arm(posture))
        .collect();
    seeds.extend((0..N_SEEDS).map(|_| search.random()));
    let steps = std::iter::successors(Some(STEP_M), |at| Some(at + STEP_M))
        .take_while(|at| *at < length + shoulder.x);
    let taken: Vec<f64> = steps
        .filter(|ahead| {
            let place = |height_m| Point3::new(*ahead, shoulder.y, height_m);
            let reaches = |place: Point3<f64>, pitches: &[f64]| {
                pitches
                    .iter()
                    .any(|pitch| seeds.iter().any(|seed| takes(search, seed, &place, *pitch)))
            };
            reaches(place(LOW_M), &PITCHES_RAD) && reaches(place(TALL_M), &TALL_PITCHES_RAD)
        })
        .collect();
    Some([*taken.first()?, *taken.last()?].map(|at| (at * 1e3).round() / 1e3))
}

/// Whether the arm reaches a place with the hand at this pitch, and lifts it straight up.
fn takes(search: &Search<'_>, seed: &[f64], place: &Point3<f64>, pitch: f64) -> bool {
    let at = |place: Point3<f64>| IkRequest {
        target: hand(&place, 0.0, pitch),
        mobility: search.mobility(),
    };
    let Some(low) = search.solve(seed, &at(*place)) else {
        return false;
    };
    let high = search.solve(&low, &at(place + Vector3::z() * LIFT_M));
    search.is_free(&low) && high.is_some_and(|high| search.is_free(&high))
}
