//! Packs all runs as columns: their outcomes, their conditions and effects.

use std::collections::{BTreeMap, BTreeSet};

use rustc_hash::FxHashMap;
use serde_json::{Value, json};

use crate::FindingsSummary;
use crate::html::pack::Pack;
use crate::summary::quantity_name;
use actcheck_analysis::{ColumnKind, OutcomeTable, PerceptionError, columns, concerns_target};
use actcheck_base::{Outcome, names};

/// Columns that a page needs in addition to those of the findings.
pub const HTML_COLUMNS: [&str; 11] = [
    "index",
    "repetition",
    "test",
    "score",
    "message",
    "duration_s",
    "witness",
    "target_displacement_m",
    "others_displacement_m",
    "reported",
    "objects",
];

/// Code for a property that a run does not have.
const NO_OUTCOME: u8 = u8::MAX;

/// A property of an action at a position in the test.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Slot {
    pub step: u32,
    pub action: String,
    pub property: String,
}

/// The displayed properties, and the slot of each table row.
#[derive(Debug)]
pub(super) struct Slots {
    pub slots: Vec<Slot>,
    /// Slot of each table row; `None` if its property is not displayed.
    of_row: Vec<Option<usize>>,
}

impl Slots {
    pub fn of(table: &OutcomeTable, findings: &FindingsSummary) -> Self {
        let shown: BTreeSet<(&str, &str)> = findings
            .properties
            .iter()
            .map(|report| {
                (
                    report.findings.action.as_str(),
                    report.findings.property.as_str(),
                )
            })
            .collect();
        let (actions, properties, steps) = (
            table.text("action"),
            table.text("property"),
            table.number("step"),
        );
        let key = |row: usize| -> Option<(u32, u32, u32)> {
            let step = steps.get(row).filter(|step| !step.is_nan())?;
            Some((*step as u32, actions.of_row[row]?, properties.of_row[row]?))
        };
        let mut keys: FxHashMap<(u32, u32, u32), Option<usize>> = FxHashMap::default();
        keys.extend((0..table.len()).filter_map(key).map(|key| (key, None)));
        let mut slots: Vec<(Slot, (u32, u32, u32))> = Vec::new();
        for key @ (step, action, property) in keys.keys().copied() {
            let (action, property) = (
                &actions.texts[action as usize],
                &properties.texts[property as usize],
            );
            if shown.contains(&(action.as_str(), property.as_str())) {
                slots.push((
                    Slot {
                        step,
                        action: action.clone(),
                        property: property.clone(),
                    },
                    key,
                ));
            }
        }
        slots.sort();
        keys.extend(
            slots
                .iter()
                .enumerate()
                .map(|(place, (_, key))| (*key, Some(place))),
        );
        Self {
            of_row: (0..table.len())
                .map(|row| keys.get(&key(row)?).copied().flatten())
                .collect(),
            slots: slots.into_iter().map(|(slot, _)| slot).collect(),
        }
    }
}

/// All runs of a page, packed.
#[derive(Debug)]
pub struct PackedRuns {
    pub(super) slots: Slots,
    pub(super) packed: String,
}

impl PackedRuns {
    /// Packs the runs in `table`: their outcomes, and the parameters, messages and explanations of
    /// all or of a sample. `table` has [`HTML_COLUMNS`] and the columns of the findings; if there
    /// is a sample, only the columns of rates.
    pub fn of(
        findings: &FindingsSummary,
        table: &OutcomeTable,
        sample: Option<&OutcomeTable>,
    ) -> Self {
        let slots = Slots::of(table, findings);
        let packed = runs(findings, table, sample, &slots);
        Self { slots, packed }
    }
}

