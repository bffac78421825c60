//! Edits lists of named choices.

use actcheck_data::{Choice, ChoiceKind, ChoiceName};

/// Identifies a choice of a list: names may repeat.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Id {
    /// Name of the choice.
    pub name: ChoiceName,
    /// Number of choices of this name before it.
    pub nth: usize,
}

/// The choices of a list with their ids, in order.
pub fn ids(list: &[Choice]) -> Vec<(Id, &Choice)> {
    list.iter()
        .enumerate()
        .map(|(at, choice)| {
            let nth = list[..at]
                .iter()
                .filter(|before| before.name == choice.name)
                .count();
            (
                Id {
                    name: choice.name.clone(),
                    nth,
                },
                choice,
            )
        })
        .collect()
}

/// Whether a choice has its nominal value.
pub(super) fn is_nominal(choice: &Choice) -> bool {
    choice.value == choice.kind.nominal()
}

/// Returns the choice with an id. Returns `None` if the list has no such choice.
pub(super) fn find<'a>(list: &'a [Choice], id: &Id) -> Option<&'a Choice> {
    list.iter()
        .filter(|choice| choice.name == id.name)
        .nth(id.nth)
}

/// Returns the list with another value for one choice.
pub(super) fn with_value(mut list: Vec<Choice>, id: &Id, value: f64) -> Vec<Choice> {
    if let Some(choice) = list
        .iter_mut()
        .filter(|choice| choice.name == id.name)
        .nth(id.nth)
    {
        choice.value = value;
    }
    list
}

/// Returns the list with some choices at their nominal values.
pub(super) fn with_nominal(mut list: Vec<Choice>, ids: &[Id]) -> Vec<Choice> {
    for id in ids {
        if let Some(choice) = list
            .iter_mut()
            .filter(|choice| choice.name == id.name)
            .nth(id.nth)
        {
            choice.value = choice.kind.nominal();
        }
    }
    list
}

/// Returns the list with a choice replaced or added.
pub(super) fn with_choice(mut list: Vec<Choice>, set: &Choice) -> Vec<Choice> {
    match list.iter_mut().find(|choice| choice.name == set.name) {
        Some(choice) => *choice = set.clone(),
        None => list.push(set.clone()),
    }
    list
}

/// Whether the list has a choice with this name and value.
pub(super) fn has(list: &[Choice], set: &Choice) -> bool {
    list.iter()
        .any(|choice| choice.name == set.name && choice.value == set.value)
}

/// The spread of a kind's values, in the unit of the choice: the width of its range, or eight
/// standard deviations.
pub(super) fn spread(kind: &ChoiceKind) -> f64 {
    match kind {
        ChoiceKind::Index { of } => *of as f64,
        ChoiceKind::Candidate { names } => names.len() as f64,
        ChoiceKind::Real { low, high, .. } => high - low,
        ChoiceKind::Normal { sigma } => 8.0 * sigma,
    }
}

/// Drops the rejected tries of placements: only the last one, which was accepted, stays.
pub(crate) fn drop_rejected_tries(list: &[Choice]) -> Vec<Choice> {
    // Sensor noise is drawn repeatedly, and every draw counts.
    let kept = list.iter().enumerate().filter(|(at, choice)| {
        choice.name.is_noise() || !list[at + 1..].iter().any(|later| later.name == choice.name)
    });
    kept.map(|(_, choice)| choice.clone()).collect()
}
