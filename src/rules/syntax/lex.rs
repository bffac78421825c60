//! Lexer: splits a rule text into tokens with source spans.

use crate::syntax::limits::FAULT_LIMIT;
use actcheck_base::{Diagnostic, Diagnostics, Source, Span};

/// A token. Text is already decoded: without quotes and without sigils such as `?` or `$`.
#[derive(Debug, Clone, PartialEq)]
pub enum Token {
    /// A bare name: predicate, constant, built-in, format.
    Name(String),
    /// `prefix:local`, either part possibly empty.
    Prefixed(String, String),
    /// `<…>`, as written.
    Iri(String),
    /// `?x`.
    Variable(String),
    /// `!x`: a new thing.
    Existential(String),
    /// `$x`: a parameter of the program.
    Global(String),
    /// `_`.
    Anonymous,
    /// `_:label`.
    Blank(String),
    /// A string, with escapes resolved.
    String(String),
    /// `@en` directly after a string.
    Language(String),
    /// The pieces of an f-string.
    Format(Vec<FormatPiece>),
    /// A number as written, without sign.
    Number(String),
    /// A directive, for example `@import`.
    Directive(String),
    /// An aggregate, for example `#count`.
    Aggregate(String),
    /// `#[`.
    AttributeOpen,
    /// Punctuation and operators.
    Symbol(&'static str),
    /// The end of the text.
    End,
}

/// One piece of an f-string.
#[derive(Debug, Clone, PartialEq)]
pub enum FormatPiece {
    /// Literal text.
    Text(String),
    /// An expression: its tokens, closed by [`Token::End`].
    Code(Vec<Spanned>),
}

/// A token with its place in the source.
#[derive(Debug, Clone, PartialEq)]
pub struct Spanned {
    /// The token.
    pub token: Token,
    /// Its place. Unit: bytes of the source.
    pub span: Span,
}

/// Splits a text into tokens. Errors are reported and skipped; the last token is always
/// [`Token::End`].
pub fn lex(source: &Source, diagnostics: &mut Diagnostics) -> Vec<Spanned> {
    Lexer {
        source,
        text: &source.text,
        at: 0,
        end: source.text.len(),
        depth: 0,
        diagnostics,
    }
    .run()
}

pub(crate) struct Lexer<'a> {
    pub(crate) source: &'a Source,
    pub(crate) text: &'a str,
    pub(crate) at: usize,
    pub(crate) end: usize,
    pub(crate) depth: usize,
    diagnostics: &'a mut Diagnostics,
}

/// A symbol comes before its own prefixes, so that the longest one matches.
const SYMBOLS: [&str; 25] = [
    ":-", ">=", "<=", "!=", "^^", "(", ")", "{", "}", "[", "]", ",", ".", "~", "=", "<", ">", "+",
    "-", "*", "/", ":", "|", ";", "&",
];