fn runs(
    findings: &FindingsSummary,
    table: &OutcomeTable,
    sample: Option<&OutcomeTable>,
    slots: &Slots,
) -> String {
    let mut pack = Pack::default();
    let rows = first_rows(table);
    ids(table, &rows, &mut pack);
    for name in ["campaign", "test", "status"] {
        let column = kinds(table, name, &rows, &mut pack);
        pack.set(name, column);
    }
    for name in ["index", "scene", "repetition"] {
        let column = pack.counts(&of_rows(table, name, &rows));
        pack.set(name, column);
    }
    let score = pack.numbers(&of_rows(table, "score", &rows));
    pack.set("score", score);
    modes(findings, table, &mut pack);
    outcomes(table, slots, &mut pack);
    let (detailed, rows) = match sample {
        None => (table, rows),
        Some(sample) => (sample, first_rows(sample)),
    };
    let places = sample.map(|sample| places_in(table, sample));
    if let Some(places) = &places {
        let places = pack.places(places);
        pack.set("detailed", places);
    }
    witnesses(table, slots, detailed, places.as_deref(), &mut pack);
    let started = kinds(detailed, "started", &rows, &mut pack);
    pack.set("started", started);
    steps(detailed, &mut pack);
    objects(detailed, &rows, &mut pack);
    let parameters: Vec<Value> = columns()
        .iter()
        .filter(|column| column.is_condition() || column.is_effect() || column.name.ends_with("_displacement_m"))
        .filter_map(|column| {
            let values = match column.kind {
                ColumnKind::Text => Some(kinds(detailed, column.name, &rows, &mut pack)),
                _ => pack.numbers(&of_rows(detailed, column.name, &rows)),
            };
            Some(json!({
                "name": column.name, "label": quantity_name(column.name, Some(column.unit)), "unit": column.unit, "told": column.description, "role": column.role,
                "values": values?,
            }))
        })
        .collect();
    pack.set("parameters", parameters);
    let acted = kinds(detailed, "action", &rows, &mut pack);
    pack.set("action", acted);
    pack.finish()
}

/// Packs the ids of runs, unless each consists of its campaign and its number.
fn ids(table: &OutcomeTable, rows: &[usize], pack: &mut Pack) {
    let (runs, campaigns, index) = (
        table.text("run"),
        table.text("campaign"),
        table.number("index"),
    );
    let is_numbered = |(run, row): (&String, &usize)| {
        let number = index.get(*row).map(|index| index + 1.0);
        run.rsplit_once('-').is_some_and(|(campaign, of_run)| {
            campaigns.get(*row) == Some(campaign)
                && number.is_some_and(|number| of_run == number.to_string())
        })
    };
    pack.set("count", runs.texts.len());
    if !runs.texts.iter().zip(rows).all(is_numbered) {
        pack.set("ids", runs.texts.clone());
    }
}

/// Packs the failure mode of each run: its number from 1, or 0.
fn modes(findings: &FindingsSummary, table: &OutcomeTable, pack: &mut Pack) {
    let runs = &table.text("run").texts;
    let place_of: FxHashMap<&str, u32> = (1..)
        .zip(&findings.modes)
        .flat_map(|(mode, of)| of.runs.iter().map(move |run| (run.as_str(), mode)))
        .collect();
    let modes: Vec<u32> = runs
        .iter()
        .map(|run| place_of.get(run.as_str()).copied().unwrap_or(0))
        .collect();
    let modes = pack.places(&modes);
    pack.set("mode", modes);
}

/// For each run of a sample, its place among all runs.
fn places_in(table: &OutcomeTable, sample: &OutcomeTable) -> Vec<u32> {
    let wanted = &sample.text("run").texts;
    let mut places: FxHashMap<&str, u32> = wanted.iter().map(|run| (run.as_str(), 0)).collect();
    for (place, run) in (0..).zip(&table.text("run").texts) {
        if let Some(of) = places.get_mut(run.as_str()) {
            *of = place;
        }
    }
    wanted
        .iter()
        .map(|run| places.get(run.as_str()).copied().unwrap_or(0))
        .collect()
}

/// For each run, the row that describes its scene and effects: the one whose surface is nearest to
/// the target. Actions at another place refer to another surface.
fn first_rows(table: &OutcomeTable) -> Vec<usize> {
    let runs = table.text("run");
    let (x, y) = (table.number("surface_x_m"), table.number("surface_y_m"));
    let away = |row: usize| match (x.get(row), y.get(row)) {
        (Some(x), Some(y)) if !x.is_nan() && !y.is_nan() => x.hypot(*y),
        _ => f64::INFINITY,
    };
    let mut rows: Vec<Option<(usize, f64)>> = vec![None; runs.texts.len()];
    for (row, run) in runs.of_row.iter().enumerate() {
        let Some(run) = run else { continue };
        let known = &mut rows[*run as usize];
        if known.is_none_or(|(_, least)| away(row) < least) {
            *known = Some((row, away(row)));
        }
    }
    rows.into_iter()
        .map(|row| row.map_or(0, |(row, _)| row))
        .collect()
}

fn of_rows(table: &OutcomeTable, name: &str, rows: &[usize]) -> Vec<f64> {
    let column = table.number(name);
    rows.iter()
        .map(|row| column.get(*row).copied().unwrap_or(f64::NAN))
        .collect()
}

