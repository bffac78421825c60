//! The six outcomes and what stands behind each.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Outcome of one property in one action execution. Never folded into two.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Outcome {
    /// It holds.
    Passed,
    /// It does not hold, and that is the robot's doing.
    Failed,
    /// It says nothing about this action.
    Inapplicable,
    /// Simulation, transport or the tool was at fault.
    Broken,
    /// A budget was spent.
    Timeout,
    /// The action was never reached.
    Untested,
}

impl Outcome {
    /// All six, in the order in which reports count them.
    pub const ALL: [Self; 6] =
        [Self::Passed, Self::Failed, Self::Inapplicable, Self::Broken, Self::Timeout, Self::Untested];

    /// The word for it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Passed => "passed",
            Self::Failed => "failed",
            Self::Inapplicable => "inapplicable",
            Self::Broken => "broken",
            Self::Timeout => "timeout",
            Self::Untested => "untested",
        }
    }

    /// The outcome of a word.
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|outcome| outcome.word() == word)
    }

    /// Local name of EARL's outcome value.
    pub fn earl(self) -> &'static str {
        match self {
            Self::Passed => "passed",
            Self::Failed => "failed",
            Self::Inapplicable => "inapplicable",
            Self::Broken | Self::Timeout => "cantTell",
            Self::Untested => "untested",
        }
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.word())
    }
}

/// Outcome of one property with what proves it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Judgement {
    /// IRI of the property.
    pub property: String,
    /// The outcome.
    pub outcome: Outcome,
    /// How far from flipping, in the property's unit; positive: passed.
    pub margin: Option<f64>,
    /// In words: the rule author's, or made from the witness tuples, or the reason of a fault.
    pub witness: String,
    /// Digest of the rule file that decided (empty where none did).
    pub rule_digest: String,
    /// Whether what passed had held before the action already: then it shows nothing about the action.
    ///
    /// Nothing where that was not looked at: where it did not pass, and for what states that something must not happen,
    /// which has not happened before an action.
    #[serde(default)]
    pub held_before: Option<bool>,
}

impl Judgement {
    /// Whether another says the same in every part. (A margin that is no number is the same as another such.)
    pub fn says_the_same(&self, other: &Self) -> bool {
        let margin =
            |of: &Self| of.margin.map(|value| if value.is_nan() { f64::NAN.to_bits() } else { value.to_bits() });
        let texts = |of: &Self| [of.property.clone(), of.witness.clone(), of.rule_digest.clone()];
        (self.outcome, self.held_before) == (other.outcome, other.held_before)
            && margin(self) == margin(other)
            && texts(self) == texts(other)
    }
}
