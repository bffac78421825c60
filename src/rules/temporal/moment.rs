//! `moment(…, ?seconds)`: when each `success` or `violation` is decided, for the author's words.

use crate::check::checking::{Checking, Role};
use crate::model::expression::Expr;
use crate::model::program::{Atom, CheckedProgram, Literal, Operand, Rule, Scope};
use crate::syntax::{LiteralSyntax, Statement, Syntax};
use crate::temporal::Timed;
use crate::temporal::margin::formulas_of;

/// Name of the predicate.
const MOMENT: &str = "moment";

/// Defines the predicate, if a property's file reads it without defining it: the arguments of
/// `success` or `violation`, and the deciding moment.
pub(crate) fn define_moment(checking: &mut Checking<'_>, syntax: &Syntax, scope: Scope) {
    let is_known = |name: &str| checking.defined.contains_key(&(scope, name.to_owned()));
    if !reads_moment(syntax)
        || is_known(MOMENT)
        || checking.defined.contains_key(&(0, MOMENT.to_owned()))
    {
        return;
    }
    let decisive = ["success", "violation"]
        .into_iter()
        .find(|name| is_known(name));
    let arity = decisive
        .and_then(|name| checking.defined.get(&(scope, name.to_owned())))
        .map(|known| known.arity);
    if let Some(arity) = arity {
        checking.define_predicate(
            &syntax.source,
            MOMENT,
            arity + 1,
            &(0..0),
            Role::Property(scope),
        );
    }
}

fn reads_moment(syntax: &Syntax) -> bool {
    let rules = syntax
        .statements
        .iter()
        .filter_map(|statement| match statement {
            Statement::Rule(rule) => Some(rule),
            _ => None,
        });
    rules
        .flat_map(|rule| &rule.body)
        .any(|literal| match literal {
            LiteralSyntax::Atom(atom) | LiteralSyntax::Negated(atom) => atom.predicate == MOMENT,
            _ => false,
        })
}

/// Adds the rules of the predicate: the other conditions of each deciding rule, and the moment that
/// decides its formulas.
pub(crate) fn add_moment(checking: &Checking<'_>, program: &mut CheckedProgram, scope: Scope) {
    let find = |name: &str| checking.predicates.find(scope, name, None);
    let derived = |predicate| {
        program
            .rules
            .iter()
            .any(|rule| rule.head.predicate == predicate)
    };
    let Some(moment) = find(MOMENT).filter(|moment| !derived(*moment)) else {
        return;
    };
    let Some(decisive) = find("success").or_else(|| find("violation")) else {
        return;
    };
    let deciding = program
        .rules
        .iter()
        .filter(|rule| rule.head.predicate == decisive && rule.aggregation.is_none());
    let rules: Vec<Rule> = deciding
        .filter_map(|rule| moment_of(rule, moment))
        .collect();
    program.rules.extend(rules);
}

fn moment_of(rule: &Rule, moment: usize) -> Option<Rule> {
    let value = Expr::Timed(Box::new(Timed::moment_of(formulas_of(rule)?)));
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
    let (span, variable) = (rule.origin.span.clone(), rule.variables.len());
    body.push(Literal::Assign {
        variable,
        value,
        span: span.clone(),
    });
    let mut args = rule.head.args.clone();
    args.push(Operand::Variable(variable));
    let mut variables = rule.variables.clone();
    variables.push("seconds".to_owned());
    let mut head_names = rule.head_names.clone();
    head_names.push("seconds".to_owned());
    Some(Rule {
        head: Atom {
            predicate: moment,
            args,
            span,
        },
        body,
        aggregation: None,
        variables,
        head_names,
        origin: rule.origin.clone(),
        making: None,
    })
}
