//! Facts about intervals of one action: holds, motions, phases. Contacts are intervals, too.

use crate::writer::Writer;
use actcheck_data::{ActionTrace, IntervalKind, RobotCourse};

/// Writes when objects were held and when they moved.
pub(super) fn write(course: &RobotCourse, writer: &mut Writer) {
    for (kind, heading, class, property) in [
        (IntervalKind::Hold, "hold", "Hold", "heldObject"),
        (IntervalKind::Motion, "motion", "Motion", "movedObject"),
    ] {
        let of_kind = course
            .intervals
            .iter()
            .filter(|interval| interval.kind == kind);
        for (number, interval) in (1..).zip(of_kind) {
            let subject = writer.named(heading, &number.to_string());
            writer.world_class(subject, class);
            let thing = writer.thing(&interval.thing);
            writer.state(subject, property, thing);
            writer.numbers(
                subject,
                ["start", "end"],
                [interval.start_secs, interval.end_secs],
            );
        }
    }
}

/// Writes the phases of an action. A phase ends when the next one starts, or with the action.
pub(super) fn write_phases(action: &ActionTrace, writer: &mut Writer) {
    let ends = action
        .phases
        .iter()
        .skip(1)
        .map(|next| next.start_secs)
        .chain([action.duration_secs]);
    for (number, (phase, end_secs)) in (1..).zip(action.phases.iter().zip(ends)) {
        let subject = writer.named("phase", &number.to_string());
        writer.world_class(subject, "ActionPhase");
        writer.text(subject, "phaseName", &phase.name);
        writer.numbers(subject, ["start", "end"], [phase.start_secs, end_secs]);
    }
}
