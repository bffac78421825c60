//! Prepares cases, configurations with one fixed scene, and checks that the scene can be built as
//! written.

use std::collections::BTreeMap;
use std::path::Path;

use crate::Env;
use crate::export::skill_seen_from;
use actcheck_base::{Diagnostic, Diagnostics, nearest};
use actcheck_config as config;
use actcheck_config::{Campaign, Case, Overrides};
use actcheck_data::{
    Choice, ChoiceKind, ChoiceName, ChoiceValue, Choices, ObjectAxis, Scene, SightingAxis,
};
use actcheck_rules::Budget;
use actcheck_scenario as scenario;
use actcheck_scenario::Space;

impl Env {
    /// Prepares a case that tests the skills of a campaign: it has a scene and the expected
    /// failures, and the campaign's own skills perform its actions, whichever program the file
    /// names. Its history is the campaign's.
    ///
    /// # Errors
    /// As [`Env::prepare`].
    pub fn prepare_case(
        file: &Path,
        campaign: &Campaign,
        rule_budget: Budget,
    ) -> Result<Self, Diagnostics> {
        let overrides = Overrides {
            history: Some(campaign.history.clone()),
            launcher: Some(campaign.launcher.clone()),
            ..Overrides::default()
        };
        let mut env = Self::prepare_within(file, &overrides, rule_budget)?;
        let skill = skill_seen_from(file.parent().unwrap_or(Path::new("")), &campaign.launcher);
        env.text = config::with_skills(&env.campaign.source, campaign, skill)?;
        Ok(env)
    }
}

/// Finds the choices of a case that can't have their written values: S061 the scene has no such
/// choice, S062 the value is out of bounds, S063 another object is in the way, S060 the scene can't
/// be built at all. Warns of an index that may mean another candidate when candidates are added
/// (S066).
pub(super) fn check_case(campaign: &Campaign, space: &Space) -> Diagnostics {
    let mut found = Diagnostics::new();
    let Some(case) = &campaign.case else {
        return found;
    };
    let mut choices = Choices::named(&case.choices);
    let drawn = scenario::draw(space, 0, &mut choices);
    let mut made: BTreeMap<&ChoiceName, Vec<&Choice>> = BTreeMap::new();
    for choice in choices.made() {
        made.entry(&choice.name).or_default().push(choice);
    }
    for (name, values) in &case.choices {
        let fault = match made.get(name) {
            Some(made) => misplaced(campaign, name, values, made)
                .or_else(|| ambiguous(campaign, name, values, made)),
            None if is_of_run(name, drawn.as_ref().ok()) || is_of_left_out(name, case) => None,
            None => Some(unknown(
                campaign,
                name,
                drawn.as_ref().ok(),
                made.keys().copied(),
            )),
        };
        fault.into_iter().for_each(|fault| found.push(fault));
    }
    if let (Err(discard), false) = (drawn, found.has_errors()) {
        let message = format!("the scene of this case can't be built: {discard}");
        found.push(
            campaign
                .fault("S060", "case", message)
                .help("move the objects in the way, or remove them"),
        );
    }
    found
}

/// Returns the fault of a choice whose value differs from the written one, or whose values are too
/// many or too few.
fn misplaced(
    campaign: &Campaign,
    name: &ChoiceName,
    written: &[ChoiceValue],
    made: &[&Choice],
) -> Option<Diagnostic> {
    let place = Case::place_of(name);
    if let Some((written, made)) = written
        .iter()
        .zip(made)
        .find(|(written, made)| !is_as_written(written, made))
    {
        let (is, bounds) = shown(campaign, written, made)?;
        let message = format!("`{name}` is {is}, which is out of bounds here");
        return Some(
            campaign
                .fault("S062", &place, message)
                .help(format!("allowed: {bounds}")),
        );
    }
    if written.len() > made.len() {
        let message = format!(
            "`{name}` has {} values, but the scene needs {}",
            written.len(),
            made.len()
        );
        return Some(
            campaign
                .fault("S061", &place, message)
                .help("remove the extra values"),
        );
    }
    let ChoiceName::Object(object, ObjectAxis::X) = name else {
        return None;
    };
    (made.len() > written.len()).then(|| {
        campaign
            .fault(
                "S063",
                &place,
                format!("`{object}` can't be placed there: another object is in the way"),
            )
            .help("move one of the two, or remove one")
    })
}

