//! Conditions and effects of selected rows of a table.

use std::collections::BTreeMap;

use crate::{Column, ColumnKind, Hierarchy, OutcomeTable, Parameter, TextColumn, Values, columns};
use actcheck_base::names;

/// Returns the effects of the selected rows.
pub(super) fn effects(table: &OutcomeTable, rows: &[u32], hierarchy: &Hierarchy) -> Vec<Parameter> {
    columns()
        .iter()
        .filter(|column| column.is_effect())
        .map(|column| parameter(column, table, rows, hierarchy))
        .collect()
}

fn parameter(
    column: &Column,
    table: &OutcomeTable,
    rows: &[u32],
    hierarchy: &Hierarchy,
) -> Parameter {
    let values = match column.kind {
        ColumnKind::Text => kinds(table.text(column.name), rows, hierarchy),
        _ if column.wraps => Values::Angles(numbers(table.number(column.name), rows)),
        _ => Values::Numbers(numbers(table.number(column.name), rows)),
    };
    let unit = (!column.unit.is_empty() && column.unit != "1").then(|| column.unit.to_owned());
    Parameter {
        name: column.name.to_owned(),
        unit,
        values,
    }
}

/// Returns every condition of the selected rows: the parameters of the scene, realised noise, and
/// every designator that has exactly one value in each row.
pub(super) fn conditions(
    table: &OutcomeTable,
    rows: &[u32],
    hierarchy: &Hierarchy,
) -> Vec<Parameter> {
    let columns = columns().iter().filter(|column| column.is_condition());
    let mut found: Vec<Parameter> = columns
        .map(|column| parameter(column, table, rows, hierarchy))
        .collect();
    for (name, column) in designators(table.text("designators"), rows) {
        let values = kinds(
            &column,
            &(0..rows.len() as u32).collect::<Vec<u32>>(),
            hierarchy,
        );
        found.push(Parameter {
            name,
            unit: None,
            values,
        });
    }
    found
}

fn numbers(column: &[f64], rows: &[u32]) -> Vec<f64> {
    rows.iter()
        .map(|row| column.get(*row as usize).copied().unwrap_or(f64::NAN))
        .collect()
}

/// Returns kinds in the order of first occurrence. IRIs become local names, with their
/// superclasses.
fn kinds(column: &TextColumn, rows: &[u32], hierarchy: &Hierarchy) -> Values {
    let mut place_of: BTreeMap<u32, u32> = BTreeMap::new();
    let (mut names, mut above) = (Vec::new(), Vec::new());
    let of_run = rows
        .iter()
        .map(|row| {
            let text = column.of_row.get(*row as usize).copied().flatten()?;
            Some(*place_of.entry(text).or_insert_with(|| {
                let text = &column.texts[text as usize];
                names.push(names::local(text).to_owned());
                above.push(hierarchy.get(text).cloned().unwrap_or_default());
                (names.len() - 1) as u32
            }))
        })
        .collect();
    Values::Kinds {
        of_run,
        names,
        above,
    }
}

/// Returns the designators that have exactly one value in each row, as columns over the rows.
fn designators(column: &TextColumn, rows: &[u32]) -> Vec<(String, TextColumn)> {
    let read = |text: &String| -> BTreeMap<String, Vec<String>> {
        serde_json::from_str(text).unwrap_or_default()
    };
    let known: Vec<BTreeMap<String, Vec<String>>> = column.texts.iter().map(read).collect();
    let mut found: BTreeMap<&String, TextColumn> = BTreeMap::new();
    for designator in known.iter().flat_map(BTreeMap::keys) {
        found.entry(designator).or_default();
    }
    for (designator, values) in &mut found {
        for row in rows {
            let of = column.of_row.get(*row as usize).copied().flatten();
            let value =
                of.and_then(
                    |of| match known[of as usize].get(*designator).map(Vec::as_slice) {
                        Some([only]) => Some(only),
                        _ => None,
                    },
                );
            values.of_row.push(value.map(|value| {
                values
                    .texts
                    .iter()
                    .position(|known| known == value)
                    .unwrap_or_else(|| {
                        values.texts.push(value.clone());
                        values.texts.len() - 1
                    }) as u32
            }));
        }
    }
    found.retain(|_, column| column.of_row.iter().all(Option::is_some));
    found
        .into_iter()
        .map(|(name, column)| (name.clone(), column))
        .collect()
}
