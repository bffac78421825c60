//! Tables named after designators: the candidate values for scenes.

use std::collections::{BTreeMap, BTreeSet};

use crate::model_library::ModelLibrary;
use crate::{Located, OtherCounts, Table};
use actcheck_base::{Diagnostics, Span};

/// The kind of thing that a table's candidates name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    World,
    Location,
    Surface,
    Model,
}

/// The paper's tables with the key of their candidates. Worlds come first because locations and
/// surfaces refer to them.
const PAPER_TABLES: [(&str, &str, Kind); 6] = [
    ("world", "worlds", Kind::World),
    ("objectLocation", "location_list", Kind::Location),
    ("objectSurface", "object_surfaces", Kind::Surface),
    ("placeSurface", "place_object_surfaces", Kind::Surface),
    ("pickObject", "model_list", Kind::Model),
    ("surfaceObjects", "model_list", Kind::Model),
];

/// Largest accepted number of objects; a larger one is most likely a typing error.
const MOST_OBJECTS: i64 = 100;
/// Number of other objects if `[surfaceObjects]` has no `count`.
const DEFAULT_COUNT: (u32, u32) = (1, 4);

/// The candidates and counts that scene generation chooses from.
pub(crate) struct Designators {
    pub(crate) candidates: BTreeMap<String, Vec<String>>,
    pub(crate) other_counts: OtherCounts,
    pub(crate) lying: (f64, f64),
    pub(crate) nav_obstacles: Vec<String>,
    pub(crate) nav_obstacle_count: u32,
    pub(crate) nav_may_block: bool,
}

/// Reads the tables of designators: those of the paper, and any other with a single list of
/// strings. Only the ontology defines which designators exist, so `places` keeps the span for a
/// later check.
pub(crate) fn read(
    root: &mut Table,
    library: &mut ModelLibrary,
    places: &mut BTreeMap<String, Span>,
    found: &mut Diagnostics,
) -> Designators {
    let mut candidates = BTreeMap::new();
    let mut other_counts = OtherCounts::default();
    let mut lying = (0.0, 0.0);
    let nav_may_block = read_nav(root, found);
    let mut worlds = Vec::new();
    let has_others = root.key_span("surfaceObjects").is_some();
    let has_surface = root.key_span("objectSurface").is_some();
    for (name, key, kind) in PAPER_TABLES {
        let Some(mut table) = root.table(name) else {
            continue;
        };
        table.require(&[key]);
        let values = table.non_empty_strings(key).unwrap_or_default();
        for value in &values {
            match kind {
                Kind::World => library.read_world(&mut table, value, found),
                Kind::Location => library.check_location(&mut table, value, has_surface),
                Kind::Surface => library.check_surface(&mut table, value),
                Kind::Model => library.check_name(&mut table, value),
            }
        }
        if name == "surfaceObjects" {
            other_counts.beside_target = read_count(&mut table).unwrap_or(DEFAULT_COUNT);
            lying.1 = table.number("lying", 0.0..=1.0).unwrap_or(0.0);
        }
        if name == "placeSurface" {
            other_counts.at_place = read_place_count(&mut table, has_others);
        }
        if name == "pickObject" {
            lying.0 = table.number("lying", 0.0..=1.0).unwrap_or(0.0);
        }
        match name {
            "world" => worlds.clone_from(&values),
            "objectLocation" if !has_surface => {
                library.check_locations_of(&mut table, &worlds, &values);
            }
            _ => {}
        }
        keep(name, table.span(), values, &mut candidates, places);
        table.finish(found);
    }
    for name in root.untaken_tables() {
        read_own_table(root, &name, &mut candidates, places, found);
    }
    let (nav_obstacles, nav_obstacle_count) = read_obstacles(root, library);
    Designators {
        candidates,
        other_counts,
        lying,
        nav_obstacles,
        nav_obstacle_count,
        nav_may_block,
    }
}

