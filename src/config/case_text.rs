//! Writes a configuration with a single scene, for users and for `actcheck run`.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use toml::Value;

use crate::{Campaign, OtherCounts, Step};
use actcheck_base::{Diagnostic, Diagnostics, Source};
use actcheck_data::{Choice, ChoiceKind, ChoiceName, ObjectAxis};

/// Keys without a meaning for a single scene.
const OF_CAMPAIGNS: [&str; 6] = ["case", "history", "relations", "repeat", "search", "seed"];

/// Keys of `[budget]` without a meaning for a single scene.
const BUDGETS_OF_CAMPAIGNS: [&str; 3] = ["max_failures", "time", "until_width"];

/// The data of a case, in addition to the configuration's text.
#[derive(Debug, Clone)]
pub struct CaseText<'a> {
    /// The run that the case is exported from.
    pub run: &'a str,
    /// Its actions.
    pub test: &'a [Step],
    /// Names of the properties that failed.
    pub failed: &'a [String],
    /// Digest over all states of the run.
    pub trace: &'a str,
    /// Every choice of the run.
    pub choices: &'a [Choice],
    /// Paths to write; missing ones omit their key.
    pub paths: WrittenPaths,
    /// Values to write for `test_launcher` and `[skill] dir`, if an external program performs
    /// actions.
    pub skill: Option<(Option<String>, String)>,
}

/// The paths in a configuration's text, as written.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct WrittenPaths {
    /// The ontology (`ontology`).
    pub ontology: Option<String>,
    /// The folders of models (`model_dir`).
    pub models: Vec<String>,
    /// The robot's profile (`profile`), if it is a file.
    pub profile: Option<String>,
}

impl WrittenPaths {
    /// Returns all paths.
    pub fn all(&self) -> impl Iterator<Item = &str> {
        self.ontology
            .iter()
            .chain(&self.models)
            .chain(&self.profile)
            .map(String::as_str)
    }

    /// Changes each path.
    #[must_use]
    pub fn map(self, change: impl Fn(String) -> String) -> Self {
        Self {
            ontology: self.ontology.map(&change),
            models: self.models.into_iter().map(&change).collect(),
            profile: self.profile.map(&change),
        }
    }
}

/// Returns the paths in a configuration's text.
///
/// # Errors
/// C002 if the text is not TOML.
pub fn written_paths(source: &Source) -> Result<WrittenPaths, Diagnostics> {
    let table = parse(source)?;
    let text = |value: Option<&Value>| value.and_then(Value::as_str).map(str::to_owned);
    let profile = text(table.get("robot").and_then(|robot| robot.get("profile")));
    let profile = profile.filter(|profile| profile.ends_with(".toml"));
    let models = match table.get("model_dir") {
        Some(Value::Array(folders)) => folders
            .iter()
            .filter_map(|folder| text(Some(folder)))
            .collect(),
        folder => text(folder).into_iter().collect(),
    };
    Ok(WrittenPaths {
        ontology: text(table.get("ontology")),
        models,
        profile,
    })
}

fn parse(source: &Source) -> Result<toml::Table, Diagnostics> {
    source.text.parse().map_err(|error: toml::de::Error| {
        Diagnostic::error("C002", format!("this is not TOML: {}", error.message()))
            .in_source(source)
            .into()
    })
}

/// Returns a campaign's configuration reduced to a single scene.
///
/// # Errors
/// C002 if the campaign's text is not TOML.
pub fn case_text(campaign: &Campaign, case: &CaseText<'_>) -> Result<String, Diagnostics> {
    let mut table = parse(&campaign.source)?;
    OF_CAMPAIGNS.iter().for_each(|key| drop(table.remove(*key)));
    if let Some(Value::Table(budget)) = table.get_mut("budget") {
        BUDGETS_OF_CAMPAIGNS
            .iter()
            .for_each(|key| drop(budget.remove(*key)));
    }
    table.insert(
        "tests".to_owned(),
        Value::Array(vec![Value::Array(case.test.iter().map(step).collect())]),
    );
    table.insert("test_count".to_owned(), Value::Integer(1));
    let WrittenPaths {
        ontology,
        models,
        profile,
    } = case.paths.clone();
    let mut models: Vec<Value> = models.into_iter().map(Value::String).collect();
    let model_dir = if models.len() > 1 {
        Some(Value::Array(models))
    } else {
        models.pop()
    };
    for (key, value) in [
        ("ontology", ontology.map(Value::String)),
        ("model_dir", model_dir),
    ] {
        match value {
            Some(value) => table.insert(key.to_owned(), value),
            None => table.remove(key),
        };
    }
    if let (Some(profile), Some(Value::Table(robot))) = (profile, table.get_mut("robot")) {
        robot.insert("profile".to_owned(), Value::String(profile));
    }
    if let Some((launcher, dir)) = &case.skill {
        let launcher = launcher
            .iter()
            .map(|text| ("test_launcher".to_owned(), Value::String(text.clone())));
        table.extend(launcher);
        let skill = table
            .entry("skill")
            .or_insert_with(|| Value::Table(toml::Table::new()));
        if let Value::Table(skill) = skill {
            skill.insert("dir".to_owned(), Value::String(dir.clone()));
        }
    }
    let mut out = format!(
        "# One scene, exported from run {}: `actcheck run` with this file reproduces it.\n\
         # The run uses the current rules, ontology and models.\n\n{table}\n",
        case.run
    );
    let _ = writeln!(out, "[case]\nfrom = {}", Value::String(case.run.to_owned()));
    let _ = writeln!(
        out,
        "# Properties that failed in that run.\nexpect = {}",
        names(case.failed)
    );
    let _ = writeln!(
        out,
        "# Digest over all states of that run.\ntrace = {}",
        Value::String(case.trace.to_owned())
    );
    let _ = writeln!(
        out,
        "\n# Every choice of the run, to edit as needed. Choices left out take their nominal value. Poses are in the\n\
         # world frame: its origin is the middle of the surface, with the robot on the negative x side.\n[case.choices]"
    );
    out.push_str(&choice_lines(campaign, case));
    Ok(out)
}

