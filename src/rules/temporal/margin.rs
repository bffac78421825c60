//! The margin of a property whose `success` or `violation` reads formulas: their robustness.

use std::collections::BTreeSet;

use crate::builtins;
use crate::check::checking::{Checking, Role};
use crate::model::expression::Expr;
use crate::model::program::{
    Aggregate, AggregateKind, Aggregation, Atom, CheckedProgram, Literal, Operand, PredicateId,
    Predicates, Rule, Scope,
};
use crate::syntax::Syntax;
use crate::temporal::Timed;

/// Returns whether a rule reads quantities over time.
pub(crate) fn reads_course(rule: &Rule, predicates: &Predicates) -> bool {
    rule.body.iter().any(|literal| match literal {
        Literal::Test { value, .. } | Literal::Assign { value, .. } => {
            matches!(value, Expr::Timed(_))
        }
        Literal::Positive(atom) | Literal::Negative(atom) => {
            let predicate = predicates.get(atom.predicate);
            predicate.given && predicate.name == "course"
        }
        Literal::Compare { .. } => false,
    })
}

/// Adds rules for the margin of a property that does not define one: for `success`, the largest
/// robustness of its rules; for `violation`, the smallest robustness with its sign changed. Every
/// rule that decides must read a formula.
pub(crate) fn add_margin(
    checking: &mut Checking<'_>,
    program: &mut CheckedProgram,
    syntax: &Syntax,
    scope: Scope,
) {
    let find = |checking: &Checking<'_>, name: &str| checking.predicates.find(scope, name, None);
    if find(checking, "margin").is_some() {
        return;
    }
    let decisive = [("success", true), ("violation", false)]
        .into_iter()
        .find_map(|(name, positive)| Some((find(checking, name)?, positive)));
    let Some((decisive, positive)) = decisive else {
        return;
    };
    let deciding: Vec<Rule> = program
        .rules
        .iter()
        .filter(|rule| rule.head.predicate == decisive)
        .cloned()
        .collect();
    warn_of_helpers(checking, program, decisive);
    if deciding.is_empty()
        || deciding
            .iter()
            .any(|rule| rule.aggregation.is_some() || formulas_of(rule).is_none())
    {
        return;
    }
    let mut define = |name: &str| {
        checking.define_predicate(&syntax.source, name, 1, &(0..0), Role::Property(scope));
        checking.predicates.find(scope, name, None)
    };
    let (Some(margin), Some(each)) = (define("margin"), define("robustness~")) else {
        return;
    };
    let target = if positive { each } else { margin };
    let rules: Vec<Rule> = deciding
        .iter()
        .filter_map(|rule| robustness_of(rule, target, positive))
        .collect();
    let largest = rules
        .first()
        .filter(|_| positive)
        .map(|rule| largest(rule, each, margin));
    program.rules.extend(rules);
    program.rules.extend(largest);
}

/// Warns (R057) of formulas in the rules of helper predicates: their robustness is not part of the
/// margin.
fn warn_of_helpers(checking: &mut Checking<'_>, program: &CheckedProgram, decisive: PredicateId) {
    let (mut reached, mut waiting) = (BTreeSet::new(), vec![decisive]);
    while let Some(predicate) = waiting.pop() {
        if predicate != decisive && !reached.insert(predicate) {
            continue;
        }
        let rules = program
            .rules
            .iter()
            .filter(|rule| rule.head.predicate == predicate);
        waiting.extend(
            rules
                .flat_map(Rule::reads)
                .filter(|read| *read != decisive && !reached.contains(read)),
        );
    }
    let name = checking.predicates.get(decisive).name.clone();
    for rule in program
        .rules
        .iter()
        .filter(|rule| reached.contains(&rule.head.predicate))
    {
        for literal in &rule.body {
            let Literal::Test {
                value: Expr::Timed(timed),
                span,
            } = literal
            else {
                continue;
            };
            let mut compares = false;
            for formula in timed
                .formulas()
                .iter()
                .filter(|formula| !is_of_the_start(formula))
            {
                formula.visit(&mut |part| {
                    compares |= matches!(part, crate::temporal::CheckedFormula::Compare { .. })
                });
            }
            if compares {
                let helper = &checking.predicates.get(rule.head.predicate).name;
                let message = format!(
                    "the margin of the property leaves out this formula, which is in a rule of `{helper}`"
                );
                let help = format!(
                    "write the formula in the rule of `{name}`, or derive `margin(?m)` of your own"
                );
                checking.warning("R057", &rule.origin.source, span, message, help);
            }
        }
    }
}

/// Whether a formula is about the first moment alone, such as `eventually[0, 0](…)`: a fact about
/// the scene, which no motion changes.
fn is_of_the_start(formula: &crate::temporal::CheckedFormula) -> bool {
    matches!(
        formula,
        crate::temporal::CheckedFormula::Temporal {
            from: 0.0,
            to: 0.0,
            ..
        }
    )
}

/// Returns the conditions of a rule that read formulas; `None` if there are none.
pub(super) fn formulas_of(rule: &Rule) -> Option<Vec<crate::temporal::CheckedFormula>> {
    let formulas: Vec<_> = rule
        .body
        .iter()
        .filter_map(|literal| match literal {
            Literal::Test {
                value: Expr::Timed(timed),
                ..
            } => Some(timed.formulas().to_vec()),
            _ => None,
        })
        .flatten()
        .collect();
    (!formulas.is_empty()).then_some(formulas)
}

/// Returns a rule with the same other conditions that derives the robustness of a rule's formulas.
fn robustness_of(rule: &Rule, target: PredicateId, positive: bool) -> Option<Rule> {
    let value = Expr::Timed(Box::new(Timed::robustness_of(formulas_of(rule)?)));
    let value = if positive {
        value
    } else {
        Expr::Call(builtins::builtin("INVERSE")?, vec![value])
    };
    let is_formula = |literal: &&Literal| {
        matches!(
            literal,
            Literal::Test {
                value: Expr::Timed(_),
                ..
            }
        )
    };
    let mut body: Vec<Literal> = rule
        .body
        .iter()
        .filter(|literal| !is_formula(literal))
        .cloned()
        .collect();
    let span = rule.origin.span.clone();
    let variable = rule.variables.len();
    body.push(Literal::Assign {
        variable,
        value,
        span: span.clone(),
    });
    let mut variables = rule.variables.clone();
    variables.push("robustness".to_owned());
    Some(Rule {
        head: Atom {
            predicate: target,
            args: vec![Operand::Variable(variable)],
            span,
        },
        body,
        aggregation: None,
        variables,
        head_names: vec!["robustness".to_owned()],
        origin: rule.origin.clone(),
        making: None,
    })
}

/// Returns the rule `margin(#max(?robustness)) :- robustness~(?robustness)`.
fn largest(rule: &Rule, each: PredicateId, margin: PredicateId) -> Rule {
    let span = rule.origin.span.clone();
    let atom = |predicate, variable| Atom {
        predicate,
        args: vec![Operand::Variable(variable)],
        span: span.clone(),
    };
    let aggregate = Aggregate {
        kind: AggregateKind::Max,
        input: 0,
        distinct: Vec::new(),
        output: 1,
    };
    Rule {
        head: atom(margin, 1),
        body: vec![Literal::Positive(atom(each, 0))],
        aggregation: Some(Aggregation {
            group: Vec::new(),
            aggregates: vec![aggregate],
            after: Vec::new(),
        }),
        variables: vec!["robustness".to_owned(), String::new()],
        head_names: vec![String::new()],
        origin: rule.origin.clone(),
        making: None,
    }
}
