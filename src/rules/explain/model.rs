//! Data model of an explanation.

use actcheck_base::{DecidingSignal, Findings, Span};

/// Explains why a property or goal holds or does not hold: a tree, which [`Explanation::to_text`]
/// formats.
///
/// ```
/// use actcheck_rules::explain::{Failure, Premise, Support};
/// use actcheck_rules::{Facts, Rules};
///
/// let rules = Rules::parse(
///     "@prefix ex: <http://example.org/> .
///      % A full cup was lifted.
///      success(?cup) :- after(?cup, ex:lifted, true), after(?cup, ex:fill, ?f), ?f > 0.9 .",
/// )?;
/// let prefix = "@prefix ex: <http://example.org/> .";
///
/// let full = Facts::from_turtle(&format!("{prefix} ex:cup ex:lifted true ; ex:fill 1 ."))?;
/// let why = rules.why(&full)?;
/// let Support::Rule { rule, premises } = &why.proofs[0].support else { panic!("a rule derives it") };
/// assert_eq!(rule.comment.as_deref(), Some("A full cup was lifted."));
/// assert!(matches!(&premises[2], Premise::Computed(text) if text == "?f > 0.9, with 1 > 0.9"));
///
/// let half = Facts::from_turtle(&format!("{prefix} ex:cup ex:lifted true ; ex:fill 0.5 ."))?;
/// let miss = rules.why(&half)?.miss.expect("the rule came close");
/// assert_eq!((miss.satisfied.len(), miss.failed.as_str()), (2, "?f > 0.9, with 0.5 > 0.9"));
/// assert!(matches!(miss.failure, Failure::Comparison { distance: Some(distance) } if (distance - 0.4).abs() < 1e-9));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Explanation {
    /// The property's label, or the goal as written.
    pub title: String,
    /// The property's findings; `None` if a goal is explained.
    pub findings: Option<Findings>,
    /// Proofs of the first few deciding tuples.
    pub proofs: Vec<Proof>,
    /// The closest attempt, if there are no deciding tuples.
    pub miss: Option<Miss>,
    /// Constants of the goal that occur neither in the rules nor in any tuple.
    pub unknown: Vec<UnknownTerm>,
    /// Remarks, for example that a query has no proof.
    pub notes: Vec<String>,
    /// The signals that decided formulas over the course of the action.
    pub deciding: Vec<DecidingSignal>,
}

impl Explanation {
    /// Returns whether the property holds, or whether the goal is derived.
    pub fn holds(&self) -> bool {
        self.findings
            .as_ref()
            .map_or(!self.proofs.is_empty(), |findings| findings.holds)
    }
}

/// A constant of a goal that occurs neither in the rules nor in any tuple.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct UnknownTerm {
    /// The constant as written.
    pub text: String,
    /// Its place in the text of the goal.
    pub span: Span,
    /// A known term with a similar name.
    pub similar: Option<String>,
}

/// A statement with its support.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Proof {
    /// The statement, for example `after(obj:glass_1, w:x, 0.9)`.
    pub statement: String,
    /// Its support.
    pub support: Support,
}

/// The support of a statement.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Support {
    /// It is a given fact.
    Fact,
    /// It is derived by an instance of a rule.
    Rule {
        /// The rule.
        rule: RuleRef,
        /// Its conditions under the binding, in textual order.
        premises: Vec<Premise>,
    },
    /// It is derived by aggregating matches of a rule's body.
    Aggregate {
        /// The rule.
        rule: RuleRef,
        /// Number of matches.
        matches: usize,
        /// The conditions of the first few matches, one match after another.
        premises: Vec<Premise>,
    },
    /// It is proved elsewhere in this explanation.
    Cut,
    /// It is derived, but its proof is too long to find or to show.
    Omitted,
}

/// One satisfied condition of a rule.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Premise {
    /// A statement with its own proof.
    Proof(Proof),
    /// No tuple matches this pattern.
    Absent(String),
    /// A comparison, assignment or test, with its values.
    Computed(String),
}

/// A reference to a rule.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct RuleRef {
    /// `#[name("…")]`.
    pub name: Option<String>,
    /// The comment above it.
    pub comment: Option<String>,
    /// `file:line`.
    pub place: String,
    /// The rule's text.
    pub text: String,
}

/// The closest attempt to derive a goal that does not hold.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Miss {
    /// The goal, with `_` for unbound arguments.
    pub goal: String,
    /// The closest rule, or `None` if no rule has a matching head.
    pub rule: Option<RuleRef>,
    /// The conditions that were satisfied together, with their values.
    pub satisfied: Vec<String>,
    /// The first condition that failed, with its values.
    pub failed: String,
    /// The reason why it failed.
    pub failure: Failure,
}

/// Why a condition could not be satisfied.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Failure {
    /// No fact or derived tuple matches.
    NoMatch {
        /// Tuples that agree in the most arguments.
        nearest: Vec<String>,
        /// The closest attempt of the rules that derive it, if any.
        because: Option<Box<Miss>>,
    },
    /// A comparison does not hold.
    Comparison {
        /// Absolute difference of the two sides, if they are numbers.
        distance: Option<f64>,
    },
    /// The negated atom holds.
    Blocked(Box<Proof>),
    /// A computation has no value for these arguments.
    NoValue,
}
