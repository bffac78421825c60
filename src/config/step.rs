//! One action of a test.

use std::collections::BTreeMap;
use std::fmt;

/// An action of a test, and the values that the test gives to its designators.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Step {
    /// Name of the action.
    pub action: String,
    /// Values by designator: the role, model or id of an object, or the name of a place. They hold
    /// for this action and for later ones, until one of these gives another value. Designators
    /// without a value have that of the scene.
    pub values: BTreeMap<String, String>,
}

impl Step {
    /// An action with the values of the scene.
    pub fn plain(action: impl Into<String>) -> Self {
        Self {
            action: action.into(),
            values: BTreeMap::new(),
        }
    }

    /// Returns the name of a test, by which its runs are found again: its actions, joined by a
    /// space.
    pub fn test_name(test: &[Self]) -> String {
        test.iter()
            .map(ToString::to_string)
            .collect::<Vec<_>>()
            .join(" ")
    }
}

/// `Pick`, or `Pick(pickObject=other)`.
impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.action)?;
        if self.values.is_empty() {
            return Ok(());
        }
        let values: Vec<String> = self
            .values
            .iter()
            .map(|(name, value)| format!("{name}={value}"))
            .collect();
        write!(f, "({})", values.join(","))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_actions_are_written_as_their_names() {
        let values = [("placeSurface", "shelf"), ("pickObject", "other")]
            .map(|(a, b)| (a.to_owned(), b.to_owned()));
        let test = [
            Step::plain("Pick"),
            Step {
                action: "Place".to_owned(),
                values: values.into(),
            },
        ];
        assert_eq!(
            Step::test_name(&test),
            "Pick Place(pickObject=other,placeSurface=shelf)"
        );
    }
}
