//! Checks rules with new things (`!x`) in their heads, and splits each into its parts.

use std::sync::Arc;

use crate::check::checking::Role;
use crate::check::expressions::{contains_aggregate, push_new};
use crate::check::safety;
use crate::check::translate::Translation;
use crate::model::expression::Variable;
use crate::model::program::{Atom, Literal, MAX_ARITY, Making, Operand, Origin, PredicateId, Rule};
use crate::syntax::{AtomSyntax, Expression, ExpressionKind, RuleSyntax};
use actcheck_base::Span;

/// Returns whether a head of a rule has a new thing as an argument.
pub(crate) fn makes_new_things(rule: &RuleSyntax) -> bool {
    let args = rule.heads.iter().flat_map(|head| &head.args);
    args.into_iter()
        .any(|arg| matches!(arg.kind, ExpressionKind::Existential(_)))
}

impl Translation<'_, '_> {
    /// Returns the parts of a rule with new things, and its helper rules; empty if an error was
    /// reported.
    pub(super) fn making(mut self, rule: &RuleSyntax) -> Vec<Rule> {
        for literal in &rule.body {
            self.literal(literal);
        }
        let mut new: Vec<Variable> = Vec::new();
        let heads: Vec<Option<Atom>> = rule
            .heads
            .iter()
            .map(|head| self.head_with_new_things(head, &mut new))
            .collect();
        self.one_kind_each(&new);
        let Some(heads) = heads
            .into_iter()
            .collect::<Option<Vec<Atom>>>()
            .filter(|_| !self.faulty)
        else {
            return Vec::new();
        };
        let mut known: Vec<Variable> = Vec::new();
        for arg in heads.iter().flat_map(|head| &head.args) {
            if let Operand::Variable(variable) = arg
                && !new.contains(variable)
            {
                push_new(&mut known, *variable);
            }
        }
        let operands = |variables: &[Variable]| {
            variables
                .iter()
                .map(|v| Operand::Variable(*v))
                .collect::<Vec<_>>()
        };
        let span = rule.span.clone();
        let unnamed = Atom {
            predicate: heads[0].predicate,
            args: operands(&known),
            span: span.clone(),
        };
        if !safety::order(&mut self, rule, &unnamed, None) {
            return Vec::new();
        }
        if known.len() + new.len() > MAX_ARITY {
            let help = "derive the values that belong together in a rule of their own, and make the new things from it";
            let message = format!("the heads have more than {MAX_ARITY} different variables");
            self.error("R024", &rule.heads[0].span, message, help);
            return Vec::new();
        }
        let name = rule.heads[0].predicate.clone();
        let matches = self.part(&name, known.len(), &span);
        let made = self.part(&name, known.len() + new.len(), &span);
        let matched = Atom {
            predicate: matches,
            args: self.pad(matches, operands(&known)),
            span: span.clone(),
        };
        let all: Vec<Variable> = known.iter().chain(&new).copied().collect();
        let filled = Atom {
            predicate: made,
            args: operands(&all),
            span,
        };
        self.parts(
            rule,
            matched,
            filled,
            Making {
                matches,
                made,
                new,
                heads,
            },
        )
    }

    /// Returns the rules of the parts.
    fn parts(self, rule: &RuleSyntax, matched: Atom, filled: Atom, making: Making) -> Vec<Rule> {
        let origin = Origin {
            source: self.source.clone(),
            span: rule.span.clone(),
            name: rule.name.clone(),
            comment: rule.comment.clone(),
        };
        let variables: Vec<String> = self.variables.into_iter().map(|(name, _)| name).collect();
        let making = Arc::new(making);
        let part = |head: &Atom, body: Vec<Literal>, head_names: Vec<String>| Rule {
            head: head.clone(),
            body,
            aggregation: None,
            variables: variables.clone(),
            head_names,
            origin: origin.clone(),
            making: Some(Arc::clone(&making)),
        };
        let unnamed = |atom: &Atom| vec![String::new(); atom.args.len()];
        let mut rules = self.extra;
        rules.push(part(&matched, self.body, unnamed(&matched)));
        rules.push(part(
            &filled,
            vec![Literal::Positive(matched.clone())],
            unnamed(&filled),
        ));
        for (head, syntax) in making.heads.iter().zip(&rule.heads) {
            let names = syntax
                .args
                .iter()
                .map(|arg| argument_name(arg).to_owned())
                .collect();
            rules.push(part(head, vec![Literal::Positive(filled.clone())], names));
        }
        rules
    }

    /// Translates a head. Returns `None` if an error was reported.
    fn head_with_new_things(&mut self, head: &AtomSyntax, new: &mut Vec<Variable>) -> Option<Atom> {
        let (predicate, args) = self.predicate(head, true)?;
        let needs_value = matches!(head.predicate.as_str(), "margin" | "because")
            && matches!(self.role, Role::Property(_));
        let mut operands = Vec::new();
        for arg in &args {
            operands.push(match &arg.kind {
                ExpressionKind::Existential(name) if needs_value => {
                    let message = format!(
                        "`{}` needs a value, and a new thing such as `!{name}` has none",
                        head.predicate
                    );
                    self.error("R039", &arg.span, message, "write a variable of the body");
                    None
                }
                ExpressionKind::Existential(name) => {
                    // No variable of the text begins with `!`.
                    let variable = self.variable(&format!("!{name}"), &arg.span);
                    push_new(new, variable);
                    Some(Operand::Variable(variable))
                }
                _ if contains_aggregate(arg) => {
                    let help =
                        "aggregate in a rule of its own, and make the new things from its result";
                    self.error(
                        "R039",
                        &arg.span,
                        "a rule can't aggregate and make new things at once",
                        help,
                    );
                    None
                }
                _ => self.head_argument(arg, None),
            });
        }
        let operands: Vec<Operand> = operands.into_iter().collect::<Option<_>>()?;
        Some(Atom {
            predicate,
            args: self.pad(predicate, operands),
            span: head.span.clone(),
        })
    }

    /// Reports new things that have the name of a variable.
    fn one_kind_each(&mut self, new: &[Variable]) {
        for variable in new {
            let (name, span) = self.variables[*variable].clone();
            let Some(plain) = name.strip_prefix('!') else {
                continue;
            };
            if self.variables.iter().any(|(other, _)| other == plain) {
                let message = format!("`?{plain}` and `!{plain}` in one rule");
                let help = format!(
                    "`!{plain}` is a new thing and `?{plain}` a known one: give them different names"
                );
                self.error("R039", &span, message, help);
            }
        }
    }

    /// Adds a helper predicate, and returns it.
    fn part(&mut self, head: &str, arity: usize, span: &Span) -> PredicateId {
        let name = format!("{head}~{}", self.checking.predicates.len());
        self.checking
            .define_predicate(self.source, &name, arity, span, self.role);
        self.checking
            .predicates
            .find(self.role.scope(), &name, None)
            .expect("it was defined in the line above")
    }
}

fn argument_name(arg: &Expression) -> &str {
    match &arg.kind {
        ExpressionKind::Variable(name) | ExpressionKind::Existential(name) => name,
        _ => "",
    }
}