/// Packs a text column: the distinct texts, then an index for each row (0: no text). IRIs are
/// shortened to local names.
fn kinds(table: &OutcomeTable, name: &str, rows: &[usize], pack: &mut Pack) -> Value {
    let column = table.text(name);
    let mut known = BTreeMap::new();
    let mut texts: Vec<&str> = Vec::new();
    let places: Vec<u32> = rows
        .iter()
        .map(|row| match column.of_row.get(*row).copied().flatten() {
            None => 0,
            Some(of) => *known.entry(of).or_insert_with(|| {
                let text = &column.texts[of as usize];
                texts.push(if name.ends_with("_category") {
                    names::local(text)
                } else {
                    text
                });
                // A page has far fewer than 2³² texts.
                texts.len() as u32
            }),
        })
        .collect();
    let of_run = pack.places(&places);
    json!({ "kind": "texts", "texts": texts, "of": of_run })
}

/// Packs outcomes and margins for each property.
fn outcomes(table: &OutcomeTable, slots: &Slots, pack: &mut Pack) {
    let runs = table.text("run");
    let count = runs.texts.len();
    let codes = codes(table);
    let words = table.text("outcome");
    let margin = table.number("margin");
    let mut outcomes = vec![NO_OUTCOME; count * slots.slots.len()];
    let mut margins = vec![vec![f64::NAN; count]; slots.slots.len()];
    for row in 0..table.len() {
        let (Some(run), Some(slot)) = (runs.of_row[row], slots.of_row[row]) else {
            continue;
        };
        outcomes[slot * count + run as usize] =
            words.of_row[row].map_or(NO_OUTCOME, |of| codes[of as usize]);
        margins[slot][run as usize] = margin.get(row).copied().unwrap_or(f64::NAN);
    }
    let outcomes = pack.bytes(&outcomes);
    pack.set("outcomes", outcomes);
    let margins: Vec<Value> = margins
        .iter()
        .map(|margins| pack.numbers(margins).into())
        .collect();
    pack.set("margins", margins);
}

/// The code of each text of the column of outcomes.
fn codes(table: &OutcomeTable) -> Vec<u8> {
    let code = |word: &String| {
        let place = Outcome::ALL
            .iter()
            .position(|outcome| outcome.word() == word);
        place.map_or(NO_OUTCOME, |at| at as u8)
    };
    table.text("outcome").texts.iter().map(code).collect()
}

/// Packs the explanations of outcomes that did not pass, of the rows in `detailed`. `places`: the
/// places of its runs among all runs, if it is a sample.
fn witnesses(
    table: &OutcomeTable,
    slots: &Slots,
    detailed: &OutcomeTable,
    places: Option<&[u32]>,
    pack: &mut Pack,
) {
    let count = table.text("run").texts.len();
    let place_of: BTreeMap<&Slot, usize> = slots.slots.iter().zip(0..).collect();
    let (runs, words) = (detailed.text("run"), detailed.text("outcome"));
    let codes = codes(detailed);
    let mut shown_by: BTreeMap<usize, &str> = BTreeMap::new();
    for row in 0..detailed.len() {
        let code = words.of_row[row].map_or(NO_OUTCOME, |of| codes[of as usize]);
        let Some(witness) = detailed
            .text("witness")
            .get(row)
            .filter(|text| code != 0 && !text.is_empty())
        else {
            continue;
        };
        let slot = match places {
            None => slots.of_row[row],
            Some(_) => slot_of(detailed, row).and_then(|slot| place_of.get(&slot).copied()),
        };
        if let (Some(run), Some(slot)) = (runs.of_row[row], slot) {
            let run = places.map_or(run, |places| places[run as usize]);
            shown_by.insert(slot * count + run as usize, witness);
        }
    }
    let places: Vec<u32> = shown_by.keys().map(|at| *at as u32).collect();
    let places = pack.places(&places);
    pack.set(
        "witnesses",
        json!({ "at": places, "texts": shown_by.values().collect::<Vec<_>>() }),
    );
}

fn slot_of(table: &OutcomeTable, row: usize) -> Option<Slot> {
    let step = table
        .number("step")
        .get(row)
        .filter(|step| !step.is_nan())?;
    let (action, property) = (
        table.text("action").get(row)?,
        table.text("property").get(row)?,
    );
    Some(Slot {
        step: *step as u32,
        action: action.to_owned(),
        property: property.to_owned(),
    })
}

