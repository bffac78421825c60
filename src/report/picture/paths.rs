//! Paths of base, hand and target during a run, one for each action.

use actcheck_data::{Samples, Trace};

/// The body that moves along a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mover {
    Base,
    Hand,
    Target,
}

/// A path during one action.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Path {
    pub(super) mover: Mover,
    /// Index of the action.
    pub(super) action: usize,
    /// Frame: world. Unit: metres.
    pub(super) points: Vec<[f64; 3]>,
}

/// A path that leads nowhere farther than this from its start is not drawn. Unit: metres.
const SHORTEST_M: f64 = 0.01;
/// Time between two points of a path. Unit: seconds. Samples are far denser than pixels.
const POINT_SECS: f64 = 0.1;
/// The recorded quantities of a position.
const POSITION: [&str; 3] = ["x", "y", "z"];
/// Those of the base, which is on the floor.
const BASE: [&str; 2] = ["baseX", "baseY"];

/// All paths that are long enough to draw. They are those that were recorded: a base that can't
/// move has none.
pub(super) fn paths(trace: &Trace, target: Option<&str>) -> Vec<Path> {
    let has_hand = !trace.lacks.iter().any(|lack| lack == "gripper");
    let followed = [
        (Mover::Base, Some("robot"), &BASE[..]),
        (Mover::Hand, has_hand.then_some("gripper"), &POSITION[..]),
        (Mover::Target, target, &POSITION[..]),
    ];
    let mut paths = Vec::new();
    for (mover, thing, quantities) in followed {
        let Some(thing) = thing else {
            continue;
        };
        let recorded = trace.actions.iter().zip(&trace.robot_courses);
        for (action, (recorded, course)) in recorded.enumerate() {
            if mover == Mover::Base && recorded.base.is_none() {
                continue;
            }
            let points = points(&course.samples, thing, quantities);
            if reach(&points) > SHORTEST_M {
                paths.push(Path {
                    mover,
                    action,
                    points,
                });
            }
        }
    }
    paths
}

/// The recorded positions of a thing; coordinates without a quantity are 0. Empty if one was not
/// recorded.
fn points(samples: &Samples, thing: &str, quantities: &[&str]) -> Vec<[f64; 3]> {
    let mut points = vec![[0.0; 3]; samples.count];
    for (axis, quantity) in quantities.iter().enumerate() {
        let of_thing = samples.series.iter().find(|series| {
            series.thing == thing && series.other.is_empty() && series.quantity == *quantity
        });
        let Some(series) = of_thing else {
            return Vec::new();
        };
        for (point, value) in points.iter_mut().zip(series.values()) {
            point[axis] = value;
        }
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "limited to a small number"
    )]
    let every = (POINT_SECS / samples.period_secs.max(1e-4))
        .round()
        .clamp(1.0, 1e3) as usize;
    let last = points.len().saturating_sub(1);
    points
        .into_iter()
        .enumerate()
        .filter(|(idx, _)| idx % every == 0 || *idx == last)
        .map(|(_, point)| point)
        .collect()
}

/// Largest distance of a point from the first. Unit: metres.
fn reach(points: &[[f64; 3]]) -> f64 {
    let Some(first) = points.first() else {
        return 0.0;
    };
    let from_first = |point: &[f64; 3]| {
        (0..3)
            .map(|axis| (point[axis] - first[axis]).powi(2))
            .sum::<f64>()
            .sqrt()
    };
    points.iter().map(from_first).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::{ActionTrace, RobotCourse, Series};
    use std::collections::BTreeMap;

    /// A second at 100 Hz in which base and hand move by `way_m` along x.
    fn trace(base: Option<[[f64; 2]; 2]>, way_m: f64) -> Trace {
        let mut samples = Samples {
            period_secs: 0.01,
            count: 101,
            series: Vec::new(),
        };
        let of_hand = POSITION.map(|quantity| ("gripper", quantity));
        for (thing, quantity) in BASE.map(|of| ("robot", of)).into_iter().chain(of_hand) {
            let mut series = Series::recorded(thing, "", quantity);
            let speed = if matches!(quantity, "x" | "baseX") {
                way_m
            } else {
                0.0
            };
            (0..101).for_each(|tick| series.push(1.0 + speed * f64::from(tick) / 100.0));
            samples.series.push(series);
        }
        let action = ActionTrace {
            base,
            ..ActionTrace::not_reached("Pick", &BTreeMap::new())
        };
        Trace {
            actions: vec![action],
            robot_courses: vec![RobotCourse {
                samples,
                ..RobotCourse::default()
            }],
            ..Trace::default()
        }
    }

    #[test]
    fn paths_are_those_that_were_recorded() {
        let movers = |trace: &Trace| -> Vec<(Mover, usize, [f64; 3])> {
            let all = paths(trace, Some("can_1")).into_iter();
            all.map(|path| {
                (
                    path.mover,
                    path.points.len(),
                    path.points[path.points.len() - 1],
                )
            })
            .collect()
        };
        let moves = Some([[1.0, 1.0], [1.5, 1.0]]);
        assert_eq!(
            movers(&trace(moves, 0.5)),
            [
                (Mover::Base, 11, [1.5, 1.0, 0.0]),
                (Mover::Hand, 11, [1.5, 1.0, 1.0])
            ]
        );
        assert_eq!(movers(&trace(moves, 0.005)), []);
        // A base that can't move has no path, wherever its links are.
        let fixed = trace(None, 0.5);
        assert_eq!(movers(&fixed), [(Mover::Hand, 11, [1.5, 1.0, 1.0])]);
        let handless = Trace {
            lacks: vec!["gripper".to_owned()],
            ..fixed
        };
        assert_eq!(movers(&handless), []);
    }
}
