//! Worlds: the walls and furniture that all their scenes share, and their named locations and
//! rooms.

use actcheck_base::{Diagnostics, Source, Span, did_you_mean, digest_of, names};
use actcheck_data::{Location, ObjectModel, Part, Pose, Room, Shape};
use std::collections::BTreeSet;

use crate::{Located, Table};

/// A world for scenes. Frame: world; the floor is at z = 0.
#[derive(Debug, Clone, PartialEq)]
pub struct WorldMap {
    /// Name in configurations; the file's name without its extension.
    pub name: String,
    /// Walls, which have no names.
    pub walls: Vec<Wall>,
    /// Static furniture.
    pub furniture: Vec<Furniture>,
    /// Named goals for the robot.
    pub locations: Vec<Location>,
    /// Named rectangles of the floor.
    pub rooms: Vec<Room>,
    /// Digest of the world's file.
    pub digest: String,
}

/// A wall.
#[derive(Debug, Clone, PartialEq)]
pub struct Wall {
    /// Its shape and category.
    pub model: ObjectModel,
    /// Pose of the middle of its base.
    pub pose: Pose,
}

/// A piece of furniture. Robots approach it from its negative x side.
#[derive(Debug, Clone, PartialEq)]
pub struct Furniture {
    /// Unique in the world; also names its surface, if its model has one.
    pub name: String,
    /// Name of its model.
    pub model: String,
    /// Pose of its model's origin.
    pub pose: Pose,
}

/// Default height of a wall: that of a low room. Unit: metres.
const WALL_HEIGHT_M: f64 = 2.4;
/// Default thickness of a wall. Unit: metres.
const WALL_THICKNESS_M: f64 = 0.1;
/// Largest coordinate in a world: an object farther away has left the simulation. Unit: metres.
const FARTHEST_M: f64 = 12.0;

impl WorldMap {
    /// Returns a world with only a floor.
    pub(crate) fn floor_only(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            walls: Vec::new(),
            furniture: Vec::new(),
            locations: Vec::new(),
            rooms: Vec::new(),
            digest: String::new(),
        }
    }
}

/// Reads a TOML world. `model` looks models up by name; `known` lists the names for suggestions.
///
/// # Errors
/// All faults of the text: those of the table reader (`C…`), an unknown model (W040), a duplicate
/// name (W041), a location in front of an unknown surface (W042), a location inside furniture
/// (W043), a wall or room without extent (W044).
pub(crate) fn read<'a>(
    name: &str,
    source: &Source,
    model: impl Fn(&str) -> Option<&'a ObjectModel>,
    known: &[String],
) -> Result<WorldMap, Diagnostics> {
    let mut table = Table::parse(source)?;
    let mut found = Diagnostics::new();
    let rooms = table
        .tables("rooms")
        .into_iter()
        .filter_map(|room| read_room(room, &mut found))
        .collect();
    let walls: Vec<Wall> = table
        .tables("walls")
        .into_iter()
        .filter_map(|wall| read_wall(wall, &mut found))
        .collect();
    let mut taken = BTreeSet::new();
    let mut furniture = Vec::new();
    for piece in table.tables("furniture") {
        furniture.extend(read_furniture(piece, &model, known, &mut taken, &mut found));
    }
    let mut taken = BTreeSet::new();
    let mut locations = Vec::new();
    for location in table.tables("locations") {
        locations.extend(read_location(
            location, &furniture, &model, &mut taken, &mut found,
        ));
    }
    table.finish(&mut found);
    found.or(WorldMap {
        name: name.to_owned(),
        walls,
        furniture,
        locations,
        rooms,
        digest: digest_of(&source.text),
    })
}

/// Reads a name and reports duplicates (W041).
fn new_name(table: &mut Table, taken: &mut BTreeSet<String>) -> Option<String> {
    let Located { value, span } = table.string("name")?;
    if taken.insert(value.clone()) {
        return Some(value);
    }
    table.fault(
        "W041",
        span,
        format!("there are two `{value}`"),
        "give one of them another name",
    );
    None
}

fn read_room(mut table: Table, found: &mut Diagnostics) -> Option<Room> {
    table.require(&["name", "low_m", "high_m"]);
    let span = table.span();
    let name = table.string("name").map(|name| name.value);
    let (low_m, high_m) = (corner(&mut table, "low_m"), corner(&mut table, "high_m"));
    if let (Some(low), Some(high)) = (low_m, high_m)
        && (low[0] >= high[0] || low[1] >= high[1])
    {
        table.fault(
            "W044",
            span,
            "the room has no area",
            "`low_m` has the smaller x and the smaller y, `high_m` the larger ones",
        );
    }
    table.finish(found);
    Some(Room {
        name: name?,
        low_m: low_m?,
        high_m: high_m?,
    })
}

fn corner(table: &mut Table, key: &str) -> Option<[f64; 2]> {
    table.numbers(key, -FARTHEST_M..=FARTHEST_M)
}

