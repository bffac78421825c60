//! Parser: turns tokens into statements. It continues after an error, so that one pass reports
//! several.

use crate::syntax::lex::{Spanned, Token, lex};
use crate::syntax::limits::{FAULT_LIMIT, PREFIX_LIMIT, SIZE_LIMIT};
use crate::syntax::tree::{
    AtomSyntax, Comparison, ExpressionKind, Formula, FormulaKind, LiteralSyntax, RuleSyntax,
    Statement, Syntax, Transfer,
};
use actcheck_base::{Diagnostic, Diagnostics, Source, Span, did_you_mean};

/// Directives of the language.
const DIRECTIVES: [&str; 7] = [
    "base",
    "declare",
    "export",
    "import",
    "output",
    "parameter",
    "prefix",
];

/// An error was reported and the statement is abandoned.
pub(crate) struct ErrorReported;

/// Parses a rule text. Never fails: statements with errors are left out and reported in the
/// diagnostics.
///
/// ```
/// use actcheck_base::Source;
/// use actcheck_rules::syntax::Statement;
///
/// let source = Source::new("a.rls", "p(?x) :- q(?x), ?x > 1 .\n p(1 .\n r(2) .");
/// let (syntax, diagnostics) = actcheck_rules::parse(&source);
/// assert_eq!(syntax.statements.len(), 2);
/// assert!(matches!(&syntax.statements[0], Statement::Rule(rule) if rule.body.len() == 2));
/// assert_eq!(diagnostics.iter().next().and_then(|found| found.place()).as_deref(), Some("a.rls:2:6"));
/// ```
pub fn parse(source: &Source) -> (Syntax, Diagnostics) {
    let mut diagnostics = Diagnostics::new();
    let mut syntax = Syntax {
        source: source.clone(),
        prefixes: Vec::new(),
        base: None,
        statements: Vec::new(),
        whole: false,
    };
    if source.text.len() > SIZE_LIMIT {
        let message = format!("rule text of {} bytes is too large", source.text.len());
        let help = format!("at most {SIZE_LIMIT} bytes; keep large tables of facts in a CSV file");
        diagnostics.push(
            Diagnostic::error("R006", message)
                .in_source(source)
                .help(help),
        );
        return (syntax, diagnostics);
    }
    let tokens = lex(source, &mut diagnostics);
    let mut parser = Parser {
        source,
        tokens: &tokens,
        at: 0,
        prefixes: Vec::new(),
        base: None,
        depth: 0,
        diagnostics,
    };
    while !matches!(parser.token(), Token::End) && parser.diagnostics.len() < FAULT_LIMIT {
        let start = parser.at;
        match parser.statement() {
            Ok(Some(statement)) => syntax.statements.push(statement),
            Ok(None) => {}
            Err(ErrorReported) => parser.recover(start),
        }
    }
    syntax.prefixes = parser.prefixes;
    syntax.base = parser.base;
    syntax.whole = !parser.diagnostics.has_errors();
    (syntax, parser.diagnostics)
}

pub(crate) struct Parser<'a> {
    pub(crate) source: &'a Source,
    pub(crate) tokens: &'a [Spanned],
    pub(crate) at: usize,
    pub(crate) prefixes: Vec<(String, String)>,
    pub(crate) base: Option<String>,
    pub(crate) depth: usize,
    pub(crate) diagnostics: Diagnostics,
}

