//! Translates the expressions and aggregates of one rule from syntax to checked expressions.

use crate::builtins::{self, Builtin};
use crate::check::checking::{Role, counted};
use crate::check::translate::Translation;
use crate::model::expression::{Expr, Variable};
use crate::model::program::{Aggregate, AggregateKind, Aggregation, Literal};
use crate::syntax::{Expression, ExpressionKind};
use crate::temporal::known_quantity;
use actcheck_base::{Span, Term, did_you_mean, names};

impl Translation<'_, '_> {
    /// Translates a head expression that contains aggregates. Variables outside the aggregates are
    /// grouping variables.
    pub(crate) fn aggregated(
        &mut self,
        expression: &Expression,
        aggregation: &mut Aggregation,
    ) -> Option<Expr> {
        match &expression.kind {
            ExpressionKind::Aggregate(name, args) => {
                self.aggregate(name, args, &expression.span, aggregation)
            }
            ExpressionKind::Arithmetic(op, left, right) => {
                let left = self.aggregated(left, aggregation)?;
                let right = self.aggregated(right, aggregation)?;
                Some(Expr::Call(
                    builtins::builtin(operator(*op))?,
                    vec![left, right],
                ))
            }
            ExpressionKind::Negative(inner) => Some(Expr::Call(
                builtins::builtin("INVERSE")?,
                vec![self.aggregated(inner, aggregation)?],
            )),
            ExpressionKind::Call(name, args) => {
                let mut values = Vec::new();
                for arg in args {
                    values.push(self.aggregated(arg, aggregation)?);
                }
                self.call(name, values, &expression.span)
            }
            _ => {
                let value = self.expression(expression)?;
                let mut used = Vec::new();
                value.variables(&mut used);
                used.into_iter()
                    .for_each(|variable| push_new(&mut aggregation.group, variable));
                Some(value)
            }
        }
    }

    fn aggregate(
        &mut self,
        name: &str,
        args: &[Expression],
        span: &Span,
        aggregation: &mut Aggregation,
    ) -> Option<Expr> {
        const KINDS: [(&str, AggregateKind); 4] = [
            ("count", AggregateKind::Count),
            ("sum", AggregateKind::Sum),
            ("min", AggregateKind::Min),
            ("max", AggregateKind::Max),
        ];
        let Some((_, kind)) = KINDS
            .into_iter()
            .find(|(known, _)| known.eq_ignore_ascii_case(name))
        else {
            let help = did_you_mean(name, KINDS.map(|(known, _)| known));
            self.error("R032", span, format!("unknown aggregate `#{name}`"), help);
            return None;
        };
        if let Some(inner) = args.iter().find(|arg| contains_aggregate(arg)) {
            let help = "compute the inner aggregate in a separate rule";
            self.error("R032", &inner.span, "nested aggregate", help);
            return None;
        }
        let mut inputs = Vec::new();
        for arg in args {
            inputs.push(match &arg.kind {
                ExpressionKind::Variable(name) => self.variable(name, &arg.span),
                _ => {
                    let value = self.expression(arg)?;
                    let variable = self.fresh_variable(&arg.span);
                    self.body.push(Literal::Assign {
                        variable,
                        value,
                        span: arg.span.clone(),
                    });
                    variable
                }
            });
        }
        let Some((input, distinct)) = inputs.split_first() else {
            self.error(
                "R032",
                span,
                format!("`#{name}` has no arguments"),
                format!("write `#{name}(?x)`"),
            );
            return None;
        };
        let output = self.fresh_variable(span);
        aggregation.aggregates.push(Aggregate {
            kind,
            input: *input,
            distinct: distinct.to_vec(),
            output,
        });
        Some(Expr::Variable(output))
    }

    /// Translates an expression. Returns `None` if an error was reported.
    pub(crate) fn expression(&mut self, expression: &Expression) -> Option<Expr> {
        let span = &expression.span;
        match &expression.kind {
            ExpressionKind::Constant(term) => {
                if let Term::Iri(iri) = term {
                    self.checking.vocabulary(self.source, iri, span, false);
                    self.bare_name(iri, span);
                }
                Some(Expr::Constant(term.clone()))
            }
            ExpressionKind::Variable(name) => Some(Expr::Variable(self.variable(name, span))),
            ExpressionKind::Global(name) => match self.globals.get(name) {
                Some(value) => Some(Expr::Constant(value.clone())),
                None => {
                    let help = format!("set it with `@parameter ${name} = … .` above this rule");
                    self.error("R036", span, format!("unknown parameter `${name}`"), help);
                    None
                }
            },
            ExpressionKind::Call(name, args) => {
                let args = self.all(args)?;
                self.call(name, args, span)
            }
            ExpressionKind::Arithmetic(op, left, right) => {
                let (left, right) = (self.expression(left), self.expression(right));
                Some(Expr::Call(
                    builtins::builtin(operator(*op))?,
                    vec![left?, right?],
                ))
            }
            ExpressionKind::Negative(inner) => Some(Expr::Call(
                builtins::builtin("INVERSE")?,
                vec![self.expression(inner)?],
            )),
            ExpressionKind::Format(parts) => self.all(parts).map(Expr::Format),
            _ => self.report_invalid_expression(expression),
        }
    }

    /// Warns (R047) of a name that begins with a capital: in Prolog it would be a variable.
    pub(super) fn bare_name(&mut self, name: &str, span: &Span) {
        let is_bare = name.starts_with(char::is_uppercase)
            && name.chars().all(|c| c.is_alphanumeric() || c == '_');
        if is_bare && self.role != Role::Standalone {
            let help = format!(
                "a variable is written `?{name}`, and a term of the ontology with a prefix, as in `act:{name}`"
            );
            let message = format!("`{name}` is a constant that no fact has");
            // Once for each name, not for each place.
            if self.checking.bare_names.insert(name.to_owned()) {
                self.checking
                    .warning("R047", self.source, span, message, help);
            }
        }
    }

