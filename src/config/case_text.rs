//! A configuration with a single scene, as text for people and for `actcheck run`.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use toml::Value;

use crate::base::{Choice, ChoiceKind, Diagnostic, Diagnostics, Source};
use crate::config::Campaign;
use crate::config::case::Form;

/// Keys that mean nothing for a single scene.
const OF_CAMPAIGNS: [&str; 5] = ["case", "history", "repeat", "search", "seed"];

/// The same of `[budget]`.
const BUDGETS_OF_CAMPAIGNS: [&str; 3] = ["max_failures", "time", "until_width"];

/// What is written as a case, beside the configuration's text.
#[derive(Debug, Clone)]
pub struct CaseText<'a> {
    /// The run that it is taken from.
    pub run: &'a str,
    /// Names of its actions.
    pub test: &'a [String],
    /// Names of the properties that failed.
    pub failed: &'a [String],
    /// Digest over all states of the run.
    pub trace: &'a str,
    /// Every decision of the run.
    pub choices: &'a [Choice],
    /// Unit of a choice by its name; empty where it has none.
    pub unit: fn(&str) -> &'static str,
    /// The keys `ontology` and `model_dir` and the robot's `profile`, as they are to be written; nothing leaves out.
    pub paths: [Option<String>; 3],
    /// `test_launcher` and `[skill] dir` as they are to be written, where a program performs actions.
    pub skill: Option<(Option<String>, String)>,
}

/// The paths that a configuration's text names, as they are written: of the ontology, the models, and the robot where it
/// is named by a file.
///
/// # Errors
/// C002 where the text is not TOML.
pub fn written_paths(source: &Source) -> Result<[Option<String>; 3], Diagnostics> {
    let table = parse(source)?;
    let text = |value: Option<&Value>| value.and_then(Value::as_str).map(str::to_owned);
    let profile = text(table.get("robot").and_then(|robot| robot.get("profile")));
    let profile = profile.filter(|profile| profile.ends_with(".toml"));
    Ok([text(table.get("ontology")), text(table.get("model_dir")), profile])
}

fn parse(source: &Source) -> Result<toml::Table, Diagnostics> {
    source.text.parse().map_err(|error: toml::de::Error| {
        Diagnostic::error("C002", format!("this is not TOML: {}", error.message())).in_source(source).into()
    })
}

/// A campaign's configuration, but with a single scene.
///
/// # Errors
/// C002 where the campaign's text is not TOML.
pub fn case_text(campaign: &Campaign, case: &CaseText<'_>) -> Result<String, Diagnostics> {
    let mut table = parse(&campaign.source)?;
    OF_CAMPAIGNS.iter().for_each(|key| drop(table.remove(*key)));
    if let Some(Value::Table(budget)) = table.get_mut("budget") {
        BUDGETS_OF_CAMPAIGNS.iter().for_each(|key| drop(budget.remove(*key)));
    }
    table.insert("tests".to_owned(), Value::Array(vec![names(case.test)]));
    table.insert("test_count".to_owned(), Value::Integer(1));
    let [ontology, model_dir, profile] = case.paths.clone();
    for (key, path) in [("ontology", ontology), ("model_dir", model_dir)] {
        match path {
            Some(path) => table.insert(key.to_owned(), Value::String(path)),
            None => table.remove(key),
        };
    }
    if let (Some(profile), Some(Value::Table(robot))) = (profile, table.get_mut("robot")) {
        robot.insert("profile".to_owned(), Value::String(profile));
    }
    if let Some((launcher, dir)) = &case.skill {
        let launcher = launcher.iter().map(|text| ("test_launcher".to_owned(), Value::String(text.clone())));
        table.extend(launcher);
        let skill = table.entry("skill").or_insert_with(|| Value::Table(toml::Table::new()));
        if let Value::Table(skill) = skill {
            skill.insert("dir".to_owned(), Value::String(dir.clone()));
        }
    }
    let mut out = format!(
        "# One scene, taken from run {}: `actcheck run` with this file makes it again.\n\
         # Rules, ontology and models are those of the day on which it runs.\n\n{table}\n",
        case.run
    );
    let _ = writeln!(out, "[case]\nfrom = {}", Value::String(case.run.to_owned()));
    let _ = writeln!(out, "# What failed when it was taken.\nexpect = {}", names(case.failed));
    let _ = writeln!(out, "# Digest over all states of that run.\ntrace = {}", Value::String(case.trace.to_owned()));
    let _ = writeln!(
        out,
        "\n# Every decision of the run, to be changed by hand as well. What is left out is nominal; poses are in the world's\n\
         # frame, with the middle of the surface at its origin and the robot on the side of negative x.\n[case.choices]"
    );
    out.push_str(&choice_lines(campaign, case));
    Ok(out)
}

