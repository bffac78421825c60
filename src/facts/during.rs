//! Facts about the events during one action.

use std::collections::BTreeMap;

use crate::extract::Extent;
use crate::writer::Writer;
use actcheck_base::{TermId, names};
use actcheck_data::{ActionTrace, ContactEpisode, Extremes, Look, Perceived, Percept};

/// Number of contact episodes that become facts for rules for each pair: the strongest ones.
///
/// A body that chatters on a surface makes and breaks contact many times a second. Rules use the
/// pair, the first contact above some force, and the largest force. The trace keeps all episodes.
const EPISODES_OF_A_PAIR: usize = 3;

/// Writes the report, contacts, extremes and percepts of one action that began at this time, and
/// the plane and objects that the action itself perceived. Unit: seconds since the scene was built.
pub(super) fn write(action: &ActionTrace, began_secs: f64, extent: Extent, writer: &mut Writer) {
    let subject = writer.w("action");
    if let Some(report) = &action.report {
        writer.text(
            subject,
            "reported",
            if report.succeeded {
                "succeeded"
            } else {
                "failed"
            },
        );
        writer.text(subject, "message", &report.message);
    }
    writer.number(subject, "duration", action.duration_secs);
    for (idx, contact) in kept(&action.contacts, extent).into_iter().enumerate() {
        write_contact(idx + 1, contact, writer);
    }
    for extremes in &action.extremes {
        write_extremes(extremes, writer);
    }
    for (idx, percept) in action.percepts.iter().enumerate() {
        write_percept(idx + 1, percept, began_secs, writer);
    }
    if let Some(perceived) = &action.perceived {
        write_perceived(perceived, began_secs, writer);
    }
}

/// Writes the bounding box of the base's path, for rules about rooms.
pub(super) fn write_base([low, high]: &[[f64; 2]; 2], writer: &mut Writer) {
    let subject = writer.w("robot");
    writer.numbers(subject, ["baseMinX", "baseMinY"], *low);
    writer.numbers(subject, ["baseMaxX", "baseMaxY"], *high);
}

/// Returns all episodes, or the strongest ones of each pair for rules, sorted by start, then by
/// pair.
fn kept(contacts: &[ContactEpisode], extent: Extent) -> Vec<&ContactEpisode> {
    let mut by_pair: BTreeMap<&[String; 2], Vec<&ContactEpisode>> = BTreeMap::new();
    for contact in contacts {
        by_pair.entry(&contact.pair).or_default().push(contact);
    }
    let mut kept = Vec::new();
    for mut episodes in by_pair.into_values() {
        episodes.sort_by(|a, b| {
            b.max_force_n
                .total_cmp(&a.max_force_n)
                .then(a.start_secs.total_cmp(&b.start_secs))
        });
        if extent == Extent::Rules {
            episodes.truncate(EPISODES_OF_A_PAIR);
        }
        kept.extend(episodes);
    }
    kept.sort_by(|a, b| {
        a.start_secs
            .total_cmp(&b.start_secs)
            .then_with(|| a.pair.cmp(&b.pair))
    });
    kept
}

fn write_contact(number: usize, contact: &ContactEpisode, writer: &mut Writer) {
    let subject = writer.named("contact", &number.to_string());
    writer.world_class(subject, "Contact");
    for (property, id) in ["first", "second"].into_iter().zip(&contact.pair) {
        let thing = writer.thing(id);
        writer.state(subject, property, thing);
    }
    writer.numbers(
        subject,
        ["start", "end", "maxForce"],
        [contact.start_secs, contact.end_secs, contact.max_force_n],
    );
    writer.numbers(subject, ["x", "y", "z"], contact.point_m);
}

fn write_extremes(extremes: &Extremes, writer: &mut Writer) {
    let subject = writer.thing(&extremes.id);
    writer.numbers(
        subject,
        ["maxTilt", "maxSpeed", "maxRise", "maxDisplacement"],
        [
            extremes.max_tilt_rad,
            extremes.max_speed,
            extremes.max_rise_m,
            extremes.max_displacement_m,
        ],
    );
}

fn write_percept(number: usize, percept: &Percept, began_secs: f64, writer: &mut Writer) {
    let subject = writer.named("percept", &number.to_string());
    writer.world_class(subject, "Percept");
    let seen = writer.thing(&percept.id);
    writer.state(subject, "ofObject", seen);
    writer.numbers(subject, ["x", "y", "z"], percept.pose.position);
    writer.number(subject, "yaw", percept.pose.yaw());
    writer.numbers(subject, ["sizeX", "sizeY", "sizeZ"], percept.size_m);
    write_look(subject, percept.look.as_ref(), began_secs, writer);
}

/// Writes the moment of perception: the time, the base's true and believed pose, the camera's
/// position.
fn write_look(subject: TermId, look: Option<&Look>, began_secs: f64, writer: &mut Writer) {
    let Some(look) = look else { return };
    writer.number(subject, "takenAt", look.time_secs - began_secs);
    writer.numbers(
        subject,
        ["takenBaseX", "takenBaseY", "takenBaseYaw"],
        look.base_true,
    );
    writer.numbers(
        subject,
        ["takenBelievedX", "takenBelievedY", "takenBelievedYaw"],
        look.base_believed,
    );
    writer.numbers(
        subject,
        ["cameraX", "cameraY", "cameraZ"],
        look.camera.position,
    );
}

/// Writes the rotations of the camera when it took the pictures of each percept.
pub(super) fn write_cameras(action: &ActionTrace, writer: &mut Writer) {
    let percepts = action
        .percepts
        .iter()
        .enumerate()
        .map(|(idx, seen)| (format!("percept/{}", idx + 1), &seen.look));
    let perceived = action.perceived.iter().flat_map(|perceived| {
        let plane = perceived.plane.iter().map(|_| "perceivedPlane".to_owned());
        let things = (1..=perceived.things.len()).map(|number| format!("perceivedObject/{number}"));
        plane.chain(things).map(|name| (name, &perceived.look))
    });
    for (name, look) in percepts.chain(perceived) {
        if let Some(look) = look {
            let subject = writer.w(&name);
            writer.numbers(
                subject,
                ["cameraQx", "cameraQy", "cameraQz", "cameraQw"],
                look.camera.rotation,
            );
        }
    }
}

fn write_perceived(perceived: &Perceived, began_secs: f64, writer: &mut Writer) {
    if let Some(plane) = &perceived.plane {
        let subject = writer.w("perceivedPlane");
        writer.world_class(subject, "PerceivedPlane");
        writer.numbers(subject, ["x", "y", "z"], plane.pose.position);
        writer.numbers(
            subject,
            ["yaw", "tilt"],
            [plane.pose.yaw(), plane.pose.tilt()],
        );
        writer.numbers(subject, ["extentX", "extentY"], plane.size_m);
        write_look(subject, perceived.look.as_ref(), began_secs, writer);
    }
    for (idx, thing) in perceived.things.iter().enumerate() {
        let subject = writer.named("perceivedObject", &(idx + 1).to_string());
        writer.world_class(subject, "PerceivedObject");
        writer.numbers(subject, ["x", "y", "z"], thing.pose.position);
        writer.numbers(
            subject,
            ["yaw", "tilt"],
            [thing.pose.yaw(), thing.pose.tilt()],
        );
        writer.numbers(subject, ["sizeX", "sizeY", "sizeZ"], thing.size_m);
        write_look(subject, perceived.look.as_ref(), began_secs, writer);
        if let Some(category) = &thing.category {
            writer.iri(subject, "seenAs", &names::category(category));
        }
    }
}
