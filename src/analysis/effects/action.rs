//! The effects of one action.

use crate::effects::base::belief_error;
use crate::effects::contacts::{self, FirstContact, LargestForce};
use crate::effects::surroundings;
use crate::effects::{PerceptionError, Surrounding};
use actcheck_base::names;
use actcheck_data::{ActionTrace, BodyState, Role, Snapshot, Trace};
use actcheck_history::{ActionDetail, ObjectDetail, RunDetail};

/// Designator of the location that a robot is sent to.
const LOCATION: &str = "objectLocation";
const OBJECT: &str = "pickObject";
/// The action that goes to this location.
const MOVE: &str = "MoveTo";
/// Actions that handle no object, although the run's designators name a target. Any other action
/// may touch its target.
const WITHOUT_OBJECT: [&str; 2] = [MOVE, "PerceivePlane"];

/// The effects of one action: events and errors during it. The default is that of a run without a
/// trace: nothing is known.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ActionEffects {
    /// The perceived position of the target against the true one. `None` if the action did not
    /// perceive it.
    pub perceived: Option<PerceptionError>,
    /// Errors of the believed base pose when the action ended. Units: metres, radians.
    pub localisation_off: Option<[f64; 2]>,
    /// The first contact with a thing that is not to be touched.
    pub first_contact: Option<FirstContact>,
    /// The largest force on such a thing.
    pub largest_force: Option<LargestForce>,
    /// Largest force on the robot's base, and total time of the base's contacts. Units: newtons,
    /// seconds.
    pub base_pressed: Option<[f64; 2]>,
    /// Distance of the base from the location that it was sent to, when the action ended. Unit:
    /// metres.
    pub goal_off_m: Option<f64>,
    /// When the robot first touched the target. Unit: seconds.
    pub target_contact_secs: Option<f64>,
    /// The phase in which it first touched the target.
    pub target_contact_phase: Option<String>,
    /// The last phase that the action began.
    pub last_phase: Option<String>,
    /// The things around the goal, and how hard they were hit.
    pub surroundings: Option<Vec<Surrounding>>,
}

impl ActionEffects {
    /// Derives the effects of a performed action, given its index in the run. `None` without its
    /// trace.
    pub(super) fn of(run: &RunDetail, trace: &Trace, step: usize) -> Option<Self> {
        let view = ActionView::of(run, trace, step)?;
        let after = view.after;
        let target = view.target.map(|target| target.id.as_str());
        let target_contact_secs = target.and_then(|target| contacts::first_touch(&view, target));
        Some(Self {
            perceived: target
                .filter(|_| !view.moves)
                .and_then(|target| PerceptionError::of(trace, step, target)),
            localisation_off: after.map(|after| belief_error(&after.robot)),
            first_contact: contacts::first(&view),
            largest_force: Some(contacts::largest(&view)),
            base_pressed: contacts::on_base(&view),
            goal_off_m: view
                .location
                .filter(|_| view.moves)
                .zip(after)
                .map(|([x, y], after)| {
                    let [base_x, base_y, _] = after.robot.base_true;
                    libm::hypot(base_x - x, base_y - y)
                }),
            target_contact_secs,
            target_contact_phase: target_contact_secs.and_then(|secs| view.phase_at(secs)),
            last_phase: view.action.phases.last().map(|phase| phase.name.clone()),
            surroundings: Some(surroundings::of(&view)),
        })
    }
}

/// A performed action with its states.
pub(super) struct ActionView<'a> {
    run: &'a RunDetail,
    trace: &'a Trace,
    pub action: &'a ActionTrace,
    pub before: &'a Snapshot,
    /// `None` if simulation broke.
    pub after: Option<&'a Snapshot>,
    target: Option<&'a ObjectDetail>,
    /// Whether it goes to the location.
    moves: bool,
    /// Position of the location that the base is sent to.
    location: Option<[f64; 2]>,
    /// Position of the target, or where it was placed; of the location if the action handles no
    /// object.
    pub goal: Option<[f64; 2]>,
    /// Ids of the objects that the robot may touch: the targets if the action handles them, and
    /// those in its hand.
    touchable: Vec<&'a str>,
}

