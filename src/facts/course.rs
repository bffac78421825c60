//! The course of an action, from its recorded samples.

use crate::snapshot::{POSITION, ROTATION};
use crate::solids::{boxed, solid_of};
use crate::thing_iri;
use actcheck_base::{Course, Signal, names};
use actcheck_data::{Series, Trace};

/// Quantities of bodies that don't move.
const AT_REST: [&str; 6] = ["vx", "vy", "vz", "wx", "wy", "wz"];

/// Returns the course of an action, counted from 0. Returns `None` if its samples were not recorded
/// or not read.
pub(super) fn of_action(trace: &Trace, step: usize) -> Option<Course> {
    let samples = &trace.robot_courses.get(step)?.samples;
    if samples.count == 0 {
        return None;
    }
    let mut course = Course::new(samples.period_secs, samples.count);
    for body in trace
        .snapshots
        .get(step)?
        .bodies
        .iter()
        .filter(|body| body.fixed)
    {
        let mut set = |quantity: &str, value: f64| {
            course.set(
                [names::w(quantity), thing_iri(&body.id), String::new()],
                Signal::Constant(value),
            );
        };
        POSITION
            .into_iter()
            .zip(body.pose.position)
            .for_each(|(quantity, value)| set(quantity, value));
        ROTATION
            .into_iter()
            .zip(body.pose.rotation)
            .for_each(|(quantity, value)| set(quantity, value));
        AT_REST.into_iter().for_each(|quantity| set(quantity, 0.0));
    }
    for body in &trace.snapshots.get(step)?.bodies {
        let form = trace.forms.iter().find(|form| form.name == body.id);
        // A body without a form is a box of its size.
        let solids = match form {
            Some(form) => form.parts.iter().map(solid_of).collect(),
            None => vec![boxed(body.size_m)],
        };
        course.set_solids(thing_iri(&body.id), solids);
    }
    // Furniture that can slide has samples, too: they replace its constants.
    let is_recorded = |series: &&Series| trace.lacks.binary_search(&series.quantity).is_err();
    for series in samples.series.iter().filter(is_recorded) {
        let other = if series.other.is_empty() {
            String::new()
        } else {
            iri(&series.other)
        };
        let signal = Signal::Steps {
            per_unit: series.steps_per_unit,
            steps: series.steps.clone(),
        };
        course.set(
            [names::w(&series.quantity), iri(&series.thing), other],
            signal,
        );
    }
    let phases = &trace.actions.get(step)?.phases;
    course.phases = phases
        .iter()
        .map(|phase| (phase.name.clone(), phase.start_secs))
        .collect();
    Some(course)
}

/// Returns the IRI of a thing in the samples.
fn iri(thing: &str) -> String {
    match thing.strip_prefix("joint/") {
        Some(joint) => names::w(&format!("joint/{}", names::escaped(joint))),
        None if thing == "gripper" => names::w(thing),
        None => thing_iri(thing),
    }
}
