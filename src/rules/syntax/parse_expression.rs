//! Parser for expressions: terms, calls, arithmetic.

use crate::builtins;
use crate::model::values::{double_term, integer, literal};
use crate::syntax::lex::{FormatPiece, Token};
use crate::syntax::limits::ARGUMENT_LIMIT;
use crate::syntax::parse::{ErrorReported, Parser};
use crate::syntax::tree::{Expression, ExpressionKind};
use actcheck_base::{Span, Term, did_you_mean, names};

/// Maximum nesting depth of expressions, so that recursion over them is safe everywhere.
pub(super) const DEPTH_LIMIT: usize = 64;
/// Maximum number of operators in one chain (`a + b + …`), which is the depth of its tree on the
/// left side.
const CHAIN_LIMIT: usize = 256;

impl Parser<'_> {
    /// Parses a sum of products.
    pub(crate) fn expression(&mut self) -> Result<Expression, ErrorReported> {
        let help = "name parts of it with assignments such as `?part = …`";
        self.nested("expression is nested too deeply", help, |parser| {
            parser.chain(&["+", "-"], |parser| {
                parser.chain(&["*", "/"], Self::factor)
            })
        })
    }

    /// Parses a part one level deeper; reports `R005` at the present token if that is too deep.
    pub(super) fn nested<T>(
        &mut self,
        message: &str,
        help: &str,
        part: impl FnOnce(&mut Self) -> Result<T, ErrorReported>,
    ) -> Result<T, ErrorReported> {
        if self.depth >= DEPTH_LIMIT {
            let span = self.span();
            return Err(self.fault(
                "R005",
                span,
                message,
                format!("at most {DEPTH_LIMIT} levels; {help}"),
            ));
        }
        self.depth += 1;
        let result = part(self);
        self.depth -= 1;
        result
    }

    fn chain(
        &mut self,
        operators: &[&'static str],
        mut part: impl FnMut(&mut Self) -> Result<Expression, ErrorReported>,
    ) -> Result<Expression, ErrorReported> {
        let mut left = part(self)?;
        let mut length = 0;
        while let Some(operator) = operators.iter().find(|operator| self.is(operator)) {
            self.advance();
            let right = part(self)?;
            let span = left.span.start..right.span.end;
            length += 1;
            if length > CHAIN_LIMIT {
                let help = "name parts of it with assignments such as `?part = …`";
                return Err(self.fault("R005", span, "chain of operators is too long", help));
            }
            let symbol = operator.chars().next().unwrap_or('+');
            left = Expression {
                kind: ExpressionKind::Arithmetic(symbol, Box::new(left), Box::new(right)),
                span,
            };
        }
        Ok(left)
    }

    fn factor(&mut self) -> Result<Expression, ErrorReported> {
        let start = self.span().start;
        if self.take("(") {
            let inner = self.expression()?;
            self.expect(")", "at the end of the parenthesis")?;
            return Ok(Expression {
                kind: inner.kind,
                span: start..self.end(),
            });
        }
        if self.is("-") || self.is("+") {
            let negative = self.is("-");
            self.advance();
            if let Token::Number(text) = self.token().clone() {
                let span = start..self.span().end;
                self.advance();
                return Ok(self.number(&text, negative, span));
            }
            let inner = self.nested(
                "expression is nested too deeply",
                "remove some of the signs",
                Self::factor,
            )?;
            if !negative {
                return Ok(inner);
            }
            let span = start..inner.span.end;
            return Ok(Expression {
                kind: ExpressionKind::Negative(Box::new(inner)),
                span,
            });
        }
        self.primary()
    }

    fn primary(&mut self) -> Result<Expression, ErrorReported> {
        let span = self.span();
        let kind = match self.token().clone() {
            Token::Variable(name) => ExpressionKind::Variable(name),
            Token::Existential(name) => ExpressionKind::Existential(name),
            Token::Global(name) => ExpressionKind::Global(name),
            Token::Anonymous => ExpressionKind::Anonymous,
            Token::Blank(label) => ExpressionKind::Constant(Term::Blank(label.into())),
            Token::Number(text) => {
                self.advance();
                return Ok(self.number(&text, false, span));
            }
            Token::String(text) => {
                self.advance();
                return Ok(self.string(text, span.start));
            }
            Token::Format(pieces) => {
                self.advance();
                return self.format(pieces, span);
            }
            Token::Aggregate(name) => {
                self.advance();
                self.expect("(", "after the aggregate")?;
                let args = self.expressions(")")?;
                let span = span.start..self.end();
                return Ok(Expression {
                    kind: ExpressionKind::Aggregate(name, args),
                    span,
                });
            }
            Token::Name(_) | Token::Prefixed(..) | Token::Iri(_) => return self.name_or_call(),
            Token::Symbol("{") => {
                let help = "write one fact for each entry; JSON files are imported as facts with three arguments";
                return Err(self.fault("R012", span, "maps are not supported", help));
            }
            _ => return Err(self.unexpected("a term")),
        };
        self.advance();
        Ok(Expression { kind, span })
    }

    /// Parses a constant, or a call if a parenthesis follows.
    fn name_or_call(&mut self) -> Result<Expression, ErrorReported> {
        let span = self.span();
        let token = self.token().clone();
        let name = match &token {
            Token::Name(name) => name.clone(),
            Token::Prefixed(prefix, local) => self.expand(prefix, local, span.clone()),
            Token::Iri(iri) => self.resolve(iri),
            _ => return Err(self.unexpected("a name")),
        };
        self.advance();
        if self.take("(") {
            let args = self.expressions(")")?;
            return Ok(Expression {
                kind: ExpressionKind::Call(name, args),
                span: span.start..self.end(),
            });
        }
        let term = match token {
            Token::Name(word) if word == "true" => Term::Boolean(true),
            Token::Name(word) if word == "false" => Term::Boolean(false),
            Token::Name(word) => Term::iri(self.resolve(&word)),
            _ => Term::iri(name),
        };
        Ok(Expression {
            kind: ExpressionKind::Constant(term),
            span,
        })
    }

    /// Parses expressions separated by commas up to a closing symbol. A trailing comma is allowed.
    pub(crate) fn expressions(
        &mut self,
        close: &'static str,
    ) -> Result<Vec<Expression>, ErrorReported> {
        let mut found = Vec::new();
        while !self.take(close) {
            found.push(self.expression()?);
            if found.len() > ARGUMENT_LIMIT {
                let span = self.span();
                let help = "split the values over several facts or assignments";
                return Err(self.fault(
                    "R006",
                    span,
                    format!("more than {ARGUMENT_LIMIT} arguments"),
                    help,
                ));
            }
            if !self.is(close) {
                self.expect(",", &format!("or `{close}`"))?;
            }
        }
        Ok(found)
    }

    /// Parses the value of an import option: an expression or a tuple of expressions.
    pub(crate) fn option_value(&mut self) -> Result<Expression, ErrorReported> {
        let start = self.span().start;
        if self.is("(") {
            self.advance();
            let items = self.expressions(")")?;
            return Ok(Expression {
                kind: ExpressionKind::Tuple(items),
                span: start..self.end(),
            });
        }
        self.expression()
    }

    /// Parses the optional language tag or datatype after a string.
    fn string(&mut self, text: String, start: usize) -> Expression {
        let term = match self.token().clone() {
            Token::Language(tag) => {
                self.advance();
                Term::LangString(text.into(), tag.into())
            }
            Token::Symbol("^^") => {
                self.advance();
                match self.predicate("a datatype after `^^`") {
                    Ok(datatype) => literal(&text, &datatype),
                    Err(ErrorReported) => {
                        return Expression {
                            kind: ExpressionKind::Broken,
                            span: start..self.end(),
                        };
                    }
                }
            }
            _ => Term::string(text),
        };
        Expression {
            kind: ExpressionKind::Constant(term),
            span: start..self.end(),
        }
    }

    fn format(
        &mut self,
        pieces: Vec<FormatPiece>,
        span: Span,
    ) -> Result<Expression, ErrorReported> {
        let mut parts = Vec::new();
        for piece in pieces {
            match piece {
                FormatPiece::Text(text) if text.is_empty() => {}
                FormatPiece::Text(text) => parts.push(Expression {
                    kind: ExpressionKind::Constant(Term::string(text)),
                    span: span.clone(),
                }),
                FormatPiece::Code(tokens) => {
                    let mut inner = Parser {
                        source: self.source,
                        tokens: &tokens,
                        at: 0,
                        prefixes: std::mem::take(&mut self.prefixes),
                        base: self.base.clone(),
                        depth: self.depth + 1,
                        diagnostics: std::mem::take(&mut self.diagnostics),
                    };
                    let part = inner.expression().and_then(|part| match inner.token() {
                        Token::End => Ok(part),
                        _ => Err(inner.unexpected("`}`")),
                    });
                    self.prefixes = inner.prefixes;
                    self.diagnostics = inner.diagnostics;
                    parts.push(part?);
                }
            }
        }
        Ok(Expression {
            kind: ExpressionKind::Format(parts),
            span,
        })
    }

    fn number(&mut self, text: &str, negative: bool, span: Span) -> Expression {
        let sign = if negative { "-" } else { "" };
        let radix = match text.get(..2) {
            Some("0b") => Some(2),
            Some("0o") => Some(8),
            Some("0x") => Some(16),
            _ => None,
        };
        let plain = text.trim_end_matches(['f', 'd']);
        let term = match radix {
            Some(radix) => i128::from_str_radix(&format!("{sign}{}", &text[2..]), radix)
                .ok()
                .map(encoded_integer),
            None if plain.len() == text.len() && text.bytes().all(|b| b.is_ascii_digit()) => {
                integer(&format!("{sign}{text}"))
            }
            None => format!("{sign}{plain}")
                .parse::<f64>()
                .ok()
                .filter(|v| v.is_finite())
                .map(double_term),
        };
        match term {
            Some(term) => Expression {
                kind: ExpressionKind::Constant(term),
                span,
            },
            None => {
                let help = "doubles reach up to about 1.8e308; integers in other bases than ten have up to 127 bits";
                self.fault(
                    "R013",
                    span.clone(),
                    format!("number `{text}` is out of range"),
                    help,
                );
                Expression {
                    kind: ExpressionKind::Broken,
                    span,
                }
            }
        }
    }

    /// Returns the IRI of a prefixed name. Reports an undeclared prefix and then returns the name
    /// as written.
    pub(crate) fn expand(&mut self, prefix: &str, local: &str, span: Span) -> String {
        let declared = self
            .prefixes
            .iter()
            .find(|(known, _)| known == prefix)
            .map(|(_, namespace)| namespace.clone());
        let known = || {
            names::PREFIXES
                .iter()
                .find(|(known, _)| *known == prefix)
                .map(|(_, n)| (*n).to_owned())
        };
        match declared.or_else(known) {
            Some(namespace) => format!("{namespace}{local}"),
            None => {
                let candidates: Vec<String> = self
                    .prefixes
                    .iter()
                    .map(|(known, _)| known.clone())
                    .chain(names::PREFIXES.iter().map(|(known, _)| (*known).to_owned()))
                    .collect();
                let help = match prefix {
                    "geo3d" => format!(
                        "declare the extension with `@prefix geo3d: <{}> .`",
                        builtins::GEO3D
                    ),
                    _ => format!(
                        "declare it with `@prefix {prefix}: <…> .`, or {}",
                        did_you_mean(prefix, candidates.iter().map(String::as_str))
                    ),
                };
                self.fault("R014", span, format!("unknown prefix `{prefix}:`"), help);
                format!("{prefix}:{local}")
            }
        }
    }

    /// Resolves a relative IRI against the base, if one is declared.
    pub(crate) fn resolve(&self, iri: &str) -> String {
        let absolute = iri.split_once(':').is_some_and(|(scheme, _)| {
            !scheme.is_empty()
                && scheme
                    .chars()
                    .all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
        });
        match &self.base {
            Some(base) if !absolute => format!("{base}{iri}"),
            _ => iri.to_owned(),
        }
    }
}

/// Converts an integer written in binary, octal or hexadecimal. Above 64 bits the datatype is the
/// text `xsd:integer` instead of an IRI, as in Nemo's published test tables.
fn encoded_integer(value: i128) -> Term {
    match i64::try_from(value) {
        Ok(value) => Term::Integer(value),
        Err(_) => Term::Literal(value.to_string().into(), "xsd:integer".into()),
    }
}
