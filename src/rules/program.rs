//! Checked rules: predicates and variables are numbers, every variable is bound, every name is known.

use std::collections::{BTreeMap, HashMap};

use crate::base::{Source, Span, TermId};
use crate::rules::expression::Expr;
use crate::rules::syntax::Comparison;

/// Number of a predicate in [`Predicates`].
pub(crate) type PredicateId = usize;
/// Number of a variable within its rule.
pub(crate) type Variable = usize;

/// Where a predicate's name is known: 0 everywhere, otherwise only in one property's file.
pub(crate) type Scope = usize;

/// Most columns of a predicate.
pub(crate) const MAX_ARITY: usize = 16;

/// A predicate, or the part of `state` or `ontology` that belongs to one property.
#[derive(Debug, Clone)]
pub(crate) struct Predicate {
    /// As people write it.
    pub(crate) name: String,
    /// Where it is known.
    pub(crate) scope: Scope,
    /// The constant in the property's place, which counts as part of the predicate.
    pub(crate) property: Option<TermId>,
    /// Number of arguments as written.
    pub(crate) arity: usize,
    /// Columns kept: without a constant property; at least one.
    pub(crate) width: usize,
    /// Whether facts come in from outside.
    pub(crate) given: bool,
}

/// All predicates of a book or program.
#[derive(Debug, Clone, Default)]
pub(crate) struct Predicates {
    pub(crate) list: Vec<Predicate>,
    by_key: HashMap<(Scope, String, Option<TermId>), PredicateId>,
}

impl Predicates {
    pub(crate) fn find(&self, scope: Scope, name: &str, property: Option<TermId>) -> Option<PredicateId> {
        self.by_key.get(&(scope, name.to_owned(), property)).copied()
    }

    pub(crate) fn add(&mut self, predicate: Predicate) -> PredicateId {
        let key = (predicate.scope, predicate.name.clone(), predicate.property);
        if let Some(id) = self.by_key.get(&key) {
            return *id;
        }
        self.list.push(predicate);
        self.by_key.insert(key, self.list.len() - 1);
        self.list.len() - 1
    }

    pub(crate) fn get(&self, id: PredicateId) -> &Predicate {
        &self.list[id]
    }

    pub(crate) fn len(&self) -> usize {
        self.list.len()
    }
}

/// An argument of an atom.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Operand {
    /// A constant.
    Constant(TermId),
    /// A variable of the rule.
    Variable(Variable),
    /// Anything.
    Any,
}

/// A predicate with its arguments, one for each column.
#[derive(Debug, Clone)]
pub(crate) struct Atom {
    pub(crate) predicate: PredicateId,
    pub(crate) args: Vec<Operand>,
    pub(crate) span: Span,
}

/// One condition.
#[derive(Debug, Clone)]
pub(crate) enum Literal {
    /// Some tuple matches.
    Positive(Atom),
    /// No tuple matches.
    Negative(Atom),
    /// A variable gets a value.
    Assign { variable: Variable, value: Expr, span: Span },
    /// Two values compare so.
    Compare { op: Comparison, left: Expr, right: Expr, span: Span },
    /// A built-in yields true.
    Test { value: Expr, span: Span },
}

impl Literal {
    /// The atom of a positive or negative literal.
    pub(crate) fn atom(&self) -> Option<&Atom> {
        match self {
            Self::Positive(atom) | Self::Negative(atom) => Some(atom),
            _ => None,
        }
    }

    /// Where it stands.
    pub(crate) fn span(&self) -> &Span {
        match self {
            Self::Positive(atom) | Self::Negative(atom) => &atom.span,
            Self::Assign { span, .. } | Self::Compare { span, .. } | Self::Test { span, .. } => span,
        }
    }

    /// Variables that must have a value before this literal is looked at.
    pub(crate) fn needs(&self) -> Vec<Variable> {
        let mut found = Vec::new();
        match self {
            Self::Positive(_) => {}
            Self::Negative(atom) => found.extend(atom.args.iter().filter_map(|arg| match arg {
                Operand::Variable(v) => Some(*v),
                _ => None,
            })),
            Self::Assign { value, .. } | Self::Test { value, .. } => value.variables(&mut found),
            Self::Compare { left, right, .. } => {
                left.variables(&mut found);
                right.variables(&mut found);
            }
        }
        found
    }
}

/// What an aggregate computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum AggregateKind {
    Count,
    Sum,
    Min,
    Max,
}

/// One aggregate of a head: over the distinct values of its input and distinct variables in a group.
#[derive(Debug, Clone)]
pub(crate) struct Aggregate {
    pub(crate) kind: AggregateKind,
    pub(crate) input: Variable,
    pub(crate) distinct: Vec<Variable>,
    pub(crate) output: Variable,
}

/// How the matches of a body become groups and groups become heads.
#[derive(Debug, Clone)]
pub(crate) struct Aggregation {
    /// Matches that agree on these are one group.
    pub(crate) group: Vec<Variable>,
    pub(crate) aggregates: Vec<Aggregate>,
    /// Computed from the group's variables and the aggregates' outputs, in order.
    pub(crate) after: Vec<(Variable, Expr)>,
}

/// Where a rule stands.
#[derive(Debug, Clone)]
pub(crate) struct Origin {
    pub(crate) source: Source,
    pub(crate) span: Span,
    /// `#[name("…")]`.
    pub(crate) name: Option<String>,
    /// The comment right above it.
    pub(crate) comment: Option<String>,
}

impl Origin {
    /// `file:line`.
    pub(crate) fn place(&self) -> String {
        format!("{}:{}", self.source.name, self.source.line_and_column(self.span.start).0)
    }
}

/// A rule with one head.
#[derive(Debug, Clone)]
pub(crate) struct Rule {
    pub(crate) head: Atom,
    pub(crate) body: Vec<Literal>,
    pub(crate) aggregation: Option<Aggregation>,
    /// Names of the variables; made ones are empty.
    pub(crate) variables: Vec<String>,
    /// Names of the head's arguments as written: a variable's name, or nothing.
    pub(crate) head_names: Vec<String>,
    pub(crate) origin: Origin,
}

/// The checked rules and facts of one file, or of several that belong together.
#[derive(Debug, Clone, Default)]
pub(crate) struct Program {
    pub(crate) rules: Vec<Rule>,
    /// Facts that stand in the text or were read from files: rows one behind the other.
    pub(crate) facts: BTreeMap<PredicateId, Vec<TermId>>,
}
