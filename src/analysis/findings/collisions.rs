//! Collisions by type and place of the thing that was hit.

use std::collections::BTreeMap;

use crate::findings::judged::newest_of_alike;
use crate::findings::margins::{Quantiles, quantiles};
use crate::findings::scenes::Scenes;
use crate::{Interval, OutcomeTable, Sampling, Surrounding};
use actcheck_data::Role;

/// Directions from the goal, by quarter turns to the left: the first is along the approach.
const DIRECTIONS: [&str; 4] = [
    "beyond it",
    "left of it",
    "on the robot's side",
    "right of it",
];
/// Upper ends of the distances from the goal. Unit: metres.
const DISTANCES_M: [f64; 4] = [0.1, 0.2, 0.4, f64::INFINITY];

/// Collisions of one action with things that it is not to touch.
#[derive(Debug, Clone, PartialEq)]
pub struct Collisions {
    /// IRI of the action.
    pub action: String,
    /// Number of its executions. Of bit-identical runs only the newest counts, of the runs of one
    /// scene only the first.
    pub executions: u64,
    /// Number of those in which something was hit.
    pub hit: u64,
    /// Share of executions in which something was hit.
    pub rate: Interval,
    /// One for each category that was hit, most often hit first.
    pub kinds: Vec<HitKind>,
    /// How often movable things were hit, by direction from the goal, then by distance.
    pub sectors: Vec<Vec<Sector>>,
    /// Every thing with a place.
    pub things: Vec<PlacedThing>,
}

/// Hits of one category.
#[derive(Debug, Clone, PartialEq)]
pub struct HitKind {
    /// The category: an IRI.
    pub category: String,
    /// Whether it is furniture. Its share is of all executions, because furniture that was not hit
    /// is not recorded.
    pub furniture: bool,
    /// Number of executions with such a thing; for furniture, of all.
    pub present: u64,
    /// Number of executions in which one was hit.
    pub hit: u64,
    /// Share of them.
    pub rate: Interval,
    /// Largest force of each execution. Unit: newtons.
    pub force_n: Quantiles,
    /// The parts that hit it hardest, most frequent first: `robot/LINK`, or `object` for the object
    /// that the action handles.
    pub by: Vec<(String, u64)>,
    /// Phases in which it was first hit, most frequent first.
    pub phases: Vec<(String, u64)>,
    /// Directions from the goal, most frequent first.
    pub directions: Vec<(String, u64)>,
    /// Ids of the runs in which it was hit, hardest first.
    pub runs: Vec<String>,
}

/// Movable things in one direction and at one distance from the goal.
#[derive(Debug, Clone, PartialEq)]
pub struct Sector {
    /// Direction from the goal, as seen along the approach.
    pub direction: &'static str,
    /// Distance from the goal: at least, and less than. `None` if it has no upper end. Unit:
    /// metres.
    pub distance_m: (f64, Option<f64>),
    /// Number of things.
    pub present: u64,
    /// Number of those that were hit.
    pub hit: u64,
    /// Share of them. `None` without things.
    pub rate: Option<Interval>,
}

/// A thing with its place relative to the goal, as in [`Surrounding`].
#[derive(Debug, Clone, PartialEq)]
pub struct PlacedThing {
    /// Id of the run.
    pub run: String,
    /// Id of the thing.
    pub object: String,
    /// Its category: an IRI.
    pub category: String,
    /// Unit: metres.
    pub beyond_m: f64,
    /// Unit: metres.
    pub left_m: f64,
    /// Largest force on it. `None` if it was not hit. Unit: newtons.
    pub force_n: Option<f64>,
}

/// Returns the collisions of each action whose surroundings are known, sorted by action.
pub fn collisions(table: &OutcomeTable) -> Vec<Collisions> {
    let (actions, around) = (table.text("action"), table.text("surroundings"));
    let mut rows_of: BTreeMap<&str, Vec<u32>> = BTreeMap::new();
    let (runs, steps) = (table.text("run"), table.number("step"));
    for row in 0..table.len() {
        let is_first = row == 0
            || runs.of_row[row] != runs.of_row[row - 1]
            || steps.get(row).map(|step| step.to_bits())
                != steps.get(row - 1).map(|step| step.to_bits());
        if let (true, Some(action), Some(_)) = (is_first, actions.get(row), around.get(row)) {
            // A table has far fewer rows than 2^32.
            rows_of.entry(action).or_default().push(row as u32);
        }
    }
    let scenes = Scenes::of(table);
    rows_of
        .into_iter()
        .filter_map(|(action, rows)| {
            let rows = scenes.first_rows(&newest_of_alike(table, &rows));
            let read = |row: &u32| {
                let things: Vec<Surrounding> =
                    serde_json::from_str(around.get(*row as usize)?).ok()?;
                Some((runs.get(*row as usize)?, things))
            };
            of_action(
                action,
                table.sampling,
                &rows.iter().filter_map(read).collect::<Vec<_>>(),
            )
        })
        .collect()
}

