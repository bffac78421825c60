//! Checked rules: predicates and variables are indices, every variable is bound, every name is
//! resolved.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use crate::model::expression::{Expr, Variable};
use crate::syntax::Comparison;
use actcheck_base::{Source, Span, TermId};

/// Index of a predicate in [`Predicates`].
pub(crate) type PredicateId = usize;

/// Scope of a predicate's name: 0 is global, any other value is the file of one property.
pub(crate) type Scope = usize;

/// Maximum number of columns of a predicate.
pub(crate) const MAX_ARITY: usize = 16;

/// A predicate, or the part of `state` or `ontology` that belongs to one property.
#[derive(Debug, Clone)]
pub(crate) struct Predicate {
    /// Name as written in the rules.
    pub(crate) name: String,
    /// Where the name is visible.
    pub(crate) scope: Scope,
    /// The constant property argument, which is part of the predicate's identity.
    pub(crate) property: Option<TermId>,
    /// Number of arguments as written.
    pub(crate) arity: usize,
    /// Number of stored columns: without the constant property, and at least one.
    pub(crate) width: usize,
    /// Whether its facts are input, not only derived.
    pub(crate) given: bool,
}

impl Predicate {
    /// Returns the predicate of the text that a helper predicate, such as `p~12`, was added for.
    /// Returns `None` for any other predicate.
    pub(crate) fn helps(&self) -> Option<&str> {
        let (name, number) = self.name.rsplit_once('~')?;
        (!number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit())).then_some(name)
    }
}

/// All predicates of a book or program.
#[derive(Debug, Clone, Default)]
pub(crate) struct Predicates {
    pub(crate) list: Vec<Predicate>,
    by_key: HashMap<(Scope, String, Option<TermId>), PredicateId>,
}

impl Predicates {
    pub(crate) fn find(
        &self,
        scope: Scope,
        name: &str,
        property: Option<TermId>,
    ) -> Option<PredicateId> {
        self.by_key
            .get(&(scope, name.to_owned(), property))
            .copied()
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
    /// Matches any value.
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
    Assign {
        variable: Variable,
        value: Expr,
        span: Span,
    },
    /// The comparison of two values holds.
    Compare {
        op: Comparison,
        left: Expr,
        right: Expr,
        span: Span,
    },
    /// A built-in returns `true`.
    Test { value: Expr, span: Span },
}

impl Literal {
    /// Returns the atom of a positive or negative literal. Returns `None` for other literals.
    pub(crate) fn atom(&self) -> Option<&Atom> {
        match self {
            Self::Positive(atom) | Self::Negative(atom) => Some(atom),
            _ => None,
        }
    }

    /// Returns its place in the source.
    pub(crate) fn span(&self) -> &Span {
        match self {
            Self::Positive(atom) | Self::Negative(atom) => &atom.span,
            Self::Assign { span, .. } | Self::Compare { span, .. } | Self::Test { span, .. } => {
                span
            }
        }
    }

    /// Returns the variables that must be bound before this literal is evaluated.
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

/// The function of an aggregate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum AggregateKind {
    Count,
    Sum,
    Min,
    Max,
}

/// One aggregate of a head, computed over the distinct combinations of `input` and `distinct` in a
/// group.
#[derive(Debug, Clone)]
pub(crate) struct Aggregate {
    pub(crate) kind: AggregateKind,
    pub(crate) input: Variable,
    pub(crate) distinct: Vec<Variable>,
    pub(crate) output: Variable,
}

/// How the matches of a body are grouped, and how each group yields a head.
#[derive(Debug, Clone)]
pub(crate) struct Aggregation {
    /// Matches with equal values of these variables form one group.
    pub(crate) group: Vec<Variable>,
    pub(crate) aggregates: Vec<Aggregate>,
    /// Computed from the group's variables and the aggregates' outputs, in order.
    pub(crate) after: Vec<(Variable, Expr)>,
}

/// Where a rule was written.
#[derive(Debug, Clone)]
pub(crate) struct Origin {
    pub(crate) source: Source,
    pub(crate) span: Span,
    /// `#[name("…")]`.
    pub(crate) name: Option<String>,
    /// The comment directly above it.
    pub(crate) comment: Option<String>,
}

impl Origin {
    /// `file:line`.
    pub(crate) fn place(&self) -> String {
        format!(
            "{}:{}",
            self.source.name,
            self.source.line_and_column(self.span.start).0
        )
    }
}

/// A rule with one head.
#[derive(Debug, Clone)]
pub(crate) struct Rule {
    pub(crate) head: Atom,
    pub(crate) body: Vec<Literal>,
    pub(crate) aggregation: Option<Aggregation>,
    /// Names of the variables; empty for generated variables.
    pub(crate) variables: Vec<String>,
    /// Names of the head's arguments: the variable's name, or an empty string for any other
    /// argument.
    pub(crate) head_names: Vec<String>,
    pub(crate) origin: Origin,
    /// The rule with new things that this rule is a part of.
    pub(crate) making: Option<Arc<Making>>,
}

impl Rule {
    /// Returns the rule with new things if this is the part that makes them.
    pub(crate) fn makes(&self) -> Option<&Making> {
        self.making
            .as_deref()
            .filter(|making| making.made == self.head.predicate)
    }

    /// Returns the predicates that the rule reads. A rule that makes new things also reads its own
    /// heads.
    pub(crate) fn reads(&self) -> impl Iterator<Item = PredicateId> {
        let heads = self.makes().into_iter().flat_map(|making| &making.heads);
        self.body
            .iter()
            .filter_map(Literal::atom)
            .chain(heads)
            .map(|atom| atom.predicate)
    }
}

/// A rule with new things (`!x`) in its heads. For `h(?x, !v), g(!v) :- b(?x, ?y) .`, it consists
/// of these parts, which have the same variables:
///
/// ```prolog
/// matches(?x) :- b(?x, ?y) .
/// made(?x, !v) :- matches(?x) .          % For each tuple that lacks the heads: a new thing for `!v`.
/// h(?x, ?v) :- made(?x, ?v) .
/// g(?v) :- made(?x, ?v) .
/// ```
#[derive(Debug)]
pub(crate) struct Making {
    /// The values of the body that the heads read.
    pub(crate) matches: PredicateId,
    /// These values with the new things.
    pub(crate) made: PredicateId,
    /// The variables of the new things.
    pub(crate) new: Vec<Variable>,
    pub(crate) heads: Vec<Atom>,
}

/// The checked rules and facts of one file, or of several that belong together.
#[derive(Debug, Clone, Default)]
pub(crate) struct CheckedProgram {
    pub(crate) rules: Vec<Rule>,
    /// Facts from the text or from imported files, as rows stored one after another.
    pub(crate) facts: BTreeMap<PredicateId, Vec<TermId>>,
}

/// The rules that may derive each predicate.
#[derive(Debug, Clone, Default)]
pub(crate) struct RulesByHead<'a>(BTreeMap<PredicateId, Vec<&'a Rule>>);

impl<'a> RulesByHead<'a> {
    pub(crate) fn add(&mut self, program: &'a CheckedProgram) {
        for rule in &program.rules {
            self.0.entry(rule.head.predicate).or_default().push(rule);
        }
    }

    pub(crate) fn of(&self, head: PredicateId) -> impl Iterator<Item = &'a Rule> {
        self.0.get(&head).into_iter().flatten().copied()
    }
}
