//! The perceived position of an action's target against its true position.

use std::collections::BTreeMap;

use crate::effects::ActionEffects;
use crate::effects::action::target_of;
use crate::effects::base::from_base;
use actcheck_base::Outcome;
use actcheck_base::names::mentions;
use actcheck_data::{ActionTrace, BodyState, Look, Pose, RobotState, Trace};
use actcheck_history::{ActionDetail, RunDetail};

/// Tilt beyond which perception sees an object as its upright bounding box. Unit: radians.
const LYING_RAD: f64 = 0.3;
/// Smallest error that a sentence mentions. (1 cm: smaller errors hardly matter to a gripper.)
/// Unit: metres.
const MENTIONED_M: f64 = 0.01;
/// A second direction is mentioned if its part is at least this share of the largest. (It then
/// turns the direction by more than 22°, half of the angle between two directions.)
const SECOND_SHARE: f64 = 0.414;
/// Largest horizontal distance of a percept without an id from the object that it belongs to. Unit:
/// metres.
const NEAR_M: f64 = 0.1;

/// The perceived position minus the true position, in the frame of the robot's base. The error of
/// the localisation is removed: each position is relative to the base pose, perceived to the
/// believed one and true to the true one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PerceptionError {
    /// Unit: metres.
    pub ahead_m: f64,
    /// Unit: metres.
    pub left_m: f64,
    /// Unit: metres.
    pub above_m: f64,
}

impl PerceptionError {
    /// Returns the error with which an action perceived its target: that of its last picture if the
    /// trace has the pose of the base at that time, otherwise that of the first picture, by the
    /// base pose before the action. Returns `None` if the action did not perceive it.
    pub(super) fn of(trace: &Trace, step: usize, target: &str) -> Option<Self> {
        let (action, before) = (trace.actions.get(step)?, trace.snapshots.get(step)?);
        let body = before.bodies.iter().find(|body| body.id == target)?;
        let named = || {
            action
                .percepts
                .iter()
                .filter(move |percept| percept.id == target)
        };
        let looked = named()
            .rev()
            .find_map(|percept| Some((percept, percept.look.as_ref()?)));
        match (looked, named().next()) {
            (Some((percept, look)), _) => {
                Some(Self::between(&percept.pose, bases_at(look), foot(body)))
            }
            (None, Some(percept)) => Some(Self::between(
                &percept.pose,
                bases_of(&before.robot),
                foot(body),
            )),
            (None, None) => Self::of_unnamed(action, body, &before.bodies, &before.robot),
        }
    }

    /// Returns the error of the percept without an id that is nearest to the target, if no other
    /// object is nearer to it.
    fn of_unnamed(
        action: &ActionTrace,
        body: &BodyState,
        bodies: &[BodyState],
        robot: &RobotState,
    ) -> Option<Self> {
        let perceived = action.perceived.as_ref()?;
        let things = &perceived.things;
        let bases = perceived
            .look
            .as_ref()
            .map_or_else(|| bases_of(robot), bases_at);
        let error = |pose: &Pose, body: &BodyState| Self::between(pose, bases, foot(body));
        let nearest = things
            .iter()
            .map(|thing| &thing.pose)
            .min_by(|a, b| error(a, body).off_m().total_cmp(&error(b, body).off_m()))?;
        let found = error(nearest, body);
        let mut movable = bodies
            .iter()
            .filter(|other| !other.fixed && other.id != body.id);
        let rivalled = movable.any(|other| error(nearest, other).off_m() < found.off_m());
        (found.off_m() <= NEAR_M && !rivalled).then_some(found)
    }

    fn between(
        perceived: &Pose,
        Bases {
            base_true,
            base_believed,
        }: Bases,
        truth: [f64; 3],
    ) -> Self {
        let [x, y, z] = perceived.position;
        let [perceived, truth_from_base] = [
            from_base(base_believed, [x, y]),
            from_base(base_true, [truth[0], truth[1]]),
        ];
        Self {
            ahead_m: perceived[0] - truth_from_base[0],
            left_m: perceived[1] - truth_from_base[1],
            above_m: z - truth[2],
        }
    }

    /// Horizontal distance. Unit: metres.
    pub fn off_m(&self) -> f64 {
        libm::hypot(self.ahead_m, self.left_m)
    }

    /// Describes the error of an object with an id, such as
    /// `glass_1 was perceived 5.3 cm left of where it was`. Returns `None` for an error below 1 cm.
    pub fn sentence(&self, id: &str) -> Option<String> {
        Some(format!("{id} was {}", self.words()?))
    }

    /// Describes the error, such as `perceived 5.3 cm left of where it was`, as seen from the
    /// robot's base: *behind* is farther ahead of it. Returns `None` for an error below 1 cm.
    pub fn words(&self) -> Option<String> {
        let parts = [
            (self.left_m, ["left of", "right of"]),
            (self.ahead_m, ["behind", "in front of"]),
            (self.above_m, ["above", "below"]),
        ];
        let largest = parts.iter().map(|(part, _)| part.abs()).fold(0.0, f64::max);
        let mentioned: Vec<String> = parts
            .iter()
            .filter(|(part, _)| part.abs() >= MENTIONED_M && part.abs() >= SECOND_SHARE * largest)
            .map(|(part, [positive, negative])| {
                let word = if *part > 0.0 { positive } else { negative };
                format!("{:.1} cm {word}", part.abs() * 100.0)
            })
            .collect();
        let place = match mentioned.as_slice() {
            [] => return None,
            [first @ .., last] if !first.is_empty() => format!("{} and {last}", first.join(", ")),
            all => all.join(""),
        };
        Some(format!("perceived {place} where it was"))
    }
}