fn of_action(
    action: &str,
    sampling: Sampling,
    executions: &[(&str, Vec<Surrounding>)],
) -> Option<Collisions> {
    let hit = executions
        .iter()
        .filter(|(_, things)| things.iter().any(|thing| thing.force_n.is_some()))
        .count() as u64;
    let mut categories: Vec<&str> = executions
        .iter()
        .flat_map(|(_, things)| things)
        .filter(|thing| thing.force_n.is_some())
        .map(|thing| thing.category.as_str())
        .collect();
    categories.sort_unstable();
    categories.dedup();
    let mut kinds: Vec<HitKind> = categories
        .into_iter()
        .filter_map(|category| kind(category, sampling, executions))
        .collect();
    kinds.sort_by(|a, b| b.hit.cmp(&a.hit).then_with(|| a.category.cmp(&b.category)));
    let placed = |(run, things): &(&str, Vec<Surrounding>)| -> Vec<PlacedThing> {
        let place = |thing: &Surrounding| {
            Some(PlacedThing {
                run: (*run).to_owned(),
                object: thing.object.clone(),
                category: thing.category.clone(),
                beyond_m: thing.beyond_m?,
                left_m: thing.left_m?,
                force_n: thing.force_n,
            })
        };
        things.iter().filter_map(place).collect()
    };
    Some(Collisions {
        action: action.to_owned(),
        executions: executions.len() as u64,
        hit,
        rate: sampling.interval(hit, executions.len() as u64)?,
        kinds,
        sectors: sectors(sampling, executions.iter().flat_map(|(_, things)| things)),
        things: executions.iter().flat_map(placed).collect(),
    })
}

fn is_furniture(thing: &Surrounding) -> bool {
    thing.role == Role::Platform.word()
}

fn kind(
    category: &str,
    sampling: Sampling,
    executions: &[(&str, Vec<Surrounding>)],
) -> Option<HitKind> {
    let of_kind = |things: &'_ [Surrounding]| -> Vec<Surrounding> {
        things
            .iter()
            .filter(|thing| thing.category == category)
            .cloned()
            .collect()
    };
    let mut hits: Vec<(&str, Surrounding)> = Vec::new();
    let (mut present, mut furniture) = (0, false);
    for (run, things) in executions {
        let things = of_kind(things);
        present += u64::from(!things.is_empty());
        furniture |= things.iter().any(is_furniture);
        let hit = things.into_iter().filter(|thing| thing.force_n.is_some());
        let hardest = hit.max_by(|a, b| {
            a.force_n
                .unwrap_or_default()
                .total_cmp(&b.force_n.unwrap_or_default())
        });
        hits.extend(hardest.map(|hardest| (*run, hardest)));
    }
    if furniture {
        present = executions.len() as u64;
    }
    hits.sort_by(|a, b| {
        b.1.force_n
            .unwrap_or_default()
            .total_cmp(&a.1.force_n.unwrap_or_default())
    });
    let hit = hits.len() as u64;
    let by = |thing: &Surrounding| {
        thing.by.as_deref().map(|by| {
            if by.starts_with("robot/") {
                by.to_owned()
            } else {
                "object".to_owned()
            }
        })
    };
    Some(HitKind {
        category: category.to_owned(),
        furniture,
        present,
        hit,
        rate: sampling.interval(hit, present)?,
        force_n: quantiles(hits.iter().filter_map(|(_, thing)| thing.force_n))?,
        by: tally(hits.iter().filter_map(|(_, thing)| by(thing))),
        phases: tally(hits.iter().filter_map(|(_, thing)| thing.phase.clone())),
        directions: tally(
            hits.iter()
                .filter_map(|(_, thing)| Some(DIRECTIONS[direction(thing)?].to_owned())),
        ),
        runs: hits.iter().map(|(run, _)| (*run).to_owned()).collect(),
    })
}

/// Counts each text, most frequent first.
fn tally(texts: impl Iterator<Item = String>) -> Vec<(String, u64)> {
    let mut counts: BTreeMap<String, u64> = BTreeMap::new();
    texts.for_each(|text| *counts.entry(text).or_default() += 1);
    let mut found: Vec<(String, u64)> = counts.into_iter().collect();
    // The sort is stable: equal counts stay sorted by text.
    found.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    found
}

/// Index of a thing's direction from the goal. `None` without a place.
fn direction(thing: &Surrounding) -> Option<usize> {
    let turn = libm::atan2(thing.left_m?, thing.beyond_m?) / std::f64::consts::FRAC_PI_2;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "from 0 to 4"
    )]
    let quarter = libm::floor(turn + 0.5).rem_euclid(4.0) as usize;
    Some(quarter.min(DIRECTIONS.len() - 1))
}

fn sectors<'a>(
    sampling: Sampling,
    things: impl Iterator<Item = &'a Surrounding>,
) -> Vec<Vec<Sector>> {
    let lower = |band: usize| band.checked_sub(1).map_or(0.0, |below| DISTANCES_M[below]);
    let sector = |direction: &'static str, band: usize| Sector {
        direction,
        distance_m: (
            lower(band),
            Some(DISTANCES_M[band]).filter(|end| end.is_finite()),
        ),
        present: 0,
        hit: 0,
        rate: None,
    };
    let row = |direction| {
        (0..DISTANCES_M.len())
            .map(|band| sector(direction, band))
            .collect()
    };
    let mut found: Vec<Vec<Sector>> = DIRECTIONS.into_iter().map(row).collect();
    for thing in things.filter(|thing| !is_furniture(thing)) {
        let (Some(beyond), Some(left), Some(direction)) =
            (thing.beyond_m, thing.left_m, direction(thing))
        else {
            continue;
        };
        let away = libm::hypot(beyond, left);
        let band = DISTANCES_M
            .partition_point(|end| *end <= away)
            .min(DISTANCES_M.len() - 1);
        let cell = &mut found[direction][band];
        (cell.present, cell.hit) = (
            cell.present + 1,
            cell.hit + u64::from(thing.force_n.is_some()),
        );
    }
    found
        .iter_mut()
        .flatten()
        .for_each(|cell| cell.rate = sampling.interval(cell.hit, cell.present));
    found
}
