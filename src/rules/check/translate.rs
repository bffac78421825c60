//! Translates the syntax of a rule to one checked rule for each of its heads.

use std::collections::BTreeMap;

use crate::builtins;
use crate::check::checking::{Checking, Role};
use crate::check::expressions::{contains_aggregate, push_new};
use crate::check::making::makes_new_things;
use crate::check::options::globals;
use crate::check::safety;
use crate::engine::budget::Budget;
use crate::model::expression::{Expr, Variable};
use crate::model::program::{
    Aggregation, Atom, CheckedProgram, Literal, Operand, Origin, PredicateId, Rule,
};
use crate::model::universe::Universe;
use crate::syntax::limits::{FAULT_LIMIT, LITERAL_LIMIT, VARIABLE_LIMIT};
use crate::syntax::{
    AtomSyntax, Comparison, Expression, ExpressionKind, LiteralSyntax, RuleSyntax, Statement,
    Syntax,
};
use crate::temporal::Timed;
use crate::watch::Watch;
use actcheck_base::{Source, Span, Term, TermId, Terms};

/// Translates the rules and facts of a file. Statements with errors are reported and left out.
pub(crate) fn translate(
    checking: &mut Checking<'_>,
    syntax: &Syntax,
    role: Role,
) -> CheckedProgram {
    let mut program = CheckedProgram::default();
    let globals = globals(checking, syntax, role);
    let before = checking.errors;
    for statement in &syntax.statements {
        if checking.errors - before >= FAULT_LIMIT {
            break;
        }
        match statement {
            // Already reported when its heads were defined.
            Statement::Rule(rule) if rule.body.len() > LITERAL_LIMIT => {}
            Statement::Rule(rule) if rule.body.is_empty() => {
                for head in &rule.heads {
                    let fact =
                        Translation::new(checking, &syntax.source, role, &globals).fact(head);
                    if let Some((predicate, row)) = fact {
                        program.facts.entry(predicate).or_default().extend(row);
                    }
                }
            }
            Statement::Rule(rule) if makes_new_things(rule) => {
                program.rules.extend(
                    Translation::new(checking, &syntax.source, role, &globals).making(rule),
                );
            }
            Statement::Rule(rule) => {
                for head in 0..rule.heads.len() {
                    let rules =
                        Translation::new(checking, &syntax.source, role, &globals).rule(rule, head);
                    program.rules.extend(rules);
                }
            }
            _ => {}
        }
    }
    program
}

/// The state of translating one rule.
pub(crate) struct Translation<'c, 'a> {
    pub(crate) checking: &'c mut Checking<'a>,
    pub(crate) source: &'c Source,
    pub(super) role: Role,
    pub(crate) globals: &'c BTreeMap<String, Term>,
    /// Name and first place of each variable; the name of a generated variable is empty.
    pub(crate) variables: Vec<(String, Span)>,
    pub(crate) body: Vec<Literal>,
    /// Helper rules for negated atoms with repeated variables.
    pub(super) extra: Vec<Rule>,
    pub(crate) faulty: bool,
    /// Whether too many variables have been reported.
    variable_limit_reported: bool,
}

impl<'c, 'a> Translation<'c, 'a> {
    pub(crate) fn new(
        checking: &'c mut Checking<'a>,
        source: &'c Source,
        role: Role,
        globals: &'c BTreeMap<String, Term>,
    ) -> Self {
        Self {
            checking,
            source,
            role,
            globals,
            variables: Vec::new(),
            body: Vec::new(),
            extra: Vec::new(),
            faulty: false,
            variable_limit_reported: false,
        }
    }

    pub(crate) fn error(
        &mut self,
        code: &'static str,
        span: &Span,
        message: impl Into<String>,
        help: impl Into<String>,
    ) {
        self.faulty = true;
        self.checking.error(code, self.source, span, message, help);
    }

