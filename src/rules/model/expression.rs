//! Checked expressions and their evaluation under a binding of the rule's variables.

use std::borrow::Cow;
use std::cmp::Ordering;

use crate::builtins::{self, Builtin, Value};
use crate::model::universe::Universe;
use crate::syntax::Comparison;
use actcheck_base::{Term, TermId};

/// Index of a variable within its rule.
pub(crate) type Variable = usize;

/// A checked expression.
#[derive(Debug, Clone)]
pub(crate) enum Expr {
    /// A constant.
    Constant(Term),
    /// A variable, bound before the expression is evaluated.
    Variable(Variable),
    /// A built-in.
    Call(&'static Builtin, Vec<Expr>),
    /// `REGEX` with a constant pattern, compiled once.
    Matches(Box<Expr>, Box<regex::Regex>),
    /// The pieces of an f-string: each value's text.
    Format(Vec<Expr>),
}

impl Expr {
    /// Appends the variables that occur in the expression.
    pub(crate) fn variables(&self, found: &mut Vec<Variable>) {
        match self {
            Self::Constant(_) => {}
            Self::Variable(variable) => found.push(*variable),
            Self::Call(_, args) | Self::Format(args) => args.iter().for_each(|arg| arg.variables(found)),
            Self::Matches(arg, _) => arg.variables(found),
        }
    }

    /// Computes the value. Returns `None` if a built-in has no result for its arguments.
    pub(crate) fn value<'a>(&'a self, binding: &[TermId], terms: &'a Universe<'_>) -> Option<Value<'a>> {
        match self {
            Self::Constant(term) => Some(Cow::Borrowed(term)),
            Self::Variable(variable) => Some(Cow::Borrowed(terms.term(binding[*variable]))),
            Self::Call(builtin, args) => match args.as_slice() {
                [a] => (builtin.apply)(&[a.value(binding, terms)?]),
                [a, b] => (builtin.apply)(&[a.value(binding, terms)?, b.value(binding, terms)?]),
                _ => {
                    let args: Vec<Value<'a>> =
                        args.iter().map(|arg| arg.value(binding, terms)).collect::<Option<_>>()?;
                    (builtin.apply)(&args)
                }
            }
            .map(Cow::Owned),
            Self::Matches(arg, pattern) => match arg.value(binding, terms)?.as_ref() {
                Term::String(text) | Term::LangString(text, _) => {
                    Some(Cow::Owned(Term::Boolean(pattern.is_match(text))))
                }
                _ => None,
            },
            Self::Format(parts) => {
                let mut text = String::new();
                for part in parts {
                    text.push_str(&crate::model::values::lexical(part.value(binding, terms)?.as_ref()));
                }
                Some(Cow::Owned(Term::string(text)))
            }
        }
    }
}

/// Returns whether a comparison holds; `false` for terms that can't be ordered.
pub(crate) fn holds(op: Comparison, left: &Term, right: &Term) -> bool {
    let ordered = |wanted: fn(Ordering) -> bool| builtins::compare(left, right).is_some_and(wanted);
    match op {
        Comparison::Equal => builtins::equal(left, right),
        Comparison::Unequal => !builtins::equal(left, right),
        Comparison::Less => ordered(Ordering::is_lt),
        Comparison::LessEqual => ordered(Ordering::is_le),
        Comparison::Greater => ordered(Ordering::is_gt),
        Comparison::GreaterEqual => ordered(Ordering::is_ge),
    }
}