    fn all(&mut self, expressions: &[Expression]) -> Option<Vec<Expr>> {
        let values: Vec<Option<Expr>> =
            expressions.iter().map(|arg| self.expression(arg)).collect();
        values.into_iter().collect()
    }

    fn report_invalid_expression(&mut self, expression: &Expression) -> Option<Expr> {
        let span = &expression.span;
        match &expression.kind {
            ExpressionKind::Anonymous => self.error(
                "R035",
                span,
                "`_` has no value to compute with",
                "use a variable",
            ),
            ExpressionKind::Existential(name) => {
                let help = format!(
                    "a new thing is an argument of a head, on its own; elsewhere write `?{name}`"
                );
                self.error(
                    "R039",
                    span,
                    format!("new thing `!{name}` in a body or a computation"),
                    help,
                );
            }
            ExpressionKind::Aggregate(name, _) => {
                let help = "write aggregates in heads: derive the value in a separate rule and use it here";
                self.error("R032", span, format!("aggregate `#{name}` in a body"), help);
            }
            ExpressionKind::Tuple(_) => self.error(
                "R012",
                span,
                "tuples are not supported",
                "use one argument for each part",
            ),
            // The parser has already reported it.
            _ => self.faulty = true,
        }
        None
    }

    /// Returns the built-in of a call with this number of arguments. Returns `None` if an error was
    /// reported.
    pub(super) fn builtin(
        &mut self,
        name: &str,
        n_args: usize,
        span: &Span,
    ) -> Option<&'static Builtin> {
        let Some(builtin) = builtins::builtin(name) else {
            if name.starts_with("geo3d:") {
                // The prefix is unknown, which the parser has reported.
                self.faulty = true;
                return None;
            }
            if let Some(local) = name
                .strip_prefix(names::W)
                .filter(|local| known_quantity(local).is_some())
            {
                let message = format!(
                    "`w:{local}(…)` has a value at each moment, not one for the whole action"
                );
                let help = format!(
                    "write a formula, such as `always(w:{local}(…) < 1)`; see docs/time.md"
                );
                self.error("R053", span, message, help);
                return None;
            }
            let shown = name
                .strip_prefix(builtins::GEO3D)
                .map_or(name.to_owned(), |local| format!("geo3d:{local}"));
            let help = match actcheck_base::nearest(&shown, builtins::builtin_names()) {
                Some(found) => format!("did you mean `{found}`?"),
                None => "built-in functions are listed in rules/README.md".to_owned(),
            };
            self.error("R027", span, format!("unknown function `{shown}`"), help);
            return None;
        };
        if !(builtin.min_args..=builtin.max_args).contains(&n_args) {
            let wanted = match (builtin.min_args, builtin.max_args) {
                (least, usize::MAX) => format!("at least {least}"),
                (least, most) if least == most => least.to_string(),
                (least, most) => format!("{least} to {most}"),
            };
            let message = format!("`{}` has {}, needs {wanted}", builtin.name, counted(n_args));
            self.error(
                "R027",
                span,
                message,
                "functions and their arguments are listed in rules/README.md",
            );
            return None;
        }
        Some(builtin)
    }

    pub(crate) fn call(&mut self, name: &str, args: Vec<Expr>, span: &Span) -> Option<Expr> {
        let builtin = self.builtin(name, args.len(), span)?;
        let pattern = match (builtin.name, args.as_slice()) {
            ("REGEX", [_, Expr::Constant(Term::String(pattern))]) => {
                Some(builtins::compile_pattern(pattern))
            }
            (
                "REGEX",
                [
                    _,
                    Expr::Constant(Term::String(pattern)),
                    Expr::Constant(Term::String(flags)),
                ],
            ) => Some(builtins::compile_pattern_as(pattern, flags)),
            _ => None,
        };
        if let Some(pattern) = pattern {
            return match pattern {
                Ok(pattern) => args
                    .into_iter()
                    .next()
                    .map(|text| Expr::Matches(Box::new(text), Box::new(pattern))),
                Err(reason) => {
                    self.error(
                        "R033",
                        span,
                        format!("invalid pattern: {reason}"),
                        "see https://docs.rs/regex/#syntax",
                    );
                    None
                }
            };
        }
        Some(Expr::Call(builtin, args))
    }
}

/// Appends a variable unless the list contains it.
pub(crate) fn push_new(list: &mut Vec<Variable>, variable: Variable) {
    if !list.contains(&variable) {
        list.push(variable);
    }
}

/// Returns the name of the built-in of an operator.
pub(super) fn operator(symbol: char) -> &'static str {
    match symbol {
        '+' => "SUM",
        '-' => "MINUS",
        '*' => "PRODUCT",
        _ => "DIVISION",
    }
}

/// Returns whether an expression contains an aggregate.
pub(crate) fn contains_aggregate(expression: &Expression) -> bool {
    match &expression.kind {
        ExpressionKind::Aggregate(..) => true,
        ExpressionKind::Call(_, args)
        | ExpressionKind::Format(args)
        | ExpressionKind::Tuple(args) => args.iter().any(contains_aggregate),
        ExpressionKind::Arithmetic(_, left, right) => {
            contains_aggregate(left) || contains_aggregate(right)
        }
        ExpressionKind::Negative(inner) => contains_aggregate(inner),
        _ => false,
    }
}