impl Lexer<'_> {
    fn run(mut self) -> Vec<Spanned> {
        let mut tokens = Vec::new();
        if self.rest().starts_with('\u{feff}') {
            self.at += '\u{feff}'.len_utf8();
        }
        loop {
            self.skip_blank();
            let start = self.at;
            if self.at >= self.end {
                tokens.push(Spanned {
                    token: Token::End,
                    span: start..start,
                });
                return tokens;
            }
            if let Some(token) = self.next(tokens.last()) {
                tokens.push(Spanned {
                    token,
                    span: start..self.at,
                });
            }
        }
    }

    pub(crate) fn rest(&self) -> &str {
        &self.text[self.at..self.end]
    }

    pub(crate) fn peek(&self) -> Option<char> {
        self.rest().chars().next()
    }

    fn peek_second(&self) -> Option<char> {
        self.rest().chars().nth(1)
    }

    fn take_while(&mut self, mut keep: impl FnMut(char) -> bool) -> String {
        let taken: String = self.rest().chars().take_while(|c| keep(*c)).collect();
        self.at += taken.len();
        taken
    }

    pub(crate) fn error(&mut self, code: &'static str, span: Span, message: String, help: &str) {
        if self.diagnostics.len() < FAULT_LIMIT {
            self.diagnostics.push(
                Diagnostic::error(code, message)
                    .at(self.source, span)
                    .help(help),
            );
        }
    }

    /// Skips white space and comments of both forms.
    pub(crate) fn skip_blank(&mut self) {
        loop {
            self.take_while(char::is_whitespace);
            if self.rest().starts_with('%') {
                self.take_while(|c| c != '\n');
            } else if self.rest().starts_with("/*") {
                let start = self.at;
                match self.rest().find("*/") {
                    Some(length) => self.at += length + 2,
                    None => {
                        self.at = self.end;
                        self.error(
                            "R001",
                            start..start + 2,
                            "comment has no end".into(),
                            "close it with `*/`",
                        );
                    }
                }
            } else {
                return;
            }
        }
    }

    pub(crate) fn next(&mut self, before: Option<&Spanned>) -> Option<Token> {
        let start = self.at;
        let first = self.peek()?;
        match first {
            '?' | '!' | '$' if self.peek_second().is_some_and(starts_name) => {
                self.at += 1;
                let name = self.take_while(continues_name);
                Some(match first {
                    '?' => Token::Variable(name),
                    '!' => Token::Existential(name),
                    _ => Token::Global(name),
                })
            }
            '"' => self.string(),
            'f' if self.rest().starts_with("f\"") => self.format(),
            '<' => self.iri_or_less(),
            '#' => self.hash(),
            '@' => {
                self.at += 1;
                let tag = before
                    .is_some_and(|b| matches!(b.token, Token::String(_)) && b.span.end == start);
                let name =
                    self.take_while(|c| c.is_ascii_alphanumeric() || c == '_' || (tag && c == '-'));
                Some(if tag {
                    Token::Language(name)
                } else {
                    Token::Directive(name)
                })
            }
            '_' if self.rest().starts_with("_:") => {
                self.at += 2;
                Some(Token::Blank(
                    self.take_while(|c| continues_name(c) || c == '-'),
                ))
            }
            '_' => {
                self.at += 1;
                if self.peek().is_some_and(continues_name) {
                    self.take_while(continues_name);
                    self.error(
                        "R002",
                        start..self.at,
                        "a name can't begin with `_`".into(),
                        "write `_` alone for any value",
                    );
                }
                Some(Token::Anonymous)
            }
            c if c.is_ascii_digit() => Some(self.number()),
            '.' if self.peek_second().is_some_and(|c| c.is_ascii_digit()) => Some(self.number()),
            c if starts_name(c) => Some(self.name()),
            ':' if self.peek_second().is_some_and(starts_name) => {
                self.at += 1;
                Some(Token::Prefixed(
                    String::new(),
                    self.take_while(continues_name),
                ))
            }
            _ => self.symbol(),
        }
    }

    fn symbol(&mut self) -> Option<Token> {
        if let Some(symbol) = SYMBOLS
            .into_iter()
            .find(|symbol| self.rest().starts_with(symbol))
        {
            self.at += symbol.len();
            return Some(Token::Symbol(symbol));
        }
        let start = self.at;
        let c = self.peek()?;
        self.at += c.len_utf8();
        let help = match c {
            '\'' => "write strings in double quotes",
            '!' => "write `~` before an atom for \"not\", `!=` for \"differs from\"",
            _ => "remove it, or put it in a string",
        };
        self.error(
            "R002",
            start..self.at,
            format!("unexpected character `{c}`"),
            help,
        );
        None
    }

    fn name(&mut self) -> Token {
        let name = self.name_with_escapes();
        // Matches `p:local` and `p:`, but not the arrow in `p:-`.
        if self.peek() == Some(':') && self.peek_second() != Some('-') {
            self.at += 1;
            let local = self.name_with_escapes();
            return Token::Prefixed(name, local);
        }
        Token::Name(name)
    }

    /// Reads a name, which may contain percent escapes such as `%20`. (Any other `%` begins a
    /// comment.)
    fn name_with_escapes(&mut self) -> String {
        let mut name = self.take_while(continues_name);
        while self.rest().starts_with('%')
            && self
                .rest()
                .chars()
                .skip(1)
                .take(2)
                .filter(char::is_ascii_hexdigit)
                .count()
                == 2
        {
            self.at += 1;
            name.push('%');
            name.push_str(&self.take_while(continues_name));
        }
        name
    }

    /// Reads an IRI if the matching `>` comes before any white space; otherwise `<` is the
    /// operator. Returns `None` if neither fits.
    fn iri_or_less(&mut self) -> Option<Token> {
        let inside = &self.rest()[1..];
        let length = inside.find(|c: char| c == '>' || c.is_whitespace() || "<\"{}|^`".contains(c));
        match length {
            Some(length)
                if inside[length..].starts_with('>')
                    && !inside.starts_with(['=', '?', '(', '$']) =>
            {
                let iri = inside[..length].to_owned();
                self.at += length + 2;
                Some(Token::Iri(iri))
            }
            _ => self.symbol(),
        }
    }

    fn hash(&mut self) -> Option<Token> {
        let start = self.at;
        self.at += 1;
        if self.peek() == Some('[') {
            self.at += 1;
            return Some(Token::AttributeOpen);
        }
        let name = self.take_while(continues_name);
        if name.is_empty() {
            self.error(
                "R002",
                start..self.at,
                "unexpected character `#`".into(),
                "comments begin with `%`, aggregates are `#count`, `#sum`, `#min`, `#max`",
            );
            if self.peek() == Some(' ') {
                // Probably meant as a comment.
                self.take_while(|c| c != '\n');
            }
            return None;
        }
        Some(Token::Aggregate(name))
    }

    /// Reads digits, fraction, exponent and type suffix; or an integer that begins with `0b`, `0o`
    /// or `0x`.
    fn number(&mut self) -> Token {
        let start = self.at;
        for (prefix, radix) in [("0b", 2), ("0o", 8), ("0x", 16)] {
            if self.rest().starts_with(prefix)
                && self.rest()[2..].starts_with(|c: char| c.is_digit(radix))
            {
                self.at += 2;
                self.take_while(|c| c.is_digit(radix));
                return Token::Number(self.text[start..self.at].to_owned());
            }
        }
        self.take_while(|c| c.is_ascii_digit());
        if self.peek() == Some('.') && self.peek_second().is_some_and(|c| c.is_ascii_digit()) {
            self.at += 1;
            self.take_while(|c| c.is_ascii_digit());
        }
        if self.peek().is_some_and(|c| c == 'e' || c == 'E') {
            let sign = usize::from(self.peek_second().is_some_and(|c| c == '+' || c == '-'));
            if self.rest()[1 + sign..].starts_with(|c: char| c.is_ascii_digit()) {
                self.at += 1 + sign;
                self.take_while(|c| c.is_ascii_digit());
            }
        }
        if self.peek().is_some_and(|c| c == 'f' || c == 'd')
            && !self.peek_second().is_some_and(continues_name)
        {
            self.at += 1;
        }
        Token::Number(self.text[start..self.at].to_owned())
    }
}

fn starts_name(c: char) -> bool {
    c.is_alphabetic()
}

fn continues_name(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}
