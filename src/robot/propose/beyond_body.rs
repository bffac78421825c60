//! Postures in which the hand is far beyond the body, for mobile robots: they keep the base off the
//! table.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

use super::postures::Search;
use crate::ik::{self, IkRequest};

/// Distance of the hand beyond the body from which the base keeps off a table. Unit: metres.
const ENOUGH_M: f64 = 0.4;
/// Only parts of the body lower than the hand by this are kept off a table. Unit: metres.
const BELOW_M: f64 = 0.15;
/// Horizontal part of the direction of a hand that has a heading.
const LEVEL: f64 = 0.3;
/// Spacing of points on the body. Unit: metres.
const SPACING_M: f64 = 0.1;
/// Headings of the hand relative to the base: the arms of some robots reach aside. Unit: radians.
const TURNS_RAD: [f64; 5] = [0.0, -FRAC_PI_2, FRAC_PI_2, -FRAC_PI_4, FRAC_PI_4];
/// Random postures of the arm tried for each target and heading.
const N_SEEDS: usize = 16;
/// Least gain over the postures so far. Unit: metres.
const GAIN_M: f64 = 0.05;

/// Adds a posture for each target for which the hand can be farther beyond the body, if none so far
/// is far enough.
pub(super) fn add(
    search: &mut Search<'_>,
    targets: &[Isometry3<f64>],
    postures: &mut Vec<Vec<f64>>,
) {
    let points = search.kinematics.surface_points(SPACING_M);
    let beyond = |search: &Search<'_>, posture: &[f64]| beyond_m(search, posture, &points);
    let most = postures
        .iter()
        .map(|posture| beyond(search, posture))
        .fold(f64::NEG_INFINITY, f64::max);
    if search.base.is_empty() || most >= ENOUGH_M {
        return;
    }
    for target in targets.iter().filter(|target| direction(target).is_some()) {
        let mut mobility = search.mobility();
        search
            .base
            .iter()
            .take(2)
            .for_each(|idx| mobility[*idx] = 1.0);
        let mut best: Option<(f64, Vec<f64>)> = None;
        for turn in TURNS_RAD {
            let turned = ik::turned(target, turn);
            // The fingers are alike, so the hand may be turned over.
            let over = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), PI);
            for number in 0..N_SEEDS {
                let target = if number % 2 == 0 {
                    turned
                } else {
                    turned * over
                };
                let reach = IkRequest {
                    target,
                    mobility: mobility.clone(),
                };
                let seed = search.random();
                let Some(found) = search
                    .solve(&seed, &reach)
                    .filter(|found| search.is_free(found))
                else {
                    continue;
                };
                let at = beyond(search, &found).min(ENOUGH_M);
                if best.as_ref().is_none_or(|(most, _)| at > *most) {
                    best = Some((at, found));
                }
            }
        }
        postures.extend(
            best.filter(|(at, _)| *at > most + GAIN_M)
                .map(|(_, found)| found),
        );
    }
}

/// The horizontal direction of a hand that does not point down.
fn direction(hand: &Isometry3<f64>) -> Option<Vector3<f64>> {
    let ahead = hand.rotation * Vector3::x();
    let level = Vector3::new(ahead.x, ahead.y, 0.0);
    (level.norm() > LEVEL).then(|| level.normalize())
}

/// How far the hand is beyond the part of the body that is lower, in the direction of the hand.
/// Unit: metres.
fn beyond_m(search: &Search<'_>, posture: &[f64], points: &[(usize, Point3<f64>)]) -> f64 {
    let hand = search.kinematics.grasp(posture);
    let Some(ahead) = direction(&hand) else {
        return f64::NEG_INFINITY;
    };
    let links = search.kinematics.links(posture);
    let place = hand.translation.vector;
    let below = points
        .iter()
        .map(|(link, point)| (links[*link] * point).coords);
    below
        .filter(|point| point.z < place.z - BELOW_M)
        .map(|point| (place - point).dot(&ahead))
        .fold(f64::INFINITY, f64::min)
}