    /// Returns the helper rules followed by the checked rule of one head; empty if an error was
    /// reported.
    fn rule(mut self, rule: &RuleSyntax, head: usize) -> Vec<Rule> {
        for literal in &rule.body {
            self.literal(literal);
        }
        for (_, other) in rule
            .heads
            .iter()
            .enumerate()
            .filter(|(idx, _)| *idx != head)
        {
            self.values(other);
        }
        let head = &rule.heads[head];
        let (predicate, args) = match self.predicate(head, true) {
            Some(found) => found,
            None => return Vec::new(),
        };
        let head_names = head
            .args
            .iter()
            .map(|arg| variable_name(arg).unwrap_or_default().to_owned())
            .collect();
        let mut aggregation = Aggregation {
            group: Vec::new(),
            aggregates: Vec::new(),
            after: Vec::new(),
        };
        let has_aggregate = args.iter().any(|arg| contains_aggregate(arg));
        let mut operands = Vec::new();
        for arg in &args {
            operands.push(self.head_argument(arg, has_aggregate.then_some(&mut aggregation)));
        }
        let operands: Option<Vec<Operand>> = operands.into_iter().collect();
        let Some(operands) = operands.filter(|_| !self.faulty) else {
            return Vec::new();
        };
        let head = Atom {
            predicate,
            args: self.pad(predicate, operands),
            span: head.span.clone(),
        };
        let aggregation = has_aggregate.then_some(aggregation);
        if !safety::order(&mut self, rule, &head, aggregation.as_ref()) {
            return Vec::new();
        }
        let origin = Origin {
            source: self.source.clone(),
            span: rule.span.clone(),
            name: rule.name.clone(),
            comment: rule.comment.clone(),
        };
        let variables = self.variables.into_iter().map(|(name, _)| name).collect();
        let mut rules = self.extra;
        rules.push(Rule {
            head,
            body: self.body,
            aggregation,
            variables,
            head_names,
            origin,
            making: None,
        });
        rules
    }

    /// Adds the computed values of another head as conditions: a rule applies to a match as a whole
    /// or not at all.
    fn values(&mut self, head: &AtomSyntax) {
        // Its own translation reports wrong predicates. The faults here are those of the other
        // head, not of this one.
        let faulty = self.faulty;
        let args = self
            .predicate(head, true)
            .map_or(Vec::new(), |(_, args)| args);
        let mut unused = Aggregation {
            group: Vec::new(),
            aggregates: Vec::new(),
            after: Vec::new(),
        };
        for arg in args
            .iter()
            .filter(|arg| !matches!(arg.kind, ExpressionKind::Variable(_)))
        {
            let before = self.body.len();
            self.head_argument(arg, Some(&mut unused));
            if matches!(self.body.last(), Some(Literal::Assign { value, .. }) if value.is_total()) {
                self.body.truncate(before);
            }
        }
        self.faulty = faulty;
    }

    fn fact(mut self, head: &AtomSyntax) -> Option<(PredicateId, Vec<TermId>)> {
        let (predicate, args) = self.predicate(head, true)?;
        if let Some((name, span)) = head.args.iter().find_map(new_thing) {
            let help =
                "a rule makes new things, one for each match of its body: write a body after `:-`";
            self.error("R039", span, format!("new thing `!{name}` in a fact"), help);
            return None;
        }
        let mut row = Vec::new();
        for arg in &args {
            let term = self.ground(arg)?;
            row.push(self.checking.terms.intern(term));
        }
        if row.is_empty() {
            row.push(unit(self.checking.terms));
        }
        Some((predicate, row))
    }

    /// Evaluates an expression without variables. Returns `None` if an error was reported.
    pub(crate) fn ground(&mut self, expression: &Expression) -> Option<Term> {
        let expr = self.expression(expression)?;
        let mut variables = Vec::new();
        expr.variables(&mut variables);
        if let Some(variable) = variables.first() {
            let name = self.variables[*variable].0.clone();
            let help = "a fact may contain only constants; for a rule, write a body after `:-`";
            self.error(
                "R020",
                &expression.span,
                format!("variable `?{name}` in a fact"),
                help,
            );
            return None;
        }
        let nothing = Terms::new();
        let value = expr
            .value(
                &[],
                &Universe::new(&nothing, None),
                &Watch::new(&Budget::default()),
            )
            .map(|value| value.into_owned());
        if value.is_none() {
            self.error(
                "R037",
                &expression.span,
                "the expression has no value",
                "check the types of its arguments",
            );
        }
        value
    }

