//! Lists of named choices, and edits of them.

use crate::base::{Choice, ChoiceKind};

/// One choice of a list: names may repeat.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Id {
    /// Name of the choice.
    pub name: String,
    /// How many of this name stand before it.
    pub nth: usize,
}

/// The choices of a list with their ids, in order.
pub fn ids(list: &[Choice]) -> Vec<(Id, &Choice)> {
    list.iter()
        .enumerate()
        .map(|(at, choice)| {
            let nth = list[..at].iter().filter(|before| before.name == choice.name).count();
            (Id { name: choice.name.clone(), nth }, choice)
        })
        .collect()
}

/// Whether nothing is special about it.
pub(super) fn is_nominal(choice: &Choice) -> bool {
    choice.value == choice.kind.nominal()
}

/// The choice of an id.
pub(super) fn find<'a>(list: &'a [Choice], id: &Id) -> Option<&'a Choice> {
    list.iter().filter(|choice| choice.name == id.name).nth(id.nth)
}

/// The list with another value for one choice.
pub(super) fn with_value(mut list: Vec<Choice>, id: &Id, value: f64) -> Vec<Choice> {
    if let Some(choice) = list.iter_mut().filter(|choice| choice.name == id.name).nth(id.nth) {
        choice.value = value;
    }
    list
}

/// The list with some choices at their nominal values.
pub(super) fn with_nominal(mut list: Vec<Choice>, ids: &[Id]) -> Vec<Choice> {
    for id in ids {
        if let Some(choice) = list.iter_mut().filter(|choice| choice.name == id.name).nth(id.nth) {
            choice.value = choice.kind.nominal();
        }
    }
    list
}

/// The list with a choice set, whether it was there or not.
pub(super) fn with_choice(mut list: Vec<Choice>, set: &Choice) -> Vec<Choice> {
    match list.iter_mut().find(|choice| choice.name == set.name) {
        Some(choice) => *choice = set.clone(),
        None => list.push(set.clone()),
    }
    list
}

/// Whether a list says the same of a choice.
pub(super) fn has(list: &[Choice], set: &Choice) -> bool {
    list.iter().any(|choice| choice.name == set.name && choice.value == set.value)
}

/// How far values of a kind lie apart, in the unit of the choice: the width of its range, or eight standard deviations.
pub(super) fn spread(kind: &ChoiceKind) -> f64 {
    match kind {
        ChoiceKind::Index { of } => *of as f64,
        ChoiceKind::Real { low, high, .. } => high - low,
        ChoiceKind::Normal { sigma } => 8.0 * sigma,
    }
}

/// Of a place that was tried several times, only the last try: the one that was accepted.
pub(in crate::campaign) fn accepted_places(list: &[Choice]) -> Vec<Choice> {
    // What sensors get wrong is asked for again and again, and counts each time.
    let placed = |name: &str| !name.starts_with("sense.");
    let kept = list
        .iter()
        .enumerate()
        .filter(|(at, choice)| !placed(&choice.name) || !list[at + 1..].iter().any(|later| later.name == choice.name));
    kept.map(|(_, choice)| choice.clone()).collect()
}

/// Unit of a choice of a scene or of noise, by the end of its name; empty for names, counts and factors.
pub fn unit_of(name: &str) -> &'static str {
    match name.rsplit('.').next().unwrap_or(name) {
        "x" | "y" | "z" | "gap" | "side" | "width" | "depth" | "height" | "gripper" => "m",
        "yaw" | "heading" => "rad",
        _ => "",
    }
}
