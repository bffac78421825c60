//! `[case]`: one scene as a list of its choices, written by `actcheck export` and read by
//! `actcheck run`.

use std::collections::BTreeMap;

use crate::designators::Designators;
use crate::{Located, Table};
use actcheck_base::{Diagnostics, Span, did_you_mean};
use actcheck_data::{ChoiceName, ChoiceValue, OBSTACLE_LIST, ObjectAxis};

/// A scene fixed by the configuration: every run makes these choices.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Case {
    /// The run that the case was exported from.
    pub from: Option<String>,
    /// Names of the properties that failed in that run.
    pub expect: Vec<String>,
    /// Digest over all states of that run.
    pub trace: Option<String>,
    /// Values by name of the choice, in order if a name repeats. Missing choices take their nominal
    /// value.
    pub choices: BTreeMap<ChoiceName, Vec<ChoiceValue>>,
}

impl Case {
    /// Returns the key of a choice in [`crate::Campaign::places`].
    pub fn place_of(choice: &ChoiceName) -> String {
        format!("case.choices.{choice}")
    }
}

/// The notation of a choice's value.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Form<'a> {
    /// As one of these candidates. (Old cases have its index.)
    Candidate(&'a [String]),
    /// As a count: the choice's value plus this least count.
    Count(u32),
    /// As `true` for 1 and `false` for 0.
    YesNo,
    /// As the id of an object of the scene, or another name that only the scene knows.
    OfScene,
    /// As a number.
    Number,
}

impl<'a> Form<'a> {
    /// Returns the form of a choice's values, given its name.
    fn of(choice: &ChoiceName, designators: &'a Designators) -> Self {
        match choice {
            ChoiceName::Designator(name) => designators
                .candidates
                .get(name)
                .map_or(Self::Number, |names| Self::Candidate(names)),
            ChoiceName::Object(_, ObjectAxis::LeftOut) | ChoiceName::Renamed => Self::YesNo,
            ChoiceName::Step { .. } => Self::OfScene,
            _ => match (
                choice.candidates(),
                designators.other_counts.of_choice(choice),
            ) {
                (Some(OBSTACLE_LIST), _) => Self::Candidate(&designators.nav_obstacles),
                (Some(table), _) => {
                    Self::Candidate(designators.candidates.get(table).map_or(&[], Vec::as_slice))
                }
                (None, Some((least, _))) => Self::Count(least),
                (None, None) => Self::Number,
            },
        }
    }
}

/// Reads `[case]` and looks its names up among the candidates of their designators.
pub(super) fn read(
    mut table: Table,
    designators: &Designators,
    places: &mut BTreeMap<String, Span>,
    found: &mut Diagnostics,
) -> Case {
    places.insert("case".to_owned(), table.span());
    table.require(&["choices"]);
    let mut case = Case {
        from: table.string("from").map(|from| from.value),
        trace: table.string("trace").map(|trace| trace.value),
        ..Case::default()
    };
    for (idx, name) in table
        .strings("expect")
        .unwrap_or_default()
        .into_iter()
        .enumerate()
    {
        places.insert(format!("case.expect.{idx}"), name.span);
        case.expect.push(name.value);
    }
    if let Some(choices) = table.table("choices") {
        read_choices(choices, "", designators, (&mut case.choices, places), found);
    }
    table.finish(found);
    case
}

/// Reads the choices whose names begin with `prefix`: each part of a name but the last is a table.
fn read_choices(
    mut table: Table,
    prefix: &str,
    designators: &Designators,
    (choices, places): (
        &mut BTreeMap<ChoiceName, Vec<ChoiceValue>>,
        &mut BTreeMap<String, Span>,
    ),
    found: &mut Diagnostics,
) {
    for key in table.untaken_tables() {
        if let Some(inner) = table.table(&key) {
            read_choices(
                inner,
                &format!("{prefix}{key}."),
                designators,
                (&mut *choices, &mut *places),
                found,
            );
        }
    }
    for key in table.untaken_keys() {
        let name = ChoiceName::from(format!("{prefix}{key}"));
        let span = table.key_span(&key).unwrap_or_default();
        let form = Form::of(&name, designators);
        let values = read_values(&mut table, &key, form);
        places.insert(Case::place_of(&name), span.clone());
        if choices.insert(name.clone(), values).is_some() {
            let message =
                format!("the choice `{name}` is written twice, with and without quotation marks");
            table.fault("C015", span, message, "leave one of them out");
        }
    }
    table.finish(found);
}

/// Reads the values of one choice: a single value or a list.
fn read_values(table: &mut Table, key: &str, form: Form<'_>) -> Vec<ChoiceValue> {
    let numbers = match form {
        Form::Candidate(_) if table.is_number(key) => table.number(key, ..).into_iter().collect(),
        Form::OfScene => {
            let written = table.string(key).into_iter();
            return written
                .map(|text| ChoiceValue::Candidate(text.value))
                .collect();
        }
        Form::Candidate(names) => return read_candidates(table, key, names),
        Form::Count(least) => table
            .integer(key, 0..=i64::from(u32::MAX))
            .map(|count| count as f64 - f64::from(least))
            .into_iter()
            .collect(),
        Form::YesNo => table.boolean(key).map(f64::from).into_iter().collect(),
        Form::Number if table.is_list(key) => table.number_list(key, ..).unwrap_or_default(),
        Form::Number => table.number(key, ..).into_iter().collect(),
    };
    numbers.into_iter().map(ChoiceValue::Number).collect()
}

fn read_candidates(table: &mut Table, key: &str, names: &[String]) -> Vec<ChoiceValue> {
    let written = match table.is_list(key) {
        true => table.strings(key).unwrap_or_default(),
        false => table.string(key).into_iter().collect(),
    };
    written
        .into_iter()
        .filter_map(|text| candidate(table, key, text, names))
        .collect()
}

/// Returns a candidate, or reports that it is not in the list (C015).
fn candidate(
    table: &mut Table,
    key: &str,
    text: Located<String>,
    names: &[String],
) -> Option<ChoiceValue> {
    if !names.contains(&text.value) {
        let message = format!("`{}` is not a candidate for `{key}`", text.value);
        let help = did_you_mean(&text.value, names.iter().map(String::as_str));
        table.fault("C015", text.span, message, help);
        return None;
    }
    Some(ChoiceValue::Candidate(text.value))
}
