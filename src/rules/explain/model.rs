//! What an explanation says.

use crate::rules::findings::Findings;

/// Why a property holds or does not.
#[derive(Debug, Clone, PartialEq)]
pub struct Explanation {
    /// The property's label, or the goal as written.
    pub title: String,
    /// What was found.
    pub findings: Option<Findings>,
    /// Proofs of the tuples that decide, the first few.
    pub proofs: Vec<Proof>,
    /// Where nothing decides: how near the rules came.
    pub miss: Option<Miss>,
    /// Remarks, such as that a query has no proof.
    pub notes: Vec<String>,
}

/// A statement and what supports it.
#[derive(Debug, Clone, PartialEq)]
pub struct Proof {
    /// Such as `after(obj:glass_1, w:x, 0.9)`.
    pub statement: String,
    /// What supports it.
    pub support: Support,
}

/// What supports a statement.
#[derive(Debug, Clone, PartialEq)]
pub enum Support {
    /// It was given.
    Fact,
    /// An instance of a rule.
    Rule {
        /// The rule.
        rule: RuleRef,
        /// Its conditions under the binding, in the order of the text.
        premises: Vec<Premise>,
    },
    /// An aggregate over matches of a rule's body.
    Aggregate {
        /// The rule.
        rule: RuleRef,
        /// How many matches there are.
        matches: usize,
        /// The conditions of the first few matches, one behind the other.
        premises: Vec<Premise>,
    },
    /// It is proved elsewhere in this explanation, or the proof was cut for its length.
    Cut,
}

/// One condition of a rule that holds.
#[derive(Debug, Clone, PartialEq)]
pub enum Premise {
    /// A statement with its own proof.
    Proof(Proof),
    /// Nothing of this form holds.
    Absent(String),
    /// A comparison, assignment or test with its values.
    Computed(String),
}

/// A rule, for people to find.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RuleRef {
    /// `#[name("…")]`.
    pub name: Option<String>,
    /// The comment above it.
    pub comment: Option<String>,
    /// `file:line`.
    pub place: String,
    /// Its text.
    pub text: String,
}

/// How near the rules came to a goal that does not hold.
#[derive(Debug, Clone, PartialEq)]
pub struct Miss {
    /// The goal, with `_` for what was left open.
    pub goal: String,
    /// The rule that came closest; nothing where no rule derives the goal.
    pub rule: Option<RuleRef>,
    /// The conditions that could be satisfied together, with their values.
    pub satisfied: Vec<String>,
    /// The first condition that could not, with its values.
    pub failed: String,
    /// Why.
    pub failure: Failure,
}

/// Why a condition could not be satisfied.
#[derive(Debug, Clone, PartialEq)]
pub enum Failure {
    /// No fact and no rule gives it.
    NoMatch {
        /// Facts that differ in the fewest places.
        nearest: Vec<String>,
        /// Where rules derive it: how near they came.
        because: Option<Box<Miss>>,
    },
    /// A comparison does not hold.
    Comparison {
        /// By how much the best values miss it, where they are numbers.
        distance: Option<f64>,
    },
    /// What is negated holds.
    Blocked(Box<Proof>),
    /// A computation has no value for these arguments.
    NoValue,
}
