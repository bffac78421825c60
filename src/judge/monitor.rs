//! Judges an action after every step, from its begin to the newest state.

use std::collections::BTreeMap;

use actcheck_base::{Diagnostic, Diagnostics, guarded};
use actcheck_data::{
    ActionEnd, ActionReport, ActionTrace, ContactEpisode, Extremes, JointCourse, RobotCourse,
};

use crate::book::panicked;
use crate::course::{Course, Recorder, norm, still};
use crate::during::During;
use crate::lacks::{BASE_PATH, CONTACTS, LOOK, Lacks, PERCEIVED, SELF_CONTACTS};
use crate::reader::Faults;
use crate::snapshot::{self, State, Touch};
use crate::trace::{differing, trace};
use crate::{Judge, Value, Verdict};

/// Shorter gaps between contacts of a pair are ignored. Unit: seconds. As in our own traces.
const SAME_CONTACT_SECS: f64 = 0.05;
/// Steps may differ by this share of the first one.
const SAME_STEP: f64 = 0.01;

/// Judges an action after every step.
///
/// A step adds a sample of every quantity that the states give, and judges the whole action so far:
/// it takes as long as a judgement, and more by the number of samples, which formulas read.
#[derive(Debug, Clone)]
pub struct Monitor {
    judge: Judge,
    action: String,
    parameters: BTreeMap<String, Vec<String>>,
    before: State,
    recorder: Recorder,
    /// Whether each step gave the same quantities as the state before.
    complete: Complete,
    extremes: Vec<Extremes>,
    joints: Vec<JointCourse>,
    contacts: Contacts,
    held: BTreeMap<String, [f64; 2]>,
    /// Time of the newest state, since the action began; the time between two. Unit: seconds.
    secs: f64,
    period_secs: Option<f64>,
}

/// The quantities that all states gave.
#[derive(Debug, Clone, Copy)]
struct Complete {
    contacts: bool,
    forces: bool,
    points: bool,
    fingers: bool,
    base: bool,
    joints: bool,
    rotations: bool,
    velocities: bool,
}

#[derive(Debug, Clone, Default)]
struct Contacts {
    open: BTreeMap<[String; 2], ContactEpisode>,
    closed: Vec<ContactEpisode>,
}

impl Monitor {
    pub(crate) fn new(
        judge: Judge,
        action: &str,
        parameters: BTreeMap<String, Vec<String>>,
        before: State,
    ) -> Self {
        let bodies = before.snapshot.bodies.iter();
        let joints = before
            .snapshot
            .robot
            .joints
            .iter()
            .map(|joint| JointCourse {
                name: joint.name.clone(),
                max_excess: f64::NEG_INFINITY,
                max_speed_share: 0.0,
                overload_secs: 0.0,
            });
        let mut monitor = Self {
            judge,
            action: action.to_owned(),
            parameters,
            recorder: Recorder::default(),
            complete: Complete {
                contacts: true,
                forces: true,
                points: true,
                fingers: true,
                base: true,
                joints: true,
                rotations: true,
                velocities: true,
            },
            extremes: bodies.map(|body| still(&body.id)).collect(),
            joints: joints.collect(),
            contacts: Contacts::default(),
            held: BTreeMap::new(),
            secs: 0.0,
            period_secs: None,
            before: before.clone(),
        };
        monitor.add(&before, 0.0);
        monitor
    }

    /// Adds the state at a time since the action began, and judges the action as if it ended then.
    /// The report is that of the action itself, if it made one. Unit: seconds.
    ///
    /// # Errors
    /// As [`Judge::judge`], and `J010` unless the steps have equal lengths. A state with a fault is
    /// not added.
    pub fn step(
        &mut self,
        state: &Value,
        secs: f64,
        report: Option<(bool, &str)>,
    ) -> Result<Verdict, Diagnostics> {
        let faults = Faults::default();
        let at = faults.argument("state", state);
        let ontology = &self.judge.prepared_rules().ontology;
        let state = snapshot::read(&at, Some(&self.before), ontology);
        if !differing(&self.before, &state).is_empty() {
            at.fault("J008", "all states must have the same bodies", "");
        }
        faults.or(())?;
        self.check_time(secs)?;
        let judged = guarded(|| {
            self.add(&state, secs);
            self.verdict(&state, report)
        });
        judged.unwrap_or_else(|| Err(panicked()))
    }

    fn check_time(&mut self, secs: f64) -> Result<(), Diagnostics> {
        let step = secs - self.secs;
        let fault = |message: String| {
            Err(Diagnostic::error("J010", message)
                .help("give the time since the action began, in steps of equal length")
                .into())
        };
        if !secs.is_finite() || step <= 0.0 {
            return fault(format!("{secs} s is not later than the state before it"));
        }
        match self.period_secs {
            Some(period) if (step - period).abs() > SAME_STEP * period => fault(format!(
                "this step takes {step:.4} s, but the first one {period:.4} s"
            )),
            Some(_) => Ok(()),
            None => {
                self.period_secs = Some(step);
                Ok(())
            }
        }
    }

