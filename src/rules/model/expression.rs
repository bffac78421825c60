//! Checked expressions and their evaluation under a binding of the rule's variables.

use std::borrow::Cow;
use std::cmp::Ordering;

use crate::builtins::{self, Builtin, Value};
use crate::model::universe::Universe;
use crate::model::values::{lexical, text_len};
use crate::syntax::Comparison;
use crate::temporal::Timed;
use crate::watch::Watch;
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
    /// A formula over the course of the action: its truth or its robustness.
    Timed(Box<Timed>),
}

impl Expr {
    /// Appends the variables that occur in the expression.
    pub(crate) fn variables(&self, found: &mut Vec<Variable>) {
        match self {
            Self::Constant(_) => {}
            Self::Variable(variable) => found.push(*variable),
            Self::Call(_, args) | Self::Format(args) => {
                args.iter().for_each(|arg| arg.variables(found))
            }
            Self::Matches(arg, _) => arg.variables(found),
            Self::Timed(timed) => timed.variables(found),
        }
    }

    /// Returns the expression with other variables. Formulas over time are not renamed.
    pub(crate) fn renamed(&self, new: &dyn Fn(Variable) -> Variable) -> Self {
        let all = |args: &[Self]| args.iter().map(|arg| arg.renamed(new)).collect();
        match self {
            Self::Variable(variable) => Self::Variable(new(*variable)),
            Self::Call(builtin, args) => Self::Call(builtin, all(args)),
            Self::Matches(arg, pattern) => {
                Self::Matches(Box::new(arg.renamed(new)), pattern.clone())
            }
            Self::Format(parts) => Self::Format(all(parts)),
            Self::Constant(_) | Self::Timed(_) => self.clone(),
        }
    }

    /// Whether the expression has a value for any binding.
    pub(crate) fn is_total(&self) -> bool {
        match self {
            Self::Constant(_) | Self::Variable(_) => true,
            Self::Format(parts) => parts.iter().all(Self::is_total),
            Self::Call(..) | Self::Matches(..) | Self::Timed(_) => false,
        }
    }

    /// Whether a formula over the course of the action is part of the expression.
    pub(crate) fn is_timed(&self) -> bool {
        match self {
            Self::Constant(_) | Self::Variable(_) => false,
            Self::Call(_, args) | Self::Format(args) => args.iter().any(Self::is_timed),
            Self::Matches(arg, _) => arg.is_timed(),
            Self::Timed(_) => true,
        }
    }

    /// Computes the value. Returns `None` if a built-in has no result for its arguments, or if the
    /// budget is spent (see [`Watch::stopped`]).
    pub(crate) fn value<'a>(
        &'a self,
        binding: &[TermId],
        terms: &'a Universe<'_>,
        watch: &Watch,
    ) -> Option<Value<'a>> {
        match self {
            Self::Constant(term) => Some(Cow::Borrowed(term)),
            Self::Variable(variable) => Some(Cow::Borrowed(terms.term(binding[*variable]))),
            Self::Call(builtin, args) => match args.as_slice() {
                [a] => builtin.call(&[a.value(binding, terms, watch)?], watch),
                [a, b] => builtin.call(
                    &[
                        a.value(binding, terms, watch)?,
                        b.value(binding, terms, watch)?,
                    ],
                    watch,
                ),
                _ => {
                    let args: Vec<Value<'a>> = args
                        .iter()
                        .map(|arg| arg.value(binding, terms, watch))
                        .collect::<Option<_>>()?;
                    builtin.call(&args, watch)
                }
            }
            .map(Cow::Owned),
            Self::Matches(arg, pattern) => match arg.value(binding, terms, watch)?.as_ref() {
                Term::String(text) | Term::LangString(text, _) => Some(Cow::Owned(Term::Boolean(
                    builtins::matches(pattern, text, watch)?,
                ))),
                _ => None,
            },
            Self::Format(parts) => {
                let mut text = String::new();
                for part in parts {
                    let part = part.value(binding, terms, watch)?;
                    watch.make(text_len(&part))?;
                    text.push_str(&lexical(&part));
                }
                Some(Cow::Owned(Term::string(text)))
            }
            Self::Timed(timed) => timed.value(binding, terms, watch).map(Cow::Owned),
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