/// Packs the objects of each run: the distinct ones, then those of all runs one after another by
/// their places, and where each run's end.
fn objects(table: &OutcomeTable, rows: &[usize], pack: &mut Pack) {
    let column = table.text("objects");
    let mut known: FxHashMap<&str, u32> = FxHashMap::default();
    let (mut items, mut of, mut ends) = (Vec::new(), Vec::new(), Vec::new());
    for row in rows {
        let listed = column.get(*row).unwrap_or_default().split(", ");
        of.extend(listed.filter(|item| !item.is_empty()).map(|item| {
            *known.entry(item).or_insert_with(|| {
                items.push(item);
                // A page has far fewer than 2³² objects.
                items.len() as u32 - 1
            })
        }));
        ends.push(of.len() as u32);
    }
    let (of, ends) = (pack.places(&of), pack.places(&ends));
    pack.set("objects", json!({ "items": items, "of": of, "ends": ends }));
}

/// Packs texts of rows that are made here: the distinct ones, then an index for each row (0: no
/// text).
fn made_texts(texts: impl Iterator<Item = Option<String>>, pack: &mut Pack) -> Value {
    let mut known: BTreeMap<String, u32> = BTreeMap::new();
    let mut distinct = Vec::new();
    let places: Vec<u32> = texts
        .map(|text| {
            text.map_or(0, |text| {
                *known.entry(text).or_insert_with_key(|text| {
                    distinct.push(text.clone());
                    distinct.len() as u32
                })
            })
        })
        .collect();
    let of_run = pack.places(&places);
    json!({ "kind": "texts", "texts": distinct, "of": of_run })
}

/// For each run, whether a property failed and its witness mentions the target, or no object at all.
/// Failures that are only about other objects don't come from the perception of the target.
fn failed_with_target(table: &OutcomeTable) -> Vec<bool> {
    let (runs, words) = (table.text("run"), table.text("outcome"));
    let mut failed = vec![false; runs.texts.len()];
    for (row, run) in runs.of_row.iter().enumerate() {
        if let Some(run) = run {
            failed[*run as usize] |=
                words.get(row) == Some(Outcome::Failed.word()) && is_about_target(table, row);
        }
    }
    failed
}

/// Whether a failure concerns the target of its action. The table has the models of the objects, and
/// an id is that of the model with a number.
fn is_about_target(table: &OutcomeTable, row: usize) -> bool {
    let listed = table.text("objects").get(row).unwrap_or_default();
    let models = listed
        .split(", ")
        .filter_map(|item| item.split_once(" ("))
        .map(|(model, _)| model);
    concerns_target(
        table.text("witness").get(row).unwrap_or_default(),
        table.text("target_model").get(row),
        models,
        |witness, model| witness.contains(&format!("{model}_")),
    )
}

/// The error with which the action of a row perceived its target, in words: `target perceived 5 cm
/// left of where it was`.
fn perceived(table: &OutcomeTable, row: usize) -> Option<String> {
    let part = |name: &str| {
        let value = table.number(name).get(row).copied();
        value.filter(|value| value.is_finite())
    };
    let error = PerceptionError {
        ahead_m: part("target_perceived_ahead_m")?,
        left_m: part("target_perceived_left_m")?,
        above_m: part("target_perceived_above_m")?,
    };
    Some(format!("target {}", error.words()?))
}

/// Packs the message and duration of each action, step by step, whether it reported success, and
/// how far off it perceived its target.
fn steps(table: &OutcomeTable, pack: &mut Pack) {
    let runs = table.text("run");
    let steps = table.number("step");
    let most = steps
        .iter()
        .copied()
        .filter(|step| step.is_finite())
        .fold(0.0, f64::max) as usize;
    let mut rows: Vec<Vec<Option<usize>>> = vec![vec![None; runs.texts.len()]; most];
    for (row, step) in steps.iter().enumerate().filter(|(_, step)| **step >= 1.0) {
        if let Some(run) = runs.of_row[row] {
            rows[*step as usize - 1][run as usize].get_or_insert(row);
        }
    }
    let failed = failed_with_target(table);
    let steps: Vec<Value> = rows
        .iter()
        .map(|rows| {
            // Runs without this step refer to the row after the last, which is empty.
            let rows: Vec<usize> = rows.iter().map(|row| row.unwrap_or(table.len())).collect();
            let messages = kinds(table, "message", &rows, pack);
            let action = kinds(table, "action", &rows, pack);
            let told = rows.iter().zip(&failed).map(|(row, failed)| failed.then(|| perceived(table, *row))?);
            let perceived = made_texts(told, pack);
            json!({
                "action": action, "message": messages, "seconds": pack.numbers(&of_rows(table, "duration_s", &rows)),
                "reported": pack.numbers(&of_rows(table, "reported", &rows)), "perceived": perceived,
            })
        })
        .collect();
    pack.set("steps", steps);
}