fn read_wall(mut table: Table, found: &mut Diagnostics) -> Option<Wall> {
    table.require(&["from_m", "to_m"]);
    let span = table.span();
    let (from, to) = (corner(&mut table, "from_m"), corner(&mut table, "to_m"));
    let height = table
        .number("height_m", 0.05..=10.0)
        .unwrap_or(WALL_HEIGHT_M);
    let thickness = table
        .number("thickness_m", 0.01..=2.0)
        .unwrap_or(WALL_THICKNESS_M);
    let length = |from: [f64; 2], to: [f64; 2]| libm::hypot(to[0] - from[0], to[1] - from[1]);
    if let (Some(from), Some(to)) = (from, to)
        && length(from, to) < thickness
    {
        table.fault(
            "W044",
            span,
            "the wall has no length",
            "`from_m` and `to_m` are its two ends, x and y",
        );
    }
    table.finish(found);
    let (from, to) = (from?, to?);
    let heading = libm::atan2(to[1] - from[1], to[0] - from[0]);
    let middle = [(from[0] + to[0]) / 2.0, (from[1] + to[1]) / 2.0, 0.0];
    // Extend the wall so that adjacent walls overlap at the corner.
    let model = wall_model([length(from, to) + thickness, thickness, height]);
    Some(Wall {
        model,
        pose: Pose::upright(middle, heading),
    })
}

/// A wall of painted plaster.
fn wall_model(size_m: [f64; 3]) -> ObjectModel {
    let part = Part {
        pose: Pose::upright([0.0, 0.0, size_m[2] / 2.0], 0.0),
        shape: Shape::Box { size: size_m },
    };
    ObjectModel {
        name: "wall".to_owned(),
        category: names::act("Wall"),
        // Density of aerated concrete.
        mass_kg: 600.0 * part.shape.volume(),
        friction: 0.6,
        restitution: 0.0,
        origin_m: [0.0; 3],
        size_m,
        parts: vec![part],
        fixed: true,
        inertia: None,
        surface: None,
        moving: Vec::new(),
        digest: String::new(),
    }
}

fn read_furniture<'a>(
    mut table: Table,
    model: &impl Fn(&str) -> Option<&'a ObjectModel>,
    known: &[String],
    taken: &mut BTreeSet<String>,
    found: &mut Diagnostics,
) -> Option<Furniture> {
    table.require(&["name", "model", "at_m"]);
    let name = new_name(&mut table, taken);
    let named = table.string("model");
    if let Some(named) = &named
        && model(&named.value).is_none()
    {
        let message = format!("there is no usable model `{}`", named.value);
        table.fault(
            "W040",
            named.span.clone(),
            message,
            did_you_mean(&named.value, known.iter().map(String::as_str)),
        );
    }
    let at = corner(&mut table, "at_m");
    let heading = table.number("heading_rad", ..).unwrap_or(0.0);
    table.finish(found);
    let [x, y] = at?;
    Some(Furniture {
        name: name?,
        model: named?.value,
        pose: Pose::upright([x, y, 0.0], heading),
    })
}

fn read_location<'a>(
    mut table: Table,
    furniture: &[Furniture],
    model: &impl Fn(&str) -> Option<&'a ObjectModel>,
    taken: &mut BTreeSet<String>,
    found: &mut Diagnostics,
) -> Option<Location> {
    table.require(&["name", "at_m"]);
    let span: Span = table.key_span("at_m").unwrap_or(table.span());
    let name = new_name(&mut table, taken);
    let at = corner(&mut table, "at_m");
    let heading = table.number("heading_rad", ..).unwrap_or(0.0);
    let surface = table.string("surface");
    let carries =
        |piece: &&Furniture| model(&piece.model).is_some_and(|model| model.surface.is_some());
    if let Some(surface) = &surface
        && !furniture
            .iter()
            .filter(carries)
            .any(|piece| piece.name == surface.value)
    {
        let message = format!("the world has no surface `{}`", surface.value);
        let surfaces: Vec<&str> = furniture
            .iter()
            .filter(carries)
            .map(|piece| piece.name.as_str())
            .collect();
        table.fault(
            "W042",
            surface.span.clone(),
            message,
            did_you_mean(&surface.value, surfaces),
        );
    }
    if let Some(at) = at {
        let inside = furniture
            .iter()
            .find(|piece| model(&piece.model).is_some_and(|model| is_inside(at, piece, model)));
        if let Some(piece) = inside {
            let message = format!("the location is inside `{}`", piece.name);
            table.fault(
                "W043",
                span,
                message,
                "move it away: the robot drives to this location",
            );
        }
    }
    table.finish(found);
    let [x, y] = at?;
    Some(Location {
        name: name?,
        at: [x, y, heading],
        surface: surface.map(|surface| surface.value),
    })
}

fn is_inside([x, y]: [f64; 2], piece: &Furniture, model: &ObjectModel) -> bool {
    let local = piece.pose.to_isometry().inverse() * nalgebra::Point3::new(x, y, 0.0);
    local.x.abs() < model.size_m[0] / 2.0 && local.y.abs() < model.size_m[1] / 2.0
}