    /// Adds a state.
    fn add(&mut self, state: &State, secs: f64) {
        self.add_samples(state);
        for (idx, body) in self.before.snapshot.bodies.iter().enumerate() {
            let Some(place) = state.snapshot.bodies.iter().position(|it| it.id == body.id) else {
                continue;
            };
            let (now, known) = (&state.snapshot.bodies[place], &state.known[place]);
            let found = &mut self.extremes[idx];
            let way =
                std::array::from_fn(|axis| now.pose.position[axis] - body.pose.position[axis]);
            found.max_displacement_m = found.max_displacement_m.max(norm(way));
            found.max_rise_m = found.max_rise_m.max(way[2]);
            self.complete.rotations &= known.rotation;
            found.max_tilt_rad = found.max_tilt_rad.max(now.pose.tilt());
            self.complete.velocities &= known.velocities[0];
            found.max_speed = found.max_speed.max(norm(now.linear_velocity));
        }
        self.complete.base &= state.robot.base;
        self.complete.joints &= state.robot.joints
            && state.robot.joint_velocities
            && state.robot.joint_limits
            && state.robot.max_velocities;
        for course in &mut self.joints {
            let joints = &state.snapshot.robot.joints;
            let Some(now) = joints.iter().find(|joint| joint.name == course.name) else {
                self.complete.joints = false;
                continue;
            };
            let excess = (now.lower - now.position).max(now.position - now.upper);
            course.max_excess = course.max_excess.max(excess);
            let share = now.velocity.abs() / now.max_velocity;
            course.max_speed_share = course.max_speed_share.max(share);
        }
        self.complete.fingers &= state.robot.fingers && state.known.iter().all(|it| it.rotation);
        if self.complete.fingers {
            for id in state.held() {
                let body = state.snapshot.bodies.iter().find(|body| body.id == *id);
                let tilt = body.map_or(0.0, |body| body.pose.tilt());
                let [held_secs, max_tilt] = self.held.entry(id.clone()).or_default();
                *held_secs += secs - self.secs;
                *max_tilt = max_tilt.max(tilt);
            }
        }
        match &state.contacts {
            None => self.complete.contacts = false,
            Some(touches) => {
                self.complete.forces &= touches.iter().all(|touch| touch.force_n.is_some());
                self.complete.points &= touches.iter().all(|touch| touch.point_m.is_some());
                let since = if secs > 0.0 { Some(self.secs) } else { None };
                self.contacts.add(touches, secs, since);
            }
        }
        self.secs = secs;
    }

    fn add_samples(&mut self, state: &State) {
        const POSE: [&str; 7] = ["x", "y", "z", "qx", "qy", "qz", "qw"];
        const VELOCITY: [&str; 6] = ["vx", "vy", "vz", "wx", "wy", "wz"];
        let recorder = &mut self.recorder;
        let held: Vec<&String> = state.held().collect();
        for (body, known) in state.snapshot.bodies.iter().zip(&state.known) {
            if body.fixed {
                continue;
            }
            let pose = body.pose.position.into_iter().chain(body.pose.rotation);
            let n_known = if known.rotation { 7 } else { 3 };
            for (name, value) in POSE.into_iter().zip(pose).take(n_known) {
                recorder.put(&body.id, "", name, value);
            }
            let velocity = [body.linear_velocity, body.angular_velocity];
            for (half, values) in velocity.into_iter().enumerate() {
                if known.velocities[half] || body.asleep {
                    for (axis, value) in values.into_iter().enumerate() {
                        recorder.put(&body.id, "", VELOCITY[3 * half + axis], value);
                    }
                }
            }
            if state.robot.fingers {
                let is_held = held.contains(&&body.id);
                recorder.put(&body.id, "", "held", f64::from(u8::from(is_held)));
            }
        }
        let robot = &state.snapshot.robot;
        if state.robot.gripper {
            let pose = robot
                .gripper
                .position
                .into_iter()
                .chain(robot.gripper.rotation);
            for (name, value) in POSE.into_iter().zip(pose) {
                recorder.put("gripper", "", name, value);
            }
        }
        if state.robot.opening {
            recorder.put("gripper", "", "opening", robot.gripper_opening_m);
        }
        if state.robot.base {
            for (name, value) in ["baseX", "baseY", "baseYaw"]
                .into_iter()
                .zip(robot.base_true)
            {
                recorder.put("robot", "", name, value);
            }
        }
        for joint in &robot.joints {
            let thing = format!("joint/{}", joint.name);
            recorder.put(&thing, "", "position", joint.position);
            if state.robot.joint_velocities {
                recorder.put(&thing, "", "velocity", joint.velocity);
            }
        }
        for touch in state.contacts.iter().flatten() {
            if let Some(force) = touch.force_n {
                recorder.put(&touch.pair[0], &touch.pair[1], "contactForce", force);
            }
        }
        recorder.end_sample();
    }

