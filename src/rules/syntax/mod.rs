//! Rule text to its syntax tree, with a span for each part.
//!
//! Never: resolves a predicate or checks a rule; a text with errors yields the statements that
//! could be parsed.

mod lex;
mod lex_text;
pub(crate) mod limits;
mod parse;
mod parse_expression;
mod parse_formula;
mod tree;

pub use parse::parse;
pub use tree::{
    AtomSyntax, Comparison, Expression, ExpressionKind, Formula, FormulaKind, LiteralSyntax,
    RuleSyntax, Statement, Syntax, TemporalOperator, Transfer,
};