    /// Adds the constant column of an atom without arguments.
    pub(super) fn pad(&mut self, predicate: PredicateId, mut args: Vec<Operand>) -> Vec<Operand> {
        if args.is_empty() && self.checking.predicates.get(predicate).width == 1 {
            args.push(Operand::Constant(unit(self.checking.terms)));
        }
        args
    }

    /// Returns the index of a variable, adding it if it is new.
    pub(crate) fn variable(&mut self, name: &str, span: &Span) -> Variable {
        match self.variables.iter().position(|(known, _)| known == name) {
            Some(variable) => variable,
            None => self.add_variable(name, span),
        }
    }

    pub(crate) fn fresh_variable(&mut self, span: &Span) -> Variable {
        self.add_variable("", span)
    }

    /// Adds a variable. A rule with too many variables is marked as faulty and returns a dummy
    /// index.
    fn add_variable(&mut self, name: &str, span: &Span) -> Variable {
        if self.variables.len() == VARIABLE_LIMIT {
            if !self.variable_limit_reported {
                self.variable_limit_reported = true;
                let message = format!("rule with more than {VARIABLE_LIMIT} variables");
                self.error("R006", span, message, "split it into several rules");
            }
            return 0;
        }
        self.variables.push((name.to_owned(), span.clone()));
        self.variables.len() - 1
    }

    pub(super) fn literal(&mut self, literal: &LiteralSyntax) {
        match literal {
            LiteralSyntax::Atom(atom) => {
                if self.is_test(atom) {
                    let call = Expression {
                        kind: ExpressionKind::Call(atom.predicate.clone(), atom.args.clone()),
                        span: atom.span.clone(),
                    };
                    if let Some(value) = self.expression(&call) {
                        self.body.push(Literal::Test {
                            value,
                            span: atom.span.clone(),
                        });
                    }
                } else if let Some(atom) = self.body_atom(atom) {
                    self.body.push(Literal::Positive(atom));
                }
            }
            LiteralSyntax::Negated(syntax) => {
                if let Some(atom) = self.body_atom(syntax) {
                    self.body.push(Literal::Negative(atom));
                }
            }
            LiteralSyntax::Temporal(formula) => {
                if let Some(checked) = self.formula(formula) {
                    let value = Expr::Timed(Box::new(Timed::truth(checked)));
                    self.body.push(Literal::Test {
                        value,
                        span: formula.span.clone(),
                    });
                }
            }
            LiteralSyntax::Comparison {
                op,
                left,
                right,
                span,
            } => {
                let (left, right) = (self.expression(left), self.expression(right));
                if let (Some(left), Some(right)) = (left, right) {
                    self.body.push(Literal::Compare {
                        op: *op,
                        left,
                        right,
                        span: span.clone(),
                    });
                }
            }
        }
    }

    /// Returns whether an atom is a call of a built-in: a predicate of the same name takes
    /// precedence.
    fn is_test(&self, atom: &AtomSyntax) -> bool {
        let defined = |scope| {
            self.checking
                .defined
                .contains_key(&(scope, atom.predicate.clone()))
        };
        builtins::builtin(&atom.predicate).is_some() && !defined(0) && !defined(self.role.scope())
    }

    fn body_atom(&mut self, atom: &AtomSyntax) -> Option<Atom> {
        let (predicate, args) = match self.predicate(atom, false) {
            Some(found) => found,
            None => {
                if self.role != Role::Standalone {
                    return None;
                }
                // An undefined predicate is empty.
                self.faulty = false;
                self.checking.define_predicate(
                    self.source,
                    &atom.predicate,
                    atom.args.len(),
                    &atom.span,
                    self.role,
                );
                let id = self.checking.predicates.find(0, &atom.predicate, None)?;
                (
                    id,
                    atom.args.iter().map(std::borrow::Cow::Borrowed).collect(),
                )
            }
        };
        let mut operands = Vec::new();
        for arg in &args {
            operands.push(self.body_argument(arg)?);
        }
        Some(Atom {
            predicate,
            args: self.pad(predicate, operands),
            span: atom.span.clone(),
        })
    }

