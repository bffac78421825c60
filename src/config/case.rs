//! `[case]`: one scene as a list of its choices, written by `actcheck export` and read by `actcheck run`.

use std::collections::BTreeMap;

use crate::designators::Designators;
use crate::{Located, OtherCounts, Table};
use actcheck_base::{Diagnostics, Span, did_you_mean};

/// Choices that pick a name from a designator's candidates. They are written by name, so that a case stays valid when
/// candidates are added. `*` matches a number.
const NAMED: [(&str, &str); 4] = [
    ("surface.model", "objectSurface"),
    ("target.model", "pickObject"),
    ("other.*.model", "surfaceObjects"),
    ("place_other.*.model", "surfaceObjects"),
];

/// A scene fixed by the configuration: every run makes these choices.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Case {
    /// The run that the case was exported from.
    pub from: Option<String>,
    /// Names of the properties that failed in that run.
    pub expect: Vec<String>,
    /// Digest over all states of that run.
    pub trace: Option<String>,
    /// Values by name of the choice, in order if a name repeats. Missing choices take their nominal value.
    pub choices: BTreeMap<String, Vec<f64>>,
}

impl Case {
    /// Returns the key of a choice in [`crate::Campaign::places`].
    pub fn place_of(choice: &str) -> String {
        format!("case.choices.{choice}")
    }
}

/// The notation of a choice's value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Form<'a> {
    /// As one of these names.
    Name(&'a [String]),
    /// As a count: the choice's value plus this least count.
    Count(u32),
    /// As `true` for 1 and `false` for 0.
    YesNo,
    /// As a number.
    Number,
}

impl<'a> Form<'a> {
    /// Returns the form of a choice's values, given its name.
    pub(super) fn of(choice: &str, candidates: &'a BTreeMap<String, Vec<String>>, counts: &OtherCounts) -> Self {
        let fits = |pattern: &str| match pattern.split_once('*') {
            Some((start, end)) => {
                choice.strip_prefix(start).and_then(|rest| rest.strip_suffix(end)).is_some_and(is_number)
            }
            None => choice == pattern,
        };
        let designator = NAMED.iter().find(|(pattern, _)| fits(pattern)).map_or(choice, |(_, designator)| designator);
        match (candidates.get(designator), counts.of_choice(choice)) {
            (Some(names), _) => Self::Name(names),
            (None, Some((least, _))) => Self::Count(least),
            (None, None) if choice.ends_with(".left_out") => Self::YesNo,
            (None, None) => Self::Number,
        }
    }
}

fn is_number(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit())
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
    for (idx, name) in table.strings("expect").unwrap_or_default().into_iter().enumerate() {
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
    (choices, places): (&mut BTreeMap<String, Vec<f64>>, &mut BTreeMap<String, Span>),
    found: &mut Diagnostics,
) {
    for key in table.untaken_tables() {
        if let Some(inner) = table.table(&key) {
            read_choices(inner, &format!("{prefix}{key}."), designators, (&mut *choices, &mut *places), found);
        }
    }
    for key in table.untaken_keys() {
        let name = format!("{prefix}{key}");
        let span = table.key_span(&key).unwrap_or_default();
        let form = Form::of(&name, &designators.candidates, &designators.other_counts);
        let values = read_values(&mut table, &key, form);
        places.insert(Case::place_of(&name), span.clone());
        if choices.insert(name.clone(), values).is_some() {
            let message = format!("the choice `{name}` is written twice, with and without quotation marks");
            table.fault("C015", span, message, "leave one of them out");
        }
    }
    table.finish(found);
}

/// Reads the values of one choice: a single value or a list.
fn read_values(table: &mut Table, key: &str, form: Form<'_>) -> Vec<f64> {
    match form {
        Form::Name(names) => {
            let written = match table.is_list(key) {
                true => table.strings(key).unwrap_or_default(),
                false => table.string(key).into_iter().collect(),
            };
            written.into_iter().filter_map(|text| index_of(table, key, &text, names)).collect()
        }
        Form::Count(least) => table
            .integer(key, 0..=i64::from(u32::MAX))
            .map(|count| count as f64 - f64::from(least))
            .into_iter()
            .collect(),
        Form::YesNo => table.boolean(key).map(f64::from).into_iter().collect(),
        Form::Number if table.is_list(key) => table.number_list(key, ..).unwrap_or_default(),
        Form::Number => table.number(key, ..).into_iter().collect(),
    }
}

fn index_of(table: &mut Table, key: &str, text: &Located<String>, names: &[String]) -> Option<f64> {
    let found = names.iter().position(|name| *name == text.value);
    if found.is_none() {
        let message = format!("`{}` is not a candidate for `{key}`", text.value);
        let help = did_you_mean(&text.value, names.iter().map(String::as_str));
        table.fault("C015", text.span.clone(), message, help);
    }
    found.map(|idx| idx as f64)
}
