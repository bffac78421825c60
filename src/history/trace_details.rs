//! The fields of a trace that its first format did not have. They follow that format in the file,
//! so that traces of earlier versions can still be read.

use serde::{Deserialize, Serialize};

use actcheck_data::{
    ActionTrace, Clearance, CupState, Interval, LinkState, Look, RobotCourse, SelfPress, Snapshot,
    Trace,
};

/// The later fields of a whole trace, in the order of its parts.
#[derive(Default, Serialize, Deserialize)]
pub(super) struct Details {
    snapshots: Vec<SnapshotDetails>,
    actions: Vec<ActionDetails>,
    clearances: Vec<Vec<Clearance>>,
}

/// The holds and motions of each action, which follow [`Details`] in the file.
#[derive(Default, Serialize, Deserialize)]
pub(super) struct Intervals(Vec<Option<Vec<Interval>>>);

impl Intervals {
    pub(super) fn of(trace: &Trace) -> Self {
        Self(
            trace
                .robot_courses
                .iter()
                .map(|course| course.intervals.clone())
                .collect(),
        )
    }

    /// Sets the intervals of each action. Does nothing for traces of earlier versions, which have
    /// none.
    pub(super) fn fill(self, trace: &mut Trace) {
        for (course, intervals) in trace.robot_courses.iter_mut().zip(self.0) {
            course.intervals = intervals;
        }
    }
}

/// The suction cup in each snapshot, which follows [`Intervals`] in the file if the robot has one.
#[derive(Default, Serialize, Deserialize)]
pub(super) struct Cups(Vec<Option<CupState>>);

impl Cups {
    /// Returns `None` if the robot has fingers.
    pub(super) fn of(trace: &Trace) -> Option<Self> {
        let cups: Vec<Option<CupState>> = trace
            .snapshots
            .iter()
            .map(|snapshot| snapshot.robot.cup)
            .collect();
        cups.iter().any(Option::is_some).then_some(Self(cups))
    }

    /// Sets the cup in each snapshot.
    pub(super) fn fill(self, trace: &mut Trace) {
        for (snapshot, cup) in trace.snapshots.iter_mut().zip(self.0) {
            snapshot.robot.cup = cup;
        }
    }
}

/// How hard links pressed each other in each action, and the bodies that had left the world in each
/// snapshot, which follow [`Cups`] in the file if there are any.
#[derive(Default, Serialize, Deserialize)]
pub(super) struct Marks {
    presses: Vec<Vec<Option<SelfPress>>>,
    left: Vec<Vec<String>>,
}

impl Marks {
    /// Returns `None` if no links met and nothing left the world.
    pub(super) fn of(trace: &Trace) -> Option<Self> {
        let presses = |course: &RobotCourse| {
            course
                .self_contacts
                .iter()
                .map(|contact| contact.press)
                .collect()
        };
        let left = |snapshot: &Snapshot| {
            let left = snapshot.bodies.iter().filter(|body| body.left_world);
            left.map(|body| body.id.clone()).collect()
        };
        let marks = Self {
            presses: trace.robot_courses.iter().map(presses).collect(),
            left: trace.snapshots.iter().map(left).collect(),
        };
        let is_empty = marks.presses.iter().flatten().all(Option::is_none)
            && marks.left.iter().all(Vec::is_empty);
        (!is_empty).then_some(marks)
    }

    /// Sets these fields of a trace.
    pub(super) fn fill(self, trace: &mut Trace) {
        for (course, presses) in trace.robot_courses.iter_mut().zip(self.presses) {
            for (contact, press) in course.self_contacts.iter_mut().zip(presses) {
                contact.press = press;
            }
        }
        for (snapshot, left) in trace.snapshots.iter_mut().zip(self.left) {
            for body in &mut snapshot.bodies {
                body.left_world = left.contains(&body.id);
            }
        }
    }
}

/// The later fields of a snapshot.
#[derive(Serialize, Deserialize)]
struct SnapshotDetails {
    /// For each body: its size and its distance from the grasp point.
    bodies: Vec<(Option<[f64; 3]>, Option<f64>)>,
    links: Vec<LinkState>,
}

/// The later fields of an action.
#[derive(Serialize, Deserialize)]
struct ActionDetails {
    contact_points: Vec<Option<[f64; 3]>>,
    percept_looks: Vec<Option<Look>>,
    perceived_look: Option<Look>,
}

impl Details {
    /// Collects these fields of a trace.
    pub(super) fn of(trace: &Trace) -> Self {
        Self {
            snapshots: trace.snapshots.iter().map(SnapshotDetails::of).collect(),
            actions: trace.actions.iter().map(ActionDetails::of).collect(),
            clearances: trace
                .robot_courses
                .iter()
                .map(|course| course.clearances.clone())
                .collect(),
        }
    }

    /// Sets these fields of a trace. Does nothing for traces of earlier versions, which have none.
    pub(super) fn fill(self, trace: &mut Trace) {
        for (snapshot, details) in trace.snapshots.iter_mut().zip(self.snapshots) {
            details.fill(snapshot);
        }
        for (action, details) in trace.actions.iter_mut().zip(self.actions) {
            details.fill(action);
        }
        for (course, clearances) in trace.robot_courses.iter_mut().zip(self.clearances) {
            *course = RobotCourse {
                clearances,
                ..std::mem::take(course)
            };
        }
    }
}

impl SnapshotDetails {
    fn of(snapshot: &Snapshot) -> Self {
        let bodies = snapshot
            .bodies
            .iter()
            .map(|body| (body.size_m, body.grasp_distance_m));
        Self {
            bodies: bodies.collect(),
            links: snapshot.robot.links.clone(),
        }
    }

    fn fill(self, snapshot: &mut Snapshot) {
        for (body, details) in snapshot.bodies.iter_mut().zip(self.bodies) {
            (body.size_m, body.grasp_distance_m) = details;
        }
        snapshot.robot.links = self.links;
    }
}

impl ActionDetails {
    fn of(action: &ActionTrace) -> Self {
        Self {
            contact_points: action
                .contacts
                .iter()
                .map(|contact| contact.point_m)
                .collect(),
            percept_looks: action.percepts.iter().map(|percept| percept.look).collect(),
            perceived_look: action
                .perceived
                .as_ref()
                .and_then(|perceived| perceived.look),
        }
    }

    fn fill(self, action: &mut ActionTrace) {
        for (contact, point) in action.contacts.iter_mut().zip(self.contact_points) {
            contact.point_m = point;
        }
        for (percept, look) in action.percepts.iter_mut().zip(self.percept_looks) {
            percept.look = look;
        }
        if let Some(perceived) = &mut action.perceived {
            perceived.look = self.perceived_look;
        }
    }
}
