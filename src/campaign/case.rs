//! Checks that the scene of a case, a configuration with one fixed scene, can be built as written.

use std::collections::BTreeMap;

use actcheck_base::{Diagnostic, Diagnostics, nearest};
use actcheck_config::{Campaign, Case};
use actcheck_data::{Choice, ChoiceKind, Choices, Scene};
use actcheck_scenario as scenario;
use actcheck_scenario::Space;

/// Names of the choices that are made only during a run: sensor noise, and the seeds of planner and skill. The choices
/// of single objects are in `SENSES_OF_OBJECT`.
const SENSES: [&str; 14] = [
    "sense.localisation.x",
    "sense.localisation.y",
    "sense.localisation.heading",
    "sense.gripper",
    "sense.camera.frame",
    "sense.odometry.along",
    "sense.odometry.across",
    "sense.odometry.turning",
    "sense.odometry.veering",
    "sense.odometry.landmark.x",
    "sense.odometry.landmark.y",
    "sense.odometry.landmark.heading",
    "motion.samples",
    "skill.seed",
];
/// Sensor noise of one object.
const SENSES_OF_OBJECT: [&str; 7] = ["x", "y", "z", "yaw", "width", "depth", "height"];

/// Finds the choices of a case that can't have their written values: S061 the scene has no such choice, S062 the value
/// is out of bounds, S063 another object is in the way, S060 the scene can't be built at all.
pub(super) fn check_case(campaign: &Campaign, space: &Space) -> Diagnostics {
    let mut found = Diagnostics::new();
    let Some(case) = &campaign.case else { return found };
    let mut choices = Choices::named(&case.choices);
    let drawn = scenario::draw(space, 0, &mut choices);
    let mut made: BTreeMap<&str, Vec<&Choice>> = BTreeMap::new();
    for choice in choices.made() {
        made.entry(&choice.name).or_default().push(choice);
    }
    for (name, values) in &case.choices {
        let fault = match made.get(name.as_str()) {
            Some(made) => misplaced(campaign, name, values, made),
            None if is_of_senses(name, drawn.as_ref().ok()) || is_of_left_out(name, case) => None,
            None => Some(unknown(campaign, name, drawn.as_ref().ok(), made.keys().copied())),
        };
        fault.into_iter().for_each(|fault| found.push(fault));
    }
    if let (Err(discard), false) = (drawn, found.has_errors()) {
        let message = format!("the scene of this case can't be built: {discard}");
        found.push(campaign.fault("S060", "case", message).help("move the objects in the way, or remove them"));
    }
    found
}

/// Returns the fault of a choice whose value differs from the written one, or whose values are too many or too few.
fn misplaced(campaign: &Campaign, name: &str, written: &[f64], made: &[&Choice]) -> Option<Diagnostic> {
    let place = Case::place_of(name);
    let moved = written.iter().zip(made).find(|(written, made)| written.to_bits() != made.value.to_bits());
    if let Some((written, made)) = moved {
        let (is, bounds) = match made.kind {
            ChoiceKind::Index { .. } if let Some((least, most)) = campaign.other_counts.of_choice(name) => {
                (format!("{}", written + f64::from(least)), format!("{least} to {most}"))
            }
            ChoiceKind::Index { of } => (format!("{written}"), format!("whole numbers from 0 to {}", of - 1)),
            ChoiceKind::Real { low, high, .. } => (format!("{written}"), format!("{low} to {high}")),
            ChoiceKind::Normal { .. } => return None,
        };
        let message = format!("`{name}` is {is}, which is out of bounds here");
        return Some(campaign.fault("S062", &place, message).help(format!("allowed: {bounds}")));
    }
    if written.len() > made.len() {
        let message = format!("`{name}` has {} values, but the scene needs {}", written.len(), made.len());
        return Some(campaign.fault("S061", &place, message).help("remove the extra values"));
    }
    let thing = name.strip_suffix(".x")?;
    (made.len() > written.len()).then(|| {
        campaign
            .fault("S063", &place, format!("`{thing}` can't be placed there: another object is in the way"))
            .help("move one of the two, or remove one")
    })
}

/// Whether a choice is made only during the run of this scene.
fn is_of_senses(name: &str, scene: Option<&Scene>) -> bool {
    let of_object = |rest: &str| {
        let (id, what) = rest.rsplit_once('.')?;
        let is_there = scene.is_none_or(|scene| scene.objects.iter().any(|object| object.id == id));
        Some(is_there && SENSES_OF_OBJECT.contains(&what))
    };
    SENSES.contains(&name) || name.strip_prefix("sense.").and_then(of_object).unwrap_or(false)
}

/// Whether a choice belongs to an object that the case leaves out.
fn is_of_left_out(name: &str, case: &Case) -> bool {
    let of = name.rsplit_once('.').and_then(|(of, _)| case.choices.get(&format!("{of}.left_out")));
    of.is_some_and(|left_out| left_out.first().is_some_and(|value| *value != 0.0))
}

fn unknown<'a>(
    campaign: &Campaign,
    name: &str,
    scene: Option<&'a Scene>,
    made: impl Iterator<Item = &'a str>,
) -> Diagnostic {
    let objects = scene.map_or(&[][..], |scene| &scene.objects);
    let of_objects =
        objects.iter().flat_map(|object| SENSES_OF_OBJECT.map(|what| format!("sense.{}.{what}", object.id)));
    let known: Vec<String> = made.map(str::to_owned).chain(SENSES.map(str::to_owned)).chain(of_objects).collect();
    campaign
        .fault("S061", &Case::place_of(name), format!("the scene of this case has no choice `{name}`"))
        // There are too many choices to list.
        .help(match nearest(name, known.iter().map(String::as_str)) {
            Some(found) => format!("did you mean `{found}`?"),
            None => "remove it; `actcheck export` writes a case with every choice of its scene".to_owned(),
        })
}
