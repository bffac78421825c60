//! Facts about a world's map: its locations, rooms and surfaces. They hold in every snapshot.

use crate::writer::Writer;
use actcheck_data::SceneMap;

/// Writes every named place.
pub(super) fn write(map: &SceneMap, writer: &mut Writer) {
    for location in &map.locations {
        let subject = writer.named("location", &location.name);
        writer.world_class(subject, "Location");
        writer.text(subject, "name", &location.name);
        writer.numbers(subject, ["x", "y", "yaw"], location.at);
        if let Some(surface) = &location.surface {
            writer.things(subject, "ofSurface", std::slice::from_ref(surface));
        }
        let [x, y, _] = location.at;
        in_room(map, subject, [x, y], writer);
    }
    for room in &map.rooms {
        let subject = writer.named("room", &room.name);
        writer.world_class(subject, "Room");
        writer.text(subject, "name", &room.name);
        writer.numbers(subject, ["lowX", "lowY"], room.low_m);
        writer.numbers(subject, ["highX", "highY"], room.high_m);
    }
    for surface in &map.surfaces {
        let subject = writer.thing(&surface.id);
        writer.world_class(subject, "Surface");
        let [x, y, z] = surface.at;
        writer.number(subject, "surfaceHeight", z);
        writer.numbers(subject, ["surfaceLength", "surfaceWidth"], surface.size_m);
        in_room(map, subject, [x, y], writer);
    }
}

fn in_room(map: &SceneMap, subject: actcheck_base::TermId, [x, y]: [f64; 2], writer: &mut Writer) {
    if let Some(room) = map.room_of(x, y) {
        let room = writer.named("room", &room.name);
        writer.state(subject, "inRoom", room);
    }
}
