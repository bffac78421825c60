//! The actions that the reference skills perform.

use crate::ActionCall;
use crate::navigate::move_to;
use crate::operator::{Interrupt, Operator};
use crate::perceive::perceive_plane;
use crate::pick::pick;
use crate::place::place;
use actcheck_base::{Diagnostic, did_you_mean};
use actcheck_data::ActionReport;

/// Performs an action through commands and observations and returns the action's own report.
pub(super) type Skill = fn(&ActionCall, &mut Operator<'_>) -> Result<ActionReport, Interrupt>;

/// The skills by action name, sorted.
const SKILLS: [(&str, Skill); 4] = [
    ("MoveTo", move_to),
    ("PerceivePlane", perceive_plane),
    ("Pick", pick),
    ("Place", place),
];

/// An action that no reference skill performs.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("no reference skill performs the action `{action}`")]
pub struct UnknownSkill {
    /// The action's name.
    pub action: String,
}

impl UnknownSkill {
    /// This error as a diagnostic with a suggestion for the user.
    pub fn diagnostic(&self) -> Diagnostic {
        let help = did_you_mean(&self.action, reference_skills());
        Diagnostic::error("S010", self.to_string()).help(help)
    }
}

/// Names of the actions that the reference skills perform, sorted.
pub fn reference_skills() -> impl Iterator<Item = &'static str> + Clone {
    SKILLS.iter().map(|(action, _)| *action)
}

/// Whether a reference skill performs the action.
///
/// # Errors
/// [`UnknownSkill`] if none does.
pub fn known_skill(action: &str) -> Result<(), UnknownSkill> {
    skill(action).map(|_| ())
}

/// The reference skill that performs the action.
pub(super) fn skill(action: &str) -> Result<Skill, UnknownSkill> {
    let found = SKILLS.iter().find(|(known, _)| *known == action);
    found.map(|(_, skill)| *skill).ok_or_else(|| UnknownSkill {
        action: action.to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mistyped_action_is_refused_with_help() {
        assert!(reference_skills().all(|action| known_skill(action).is_ok()));
        let refused = known_skill("Pikc").expect_err("no such skill");
        assert_eq!(
            refused.diagnostic().help.as_deref(),
            Some("did you mean `Pick`?")
        );
    }
}
