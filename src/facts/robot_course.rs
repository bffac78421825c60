//! Facts about the robot's joints, self-contacts and held objects during one action.

use crate::writer::Writer;
use actcheck_data::RobotCourse;

/// A joint that used less than this share of its maximum speed counts as unmoved: its speed is not
/// written.
const MIN_SPEED_SHARE: f64 = 0.01;

/// Writes how close joints came to their limits, self-contacts, clearances and held objects.
pub(super) fn write(course: &RobotCourse, writer: &mut Writer) {
    for joint in &course.joints {
        let subject = writer.named("joint", &joint.name);
        // A continuous joint is infinitely far from its limits.
        if joint.max_excess.is_finite() {
            writer.number(subject, "maxExcess", joint.max_excess);
        }
        if joint.max_speed_share >= MIN_SPEED_SHARE {
            writer.number(subject, "maxSpeedShare", joint.max_speed_share);
        }
        if joint.overload_secs > 0.0 {
            writer.number(subject, "overloadTime", joint.overload_secs);
        }
    }
    for (idx, contact) in course.self_contacts.iter().enumerate() {
        let subject = writer.named("selfContact", &(idx + 1).to_string());
        writer.world_class(subject, "SelfContact");
        for (property, link) in ["firstLink", "secondLink"].into_iter().zip(&contact.pair) {
            let link = writer.thing(link);
            writer.state(subject, property, link);
        }
        writer.numbers(
            subject,
            ["seenAt", "maxDepth"],
            [contact.start_secs, contact.max_depth_m],
        );
        writer.number(subject, "maxForce", contact.press.max_force_n);
        writer.boolean(subject, "fingersMeet", contact.press.of_hand);
    }
    for near in &course.clearances {
        let subject = writer.thing(&near.id);
        writer.number(subject, "clearance", near.smallest_m);
    }
    for held in &course.held {
        let subject = writer.thing(&held.id);
        writer.numbers(
            subject,
            ["heldTime", "heldTilt"],
            [held.held_secs, held.max_tilt_rad],
        );
    }
}