impl Parser<'_> {
    pub(crate) fn token(&self) -> &Token {
        &self.tokens[self.at].token
    }

    pub(crate) fn span(&self) -> Span {
        self.tokens[self.at].span.clone()
    }

    /// Returns the end of the previous token.
    pub(crate) fn end(&self) -> usize {
        self.at
            .checked_sub(1)
            .map_or(0, |at| self.tokens[at].span.end)
    }

    pub(crate) fn advance(&mut self) {
        if self.at + 1 < self.tokens.len() {
            self.at += 1;
        }
    }

    pub(crate) fn is(&self, symbol: &str) -> bool {
        matches!(self.token(), Token::Symbol(s) if *s == symbol)
    }

    pub(crate) fn take(&mut self, symbol: &str) -> bool {
        let found = self.is(symbol);
        if found {
            self.advance();
        }
        found
    }

    pub(crate) fn expect(&mut self, symbol: &str, place: &str) -> Result<(), ErrorReported> {
        if self.take(symbol) {
            Ok(())
        } else {
            Err(self.unexpected(&format!("`{symbol}` {place}")))
        }
    }

    pub(crate) fn fault(
        &mut self,
        code: &'static str,
        span: Span,
        message: impl Into<String>,
        help: impl Into<String>,
    ) -> ErrorReported {
        self.diagnostics.push(
            Diagnostic::error(code, message)
                .at(self.source, span)
                .help(help),
        );
        ErrorReported
    }

    pub(crate) fn unexpected(&mut self, wanted: &str) -> ErrorReported {
        if let Some(fault) = self.unfinished(wanted) {
            return fault;
        }
        let message = format!("expected {wanted}, found {}", describe(self.token()));
        let text = &self.source.text[self.span().start..];
        let before = &self.source.text[..self.end()];
        let help = match self.token() {
            _ if text.starts_with("<-") || text.starts_with("<=") => {
                "a rule is written `head(…) :- body(…) .`"
            }
            Token::Symbol("=") if before.ends_with('=') => "equality is written `=`",
            Token::Name(_) | Token::Prefixed(..) if before.ends_with("not") => {
                "negation is written `~atom(…)`"
            }
            Token::Name(_) if before.ends_with(|c: char| c.is_ascii_digit()) => {
                "numbers are written without a unit, in metres, radians, seconds and kilograms"
            }
            Token::End => "end the statement with `.`",
            Token::Symbol(":-") => {
                "a rule has one `:-`; the statement before it may lack its final `.`"
            }
            Token::Symbol(";") => "write one rule for each alternative",
            _ => "a rule has the form `head(?x) :- atom(?x), ~atom(?x), ?x > 1 .`",
        };
        let span = self.span();
        self.fault("R010", span, message, help)
    }

    /// Reports a statement without its full stop at its end, if the next token begins a statement
    /// in another line.
    fn unfinished(&mut self, wanted: &str) -> Option<ErrorReported> {
        let (end, next) = (self.end(), self.span().start);
        let begins = matches!(
            self.token(),
            Token::Name(_) | Token::Directive(_) | Token::AttributeOpen
        );
        let is_next = begins
            && self.source.text[end..next].contains('\n')
            && self.source.text[..next].ends_with('\n');
        (is_next && wanted.starts_with("`.` ")).then(|| {
            let help = "end every statement with ` .`";
            self.fault(
                "R010",
                end.saturating_sub(1)..end,
                "the statement has no `.` at its end",
                help,
            )
        })
    }

    /// Skips past the next dot, or to a token that can only begin a statement.
    fn recover(&mut self, start: usize) {
        if self.at == start {
            self.advance();
        }
        loop {
            match self.token() {
                Token::End | Token::Directive(_) | Token::AttributeOpen => return,
                Token::Symbol(".") => return self.advance(),
                _ => self.advance(),
            }
        }
    }

    fn statement(&mut self) -> Result<Option<Statement>, ErrorReported> {
        if let Token::Directive(name) = self.token().clone() {
            return self.directive(&name);
        }
        let name = self.attributes()?;
        self.rule(name).map(|rule| Some(Statement::Rule(rule)))
    }

    /// Parses attributes and returns the text of `#[name("…")]`. Other attributes are skipped.
    fn attributes(&mut self) -> Result<Option<String>, ErrorReported> {
        let mut name = None;
        while matches!(self.token(), Token::AttributeOpen) {
            self.advance();
            let mut open = 1;
            let mut is_name = false;
            while open > 0 {
                match self.token() {
                    Token::Symbol("[") => open += 1,
                    Token::Symbol("]") => open -= 1,
                    Token::Name(word) => is_name = word == "name",
                    Token::String(text) if is_name => name = Some(text.clone()),
                    Token::End => return Err(self.unexpected("`]` at the end of the attribute")),
                    _ => {}
                }
                self.advance();
            }
        }
        Ok(name)
    }

    fn rule(&mut self, name: Option<String>) -> Result<RuleSyntax, ErrorReported> {
        let start = self.span().start;
        let comment = self.comment_above(start);
        let mut heads = vec![self.atom("a predicate or a directive at the start of a statement")?];
        while self.take(",") {
            heads.push(self.atom("an atom of the head")?);
        }
        let mut body = Vec::new();
        if self.take(":-") {
            loop {
                body.push(self.literal()?);
                if !self.take(",") {
                    break;
                }
            }
        }
        self.expect(".", "at the end of the statement")?;
        Ok(RuleSyntax {
            name,
            heads,
            body,
            span: start..self.end(),
            comment,
        })
    }

    /// Returns the comment lines directly above a place, joined. Returns `None` if there are none.
    fn comment_above(&self, start: usize) -> Option<String> {
        let before = self.source.text.get(..start)?.trim_end_matches([' ', '\t']);
        if !before.ends_with('\n') {
            return None;
        }
        let mut lines: Vec<&str> = Vec::new();
        for line in before.lines().rev() {
            let line = line.trim();
            match line.strip_prefix('%') {
                Some(text) => lines.push(text.trim_start_matches(['%', '!']).trim()),
                None => break,
            }
        }
        lines.reverse();
        let text = lines.join(" ").trim().to_owned();
        (!text.is_empty()).then_some(text)
    }

    fn literal(&mut self) -> Result<LiteralSyntax, ErrorReported> {
        if self.take("~") {
            if self.begins_formula() {
                let start = self.tokens[self.at - 1].span.start;
                let formula = self.temporal()?;
                let span = start..formula.span.end;
                return Ok(LiteralSyntax::Temporal(Formula {
                    kind: FormulaKind::Not(Box::new(formula)),
                    span,
                }));
            }
            return Ok(LiteralSyntax::Negated(self.atom("an atom after `~`")?));
        }
        if self.begins_formula() {
            return Ok(LiteralSyntax::Temporal(self.temporal()?));
        }
        let start = self.at;
        let left = self.expression()?;
        let Some(op) = self.comparison() else {
            let name_span = self.tokens[start].span.clone();
            return match left.kind {
                ExpressionKind::Call(predicate, args) => Ok(LiteralSyntax::Atom(AtomSyntax {
                    predicate,
                    args,
                    span: left.span,
                    name_span,
                })),
                _ => Err(self.unexpected("a comparison")),
            };
        };
        let right = self.expression()?;
        let span = left.span.start..right.span.end;
        Ok(LiteralSyntax::Comparison {
            op,
            left,
            right,
            span,
        })
    }

    /// Takes a comparison operator, if one is next.
    pub(super) fn comparison(&mut self) -> Option<Comparison> {
        let op = match self.token() {
            Token::Symbol("=") => Comparison::Equal,
            Token::Symbol("!=") => Comparison::Unequal,
            Token::Symbol("<") => Comparison::Less,
            Token::Symbol("<=") => Comparison::LessEqual,
            Token::Symbol(">") => Comparison::Greater,
            Token::Symbol(">=") => Comparison::GreaterEqual,
            _ => return None,
        };
        self.advance();
        Some(op)
    }

    pub(crate) fn atom(&mut self, wanted: &str) -> Result<AtomSyntax, ErrorReported> {
        let name_span = self.span();
        let predicate = self.predicate(wanted)?;
        self.expect("(", &format!("after the predicate `{predicate}`"))?;
        let args = self.expressions(")")?;
        Ok(AtomSyntax {
            predicate,
            args,
            span: name_span.start..self.end(),
            name_span,
        })
    }

    /// Parses a predicate: a name, prefixed name or IRI.
    pub(crate) fn predicate(&mut self, wanted: &str) -> Result<String, ErrorReported> {
        let span = self.span();
        let predicate = match self.token().clone() {
            Token::Name(name) => name,
            Token::Prefixed(prefix, local) => self.expand(&prefix, &local, span),
            Token::Iri(iri) => self.resolve(&iri),
            _ => return Err(self.unexpected(wanted)),
        };
        self.advance();
        Ok(predicate)
    }

    fn directive(&mut self, name: &str) -> Result<Option<Statement>, ErrorReported> {
        let start = self.span();
        self.advance();
        let statement = match name {
            "prefix" => self.prefix()?,
            "base" => self.base()?,
            "parameter" => Some(self.parameter(start.start)?),
            "import" | "export" => Some(Statement::Transfer(
                self.transfer(name == "import", start.start)?,
            )),
            "output" => Some(self.output()?),
            "declare" => Some(self.declare(start.start)?),
            _ => {
                let help = did_you_mean(name, DIRECTIVES);
                return Err(self.fault(
                    "R011",
                    start,
                    format!("unknown directive `@{name}`"),
                    help,
                ));
            }
        };
        self.expect(".", "at the end of the directive")?;
        Ok(statement)
    }

    fn prefix(&mut self) -> Result<Option<Statement>, ErrorReported> {
        let Token::Prefixed(prefix, local) = self.token().clone() else {
            // In `@prefix : <…>` the colon is a token of its own.
            if self.take(":") {
                return self.namespace(String::new());
            }
            return Err(self.unexpected("a prefix such as `w:`"));
        };
        if !local.is_empty() {
            return Err(self.unexpected("a prefix such as `w:`"));
        }
        self.advance();
        self.namespace(prefix)
    }

    fn namespace(&mut self, prefix: String) -> Result<Option<Statement>, ErrorReported> {
        let span = self.span();
        let Token::Iri(iri) = self.token().clone() else {
            return Err(self.unexpected("a namespace such as `<https://example.org/>`"));
        };
        self.advance();
        let namespace = self.resolve(&iri);
        self.prefixes.retain(|(known, _)| *known != prefix);
        if self.prefixes.len() == PREFIX_LIMIT {
            let help = "write the other names as IRIs in `<…>`";
            return Err(self.fault(
                "R006",
                span,
                format!("more than {PREFIX_LIMIT} prefixes"),
                help,
            ));
        }
        self.prefixes.push((prefix, namespace));
        Ok(None)
    }

    fn base(&mut self) -> Result<Option<Statement>, ErrorReported> {
        let Token::Iri(iri) = self.token().clone() else {
            return Err(self.unexpected("an IRI such as `<https://example.org/>`"));
        };
        self.advance();
        self.base = Some(iri);
        Ok(None)
    }

    fn parameter(&mut self, start: usize) -> Result<Statement, ErrorReported> {
        let Token::Global(name) = self.token().clone() else {
            return Err(self.unexpected("a parameter such as `$limit`"));
        };
        self.advance();
        let value = if self.take("=") {
            Some(self.expression()?)
        } else {
            None
        };
        Ok(Statement::Parameter {
            name,
            value,
            span: start..self.end(),
        })
    }

    fn transfer(&mut self, import: bool, start: usize) -> Result<Transfer, ErrorReported> {
        let predicate = self.predicate("a predicate")?;
        self.expect(":-", "after the predicate")?;
        let Token::Name(format) = self.token().clone() else {
            return Err(self.unexpected("a format such as `csv`"));
        };
        self.advance();
        self.expect("{", "after the format")?;
        let mut options = Vec::new();
        while !self.take("}") {
            let Token::Name(key) = self.token().clone() else {
                return Err(self.unexpected("an option such as `resource`"));
            };
            self.advance();
            self.expect("=", "after the option's name")?;
            options.push((key, self.option_value()?));
            if !self.is("}") {
                self.expect(",", "between options")?;
            }
        }
        let mut bindings = Vec::new();
        while self.take(",") {
            let Token::Variable(variable) = self.token().clone() else {
                return Err(self.unexpected("an assignment such as `?x = 1`"));
            };
            self.advance();
            self.expect("=", "after the variable")?;
            bindings.push((variable, self.expression()?));
        }
        Ok(Transfer {
            import,
            predicate,
            format,
            options,
            bindings,
            span: start..self.end(),
        })
    }

    fn output(&mut self) -> Result<Statement, ErrorReported> {
        let mut predicates = vec![self.predicate("a predicate")?];
        while self.take(",") {
            predicates.push(self.predicate("a predicate")?);
        }
        Ok(Statement::Output { predicates })
    }

    fn declare(&mut self, start: usize) -> Result<Statement, ErrorReported> {
        let name = self.predicate("a predicate")?;
        self.expect("(", "after the predicate")?;
        let mut columns = 1;
        while !self.take(")") {
            match self.token() {
                Token::End | Token::Symbol(".") => return Err(self.unexpected("`)`")),
                Token::Symbol(",") => columns += 1,
                _ => {}
            }
            self.advance();
        }
        Ok(Statement::Declare {
            name,
            arity: columns,
            span: start..self.end(),
        })
    }
}

/// Describes a token in a message.
pub(crate) fn describe(token: &Token) -> String {
    match token {
        Token::Name(name) => format!("`{name}`"),
        Token::Prefixed(prefix, local) => format!("`{prefix}:{local}`"),
        Token::Iri(iri) => format!("`<{iri}>`"),
        Token::Variable(name) => format!("`?{name}`"),
        Token::Existential(name) => format!("`!{name}`"),
        Token::Global(name) => format!("`${name}`"),
        Token::Anonymous => "`_`".into(),
        Token::Blank(label) => format!("`_:{label}`"),
        Token::String(_) | Token::Format(_) => "a string".into(),
        Token::Language(tag) => format!("`@{tag}`"),
        Token::Number(text) => format!("`{text}`"),
        Token::Directive(name) => format!("`@{name}`"),
        Token::Aggregate(name) => format!("`#{name}`"),
        Token::AttributeOpen => "`#[`".into(),
        Token::Symbol(symbol) => format!("`{symbol}`"),
        Token::End => "the end of the text".into(),
    }
}
