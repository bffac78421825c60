//! What can be asked for.

use std::collections::BTreeMap;

use crate::base::{Diagnostic, did_you_mean};

/// One action with the values of its designators.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ActionCall {
    /// Name of the action, as the test lists it.
    pub action: String,
    /// Values by designator: ids of objects of the scene, or names of places.
    pub parameters: BTreeMap<String, Vec<String>>,
}

impl ActionCall {
    /// The first value of a designator.
    pub fn value(&self, designator: &str) -> Option<&str> {
        self.parameters.get(designator)?.first().map(String::as_str)
    }
}

/// An action that no reference skill performs.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("no reference skill performs the action `{action}`")]
pub struct UnknownSkill {
    /// The action's name.
    pub action: String,
}

impl UnknownSkill {
    /// The same as a fault that a user can mend.
    pub fn diagnostic(&self) -> Diagnostic {
        let help = did_you_mean(&self.action, reference_skills().iter().copied());
        Diagnostic::error("W030", self.to_string()).help(help)
    }
}

/// Names of the actions that the reference skills perform, sorted.
pub fn reference_skills() -> &'static [&'static str] {
    &["Pick"]
}

/// Whether a reference skill performs the action.
///
/// # Errors
/// [`UnknownSkill`] if none does.
pub fn known_skill(action: &str) -> Result<(), UnknownSkill> {
    if reference_skills().contains(&action) { Ok(()) } else { Err(UnknownSkill { action: action.to_owned() }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mistyped_action_is_refused_with_help() {
        assert!(known_skill("Pick").is_ok());
        let refused = known_skill("Pikc").expect_err("there is no such skill");
        assert_eq!(refused.diagnostic().help.as_deref(), Some("did you mean `Pick`?"));
    }
}
