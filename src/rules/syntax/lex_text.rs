//! Lexer for strings: escapes, multi-line strings, and f-strings with embedded expressions.

use crate::syntax::lex::{FormatPiece, Lexer, Spanned, Token};

/// Maximum nesting depth of f-strings.
const FORMAT_DEPTH: usize = 8;

impl Lexer<'_> {
    pub(crate) fn string(&mut self) -> Option<Token> {
        let start = self.at;
        let triple = self.rest().starts_with("\"\"\"");
        self.at += if triple { 3 } else { 1 };
        let mut out = String::new();
        loop {
            if triple && self.rest().starts_with("\"\"\"") {
                self.at += 3;
                return Some(Token::String(out));
            }
            match self.peek() {
                Some('"') if !triple => {
                    self.at += 1;
                    return Some(Token::String(out));
                }
                None => break,
                Some('\n') if !triple => break,
                Some('\\') => self.escape(&mut out),
                Some(c) => {
                    out.push(c);
                    self.at += c.len_utf8();
                }
            }
        }
        let help = "close it with `\"`; write a string of several lines in `\"\"\"`";
        self.error("R003", start..start + 1, "string has no end".into(), help);
        Some(Token::String(out))
    }

    fn escape(&mut self, out: &mut String) {
        let start = self.at;
        self.at += 1;
        let Some(c) = self.peek() else { return };
        self.at += c.len_utf8();
        let digits = match c {
            'n' => return out.push('\n'),
            't' => return out.push('\t'),
            'r' => return out.push('\r'),
            'b' => return out.push('\u{8}'),
            'f' => return out.push('\u{c}'),
            '"' | '\\' | '\'' => return out.push(c),
            'u' => 4,
            'U' => 8,
            _ => {
                let help = "known escapes: \\n \\t \\r \\b \\f \\\" \\' \\\\ \\uXXXX \\UXXXXXXXX";
                return self.error(
                    "R004",
                    start..self.at,
                    format!("unknown escape `\\{c}`"),
                    help,
                );
            }
        };
        let hex: String = self
            .rest()
            .chars()
            .take(digits)
            .take_while(char::is_ascii_hexdigit)
            .collect();
        self.at += hex.len();
        match u32::from_str_radix(&hex, 16)
            .ok()
            .filter(|_| hex.len() == digits)
            .and_then(char::from_u32)
        {
            Some(c) => out.push(c),
            None => {
                let help = "write a Unicode code point with 4 (\\u) or 8 (\\U) hexadecimal digits";
                self.error(
                    "R004",
                    start..self.at,
                    "the escape is not a Unicode character".into(),
                    help,
                );
            }
        }
    }

    /// Reads `f"…{code}…"`; `{{` and `}}` are escaped braces. Returns `None` if an error was
    /// reported.
    pub(crate) fn format(&mut self) -> Option<Token> {
        let start = self.at;
        let triple = self.rest().starts_with("f\"\"\"");
        let close = if triple { "\"\"\"" } else { "\"" };
        self.at += 1 + close.len();
        let mut pieces = Vec::new();
        let mut text = String::new();
        loop {
            if self.rest().starts_with(close) {
                self.at += close.len();
                pieces.push(FormatPiece::Text(text));
                return Some(Token::Format(pieces));
            }
            if self.rest().starts_with("{{") || self.rest().starts_with("}}") {
                text.push_str(&self.rest()[..1]);
                self.at += 2;
                continue;
            }
            match self.peek() {
                None => break,
                Some('\n') if !triple => break,
                Some('{') => {
                    pieces.push(FormatPiece::Text(std::mem::take(&mut text)));
                    pieces.push(FormatPiece::Code(self.format_code()?));
                }
                Some('\\') => self.escape(&mut text),
                Some(c) => {
                    text.push(c);
                    self.at += c.len_utf8();
                }
            }
        }
        self.error(
            "R003",
            start..start + 2,
            "string has no end".into(),
            "close it with `\"`",
        );
        pieces.push(FormatPiece::Text(text));
        Some(Token::Format(pieces))
    }

    /// Returns the tokens between `{` and its `}`, or `None` if an error was reported.
    fn format_code(&mut self) -> Option<Vec<Spanned>> {
        let start = self.at;
        self.at += 1;
        if self.depth >= FORMAT_DEPTH {
            self.at = self.end;
            let help = "compute the inner text in a separate assignment";
            self.error(
                "R005",
                start..start + 1,
                "f-strings are nested too deeply".into(),
                help,
            );
            return None;
        }
        self.depth += 1;
        let mut tokens: Vec<Spanned> = Vec::new();
        let mut open = 0usize;
        // The span of the closing brace; empty if it is missing, because a span must not split a
        // character.
        let close = loop {
            self.skip_blank();
            let at = self.at;
            if self.at >= self.end || self.peek() == Some('\n') {
                self.error(
                    "R003",
                    start..start + 1,
                    "`{` has no end".into(),
                    "close it with `}`, or write `{{` for a brace",
                );
                break at..at;
            }
            if self.peek() == Some('}') && open == 0 {
                self.at += 1;
                break at..self.at;
            }
            if let Some(token) = self.next(tokens.last()) {
                match token {
                    Token::Symbol("{") => open += 1,
                    Token::Symbol("}") => open = open.saturating_sub(1),
                    _ => {}
                }
                tokens.push(Spanned {
                    token,
                    span: at..self.at,
                });
            }
        };
        self.depth -= 1;
        tokens.push(Spanned {
            token: Token::End,
            span: close,
        });
        Some(tokens)
    }
}