/// Returns the names of the models that a configuration may put into scenes.
pub(crate) fn named_models<'a>(
    candidates: &'a BTreeMap<String, Vec<String>>,
    nav_obstacles: &'a [String],
) -> BTreeSet<&'a str> {
    let tables = PAPER_TABLES
        .iter()
        .filter(|(.., kind)| matches!(kind, Kind::Surface | Kind::Model));
    let listed = tables
        .filter_map(|(name, ..)| candidates.get(*name))
        .flatten();
    listed.chain(nav_obstacles).map(String::as_str).collect()
}

fn keep(
    name: &str,
    header: Span,
    values: Vec<Located<String>>,
    candidates: &mut BTreeMap<String, Vec<String>>,
    places: &mut BTreeMap<String, Span>,
) {
    places.insert(name.to_owned(), header);
    for (idx, value) in values.iter().enumerate() {
        places.insert(format!("{name}.{idx}"), value.span.clone());
    }
    candidates.insert(
        name.to_owned(),
        values.into_iter().map(|value| value.value).collect(),
    );
}

/// Reads a table with a single list, which may be named after a designator of the user's ontology.
/// Any other table is left for [`Table::finish`] to report as unknown.
fn read_own_table(
    root: &mut Table,
    name: &str,
    candidates: &mut BTreeMap<String, Vec<String>>,
    places: &mut BTreeMap<String, Span>,
    found: &mut Diagnostics,
) {
    let Some(key) = root.only_list_of(name) else {
        return;
    };
    let Some(mut table) = root.table(name) else {
        return;
    };
    let values = table.non_empty_strings(&key).unwrap_or_default();
    keep(name, table.span(), values, candidates, places);
    table.finish(found);
}

/// Reads `count`: `[least, most]` or a single number.
fn read_count(table: &mut Table) -> Option<(u32, u32)> {
    let bounds = 0..=MOST_OBJECTS;
    let range = if table.is_list("count") {
        table.integer_range("count", bounds)
    } else {
        table.integer("count", bounds).map(|count| (count, count))
    };
    let both = |(least, most)| Some((u32::try_from(least).ok()?, u32::try_from(most).ok()?));
    range.and_then(both)
}

/// Reads the number of objects on the surface to place on, chosen from `[surfaceObjects]`.
fn read_place_count(table: &mut Table, has_others: bool) -> (u32, u32) {
    let place = table.key_span("count");
    let count = read_count(table).unwrap_or_default();
    if count.1 > 0 && !has_others {
        let message = format!(
            "`placeSurface.count` allows up to {} objects, but there are no models to choose from",
            count.1
        );
        table.fault(
            "C007",
            place.unwrap_or(0..0),
            message,
            "name models in `[surfaceObjects] model_list`, or set the count to 0",
        );
    }
    count
}

/// Reads `[nav] may_block`.
fn read_nav(root: &mut Table, found: &mut Diagnostics) -> bool {
    let Some(mut nav) = root.table("nav") else {
        return false;
    };
    let may_block = nav.boolean("may_block").unwrap_or(false);
    nav.finish(found);
    may_block
}

fn read_obstacles(root: &mut Table, library: &mut ModelLibrary) -> (Vec<String>, u32) {
    let names = root.strings("nav_obstacle_list").unwrap_or_default();
    names.iter().for_each(|name| library.check_name(root, name));
    let place = root.key_span("nav_obstacle_count");
    let count = root
        .integer("nav_obstacle_count", 0..=MOST_OBJECTS)
        .unwrap_or(0);
    if count > 0 && names.is_empty() {
        let message =
            format!("`nav_obstacle_count` is {count}, but there is no obstacle to choose");
        root.fault(
            "C007",
            place.unwrap_or(0..0),
            message,
            "name models in `nav_obstacle_list`, or set the count to 0",
        );
    }
    (
        names.into_iter().map(|name| name.value).collect(),
        u32::try_from(count).unwrap_or(0),
    )
}