fn names(names: &[String]) -> Value {
    Value::Array(names.iter().cloned().map(Value::String).collect())
}

/// One line for each name, in the order of their first decisions, with a gap between things.
fn choice_lines(campaign: &Campaign, case: &CaseText<'_>) -> String {
    let mut order: Vec<&str> = Vec::new();
    let mut values: BTreeMap<&str, Vec<&Choice>> = BTreeMap::new();
    for choice in case.choices {
        let same = values.entry(&choice.name).or_default();
        if same.is_empty() {
            order.push(&choice.name);
        }
        same.push(choice);
    }
    let mut out = String::new();
    let mut thing = None;
    for name in &order {
        let of = name.rsplit_once('.').map(|(thing, _)| thing);
        if thing.is_some_and(|before| before != of) {
            out.push('\n');
        }
        thing = Some(of);
        let form = Form::of(name, &campaign.candidates, &campaign.other_counts);
        let written: Vec<String> = values[name].iter().map(|choice| written(choice.value, form)).collect();
        let value = match written.as_slice() {
            [only] => only.clone(),
            several => format!("[{}]", several.join(", ")),
        };
        let remark = values[name].first().and_then(|choice| remark(choice, form, (case.unit)(name)));
        let _ = writeln!(out, "{} = {value}{}", key(name, &order), remark.unwrap_or_default());
    }
    out
}

/// A name as dotted keys; in quotation marks where the names of its beginning is a choice too, which TOML does not allow.
fn key(name: &str, all: &[&str]) -> String {
    let quoted = |text: &str| Value::String(text.to_owned()).to_string();
    let within = |other: &&&str| name.strip_prefix(**other).is_some_and(|rest| rest.starts_with('.'));
    if all.iter().any(|other| within(&other)) {
        return quoted(name);
    }
    let is_bare = |part: &str| {
        !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'-'))
    };
    let parts = name.split('.').map(|part| if is_bare(part) { part.to_owned() } else { quoted(part) });
    parts.collect::<Vec<_>>().join(".")
}

/// A value as the reader of cases takes it, with all its digits.
fn written(value: f64, form: Form<'_>) -> String {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a wrong index finds no name")]
    let whole = value.max(0.0) as usize;
    match form {
        Form::Name(names) => match names.get(whole) {
            Some(name) => Value::String(name.clone()).to_string(),
            None => whole.to_string(),
        },
        Form::Count(least) => (whole + least as usize).to_string(),
        Form::YesNo => (value != 0.0).to_string(),
        Form::Number => format!("{value:?}"),
    }
}

/// Unit and bounds, as a comment.
fn remark(choice: &Choice, form: Form<'_>, unit: &str) -> Option<String> {
    let bounds = match (form, &choice.kind) {
        (Form::Number, ChoiceKind::Real { low, high, .. }) => format!("{} to {}", short(*low), short(*high)),
        (Form::Number, ChoiceKind::Normal { sigma }) => format!("standard deviation {}", short(*sigma)),
        _ => return None,
    };
    let unit = if unit.is_empty() { String::new() } else { format!("{unit}, ") };
    Some(format!("  # {unit}{bounds}"))
}

/// Four decimal places at most: enough for a comment.
fn short(value: f64) -> String {
    let text = format!("{:.4}", value + 0.0);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
