//! Expressions and aggregates of one rule, from their syntax to checked computations.

use crate::base::{Span, Term, did_you_mean};
use crate::rules::builtins;
use crate::rules::check::counted;
use crate::rules::expression::Expr;
use crate::rules::program::{Aggregate, AggregateKind, Aggregation, Literal, Variable};
use crate::rules::syntax::{Expression, ExpressionKind};
use crate::rules::translate::Translation;

impl Translation<'_, '_> {
    /// An expression of a head around aggregates: the variables outside of them group.
    pub(crate) fn aggregated(&mut self, expression: &Expression, aggregation: &mut Aggregation) -> Option<Expr> {
        match &expression.kind {
            ExpressionKind::Aggregate(name, args) => self.aggregate(name, args, &expression.span, aggregation),
            ExpressionKind::Arithmetic(op, left, right) => {
                let left = self.aggregated(left, aggregation)?;
                let right = self.aggregated(right, aggregation)?;
                Some(Expr::Call(builtins::builtin(operator(*op))?, vec![left, right]))
            }
            ExpressionKind::Negative(inner) => {
                Some(Expr::Call(builtins::builtin("INVERSE")?, vec![self.aggregated(inner, aggregation)?]))
            }
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
                used.into_iter().for_each(|variable| push_new(&mut aggregation.group, variable));
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
        let Some((_, kind)) = KINDS.into_iter().find(|(known, _)| known.eq_ignore_ascii_case(name)) else {
            let help = did_you_mean(name, KINDS.map(|(known, _)| known));
            self.error("R032", span, format!("unknown aggregate `#{name}`"), help);
            return None;
        };
        if let Some(inner) = args.iter().find(|arg| contains_aggregate(arg)) {
            let help = "compute the inner one in a rule of its own";
            self.error("R032", &inner.span, "an aggregate in an aggregate", help);
            return None;
        }
        let mut inputs = Vec::new();
        for arg in args {
            inputs.push(match &arg.kind {
                ExpressionKind::Variable(name) => self.variable(name, &arg.span),
                _ => {
                    let value = self.expression(arg)?;
                    let variable = self.made_variable(&arg.span);
                    self.body.push(Literal::Assign { variable, value, span: arg.span.clone() });
                    variable
                }
            });
        }
        let Some((input, distinct)) = inputs.split_first() else {
            self.error("R032", span, format!("`#{name}` of nothing"), format!("write `#{name}(?x)`"));
            return None;
        };
        let output = self.made_variable(span);
        aggregation.aggregates.push(Aggregate { kind, input: *input, distinct: distinct.to_vec(), output });
        Some(Expr::Variable(output))
    }

    /// A checked expression; nothing where a fault was noted.
    pub(crate) fn expression(&mut self, expression: &Expression) -> Option<Expr> {
        let span = &expression.span;
        match &expression.kind {
            ExpressionKind::Constant(term) => {
                if let Term::Iri(iri) = term {
                    self.checking.vocabulary(self.source, iri, span, false);
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
                Some(Expr::Call(builtins::builtin(operator(*op))?, vec![left?, right?]))
            }
            ExpressionKind::Negative(inner) => {
                Some(Expr::Call(builtins::builtin("INVERSE")?, vec![self.expression(inner)?]))
            }
            ExpressionKind::Format(parts) => self.all(parts).map(Expr::Format),
            _ => self.no_expression(expression),
        }
    }

    fn all(&mut self, expressions: &[Expression]) -> Option<Vec<Expr>> {
        let values: Vec<Option<Expr>> = expressions.iter().map(|arg| self.expression(arg)).collect();
        values.into_iter().collect()
    }

    fn no_expression(&mut self, expression: &Expression) -> Option<Expr> {
        let span = &expression.span;
        match &expression.kind {
            ExpressionKind::Anonymous => self.error("R035", span, "`_` has no value to compute with", "use a variable"),
            ExpressionKind::Existential(name) => {
                let help = "this engine derives facts about known things only: existential rules are not supported";
                self.error("R039", span, format!("existential variable `!{name}`"), help);
            }
            ExpressionKind::Aggregate(name, _) => {
                let help = "aggregates stand in heads: derive the value in a rule of its own and use that here";
                self.error("R032", span, format!("`#{name}` in a body"), help);
            }
            ExpressionKind::Tuple(_) => {
                self.error("R012", span, "tuples are not supported", "use one argument for each part")
            }
            // The parser has said it already.
            _ => self.faulty = true,
        }
        None
    }

    pub(crate) fn call(&mut self, name: &str, args: Vec<Expr>, span: &Span) -> Option<Expr> {
        let Some(builtin) = builtins::builtin(name) else {
            if name.starts_with("geo3d:") {
                // The prefix is unknown, which the parser has said.
                self.faulty = true;
                return None;
            }
            let shown = name.strip_prefix(builtins::GEO3D).map_or(name.to_owned(), |local| format!("geo3d:{local}"));
            let help = match crate::base::nearest(&shown, builtins::builtin_names()) {
                Some(found) => format!("did you mean `{found}`?"),
                None => "built-in functions are listed in rules/README.md".to_owned(),
            };
            self.error("R027", span, format!("unknown function `{shown}`"), help);
            return None;
        };
        if !(builtin.least..=builtin.most).contains(&args.len()) {
            let wanted = match (builtin.least, builtin.most) {
                (least, usize::MAX) => format!("at least {least}"),
                (least, most) if least == most => least.to_string(),
                (least, most) => format!("{least} to {most}"),
            };
            let message = format!("`{}` has {}, needs {wanted}", builtin.name, counted(args.len()));
            self.error("R027", span, message, "functions and their arguments are listed in rules/README.md");
            return None;
        }
        if let ("REGEX", [_, Expr::Constant(Term::String(pattern))]) = (builtin.name, args.as_slice()) {
            return match builtins::compile_pattern(pattern) {
                Ok(pattern) => args.into_iter().next().map(|text| Expr::Matches(Box::new(text), Box::new(pattern))),
                Err(reason) => {
                    self.error(
                        "R033",
                        span,
                        format!("the pattern can't be read: {reason}"),
                        "see https://docs.rs/regex/#syntax",
                    );
                    None
                }
            };
        }
        Some(Expr::Call(builtin, args))
    }
}

/// Adds a variable that is not there yet.
pub(crate) fn push_new(list: &mut Vec<Variable>, variable: Variable) {
    if !list.contains(&variable) {
        list.push(variable);
    }
}

fn operator(symbol: char) -> &'static str {
    match symbol {
        '+' => "SUM",
        '-' => "MINUS",
        '*' => "PRODUCT",
        _ => "DIVISION",
    }
}

/// Whether an aggregate occurs anywhere in it.
pub(crate) fn contains_aggregate(expression: &Expression) -> bool {
    match &expression.kind {
        ExpressionKind::Aggregate(..) => true,
        ExpressionKind::Call(_, args) | ExpressionKind::Format(args) | ExpressionKind::Tuple(args) => {
            args.iter().any(contains_aggregate)
        }
        ExpressionKind::Arithmetic(_, left, right) => contains_aggregate(left) || contains_aggregate(right),
        ExpressionKind::Negative(inner) => contains_aggregate(inner),
        _ => false,
    }
}
