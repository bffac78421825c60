//! Safety: checks that every variable of a rule is bound, and orders comparisons and assignments
//! after their inputs.

use crate::check::translate::Translation;
use crate::model::expression::{Expr, Variable};
use crate::model::program::{Aggregation, Atom, Literal, Operand};
use crate::syntax::{Comparison, RuleSyntax};

/// Turns equalities that bind a variable into assignments, orders the conditions by dependency, and
/// resolves negations. Reports an error for each unbound variable. Returns `false` if there was
/// one.
pub(crate) fn order(
    rule: &mut Translation<'_, '_>,
    syntax: &RuleSyntax,
    head: &Atom,
    aggregation: Option<&Aggregation>,
) -> bool {
    let mut bound = vec![false; rule.variables.len()];
    let mut sorted = Vec::new();
    let mut waiting = Vec::new();
    for literal in std::mem::take(&mut rule.body) {
        match literal {
            Literal::Positive(atom) => {
                mark(&atom, &mut bound);
                sorted.push(Literal::Positive(atom));
            }
            other => waiting.push(other),
        }
    }
    move_ready(&mut waiting, &mut bound, &mut sorted);
    let mut negated = Vec::new();
    let mut safe = true;
    for literal in waiting {
        match literal {
            Literal::Negative(atom) => negated.push(atom),
            other => safe &= unbound(rule, &other, &bound),
        }
    }
    for atom in negated {
        let atom = settle_negation(rule, atom, &bound);
        sorted.push(Literal::Negative(atom));
    }
    rule.body = sorted;
    safe &= head_bound(rule, head, aggregation, &bound);
    if safe {
        warn_single_use(rule, syntax);
    }
    safe
}

/// Reports an error for each unbound variable of the head or of its aggregates. Returns `false` if
/// there was one.
fn head_bound(
    rule: &mut Translation<'_, '_>,
    head: &Atom,
    aggregation: Option<&Aggregation>,
    bound: &[bool],
) -> bool {
    let derived: Vec<Variable> = aggregation
        .iter()
        .flat_map(|a| {
            a.aggregates
                .iter()
                .map(|g| g.output)
                .chain(a.after.iter().map(|(variable, _)| *variable))
        })
        .collect();
    let inputs = aggregation.iter().flat_map(|a| {
        a.aggregates
            .iter()
            .flat_map(|g| g.distinct.iter().chain([&g.input]))
            .chain(a.group.iter())
            .copied()
    });
    let heads = head.args.iter().filter_map(|arg| match arg {
        Operand::Variable(variable) => Some(*variable),
        _ => None,
    });
    let mut missing: Vec<Variable> = heads
        .chain(inputs)
        .filter(|v| !bound[*v] && !derived.contains(v))
        .collect();
    missing.sort_unstable();
    missing.dedup();
    for variable in &missing {
        let (name, span) = rule.variables[*variable].clone();
        if !name.is_empty() {
            let help = format!(
                "use `?{name}` in a positive atom of the body, or give it a value with `?{name} = …`; if each match \
                 makes a new thing, write `!{name}`"
            );
            rule.error(
                "R020",
                &span,
                format!("variable `?{name}` of the head is not bound in the body"),
                help,
            );
        }
    }
    missing.is_empty()
}

fn mark(atom: &Atom, bound: &mut [bool]) {
    for arg in &atom.args {
        if let Operand::Variable(variable) = arg {
            bound[*variable] = true;
        }
    }
}

/// Moves the literals whose variables are bound to `sorted`, until no more can be moved.
fn move_ready(waiting: &mut Vec<Literal>, bound: &mut [bool], sorted: &mut Vec<Literal>) {
    loop {
        let mut moved = false;
        for literal in std::mem::take(waiting) {
            match ready(literal, bound) {
                Ok(literal) => {
                    if let Literal::Assign { variable, .. } = &literal {
                        bound[*variable] = true;
                    }
                    sorted.push(literal);
                    moved = true;
                }
                Err(literal) => waiting.push(literal),
            }
        }
        if !moved {
            return;
        }
    }
}

fn ready(literal: Literal, bound: &[bool]) -> Result<Literal, Literal> {
    if let Literal::Compare {
        op: Comparison::Equal,
        left,
        right,
        span,
    } = &literal
    {
        for (target, value) in [(left, right), (right, left)] {
            if let Expr::Variable(variable) = target
                && !bound[*variable]
                && all_bound(value, bound)
            {
                return Ok(Literal::Assign {
                    variable: *variable,
                    value: value.clone(),
                    span: span.clone(),
                });
            }
        }
    }
    let enough =
        !matches!(literal, Literal::Negative(_)) && literal.needs().iter().all(|v| bound[*v]);
    if enough { Ok(literal) } else { Err(literal) }
}

fn all_bound(expr: &Expr, bound: &[bool]) -> bool {
    let mut variables = Vec::new();
    expr.variables(&mut variables);
    variables.iter().all(|v| bound[*v])
}

/// Reports the first unbound variable of a literal. Skips generated variables, which have no name
/// to report.
fn unbound(rule: &mut Translation<'_, '_>, literal: &Literal, bound: &[bool]) -> bool {
    let mut needed = literal.needs();
    if let Literal::Assign { variable, .. } = literal {
        needed.push(*variable);
    }
    let missing = needed
        .into_iter()
        .find(|v| !bound[*v] && !rule.variables[*v].0.is_empty());
    if let Some(variable) = missing {
        let name = rule.variables[variable].0.clone();
        let help = format!(
            "use `?{name}` in a positive atom of the body, or give it a value with `?{name} = …`"
        );
        rule.error(
            "R021",
            literal.span(),
            format!("variable `?{name}` is not bound here"),
            help,
        );
    }
    false
}

/// Replaces unbound variables of a negated atom by [`Operand::Any`]. If one of them occurs twice in
/// the atom, a helper rule checks that both values are equal.
fn settle_negation(rule: &mut Translation<'_, '_>, atom: Atom, bound: &[bool]) -> Atom {
    let free: Vec<Variable> = atom
        .args
        .iter()
        .filter_map(|arg| match arg {
            Operand::Variable(v) if !bound[*v] => Some(*v),
            _ => None,
        })
        .collect();
    let repeated = free
        .iter()
        .any(|v| free.iter().filter(|other| *other == v).count() > 1);
    if repeated {
        let known: Vec<Variable> = (0..bound.len()).filter(|v| bound[*v]).collect();
        return rule.helper(atom, &known);
    }
    let args = atom
        .args
        .iter()
        .map(|arg| match arg {
            Operand::Variable(v) if !bound[*v] => Operand::Any,
            other => *other,
        })
        .collect();
    Atom { args, ..atom }
}

/// Warns about variables that occur once, which are often typing errors.
fn warn_single_use(rule: &mut Translation<'_, '_>, syntax: &RuleSyntax) {
    let text = rule
        .source
        .text
        .get(syntax.span.clone())
        .unwrap_or_default()
        .to_owned();
    for (name, span) in rule.variables.clone() {
        let word = format!("?{name}");
        let uses = text.match_indices(&word).filter(|(at, _)| {
            !text[at + word.len()..].starts_with(|c: char| c.is_alphanumeric() || c == '_')
        });
        if !name.is_empty() && uses.count() == 1 {
            let help = "write `_` if any value will do";
            let source = rule.source.clone();
            rule.checking.warning(
                "R041",
                &source,
                &span,
                format!("variable `{word}` occurs only once"),
                help,
            );
        }
    }
}