fn is_as_written(written: &ChoiceValue, made: &Choice) -> bool {
    match written {
        ChoiceValue::Number(value) => value.to_bits() == made.value.to_bits(),
        ChoiceValue::Candidate(name) => made.candidate() == Some(name.as_str()),
    }
}

/// Formats a written value and the allowed ones; `None` for noise, which is clamped only to its
/// farthest values.
fn shown(campaign: &Campaign, written: &ChoiceValue, made: &Choice) -> Option<(String, String)> {
    let value = match written {
        ChoiceValue::Number(value) => *value,
        ChoiceValue::Candidate(name) => {
            let ChoiceKind::Candidate { names } = &made.kind else {
                return None;
            };
            return Some((format!("`{name}`"), names.join(", ")));
        }
    };
    Some(match &made.kind {
        ChoiceKind::Index { .. }
            if let Some((least, most)) = campaign.other_counts.of_choice(&made.name) =>
        {
            (
                format!("{}", value + f64::from(least)),
                format!("{least} to {most}"),
            )
        }
        ChoiceKind::Index { of } => (
            format!("{value}"),
            format!("whole numbers from 0 to {}", of - 1),
        ),
        ChoiceKind::Candidate { names } => (format!("{value}"), names.join(", ")),
        ChoiceKind::Real { low, high, .. } => (format!("{value}"), format!("{low} to {high}")),
        ChoiceKind::Normal { .. } => return None,
    })
}

/// Returns a warning if a candidate is written as its index, as in old cases, and there are
/// several.
fn ambiguous(
    campaign: &Campaign,
    name: &ChoiceName,
    written: &[ChoiceValue],
    made: &[&Choice],
) -> Option<Diagnostic> {
    let by_index = |(written, made): &(&ChoiceValue, &&Choice)| {
        let several = matches!(&made.kind, ChoiceKind::Candidate { names } if names.len() > 1);
        several && matches!(written, ChoiceValue::Number(_))
    };
    let (_, made) = written.iter().zip(made).find(by_index)?;
    let candidate = made.candidate()?;
    let message = format!(
        "`{name}` is an index, so that it means another candidate if candidates are added before it"
    );
    let help = format!("now it means `{candidate}`: write `{name} = \"{candidate}\"`");
    Some(
        campaign
            .warning("S066", &Case::place_of(name), message)
            .help(help),
    )
}

/// Whether a choice is made only during the run of this scene.
fn is_of_run(name: &ChoiceName, scene: Option<&Scene>) -> bool {
    match name {
        ChoiceName::Sighting { id, .. } => {
            scene.is_none_or(|scene| scene.objects.iter().any(|object| object.id == *id))
        }
        ChoiceName::Designator(_) => false,
        _ => name.is_of_run(),
    }
}

/// Whether a choice belongs to an object that the case leaves out.
fn is_of_left_out(name: &ChoiceName, case: &Case) -> bool {
    let left_out = |object| {
        case.choices
            .get(&ChoiceName::Object(object, ObjectAxis::LeftOut))
    };
    let values = name.numbered_object().and_then(left_out);
    values.is_some_and(|values| {
        values
            .first()
            .is_some_and(|value| *value != ChoiceValue::Number(0.0))
    })
}

fn unknown<'a>(
    campaign: &Campaign,
    name: &ChoiceName,
    scene: Option<&'a Scene>,
    made: impl Iterator<Item = &'a ChoiceName>,
) -> Diagnostic {
    let objects = scene.map_or(&[][..], |scene| &scene.objects);
    let of_objects = objects
        .iter()
        .flat_map(|object| SightingAxis::ALL.map(|axis| ChoiceName::sighting(&object.id, axis)));
    let known = made.cloned().chain(ChoiceName::of_runs()).chain(of_objects);
    let known: Vec<String> = known.map(String::from).collect();
    campaign
        .fault(
            "S061",
            &Case::place_of(name),
            format!("the scene of this case has no choice `{name}`"),
        )
        // There are too many choices to list.
        .help(
            match nearest(&name.to_string(), known.iter().map(String::as_str)) {
                Some(found) => format!("did you mean `{found}`?"),
                None => "remove it; `actcheck export` writes a case with every choice of its scene"
                    .to_owned(),
            },
        )
}
