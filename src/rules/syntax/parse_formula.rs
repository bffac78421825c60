//! Parser for formulas over the course of an action: temporal operators, `and`, `or`, `implies`,
//! `~` and comparisons.

use crate::syntax::lex::Token;
use crate::syntax::parse::{ErrorReported, Parser};
use crate::syntax::parse_expression::DEPTH_LIMIT;
use crate::syntax::tree::{ExpressionKind, Formula, FormulaKind, TemporalOperator};

/// Maximum number of parts of one `and` or `or`.
const PARTS_LIMIT: usize = 256;

impl Parser<'_> {
    /// Returns whether a formula begins here: a temporal operator with a bound, or with a part that
    /// differs from a plain term.
    ///
    /// `until(?x, ?y)` is an atom, as in programs that have a predicate of this name.
    pub(super) fn begins_formula(&self) -> bool {
        let Token::Name(name) = self.token() else {
            return false;
        };
        if TemporalOperator::named(name).is_none() {
            return false;
        }
        match self.token_at(self.at + 1) {
            Token::Symbol("[") => true,
            Token::Symbol("(") => self.has_formula(self.at + 1, true),
            _ => false,
        }
    }

    fn token_at(&self, at: usize) -> &Token {
        self.tokens
            .get(at)
            .map_or(&Token::End, |spanned| &spanned.token)
    }

    /// Returns whether the parenthesis that opens at a token contains a comparison, a connective, a
    /// temporal operator or, if asked for, a quantity such as `w:held(?o)`. Only its own level
    /// counts.
    fn has_formula(&self, open: usize, quantities: bool) -> bool {
        let mut depth = 0usize;
        for at in open.. {
            let next = self.token_at(at + 1);
            match self.token_at(at) {
                Token::Symbol("(" | "[" | "{") => depth += 1,
                Token::Symbol(")" | "]" | "}") => {
                    depth -= 1;
                    if depth == 0 {
                        return false;
                    }
                }
                Token::End | Token::Symbol(".") => return false,
                _ if depth > 1 => {}
                Token::Symbol("=" | "!=" | "<" | "<=" | ">" | ">=" | "~") => return true,
                Token::Name(word) if matches!(word.as_str(), "and" | "or" | "implies") => {
                    return true;
                }
                Token::Name(word) if TemporalOperator::named(word).is_some() => {
                    return matches!(next, Token::Symbol("(" | "["));
                }
                Token::Prefixed(prefix, _)
                    if quantities && prefix != "geo3d" && *next == Token::Symbol("(") =>
                {
                    return true;
                }
                _ => {}
            }
            if depth == 2
                && quantities
                && self.tokens[at].token == Token::Symbol("(")
                && self.opens_group(at)
            {
                return true;
            }
        }
        false
    }

    /// Returns whether a parenthesis groups a formula, instead of arguments or of an arithmetic
    /// expression.
    fn opens_group(&self, open: usize) -> bool {
        let before = open
            .checked_sub(1)
            .map_or(&Token::End, |at| self.token_at(at));
        !matches!(before, Token::Name(_) | Token::Prefixed(..) | Token::Iri(_))
            && self.has_formula(open, false)
    }

    /// Parses a temporal operator with its bound and parts.
    pub(super) fn temporal(&mut self) -> Result<Formula, ErrorReported> {
        let span = self.span();
        let operator = match self.token() {
            Token::Name(name) => TemporalOperator::named(name),
            _ => None,
        };
        let Some(operator) = operator else {
            return Err(self.unexpected("a temporal operator"));
        };
        self.advance();
        let bound = if self.take("[") {
            let from = self.expression()?;
            self.expect(",", "between the two ends of the interval")?;
            let to = self.expression()?;
            self.expect("]", "at the end of the interval")?;
            Some([from, to])
        } else {
            None
        };
        self.expect("(", &format!("after `{}`", operator.name()))?;
        let mut parts = vec![self.formula()?];
        while self.take(",") {
            parts.push(self.formula()?);
        }
        self.expect(")", &format!("at the end of `{}`", operator.name()))?;
        let span = span.start..self.end();
        if parts.len() != operator.parts() {
            let (message, help) = if operator.parts() == 2 {
                (
                    format!("`{}` has two parts", operator.name()),
                    "write `until(first, second)`: the first holds until the second does",
                )
            } else {
                (
                    format!("`{}` has one part", operator.name()),
                    "join conditions by `and`",
                )
            };
            return Err(self.fault("R051", span, message, help));
        }
        Ok(Formula {
            kind: FormulaKind::Temporal {
                operator,
                bound,
                parts,
            },
            span,
        })
    }

    /// Parses a formula: `implies` binds weakest, then `or`, then `and`.
    fn formula(&mut self) -> Result<Formula, ErrorReported> {
        self.nested(
            "formula is nested too deeply",
            "split the formula over several rules",
            Self::implication,
        )
    }

    fn implication(&mut self) -> Result<Formula, ErrorReported> {
        let left = self.joined(
            "or",
            |parser| parser.joined("and", Self::simple, FormulaKind::And),
            FormulaKind::Or,
        )?;
        if !self.take_word("implies") {
            return Ok(left);
        }
        let right = self.formula()?;
        let span = left.span.start..right.span.end;
        Ok(Formula {
            kind: FormulaKind::Implies(Box::new(left), Box::new(right)),
            span,
        })
    }

    fn joined(
        &mut self,
        word: &str,
        mut part: impl FnMut(&mut Self) -> Result<Formula, ErrorReported>,
        kind: impl Fn(Vec<Formula>) -> FormulaKind,
    ) -> Result<Formula, ErrorReported> {
        let first = part(self)?;
        let mut parts = vec![first];
        while self.take_word(word) {
            parts.push(part(self)?);
            if parts.len() > PARTS_LIMIT {
                let span = self.span();
                let help = "split the formula over several rules";
                return Err(self.fault(
                    "R006",
                    span,
                    format!("more than {PARTS_LIMIT} parts"),
                    help,
                ));
            }
        }
        if parts.len() == 1 {
            return parts.pop().ok_or(ErrorReported);
        }
        let span = parts[0].span.start..self.end();
        Ok(Formula {
            kind: kind(parts),
            span,
        })
    }

    fn take_word(&mut self, word: &str) -> bool {
        let found = matches!(self.token(), Token::Name(name) if name == word);
        if found {
            self.advance();
        }
        found
    }

    /// Parses a negation, a temporal operator, a group, a comparison, or a quantity that is true or
    /// false.
    fn simple(&mut self) -> Result<Formula, ErrorReported> {
        let start = self.span().start;
        if self.take("~") {
            let inner = self.nested(
                "formula is nested too deeply",
                "remove some of the negations",
                Self::simple,
            )?;
            let span = start..inner.span.end;
            return Ok(Formula {
                kind: FormulaKind::Not(Box::new(inner)),
                span,
            });
        }
        let is_operator =
            matches!(self.token(), Token::Name(name) if TemporalOperator::named(name).is_some());
        if is_operator && matches!(self.token_at(self.at + 1), Token::Symbol("(" | "[")) {
            return self.temporal();
        }
        if self.is("(") && (self.has_formula(self.at, false) || self.opens_nested_group()) {
            self.advance();
            let inner = self.formula()?;
            self.expect(")", "at the end of the group")?;
            return Ok(Formula {
                kind: inner.kind,
                span: start..self.end(),
            });
        }
        let left = self.expression()?;
        let Some(op) = self.comparison() else {
            return match left.kind {
                ExpressionKind::Call(..) => Ok(Formula {
                    span: left.span.clone(),
                    kind: FormulaKind::Signal(left),
                }),
                _ => Err(self.unexpected("a comparison")),
            };
        };
        let right = self.expression()?;
        let span = start..self.end();
        Ok(Formula {
            kind: FormulaKind::Compare(op, left, right),
            span,
        })
    }

    /// Returns whether a group of groups begins here: `((a < 1))`.
    fn opens_nested_group(&self) -> bool {
        let mut at = self.at;
        while *self.token_at(at) == Token::Symbol("(") && at < self.at + DEPTH_LIMIT {
            at += 1;
        }
        at > self.at + 1 && (self.at + 1..at).any(|open| self.has_formula(open, false))
    }
}
