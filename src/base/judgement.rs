//! The six outcomes, and judgements: outcomes with their evidence.

use std::fmt;

/// Outcome of one property in one action execution. The six outcomes are never reduced to pass and
/// fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "lowercase"))]
pub enum Outcome {
    /// The property holds.
    Passed,
    /// The property does not hold, and the robot is the cause.
    Failed,
    /// The property does not apply to this action.
    Inapplicable,
    /// The simulation, the transport or the tool failed.
    Broken,
    /// A budget was exhausted.
    Timeout,
    /// The action was never reached.
    Untested,
}

impl Outcome {
    /// All six outcomes, in the order of reports.
    pub const ALL: [Self; 6] = [
        Self::Passed,
        Self::Failed,
        Self::Inapplicable,
        Self::Broken,
        Self::Timeout,
        Self::Untested,
    ];

    /// Returns the outcome's name.
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

    /// Returns the outcome of a name, or `None` if the name is unknown.
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|outcome| outcome.word() == word)
    }

    /// Returns the local name of the corresponding EARL outcome value.
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

/// Outcome of one property with its evidence.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Judgement {
    /// IRI of the property.
    pub property: String,
    /// The outcome.
    pub outcome: Outcome,
    /// Distance from flipping, in the property's unit; positive if passed.
    pub margin: Option<f64>,
    /// Explanation: the rule author's text, or the witness tuples as text, or the reason of a
    /// fault.
    pub witness: String,
    /// Digest of the rule file that decided. Empty if none did.
    pub rule_digest: String,
    /// Whether a passed property had already held before the action. If so, it is no evidence about
    /// the action.
    ///
    /// `None` if this was not checked: if the property did not pass, or if it states that something
    /// must not happen, which is always the case before an action.
    pub held_before: Option<bool>,
    /// Whether a passed property would also have passed if the right side of each of its `implies`
    /// were false: no left side held. If so, the pass is no evidence about the right side.
    ///
    /// `None` if the property did not pass or has no such `implies`.
    pub vacuous: Option<bool>,
}

impl Judgement {
    /// Whether two judgements are equal in every field. Unlike `==`, two NaN margins are equal.
    pub fn same_as(&self, other: &Self) -> bool {
        let margin = |of: &Self| {
            of.margin.map(|value| {
                if value.is_nan() {
                    f64::NAN.to_bits()
                } else {
                    value.to_bits()
                }
            })
        };
        let texts = |of: &Self| {
            [
                of.property.clone(),
                of.witness.clone(),
                of.rule_digest.clone(),
            ]
        };
        (self.outcome, self.held_before, self.vacuous)
            == (other.outcome, other.held_before, other.vacuous)
            && margin(self) == margin(other)
            && texts(self) == texts(other)
    }
}
