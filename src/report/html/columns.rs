//! Packs all runs as columns: their outcomes, their conditions and effects.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Value, json};

use crate::FindingsSummary;
use crate::html::pack::Pack;
use actcheck_analysis::{ColumnKind, OutcomeTable, columns};
use actcheck_base::{Outcome, names};

/// Columns that a page needs in addition to those of the findings.
pub const HTML_COLUMNS: [&str; 9] = [
    "index",
    "repetition",
    "test",
    "score",
    "message",
    "duration_s",
    "witness",
    "target_displacement_m",
    "others_displacement_m",
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
            .map(|report| (report.findings.action.as_str(), report.findings.property.as_str()))
            .collect();
        let slot = |row: usize| {
            let (action, property) = (table.text("action").get(row)?, table.text("property").get(row)?);
            let step = table.number("step").get(row).filter(|step| !step.is_nan())?;
            shown.contains(&(action, property)).then_some((*step as u32, action, property))
        };
        let all: BTreeSet<(u32, &str, &str)> = (0..table.len()).filter_map(slot).collect();
        let places: BTreeMap<_, usize> = all.iter().copied().zip(0..).collect();
        Self {
            of_row: (0..table.len()).map(|row| places.get(&slot(row)?).copied()).collect(),
            slots: all
                .into_iter()
                .map(|(step, action, property)| Slot { step, action: action.to_owned(), property: property.to_owned() })
                .collect(),
        }
    }
}

/// Packs all runs.
pub(super) fn runs(table: &OutcomeTable, slots: &Slots) -> String {
    let mut pack = Pack::default();
    let runs = table.text("run");
    let first_rows = first_rows(table);
    pack.set("runs", runs.texts.clone());
    for name in ["campaign", "test", "status", "started"] {
        let column = kinds(table, name, &first_rows, &mut pack);
        pack.set(name, column);
    }
    for name in ["index", "score", "scene", "repetition"] {
        let column = pack.numbers(&of_rows(table, name, &first_rows));
        pack.set(name, column);
    }
    outcomes(table, slots, &mut pack);
    steps(table, &mut pack);
    let parameters: Vec<Value> = columns()
        .iter()
        .filter(|column| column.is_condition() || column.is_effect() || column.name.ends_with("_displacement_m"))
        .filter_map(|column| {
            let values = match column.kind {
                ColumnKind::Text => Some(kinds(table, column.name, &first_rows, &mut pack)),
                _ => pack.numbers(&of_rows(table, column.name, &first_rows)),
            };
            Some(json!({
                "name": column.name, "unit": column.unit, "told": column.description, "role": column.role,
                "values": values?,
            }))
        })
        .collect();
    pack.set("parameters", parameters);
    let acted = kinds(table, "action", &first_rows, &mut pack);
    pack.set("action", acted);
    pack.finish()
}

/// For each run, the row that describes its scene and effects: the one whose surface is nearest to the target. Actions at another
/// place refer to another surface.
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
    rows.into_iter().map(|row| row.map_or(0, |(row, _)| row)).collect()
}

fn of_rows(table: &OutcomeTable, name: &str, rows: &[usize]) -> Vec<f64> {
    let column = table.number(name);
    rows.iter().map(|row| column.get(*row).copied().unwrap_or(f64::NAN)).collect()
}

/// Packs a text column: the distinct texts, then an index for each row (0: no text). IRIs are shortened to local names.
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
                texts.push(if name.ends_with("_category") { names::local(text) } else { text });
                // A page has far fewer than 2³² texts.
                texts.len() as u32
            }),
        })
        .collect();
    let of_run = pack.places(&places);
    json!({ "kind": "texts", "texts": texts, "of": of_run })
}

/// Packs outcomes and margins for each property, and the witnesses of outcomes that did not pass.
fn outcomes(table: &OutcomeTable, slots: &Slots, pack: &mut Pack) {
    let runs = table.text("run");
    let count = runs.texts.len();
    let words = table.text("outcome");
    let codes: Vec<u8> = words
        .texts
        .iter()
        .map(|word| Outcome::ALL.iter().position(|outcome| outcome.word() == word).map_or(NO_OUTCOME, |at| at as u8))
        .collect();
    let mut outcomes = vec![NO_OUTCOME; count * slots.slots.len()];
    let mut margins = vec![vec![f64::NAN; count]; slots.slots.len()];
    let mut shown_by: BTreeMap<usize, &str> = BTreeMap::new();
    for row in 0..table.len() {
        let (Some(run), Some(slot)) = (runs.of_row[row], slots.of_row[row]) else { continue };
        let code = words.of_row[row].map_or(NO_OUTCOME, |of| codes[of as usize]);
        let at = slot * count + run as usize;
        outcomes[at] = code;
        margins[slot][run as usize] = table.number("margin").get(row).copied().unwrap_or(f64::NAN);
        if let Some(witness) = table.text("witness").get(row).filter(|text| code != 0 && !text.is_empty()) {
            shown_by.insert(at, witness);
        }
    }
    let outcomes = pack.bytes(&outcomes);
    pack.set("outcomes", outcomes);
    let margins: Vec<Value> = margins.iter().map(|margins| pack.numbers(margins).into()).collect();
    pack.set("margins", margins);
    let places: Vec<u32> = shown_by.keys().map(|at| *at as u32).collect();
    let places = pack.places(&places);
    pack.set("witnesses", json!({ "at": places, "texts": shown_by.values().collect::<Vec<_>>() }));
}

/// Packs the message and duration of each action, step by step.
fn steps(table: &OutcomeTable, pack: &mut Pack) {
    let runs = table.text("run");
    let steps = table.number("step");
    let most = steps.iter().copied().filter(|step| step.is_finite()).fold(0.0, f64::max) as usize;
    let mut rows: Vec<Vec<Option<usize>>> = vec![vec![None; runs.texts.len()]; most];
    for (row, step) in steps.iter().enumerate().filter(|(_, step)| **step >= 1.0) {
        if let Some(run) = runs.of_row[row] {
            rows[*step as usize - 1][run as usize].get_or_insert(row);
        }
    }
    let steps: Vec<Value> = rows
        .iter()
        .map(|rows| {
            // Runs without this step refer to the row after the last, which is empty.
            let rows: Vec<usize> = rows.iter().map(|row| row.unwrap_or(table.len())).collect();
            let messages = kinds(table, "message", &rows, pack);
            let action = kinds(table, "action", &rows, pack);
            json!({ "action": action, "message": messages, "seconds": pack.numbers(&of_rows(table, "duration_s", &rows)) })
        })
        .collect();
    pack.set("steps", steps);
}