    fn body_argument(&mut self, arg: &Expression) -> Option<Operand> {
        match &arg.kind {
            ExpressionKind::Anonymous => Some(Operand::Any),
            ExpressionKind::Variable(name) => {
                Some(Operand::Variable(self.variable(name, &arg.span)))
            }
            _ => match self.expression(arg)? {
                Expr::Constant(term) => Some(Operand::Constant(self.checking.terms.intern(term))),
                value => {
                    let fresh = self.fresh_variable(&arg.span);
                    let left = Expr::Variable(fresh);
                    self.body.push(Literal::Compare {
                        op: Comparison::Equal,
                        left,
                        right: value,
                        span: arg.span.clone(),
                    });
                    Some(Operand::Variable(fresh))
                }
            },
        }
    }

    pub(super) fn head_argument(
        &mut self,
        arg: &Expression,
        aggregation: Option<&mut Aggregation>,
    ) -> Option<Operand> {
        match &arg.kind {
            ExpressionKind::Anonymous => {
                self.error(
                    "R035",
                    &arg.span,
                    "`_` in a head",
                    "write a variable or a constant instead of `_`",
                );
                None
            }
            ExpressionKind::Variable(name) => {
                let variable = self.variable(name, &arg.span);
                if let Some(aggregation) = aggregation {
                    push_new(&mut aggregation.group, variable);
                }
                Some(Operand::Variable(variable))
            }
            _ if contains_aggregate(arg) => {
                let aggregation = aggregation?;
                let value = self.aggregated(arg, aggregation)?;
                let fresh = self.fresh_variable(&arg.span);
                aggregation.after.push((fresh, value));
                Some(Operand::Variable(fresh))
            }
            _ => match self.expression(arg)? {
                Expr::Constant(term) => Some(Operand::Constant(self.checking.terms.intern(term))),
                value => {
                    let variable = self.fresh_variable(&arg.span);
                    self.body.push(Literal::Assign {
                        variable,
                        value,
                        span: arg.span.clone(),
                    });
                    if let Some(aggregation) = aggregation {
                        push_new(&mut aggregation.group, variable);
                    }
                    Some(Operand::Variable(variable))
                }
            },
        }
    }

    /// Adds a helper rule that projects a negated atom to its bound variables. Returns the helper's
    /// head, to be negated instead.
    pub(crate) fn helper(&mut self, negated: Atom, bound: &[Variable]) -> Atom {
        let name = format!(
            "{}~{}",
            self.checking.predicates.get(negated.predicate).name,
            self.checking.predicates.len()
        );
        let kept: Vec<Variable> = bound
            .iter()
            .copied()
            .filter(|variable| negated.args.contains(&Operand::Variable(*variable)))
            .collect();
        let span = negated.span.clone();
        self.checking
            .define_predicate(self.source, &name, kept.len(), &span, self.role);
        let predicate = self
            .checking
            .predicates
            .find(self.role.scope(), &name, None)
            .unwrap_or(negated.predicate);
        let args: Vec<Operand> = kept
            .iter()
            .map(|variable| Operand::Variable(*variable))
            .collect();
        let head = Atom {
            predicate,
            args: self.pad(predicate, args),
            span: span.clone(),
        };
        let origin = Origin {
            source: self.source.clone(),
            span,
            name: None,
            comment: None,
        };
        self.extra.push(Rule {
            head: head.clone(),
            body: vec![Literal::Positive(negated)],
            aggregation: None,
            variables: self
                .variables
                .iter()
                .map(|(name, _)| name.clone())
                .collect(),
            head_names: vec![String::new(); kept.len()],
            origin,
            making: None,
        });
        head
    }
}

/// Returns the constant in the only column of predicates without arguments.
pub(crate) fn unit(terms: &mut Terms) -> TermId {
    terms.intern(Term::Boolean(true))
}

fn new_thing(expression: &Expression) -> Option<(&str, &Span)> {
    match &expression.kind {
        ExpressionKind::Existential(name) => Some((name, &expression.span)),
        _ => None,
    }
}

fn variable_name(expression: &Expression) -> Option<&str> {
    match &expression.kind {
        ExpressionKind::Variable(name) => Some(name),
        _ => None,
    }
}
