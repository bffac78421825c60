//! The source of a row: one property of one action of a run, in its scene.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

use crate::effects::target_of;
use crate::{ActionEffects, RealisedNoise};
use actcheck_base::Judgement;
use actcheck_data::Role;
use actcheck_history::{ActionDetail, ObjectDetail, RunDetail};

/// Maps each class (an IRI) to the local names of all its superclasses, nearest first.
pub type Hierarchy = BTreeMap<String, Vec<String>>;

/// The source data of one row.
#[derive(Debug, Clone)]
pub(super) struct RowSource<'a> {
    pub run: &'a RunDetail,
    pub action: &'a ActionDetail,
    pub judgement: &'a Judgement,
    pub scene: &'a ActionScene<'a>,
    pub noise: &'a RealisedNoise,
    pub effects: &'a ActionEffects,
}

/// The objects related to an action.
#[derive(Debug, Clone)]
pub(super) struct ActionScene<'a> {
    /// The first target named by the action's designators, or else the first target of the scene.
    pub target: Option<&'a ObjectDetail>,
    /// The platform named by the designators, or else any platform. Of several, the one whose
    /// centre is nearest to the target.
    pub surface: Option<&'a ObjectDetail>,
    /// The object nearest to the target, except platforms, with its distance. Unit: metres.
    pub neighbour: Option<(&'a ObjectDetail, f64)>,
    /// Smallest horizontal distance of an obstacle's centre from the straight line to the target.
    /// Unit: metres.
    pub obstacle_distance_m: Option<f64>,
}

impl<'a> ActionScene<'a> {
    pub fn of(run: &'a RunDetail, action: &ActionDetail) -> Self {
        let named = |object: &&ObjectDetail| {
            action
                .parameters
                .values()
                .flatten()
                .any(|value| *value == object.id)
        };
        let target = target_of(run, action);
        // Designators of transport tests name several platforms: the nearest one is under the
        // target.
        let platforms = || {
            run.objects
                .iter()
                .filter(|object| object.role == Role::Platform)
        };
        let among = |wanted: &dyn Fn(&&'a ObjectDetail) -> bool| match target {
            Some(target) => platforms()
                .filter(|it| wanted(it))
                .min_by(|a, b| distance(a, target).total_cmp(&distance(b, target))),
            None => platforms().find(|it| wanted(it)),
        };
        let surface = among(&named).or_else(|| among(&|_| true));
        let others = |target: &'a ObjectDetail| {
            let loose = run
                .objects
                .iter()
                .filter(|object| object.role != Role::Platform);
            loose
                .filter(move |object| object.id != target.id)
                .map(move |object| (object, distance(object, target)))
        };
        let neighbour = target.and_then(|target| others(target).min_by(|a, b| a.1.total_cmp(&b.1)));
        let obstacles = || {
            run.objects
                .iter()
                .filter(|object| object.role == Role::Obstacle)
        };
        let way =
            |target: &ObjectDetail| [[run.robot_base[0], run.robot_base[1]], [target.x, target.y]];
        let from_way =
            |target| obstacles().map(move |object| from_segment([object.x, object.y], way(target)));
        let obstacle_distance_m = target.and_then(|target| from_way(target).min_by(f64::total_cmp));
        Self {
            target,
            surface,
            neighbour,
            obstacle_distance_m,
        }
    }

    /// Returns the target's position relative to the robot's base. `None` if the run has no target.
    /// Unit: metres. Shape: ahead, to the left.
    pub fn target_from_base(&self, base: [f64; 3]) -> Option<[f64; 2]> {
        self.target
            .map(|target| turned([target.x - base[0], target.y - base[1]], -base[2]))
    }

    /// Returns the target's position relative to the centre of its surface, along the surface's
    /// axes. `None` if the run has no target or no surface. Unit: metres.
    pub fn target_on_surface(&self) -> Option<[f64; 2]> {
        let (target, surface) = (self.target?, self.surface?);
        Some(turned(
            [target.x - surface.x, target.y - surface.y],
            -surface.yaw,
        ))
    }

    /// Returns the direction from the target to its neighbour: 0 is towards the robot's base,
    /// positive is counter-clockwise from above. Unit: radians, in [-π, π). `None` if the target
    /// has no neighbour.
    pub fn neighbour_direction(&self, base: [f64; 3]) -> Option<f64> {
        let (target, (neighbour, _)) = (self.target?, self.neighbour?);
        let to_robot = libm::atan2(base[1] - target.y, base[0] - target.x);
        Some(angle(
            libm::atan2(neighbour.y - target.y, neighbour.x - target.x) - to_robot,
        ))
    }
}

/// Normalises an angle to [-π, π). Unit: radians.
pub(super) fn angle(radians: f64) -> f64 {
    let turned = (radians + PI).rem_euclid(TAU) - PI;
    // Rounding may yield π.
    if turned < PI { turned } else { -PI }
}

fn distance(a: &ObjectDetail, b: &ObjectDetail) -> f64 {
    libm::hypot(a.x - b.x, a.y - b.y)
}

fn turned([x, y]: [f64; 2], radians: f64) -> [f64; 2] {
    let (sin, cos) = libm::sincos(radians);
    [cos * x - sin * y, sin * x + cos * y]
}

fn from_segment(point: [f64; 2], [from, to]: [[f64; 2]; 2]) -> f64 {
    let (along, away) = (
        [to[0] - from[0], to[1] - from[1]],
        [point[0] - from[0], point[1] - from[1]],
    );
    let length = along[0] * along[0] + along[1] * along[1];
    let share = if length > 0.0 {
        ((away[0] * along[0] + away[1] * along[1]) / length).clamp(0.0, 1.0)
    } else {
        0.0
    };
    libm::hypot(away[0] - share * along[0], away[1] - share * along[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_and_distances_match_a_calculation_by_hand() {
        assert_eq!(angle(1.5 * PI), -0.5 * PI);
        assert_eq!(angle(PI), -PI);
        assert_eq!(angle(-0.0), 0.0);
        let way = [[0.0, 0.0], [2.0, 0.0]];
        assert_eq!(from_segment([1.0, 0.5], way), 0.5);
        assert_eq!(from_segment([5.0, 4.0], way), 5.0);
        assert_eq!(from_segment([3.0, 4.0], [[0.0, 0.0]; 2]), 5.0);
        let [x, y] = turned([1.0, 0.0], PI / 2.0);
        assert!(x.abs() < 1e-15 && (y - 1.0).abs() < 1e-15);
    }
}
