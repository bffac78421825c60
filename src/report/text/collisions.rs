//! Collisions by type and place for the terminal.

use std::fmt::Write as _;

use crate::summary::percent;
use crate::text::{Page, fitted, ruled};
use actcheck_analysis::{Collisions, HitKind, Interval, Sector};
use actcheck_base::names;

/// Shades of cells, by rate in steps of 20 %.
const SHADES: [char; 5] = ['·', '░', '▒', '▓', '█'];
/// Maximum number of links and phases listed in a cell.
const MAX_NAMES: usize = 2;

/// Returns the shade of a rate.
pub(super) fn shade(rate: f64) -> char {
    SHADES[((rate * SHADES.len() as f64) as usize).min(SHADES.len() - 1)]
}

/// Writes the collisions of each action: the things that were hit, how often, how hard, and where
/// they were.
pub(super) fn collisions(out: &mut String, all: &[Collisions], (figures, page): (bool, Page)) {
    let hit = || all.iter().filter(|of| of.hit > 0);
    if hit().next().is_none() {
        return;
    }
    out.push_str(
        "\ncollisions (with things that the action is not to touch, with more than 1 N)\n",
    );
    for of in hit() {
        let _ = writeln!(
            out,
            "{}: in {} of {} runs",
            names::local(&of.action),
            interval(of.rate),
            of.executions
        );
        kinds(out, of, page);
        if figures {
            places(out, of, page);
        }
    }
}

fn interval(rate: Interval) -> String {
    format!(
        "{} [{:.0}–{:.0}]",
        percent(rate.rate),
        rate.low * 100.0,
        rate.high * 100.0
    )
}

fn kinds(out: &mut String, of: &Collisions, page: Page) {
    let mut table = ruled();
    table.set_header([
        "hit",
        "share",
        "runs",
        "median N",
        "max N",
        "mostly by",
        "mostly in",
        "mostly",
        "such as",
    ]);
    for kind in &of.kinds {
        let name = names::local(&kind.category);
        let directions = names_of(&kind.directions, 1, kind);
        table.add_row([
            if kind.furniture {
                format!("{name} (furniture)")
            } else {
                name.to_owned()
            },
            interval(kind.rate),
            format!("{} of {}", kind.hit, kind.present),
            format!("{:.1}", kind.force_n.p50),
            format!("{:.1}", kind.force_n.most),
            names_of(&kind.by, MAX_NAMES, kind),
            names_of(&kind.phases, MAX_NAMES, kind),
            directions,
            kind.runs.first().cloned().unwrap_or_default(),
        ]);
    }
    let expendable = [
        "mostly in",
        "mostly",
        "median N",
        "such as",
        "mostly by",
        "runs",
        "max N",
    ];
    out.push_str(&fitted(table, page, &expendable));
}

/// Formats the most frequent names; with their counts, unless there is only one name.
fn names_of(counts: &[(String, u64)], most: usize, kind: &HitKind) -> String {
    let bare = |name: &str| name.strip_prefix("robot/").unwrap_or(name).to_owned();
    match counts {
        [(only, count)] if *count == kind.hit => bare(only),
        all => {
            let shown: Vec<String> = all
                .iter()
                .take(most)
                .map(|(name, count)| format!("{} {count}", bare(name)))
                .collect();
            shown.join(", ")
        }
    }
}

/// Writes how often movable things were hit, by their place around the goal.
fn places(out: &mut String, of: &Collisions, page: Page) {
    if of
        .sectors
        .iter()
        .flatten()
        .all(|sector| sector.present == 0)
    {
        return;
    }
    out.push_str("hit movable things, by their place around the target or the goal, seen along the approach\n");
    let mut table = ruled();
    let bands = of.sectors.first().map(Vec::as_slice).unwrap_or_default();
    table.set_header(std::iter::once(String::new()).chain(bands.iter().map(band)));
    for row in &of.sectors {
        let direction = row.first().map_or("", |sector| sector.direction);
        table.add_row(std::iter::once(direction.to_owned()).chain(row.iter().map(cell)));
    }
    out.push_str(&fitted(table, page, &[]));
}

fn band(sector: &Sector) -> String {
    let (from, to) = sector.distance_m;
    let from = from * 100.0;
    to.map_or_else(
        || format!("over {from:.0} cm"),
        |to| format!("{from:.0}–{:.0} cm", to * 100.0),
    )
}

fn cell(sector: &Sector) -> String {
    sector.rate.map_or_else(String::new, |rate| {
        format!(
            "{} {} of {}",
            shade(rate.rate),
            interval(rate),
            sector.present
        )
    })
}
