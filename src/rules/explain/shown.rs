//! Formats atoms and conditions of rules with the values of a binding.

use crate::explain::model::RuleRef;
use crate::explain::search::{Binding, ProofContext};
use crate::model::expression::Expr;
use crate::model::given::property_place;
use crate::model::program::{Atom, Literal, Operand, PredicateId, Rule};
use crate::temporal::{Evidence, Timed};
use actcheck_base::{DecidingSignal, Term, TermId, names};

impl ProofContext<'_> {
    /// Formats a tuple as a statement.
    pub(super) fn statement(&self, predicate: PredicateId, row: &[TermId]) -> String {
        let args = row.iter().map(|id| self.term(*id)).collect();
        self.format_atom(predicate, args)
    }

    /// Formats an atom with its bound values, and `_` for unbound arguments. Unbound variables that
    /// occur repeatedly keep their names, because their values must be equal.
    pub(super) fn pattern(&self, atom: &Atom, binding: &Binding, names: &[String]) -> String {
        let is_repeated = |variable| {
            atom.args
                .iter()
                .filter(|arg| **arg == Operand::Variable(variable))
                .count()
                > 1
        };
        let unbound = |variable: usize| match names.get(variable) {
            Some(name) if name.starts_with('!') && is_repeated(variable) => name.clone(),
            Some(name) if !name.is_empty() && is_repeated(variable) => format!("?{name}"),
            _ => "_".to_owned(),
        };
        let args = atom
            .args
            .iter()
            .map(|arg| match arg {
                Operand::Constant(id) => self.term(*id),
                Operand::Variable(variable) => {
                    binding[*variable].map_or_else(|| unbound(*variable), |id| self.term(id))
                }
                Operand::Any => "_".into(),
            })
            .collect();
        self.format_atom(atom.predicate, args)
    }

    /// Formats a predicate with its arguments as in the rule text: with the property, and the phase
    /// as a shorthand.
    fn format_atom(&self, predicate: PredicateId, mut args: Vec<String>) -> String {
        let predicate = self.predicates.get(predicate);
        let name = predicate.name.as_str();
        args.truncate(predicate.arity);
        if let (Some(property), Some(place)) = (predicate.property, property_place(name)) {
            args.insert(place.min(args.len()), self.term(property));
        }
        if name == "state"
            && let Some(phase @ ("before" | "after" | "during")) =
                args.first().and_then(|phase| phase.strip_prefix("act:"))
        {
            let phase = phase.to_owned();
            args.remove(0);
            return format!("{phase}({})", args.join(", "));
        }
        let name = if name.contains(':') {
            names::shorten(name)
        } else {
            name.to_owned()
        };
        format!("{name}({})", args.join(", "))
    }

    /// Formats a term; doubles are rounded to six significant digits.
    pub(super) fn term(&self, id: TermId) -> String {
        shown(self.universe.term(id))
    }

    /// Formats a condition with its values.
    pub(super) fn literal(&self, rule: &Rule, literal: &Literal, binding: &Binding) -> String {
        match literal {
            Literal::Positive(atom) => self.pattern(atom, binding, &rule.variables),
            Literal::Negative(atom) => format!("not {}", self.negated(rule, atom, binding)),
            Literal::Assign { variable, span, .. } => {
                let value = binding[*variable].map_or("(no value)".into(), |id| self.term(id));
                let name = &rule.variables[*variable];
                let text = self.source_text(rule, span.clone());
                if name.is_empty() {
                    format!("{text} is {value}")
                } else {
                    format!("{text}, so ?{name} is {value}")
                }
            }
            Literal::Compare {
                op,
                left,
                right,
                span,
            } => {
                let values = [left, right].map(|side| {
                    self.value(side, binding)
                        .map_or("(no value)".into(), |term| shown(&term))
                });
                let text = self.source_text(rule, span.clone());
                format!("{text}, with {} {} {}", values[0], op.symbol(), values[1])
            }
            Literal::Test {
                value: Expr::Timed(timed),
                span,
            } => {
                let text = self.source_text(rule, span.clone());
                match self.evidence(timed, rule, binding) {
                    Some(evidence) => {
                        let said = format!("{text}: {}", evidence.text);
                        self.deciding.borrow_mut().push(evidence);
                        said
                    }
                    None => text,
                }
            }
            Literal::Test { span, .. } => self.source_text(rule, span.clone()),
        }
    }

    /// Formats a condition that is not satisfied. For an assignment, this is the computed value and
    /// the required one.
    pub(super) fn unsatisfied(&self, rule: &Rule, literal: &Literal, binding: &Binding) -> String {
        if let Literal::Assign {
            variable,
            value,
            span,
        } = literal
            && let (Some(wanted), Some(found)) = (binding[*variable], self.value(value, binding))
        {
            let text = self.source_text(rule, span.clone());
            return format!(
                "{text}, which gives {}, not {}",
                shown(&found),
                self.term(wanted)
            );
        }
        self.literal(rule, literal, binding)
    }

    /// Formats a negated atom. For a helper predicate, which is not in the rule text, returns the
    /// source text instead.
    pub(super) fn negated(&self, rule: &Rule, atom: &Atom, binding: &Binding) -> String {
        if self.predicates.get(atom.predicate).name.contains('~') {
            return self.source_text(rule, atom.span.clone());
        }
        self.pattern(atom, binding, &rule.variables)
    }

    /// Computes an expression. Returns `None` if a variable is unbound or the expression has no
    /// value.
    pub(super) fn value(&self, expr: &Expr, binding: &Binding) -> Option<Term> {
        let mut used = Vec::new();
        expr.variables(&mut used);
        if used.iter().any(|variable| binding[*variable].is_none()) {
            return None;
        }
        let values: Vec<TermId> = binding.iter().map(|id| id.unwrap_or(0)).collect();
        expr.value(&values, self.universe, self.watch)
            .map(std::borrow::Cow::into_owned)
    }

    /// Returns the moment that decides a formula, with the values there.
    fn evidence(&self, timed: &Timed, rule: &Rule, binding: &Binding) -> Option<Evidence> {
        let mut used = Vec::new();
        timed.variables(&mut used);
        if used.iter().any(|variable| binding[*variable].is_none()) {
            return None;
        }
        let values: Vec<TermId> = binding.iter().map(|id| id.unwrap_or(0)).collect();
        timed.evidence(&values, self.universe, self.watch, &|span| {
            self.source_text(rule, span)
        })
    }

    /// Takes the signals that decided the formulas of an explanation with this text, each once.
    pub(super) fn deciding_in(&self, text: &str) -> Vec<DecidingSignal> {
        let mut signals: Vec<DecidingSignal> = Vec::new();
        for evidence in self
            .deciding
            .take()
            .into_iter()
            .filter(|evidence| text.contains(&evidence.text))
        {
            for signal in evidence.signals {
                if !signals.contains(&signal) {
                    signals.push(signal);
                }
            }
        }
        signals
    }

    pub(super) fn source_text(&self, rule: &Rule, span: actcheck_base::Span) -> String {
        let text = rule.origin.source.text.get(span).unwrap_or_default();
        text.split_whitespace().collect::<Vec<_>>().join(" ")
    }

    /// Returns a reference to a rule.
    pub(super) fn rule_ref(&self, rule: &Rule) -> RuleRef {
        RuleRef {
            name: rule.origin.name.clone(),
            comment: rule.origin.comment.clone(),
            place: rule.origin.place(),
            text: self.source_text(rule, rule.origin.span.clone()),
        }
    }
}

fn shown(term: &Term) -> String {
    match term {
        // Six significant digits: within a few metres, 10 micrometres.
        Term::Double(value) if *value != 0.0 && value.is_finite() => {
            let digits = (5.0 - value.abs().log10().floor()).clamp(0.0, 12.0) as usize;
            let text = format!("{value:.digits$}");
            if text.contains('.') {
                text.trim_end_matches('0').trim_end_matches('.').to_owned()
            } else {
                text
            }
        }
        term => term.to_string(),
    }
}
