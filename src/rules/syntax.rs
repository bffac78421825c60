//! What a rule text says, as a tree with places; nothing of it is checked yet.

use crate::base::{Source, Span};

/// A parsed rule text.
#[derive(Debug, Clone)]
pub struct Syntax {
    /// The text.
    pub source: Source,
    /// Prefixes that it declares, in order: prefix, namespace.
    pub prefixes: Vec<(String, String)>,
    /// What `@base` says last.
    pub base: Option<String>,
    /// Its statements in order.
    pub statements: Vec<Statement>,
    /// Whether all of it could be read.
    pub whole: bool,
}

/// One statement. Directives that only name things (`@prefix`, `@base`) are resolved by the parser.
#[derive(Debug, Clone)]
pub enum Statement {
    /// A rule, or a fact (a rule without body).
    Rule(RuleSyntax),
    /// `@parameter $x = e .`
    Parameter {
        /// Name without `$`.
        name: String,
        /// Its value; nothing where one must be given from outside.
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

/// `@import p :- csv{resource="f"}, … .` and its mirror image.
#[derive(Debug, Clone)]
pub struct Transfer {
    /// Whether it reads; otherwise it writes.
    pub import: bool,
    /// Predicate.
    pub predicate: String,
    /// Format, such as `csv`.
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
pub struct RuleSyntax {
    /// `#[name("…")]`.
    pub name: Option<String>,
    /// What it derives.
    pub heads: Vec<AtomSyntax>,
    /// What must hold.
    pub body: Vec<LiteralSyntax>,
    /// From the first head to the final dot.
    pub span: Span,
    /// Comment lines right above it, joined.
    pub comment: Option<String>,
}

/// `p(…)`.
#[derive(Debug, Clone)]
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
pub enum LiteralSyntax {
    /// An atom, or a built-in that looks like one.
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
}

/// Comparison operators.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Comparison {
    /// `=`: the same term.
    Equal,
    /// `!=`: another term.
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
    /// How it is written.
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
pub struct Expression {
    /// What it is.
    pub kind: ExpressionKind,
    /// Where it is.
    pub span: Span,
}

/// Kinds of expressions.
#[derive(Debug, Clone)]
pub enum ExpressionKind {
    /// A constant.
    Constant(crate::base::Term),
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
    /// `!x`, kept so that one clear fault can say what it is.
    Existential(String),
    /// A tuple `(a, b)`, only in options of imports.
    Tuple(Vec<Expression>),
    /// What could not be parsed; a fault was noted.
    Broken,
}