    fn verdict(
        &mut self,
        state: &State,
        report: Option<(bool, &str)>,
    ) -> Result<Verdict, Diagnostics> {
        let during = self.during(report);
        let action = self.judge.action(&self.action)?;
        let states = [&self.before, state];
        let (trace, without_classes) = trace(&self.action, &self.parameters, states, during);
        self.judge.verdict(&trace, &action, without_classes)
    }

    /// Returns the events so far.
    fn during(&mut self, report: Option<(bool, &str)>) -> During {
        let complete = self.complete;
        let mut lacks = Lacks::default();
        let mut miss = |is_known: bool, facts: &[&str]| {
            if !is_known {
                lacks.add(facts);
            }
        };
        miss(report.is_some(), &["reported", "message"]);
        miss(complete.contacts && complete.points, CONTACTS);
        miss(complete.forces, &["maxForce"]);
        miss(complete.rotations, &["maxTilt"]);
        miss(complete.velocities, &["maxSpeed"]);
        miss(complete.joints, &["maxExcess", "maxSpeedShare"]);
        miss(complete.fingers, &["heldTime", "heldTilt"]);
        miss(complete.base, BASE_PATH);
        let never: [&[&str]; 7] = [
            &["overloadTime"],
            &["clearance"],
            &["ofObject"],
            &["phaseName", "phase", "samples/phase"],
            LOOK,
            PERCEIVED,
            SELF_CONTACTS,
        ];
        never.into_iter().for_each(|facts| miss(false, facts));
        let course: &mut Course = self.recorder.course();
        course.period_secs = self.period_secs.unwrap_or(1.0);
        course.forces = complete.contacts && complete.forces;
        course.note_missing(&self.before, &mut lacks);
        let samples = course.samples();
        let mut intervals = samples.intervals();
        for (kind, is_known) in course.intervals(&self.before) {
            if !is_known {
                intervals.retain(|interval| interval.kind != kind);
                lacks.add(&[match kind {
                    actcheck_data::IntervalKind::Hold => "heldObject",
                    actcheck_data::IntervalKind::Motion => "movedObject",
                }]);
            }
        }
        let held =
            self.held.iter().map(
                |(id, [held_secs, max_tilt_rad])| actcheck_data::HeldCourse {
                    id: id.clone(),
                    held_secs: *held_secs,
                    max_tilt_rad: *max_tilt_rad,
                },
            );
        During {
            action: ActionTrace {
                end: ActionEnd::Completed,
                report: report.map(|(succeeded, message)| ActionReport {
                    succeeded,
                    message: message.to_owned(),
                }),
                duration_secs: self.secs,
                contacts: self.contacts.so_far(),
                extremes: self.extremes.clone(),
                ..ActionTrace::not_reached("", &BTreeMap::new())
            },
            course: RobotCourse {
                joints: self.joints.clone(),
                held: held.collect(),
                intervals,
                samples,
                ..RobotCourse::default()
            },
            lacks,
        }
    }
}

impl Contacts {
    /// Adds the contacts of a state. `since` is the time of the state before it, if there is one.
    fn add(&mut self, touches: &[Touch], secs: f64, since: Option<f64>) {
        for touch in touches {
            let force = touch.force_n.unwrap_or(0.0);
            let point = touch.point_m.unwrap_or_default();
            if let Some(open) = self.open.get(&touch.pair)
                && since.is_some_and(|since| open.end_secs < since)
                && secs - open.end_secs > SAME_CONTACT_SECS
            {
                self.closed.extend(self.open.remove(&touch.pair));
            }
            let open = self
                .open
                .entry(touch.pair.clone())
                .or_insert_with(|| ContactEpisode {
                    pair: touch.pair.clone(),
                    // A contact of the first state was there before.
                    start_secs: since.map_or(0.0, |since| since.max(f64::MIN_POSITIVE)),
                    end_secs: secs,
                    max_force_n: 0.0,
                    point_m: point,
                });
            open.end_secs = secs;
            if force > open.max_force_n {
                (open.max_force_n, open.point_m) = (force, point);
            }
        }
    }

    /// Returns the contacts so far, sorted by start, then by pair.
    fn so_far(&self) -> Vec<ContactEpisode> {
        let mut all: Vec<ContactEpisode> = self
            .closed
            .iter()
            .chain(self.open.values())
            .cloned()
            .collect();
        all.sort_by(|a, b| {
            a.start_secs
                .total_cmp(&b.start_secs)
                .then_with(|| a.pair.cmp(&b.pair))
        });
        all
    }
}