/// The true and the believed pose of the base at one moment.
#[derive(Debug, Clone, Copy)]
struct Bases {
    base_true: [f64; 3],
    base_believed: [f64; 3],
}

fn bases_of(robot: &RobotState) -> Bases {
    Bases {
        base_true: robot.base_true,
        base_believed: robot.base_believed,
    }
}

fn bases_at(look: &Look) -> Bases {
    Bases {
        base_true: look.base_true,
        base_believed: look.base_believed,
    }
}

/// The point that perception reports: the origin of a standing object, or the centre of the lower
/// side of a lying object's bounding box.
fn foot(body: &BodyState) -> [f64; 3] {
    if body.pose.tilt() <= LYING_RAD {
        return body.pose.position;
    }
    let middle = |axis: usize| (body.aabb_min[axis] + body.aabb_max[axis]) / 2.0;
    [middle(0), middle(1), body.aabb_min[2]]
}

/// Returns, for each action in which a property failed, the sentence about the perception of its
/// target, by the action's position in the test (from 1). Left out are actions without such an
/// error, and those whose failures are only about other objects.
pub fn perceived_sentences(run: &RunDetail, trace: &Trace) -> BTreeMap<u32, String> {
    run.actions
        .iter()
        .filter_map(|action| {
            let step = usize::try_from(action.step.checked_sub(1)?).ok()?;
            let target = &target_of(run, action)?.id;
            let objects = || run.objects.iter().map(|object| object.id.as_str());
            let concerns = |witness| concerns_target(witness, Some(target), objects(), mentions);
            if !failures(action).any(concerns) {
                return None;
            }
            let error = ActionEffects::of(run, trace, step)?.perceived?;
            Some((action.step, error.sentence(target)?))
        })
        .collect()
}

/// The witnesses of the failures of an action.
fn failures(action: &ActionDetail) -> impl Iterator<Item = &str> {
    let failed = action
        .judgements
        .iter()
        .filter(|judgement| judgement.outcome == Outcome::Failed);
    failed.map(|judgement| judgement.witness.as_str())
}

/// Whether the witness of a failure mentions the target, or no object at all: a failure that is only
/// about other objects does not come from the perception of the target. `mentions` finds the name of
/// an object in a text.
pub fn concerns_target<'a>(
    witness: &str,
    target: Option<&str>,
    mut objects: impl Iterator<Item = &'a str>,
    mentions: impl Fn(&str, &str) -> bool,
) -> bool {
    target.is_none_or(|target| mentions(witness, target))
        || !objects.any(|object| mentions(witness, object))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(left_m: f64, ahead_m: f64, above_m: f64) -> Option<String> {
        PerceptionError {
            ahead_m,
            left_m,
            above_m,
        }
        .sentence("glass_1")
    }

    #[test]
    fn a_sentence_names_the_largest_parts_of_an_error() {
        let expected = |place: &str| Some(format!("glass_1 was perceived {place} where it was"));
        assert_eq!(said(0.053, 0.01, 0.0), expected("5.3 cm left of"));
        assert_eq!(said(-0.053, 0.0, 0.0), expected("5.3 cm right of"));
        assert_eq!(said(0.0, 0.02, 0.0), expected("2.0 cm behind"));
        assert_eq!(said(0.0, -0.02, 0.0), expected("2.0 cm in front of"));
        assert_eq!(said(0.002, 0.0, -0.03), expected("3.0 cm below"));
        assert_eq!(
            said(0.04, -0.03, 0.005),
            expected("4.0 cm left of and 3.0 cm in front of")
        );
        assert_eq!(said(0.009, -0.009, 0.0), None);
    }

    #[test]
    fn the_error_of_the_localisation_is_removed() {
        // The robot at (1, 2) faces along y and believes to be a quarter metre ahead and turned by
        // 0.1.
        let (base_true, turn) = ([1.0, 2.0, std::f64::consts::FRAC_PI_2], 0.1);
        let believed = [1.0, 2.25, std::f64::consts::FRAC_PI_2 + turn];
        // An object 1 m ahead is perceived 0.05 m to its left, in the believed frame.
        let [x, y] = super::super::base::turned([1.0, 0.05], believed[2]);
        let perceived = Pose::upright([believed[0] + x, believed[1] + y, 0.72], 0.0);
        let error = PerceptionError::between(
            &perceived,
            Bases {
                base_true,
                base_believed: believed,
            },
            [1.0, 3.0, 0.7],
        );
        assert!(
            (error.left_m - 0.05).abs() < 1e-12 && error.ahead_m.abs() < 1e-12,
            "{error:?}"
        );
        assert!((error.above_m - 0.02).abs() < 1e-12 && (error.off_m() - 0.05).abs() < 1e-12);
    }
}
