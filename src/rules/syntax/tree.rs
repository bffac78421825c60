//! The syntax tree of a rule text, with source spans. Nothing in it is checked yet.

use actcheck_base::{Source, Span};

/// A parsed rule text.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Syntax {
    /// The text.
    pub source: Source,
    /// Declared prefixes with their namespaces, in order.
    pub prefixes: Vec<(String, String)>,
    /// The IRI of the last `@base`.
    pub base: Option<String>,
    /// Its statements in order.
    pub statements: Vec<Statement>,
    /// Whether the whole text was parsed without errors.
    pub whole: bool,
}

/// One statement. The parser resolves `@prefix` and `@base`, so they do not appear here.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum Statement {
    /// A rule, or a fact (a rule without body).
    Rule(RuleSyntax),
    /// `@parameter $x = e .`
    Parameter {
        /// Name without `$`.
        name: String,
        /// Its value; `None` if the text gives no value.
        value: Option<Expression>,
        /// The whole directive.
        span: Span,
    },
    /// `@import` or `@export`.
    Transfer(Transfer),
    /// `@output p, q .`
    Output {
        /// Predicates to write.
        predicates: Vec<String>,
    },
    /// `@declare p(any, any) .`: kept for its predicate's name and arity.
    Declare {
        /// Predicate.
        name: String,
        /// Number of columns.
        arity: usize,
        /// The whole directive.
        span: Span,
    },
}

/// `@import p :- csv{resource="f"}, … .`, or the corresponding `@export`.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Transfer {
    /// Whether this is an import; otherwise it is an export.
    pub import: bool,
    /// Predicate.
    pub predicate: String,
    /// File format, for example `csv`.
    pub format: String,
    /// Options by name.
    pub options: Vec<(String, Expression)>,
    /// Assignments after the options.
    pub bindings: Vec<(String, Expression)>,
    /// The whole directive.
    pub span: Span,
}

/// A rule as written.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct RuleSyntax {
    /// `#[name("…")]`.
    pub name: Option<String>,
    /// The atoms it derives.
    pub heads: Vec<AtomSyntax>,
    /// The conditions that must hold.
    pub body: Vec<LiteralSyntax>,
    /// From the first head to the final dot.
    pub span: Span,
    /// Comment lines directly above it, joined.
    pub comment: Option<String>,
}

/// `p(…)`.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct AtomSyntax {
    /// Predicate: a bare name or an absolute IRI.
    pub predicate: String,
    /// Arguments.
    pub args: Vec<Expression>,
    /// The whole atom.
    pub span: Span,
    /// The predicate alone.
    pub name_span: Span,
}

/// One condition of a body.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum LiteralSyntax {
    /// An atom, or a call of a built-in, which has the same syntax.
    Atom(AtomSyntax),
    /// `~p(…)`.
    Negated(AtomSyntax),
    /// `left op right`.
    Comparison {
        /// Operator.
        op: Comparison,
        /// Left side.
        left: Expression,
        /// Right side.
        right: Expression,
        /// The whole comparison.
        span: Span,
    },
    /// A formula that begins with a temporal operator, such as `always(w:tilt(?o) < 0.5)`.
    Temporal(Formula),
}

/// A formula over the course of an action.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Formula {
    /// Its kind, with its parts.
    pub kind: FormulaKind,
    /// Its place in the source.
    pub span: Span,
}

/// Kinds of formulas.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum FormulaKind {
    /// The comparison of two quantities.
    Compare(Comparison, Expression, Expression),
    /// A quantity that is true or false, such as `w:held(?o)`.
    Signal(Expression),
    /// `~a`.
    Not(Box<Formula>),
    /// `a and b`.
    And(Vec<Formula>),
    /// `a or b`.
    Or(Vec<Formula>),
    /// `a implies b`.
    Implies(Box<Formula>, Box<Formula>),
    /// A temporal operator with one part, or for `until` and `since` two.
    Temporal {
        /// Operator.
        operator: TemporalOperator,
        /// `[from, to]` in seconds, if written.
        bound: Option<[Expression; 2]>,
        /// Its parts.
        parts: Vec<Formula>,
    },
}

/// Temporal operators.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TemporalOperator {
    /// At every later time.
    Always,
    /// At some later time.
    Eventually,
    /// The second at some later time, and the first at all times before that.
    Until,
    /// At every earlier time.
    Historically,
    /// At some earlier time.
    Once,
    /// The second at some earlier time, and the first at all times after that.
    Since,
}

impl TemporalOperator {
    /// All operators.
    pub const ALL: [Self; 6] = [
        Self::Always,
        Self::Eventually,
        Self::Until,
        Self::Historically,
        Self::Once,
        Self::Since,
    ];

    /// Returns the operator of a name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|operator| operator.name() == name)
    }

    /// Returns the name as written.
    pub fn name(self) -> &'static str {
        match self {
            Self::Always => "always",
            Self::Eventually => "eventually",
            Self::Until => "until",
            Self::Historically => "historically",
            Self::Once => "once",
            Self::Since => "since",
        }
    }

    /// Returns whether it looks at earlier times.
    pub fn is_past(self) -> bool {
        matches!(self, Self::Historically | Self::Once | Self::Since)
    }

    /// Returns the number of its parts.
    pub fn parts(self) -> usize {
        if matches!(self, Self::Until | Self::Since) {
            2
        } else {
            1
        }
    }
}

/// Comparison operators.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Comparison {
    /// `=`: the same term.
    Equal,
    /// `!=`: a different term.
    Unequal,
    /// `<`, of numbers.
    Less,
    /// `<=`, of numbers.
    LessEqual,
    /// `>`, of numbers.
    Greater,
    /// `>=`, of numbers.
    GreaterEqual,
}

impl Comparison {
    /// Returns the operator of the same comparison with its sides exchanged.
    pub(crate) fn turned(self) -> Self {
        match self {
            Self::Less => Self::Greater,
            Self::LessEqual => Self::GreaterEqual,
            Self::Greater => Self::Less,
            Self::GreaterEqual => Self::LessEqual,
            same => same,
        }
    }

    /// Returns the operator as written.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Equal => "=",
            Self::Unequal => "!=",
            Self::Less => "<",
            Self::LessEqual => "<=",
            Self::Greater => ">",
            Self::GreaterEqual => ">=",
        }
    }
}

/// A term or a computation.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Expression {
    /// Its kind, with its operands.
    pub kind: ExpressionKind,
    /// Its place in the source.
    pub span: Span,
}

/// Kinds of expressions.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum ExpressionKind {
    /// A constant.
    Constant(actcheck_base::Term),
    /// `?x`.
    Variable(String),
    /// `_`.
    Anonymous,
    /// `$x`.
    Global(String),
    /// `NAME(…)`: a built-in by its name as written.
    Call(String, Vec<Expression>),
    /// `a + b` and the like: one of `+ - * /`.
    Arithmetic(char, Box<Expression>, Box<Expression>),
    /// `-a`.
    Negative(Box<Expression>),
    /// An f-string.
    Format(Vec<Expression>),
    /// `#count(v, distinct…)`.
    Aggregate(String, Vec<Expression>),
    /// `!x`: a new thing, in a head.
    Existential(String),
    /// A tuple `(a, b)`, only in options of imports.
    Tuple(Vec<Expression>),
    /// Text that could not be parsed; the error has been reported.
    Broken,
}