/// Returns a case's text with the skills of a campaign instead of its own. `skill`: as in
/// [`CaseText`]. The text is unchanged if it names the same skills.
///
/// # Errors
/// C002 if one of the texts is not TOML.
pub fn with_skills(
    case: &Source,
    campaign: &Campaign,
    skill: Option<(Option<String>, String)>,
) -> Result<String, Diagnostics> {
    let (mut table, own) = (parse(case)?, parse(&campaign.source)?);
    let was = [table.remove("test_launcher"), table.remove("skill")];
    let is = match skill {
        None => [None, None],
        Some((launcher, dir)) => {
            let mut options = own
                .get("skill")
                .and_then(Value::as_table)
                .cloned()
                .unwrap_or_default();
            options.insert("dir".to_owned(), Value::String(dir));
            [
                launcher
                    .map(Value::String)
                    .or_else(|| own.get("test_launcher").cloned()),
                Some(Value::Table(options)),
            ]
        }
    };
    let names_none = was[1].is_none()
        && was[0]
            .as_ref()
            .is_none_or(|name| name.as_str() == Some("reference"));
    if was == is || (is == [None, None] && names_none) {
        return Ok(case.text.to_string());
    }
    let keys = ["test_launcher", "skill"].map(str::to_owned);
    table.extend(
        keys.into_iter()
            .zip(is)
            .filter_map(|(key, value)| Some((key, value?))),
    );
    Ok(table.to_string())
}

/// An action of a test as configurations write it.
fn step(step: &Step) -> Value {
    if step.values.is_empty() {
        return Value::String(step.action.clone());
    }
    let values = step
        .values
        .iter()
        .map(|(name, value)| (name.clone(), Value::String(value.clone())));
    Value::Table(
        [("action".to_owned(), Value::String(step.action.clone()))]
            .into_iter()
            .chain(values)
            .collect(),
    )
}

fn names(names: &[String]) -> Value {
    Value::Array(names.iter().cloned().map(Value::String).collect())
}

/// Writes one line per name, in the order of first choices, with a blank line between objects.
fn choice_lines(campaign: &Campaign, case: &CaseText<'_>) -> String {
    let mut order: Vec<String> = Vec::new();
    let mut values: BTreeMap<&ChoiceName, Vec<&Choice>> = BTreeMap::new();
    for choice in case.choices {
        let same = values.entry(&choice.name).or_default();
        if same.is_empty() {
            order.push(choice.name.to_string());
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
        let same = &values[&ChoiceName::from(name.as_str())];
        let written: Vec<String> = same
            .iter()
            .map(|choice| written(choice, &campaign.other_counts))
            .collect();
        let value = match written.as_slice() {
            [only] => only.clone(),
            several => format!("[{}]", several.join(", ")),
        };
        let remark = same.first().and_then(|choice| remark(choice));
        let _ = writeln!(
            out,
            "{} = {value}{}",
            key(name, &order),
            remark.unwrap_or_default()
        );
    }
    out
}

/// Formats a name as dotted keys, or in quotation marks if a prefix of it is a choice too, which
/// TOML forbids.
fn key(name: &str, all: &[String]) -> String {
    let quoted = |text: &str| Value::String(text.to_owned()).to_string();
    let within = |other: &String| {
        name.strip_prefix(other.as_str())
            .is_some_and(|rest| rest.starts_with('.'))
    };
    if all.iter().any(within) {
        return quoted(name);
    }
    let is_bare = |part: &str| {
        !part.is_empty()
            && part
                .bytes()
                .all(|byte| byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'-'))
    };
    let parts = name.split('.').map(|part| {
        if is_bare(part) {
            part.to_owned()
        } else {
            quoted(part)
        }
    });
    parts.collect::<Vec<_>>().join(".")
}

/// Formats a value for the reader of cases: a candidate by its name, a number with all its digits.
fn written(choice: &Choice, counts: &OtherCounts) -> String {
    match (choice.candidate(), counts.of_choice(&choice.name)) {
        (Some(name), _) => Value::String(name.to_owned()).to_string(),
        (None, Some((least, _))) => (choice.value as u32 + least).to_string(),
        (None, None)
            if matches!(
                choice.name,
                ChoiceName::Object(_, ObjectAxis::LeftOut) | ChoiceName::Renamed
            ) =>
        {
            (choice.value != 0.0).to_string()
        }
        (None, None) => format!("{:?}", choice.value),
    }
}

/// Returns unit and bounds as a TOML comment.
fn remark(choice: &Choice) -> Option<String> {
    let bounds = match &choice.kind {
        ChoiceKind::Real { low, high, .. } => format!("{} to {}", short(*low), short(*high)),
        ChoiceKind::Normal { sigma } => format!("standard deviation {}", short(*sigma)),
        ChoiceKind::Index { .. } | ChoiceKind::Candidate { .. } => return None,
    };
    let unit = choice.name.unit();
    let unit = if unit.is_empty() {
        String::new()
    } else {
        format!("{unit}, ")
    };
    Some(format!("  # {unit}{bounds}"))
}

/// Formats a number with at most four decimal places.
fn short(value: f64) -> String {
    let text = format!("{:.4}", value + 0.0);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
