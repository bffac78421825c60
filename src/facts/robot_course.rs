//! What the robot went through during one action, as facts.

use crate::actions::RobotCourse;
use crate::base::names;
use crate::facts::writer::Writer;

/// A joint that has used less than this share of its speed has not moved: nothing is said of how fast.
const STANDS_STILL: f64 = 0.01;

/// Writes joints at their limits, links in each other and what was held; and that all this was measured, for rules that
/// must not take its absence for a pass.
pub(super) fn write(course: &RobotCourse, writer: &mut Writer) {
    let action = writer.w("action");
    writer.boolean(action, "robotMeasured", true);
    for joint in &course.joints {
        let subject = writer.named("joint", &joint.name);
        // A joint that turns without end is infinitely far from its limits.
        if joint.max_excess.is_finite() {
            writer.number(subject, "maxExcess", joint.max_excess);
        }
        if joint.max_speed_share >= STANDS_STILL {
            writer.number(subject, "maxSpeedShare", joint.max_speed_share);
        }
        if joint.overload_secs > 0.0 {
            writer.number(subject, "overloadTime", joint.overload_secs);
        }
    }
    for (idx, contact) in course.self_contacts.iter().enumerate() {
        let subject = writer.named("selfContact", &(idx + 1).to_string());
        writer.class(subject, &names::w("SelfContact"));
        for (property, link) in ["firstLink", "secondLink"].into_iter().zip(&contact.pair) {
            let link = writer.thing(link);
            writer.state(subject, property, link);
        }
        writer.numbers(subject, ["seenAt", "maxDepth"], [contact.start_secs, contact.max_depth_m]);
    }
    for held in &course.held {
        let subject = writer.thing(&held.id);
        writer.numbers(subject, ["heldTime", "heldTilt"], [held.held_secs, held.max_tilt_rad]);
    }
}