impl<'a> ActionView<'a> {
    fn of(run: &'a RunDetail, trace: &'a Trace, step: usize) -> Option<Self> {
        let (detail, action) = (run.actions.get(step)?, trace.actions.get(step)?);
        let before = trace
            .snapshots
            .get(step)
            .filter(|_| action.end.was_begun())?;
        let kind = names::local(&detail.action);
        let handles = !WITHOUT_OBJECT.contains(&kind);
        let named = |object: &&ObjectDetail| {
            let is_named = |values: &Vec<String>| values.contains(&object.id);
            let is_target = object.role == Role::Target && detail.parameters.values().any(is_named);
            is_target || detail.parameters.get(OBJECT).is_some_and(is_named)
        };
        let held = before
            .robot
            .left_touches
            .iter()
            .filter(|id| before.robot.right_touches.contains(id));
        let held: Vec<&str> = held.map(String::as_str).collect();
        let targets = run
            .objects
            .iter()
            .filter(named)
            .filter(|_| handles)
            .map(|object| object.id.as_str());
        let touchable: Vec<&str> = targets.chain(held.iter().copied()).collect();
        let sent = detail
            .parameters
            .get(LOCATION)
            .and_then(|values| values.first());
        let location = sent.and_then(|sent| {
            trace
                .map
                .locations
                .iter()
                .find(|location| location.name == *sent)
        });
        let location = location.map(|location| [location.at[0], location.at[1]]);
        let after = trace.snapshots.get(step + 1);
        let target = target_of(run, detail);
        let place = |target: &ObjectDetail| {
            let state = if held.contains(&target.id.as_str()) {
                after?
            } else {
                before
            };
            let body = state.bodies.iter().find(|body| body.id == target.id)?;
            Some([body.pose.position[0], body.pose.position[1]])
        };
        Some(Self {
            run,
            trace,
            action,
            before,
            after,
            target,
            moves: kind == MOVE,
            location,
            goal: if handles {
                target.and_then(place)
            } else {
                location
            },
            touchable,
        })
    }

    pub fn may_touch(&self, id: &str) -> bool {
        self.touchable.contains(&id)
    }

    fn body(&self, id: &str) -> Option<&'a BodyState> {
        self.before.bodies.iter().find(|body| body.id == id)
    }

    pub fn is_movable(&self, id: &str) -> bool {
        self.body(id).is_some_and(|body| !body.fixed)
    }

    /// The class of an object: an IRI.
    pub fn category(&self, id: &str) -> Option<String> {
        self.body(id).map(|body| body.category.clone())
    }

    /// The role of an object. Furniture of the world is a platform.
    pub fn role(&self, id: &str) -> Role {
        self.run
            .objects
            .iter()
            .find(|object| object.id == id)
            .map_or(Role::Platform, |object| object.role)
    }

    /// Name of the phase at a time since the action began.
    pub fn phase_at(&self, secs: f64) -> Option<String> {
        self.action
            .phases
            .iter()
            .rev()
            .find(|phase| phase.start_secs <= secs)
            .map(|phase| phase.name.clone())
    }

    /// Name of the robot's link that carries all others: the first one with a shape.
    pub fn base_link(&self) -> Option<&'a str> {
        self.trace
            .forms
            .iter()
            .map(|form| form.name.as_str())
            .find(|name| name.starts_with("robot/"))
    }
}

/// Returns the target of an action: the first one that its designators name, or else the first of
/// the scene.
pub(crate) fn target_of<'a>(run: &'a RunDetail, action: &ActionDetail) -> Option<&'a ObjectDetail> {
    let named = |object: &&ObjectDetail| {
        action
            .parameters
            .values()
            .flatten()
            .any(|value| *value == object.id)
    };
    let targets = || {
        run.objects
            .iter()
            .filter(|object| object.role == Role::Target)
    };
    targets().find(named).or_else(|| targets().next())
}
