//! Values known before evaluation: parameters, and the options of imports and exports.

use std::collections::BTreeMap;

use crate::check::checking::{Checking, Role};
use crate::check::translate::Translation;
use crate::syntax::{Expression, ExpressionKind, Statement, Syntax, Transfer};
use actcheck_base::Term;

/// Computes the values of a file's parameters. Each may use the parameters above it.
pub(crate) fn globals(
    checking: &mut Checking<'_>,
    syntax: &Syntax,
    role: Role,
) -> BTreeMap<String, Term> {
    let mut globals: BTreeMap<String, Term> = BTreeMap::new();
    for statement in &syntax.statements {
        let Statement::Parameter { name, value, span } = statement else {
            continue;
        };
        let mut rule = Translation::new(checking, &syntax.source, role, &globals);
        let value = match value {
            Some(value) => rule.ground(value),
            None => {
                let help = format!("write `@parameter ${name} = … .`");
                rule.error("R036", span, format!("`${name}` has no value"), help);
                None
            }
        };
        globals.insert(name.clone(), value.unwrap_or(Term::Boolean(false)));
    }
    globals
}

/// Computes the values of an import's or export's options, with its assignments applied.
pub(crate) fn options(
    checking: &mut Checking<'_>,
    syntax: &Syntax,
    transfer: &Transfer,
) -> BTreeMap<String, OptionValue> {
    // Errors in parameters are reported when the rules are translated.
    let before = std::mem::take(&mut checking.diagnostics);
    let globals = globals(checking, syntax, Role::Standalone);
    checking.diagnostics = before;
    let mut known: BTreeMap<String, Term> = BTreeMap::new();
    for (name, value) in &transfer.bindings {
        let value = substituted(value, &known);
        if let Some(term) =
            Translation::new(checking, &syntax.source, Role::Standalone, &globals).ground(&value)
        {
            known.insert(name.clone(), term);
        }
    }
    let mut values = BTreeMap::new();
    for (name, value) in &transfer.options {
        let mut ground = |value: &Expression| {
            Translation::new(checking, &syntax.source, Role::Standalone, &globals)
                .ground(&substituted(value, &known))
        };
        let found = match &value.kind {
            ExpressionKind::Tuple(items) => items
                .iter()
                .map(&mut ground)
                .collect::<Option<_>>()
                .map(OptionValue::Many),
            _ => ground(value).map(OptionValue::One),
        };
        if let Some(found) = found {
            values.insert(name.clone(), found);
        }
    }
    values
}

/// The value of an option.
#[derive(Debug, Clone)]
pub(crate) enum OptionValue {
    One(Term),
    Many(Vec<Term>),
}

/// Replaces the known variables of an expression by their values.
fn substituted(expression: &Expression, known: &BTreeMap<String, Term>) -> Expression {
    let all = |args: &[Expression]| {
        args.iter()
            .map(|arg| substituted(arg, known))
            .collect::<Vec<_>>()
    };
    let one = |arg: &Expression| Box::new(substituted(arg, known));
    let kind = match &expression.kind {
        ExpressionKind::Variable(name) => match known.get(name) {
            Some(term) => ExpressionKind::Constant(term.clone()),
            None => ExpressionKind::Variable(name.clone()),
        },
        ExpressionKind::Call(name, args) => ExpressionKind::Call(name.clone(), all(args)),
        ExpressionKind::Format(args) => ExpressionKind::Format(all(args)),
        ExpressionKind::Arithmetic(op, left, right) => {
            ExpressionKind::Arithmetic(*op, one(left), one(right))
        }
        ExpressionKind::Negative(inner) => ExpressionKind::Negative(one(inner)),
        other => other.clone(),
    };
    Expression {
        kind,
        span: expression.span.clone(),
    }
}
