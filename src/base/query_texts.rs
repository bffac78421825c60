//! The functions of SPARQL that make texts, within a limit.
//!
//! Evaluators of SPARQL don't limit texts: 36 nested `BIND(CONCAT(?x, ?x) AS ?y)` make one of 64
//! GiB. [`bounded_texts`] renames these functions in a query, so that an evaluator with
//! [`TEXT_FUNCTIONS`] as its own functions refuses long texts.

use std::sync::Arc;

use regex::{Regex, RegexBuilder};

use crate::Term;

/// A function returned a text beyond its limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a text is too long")]
pub struct TextTooLong;

/// A function of SPARQL over its arguments, and the maximum length of its result in bytes.
/// `Ok(None)` is SPARQL's error value.
pub type TextFunction = fn(&[Term], usize) -> Result<Option<Term>, TextTooLong>;

/// Name and IRI of each function, with its definition.
pub const TEXT_FUNCTIONS: [(&str, &str, TextFunction); 5] = [
    ("CONCAT", "urn:actcheck:text:concat", concat),
    ("REPLACE", "urn:actcheck:text:replace", replace),
    (
        "ENCODE_FOR_URI",
        "urn:actcheck:text:encode-for-uri",
        encode_for_uri,
    ),
    ("UCASE", "urn:actcheck:text:ucase", |args, most| {
        changed(args, most, str::to_uppercase)
    }),
    ("LCASE", "urn:actcheck:text:lcase", |args, most| {
        changed(args, most, str::to_lowercase)
    }),
];

/// IRI of the function around each text that `GROUP_CONCAT` appends: it returns its argument, and
/// counts its length.
pub const COUNTED_TEXT: &str = "urn:actcheck:text:counted";

/// Maximum nesting of calls that [`check_calls`] accepts.
pub const MOST_NESTED_CALLS: usize = 12;

/// Upper and lower case have at most this many times the bytes of a text, and so do escaped bytes.
const GROWTH: usize = 3;
/// Maximum size of a compiled pattern, as in oxigraph. Unit: bytes.
const PATTERN_LIMIT: usize = 1_000_000;

/// Replaces the calls of [`TEXT_FUNCTIONS`] in a valid query by calls of their IRIs, and adds
/// [`COUNTED_TEXT`] to `GROUP_CONCAT`.
#[must_use]
pub fn bounded_texts(query: &str) -> String {
    let mut out = String::with_capacity(query.len());
    let mut rest = query;
    let mut counting = Counting::default();
    while let Some((token, after)) = split_token(rest) {
        counting.before(token, &mut out);
        match text_function(token).filter(|_| opens(after)) {
            Some(iri) => out.extend(["<", iri, ">"]),
            None => out.push_str(token),
        }
        rest = after;
    }
    out
}

/// Checks that calls of [`TEXT_FUNCTIONS`] and of functions with IRIs are nested at most
/// [`MOST_NESTED_CALLS`] deep: the time of oxigraph's parser doubles with each level.
///
/// # Errors
/// Place of the first call that is deeper, in bytes.
pub fn check_calls(query: &str) -> Result<(), usize> {
    check_calls_within(query, MOST_NESTED_CALLS)
}

/// Like [`check_calls`], with another maximum.
///
/// # Errors
/// As [`check_calls`].
pub fn check_calls_within(query: &str, most: usize) -> Result<(), usize> {
    // For each open parenthesis, whether it begins the arguments of such a call.
    let mut open: Vec<bool> = Vec::new();
    let (mut rest, mut calls) = (query, false);
    while let Some((token, after)) = split_token(rest) {
        match token {
            "(" => {
                open.push(calls);
                if open.iter().filter(|call| **call).count() > most {
                    return Err(query.len() - rest.len());
                }
            }
            ")" => drop(open.pop()),
            _ => {}
        }
        if !token.starts_with('#') && !token.trim().is_empty() {
            calls = token.len() > 1 && (token.starts_with('<') || token.contains(':'))
                || text_function(token).is_some();
        }
        rest = after;
    }
    Ok(())
}

/// Splits a query after its first token: a comment, string, IRI, word or character.
fn split_token(query: &str) -> Option<(&str, &str)> {
    let first = query.chars().next()?;
    let length = match first {
        '#' => query.find('\n').unwrap_or(query.len()),
        '"' | '\'' => string_end(query, 0, first),
        '<' => match query.find(|c: char| c == '>' || c.is_whitespace()) {
            Some(end) if query[end..].starts_with('>') => end + 1,
            _ => 1,
        },
        _ if is_of_word(first) => query.find(|c: char| !is_of_word(c)).unwrap_or(query.len()),
        other => other.len_utf8(),
    };
    Some(query.split_at(length))
}

/// Returns the IRI of the function with this name.
fn text_function(name: &str) -> Option<&'static str> {
    TEXT_FUNCTIONS
        .iter()
        .find(|(known, ..)| known.eq_ignore_ascii_case(name))
        .map(|(_, iri, _)| *iri)
}

/// Finds the arguments of `GROUP_CONCAT`.
#[derive(Default)]
struct Counting {
    /// Number of open parentheses.
    depth: usize,
    /// The depths of the arguments being read.
    open: Vec<usize>,
    expected: Expected,
}

/// The next token in a call of `GROUP_CONCAT`.
#[derive(Default, PartialEq, Eq)]
enum Expected {
    #[default]
    Nothing,
    Parenthesis,
    Argument,
}

impl Counting {
    /// Writes the begin or the end of a call that counts, if it comes before a token.
    fn before(&mut self, token: &str, out: &mut String) {
        if token.starts_with('#') || token.trim().is_empty() {
            return;
        }
        if self.expected == Expected::Argument && !token.eq_ignore_ascii_case("DISTINCT") {
            out.extend(["<", COUNTED_TEXT, ">("]);
            self.open.push(self.depth);
            self.expected = Expected::Nothing;
        }
        match token {
            "(" => {
                self.depth += 1;
                if self.expected == Expected::Parenthesis {
                    self.expected = Expected::Argument;
                }
            }
            ")" | ";" => {
                if self.open.pop_if(|depth| *depth == self.depth).is_some() {
                    out.push(')');
                }
                self.depth = self.depth.saturating_sub(usize::from(token == ")"));
            }
            _ if token.eq_ignore_ascii_case("GROUP_CONCAT") => {
                self.expected = Expected::Parenthesis
            }
            _ => {}
        }
    }
}

/// Characters of keywords, variables, and prefixed names.
fn is_of_word(c: char) -> bool {
    c.is_alphanumeric() || "_-.:?$".contains(c)
}

/// Returns whether a text begins with a parenthesis, after spaces and comments.
fn opens(text: &str) -> bool {
    let mut text = text.trim_start();
    while text.starts_with('#') {
        text = text.find('\n').map_or("", |end| text[end..].trim_start());
    }
    text.starts_with('(')
}

/// Returns the end of the string in a SPARQL query that begins at `start` with this quotation mark,
/// one or three of them. Unit: bytes.
#[must_use]
pub fn string_end(query: &str, start: usize, quote: char) -> usize {
    let triple = quote.to_string().repeat(3);
    let close = if query[start..].starts_with(&triple) {
        triple
    } else {
        quote.to_string()
    };
    let mut at = start + close.len();
    while let Some(c) = query[at..].chars().next() {
        if query[at..].starts_with(&close) {
            return at + close.len();
        }
        at += c.len_utf8();
        if c == '\\' {
            at += query[at..].chars().next().map_or(0, char::len_utf8);
        }
    }
    query.len()
}

fn limited(length: usize, most: usize) -> Result<(), TextTooLong> {
    if length <= most {
        Ok(())
    } else {
        Err(TextTooLong)
    }
}

/// Returns the text and language of a string, or `None` for another term.
fn parts(term: &Term) -> Option<(&str, Option<&Arc<str>>)> {
    match term {
        Term::String(text) => Some((text, None)),
        Term::LangString(text, tag) => Some((text, Some(tag))),
        _ => None,
    }
}

fn string(text: String, tag: Option<&Arc<str>>) -> Option<Term> {
    Some(match tag {
        Some(tag) => Term::LangString(text.into(), Arc::clone(tag)),
        None => Term::String(text.into()),
    })
}

fn concat(args: &[Term], most: usize) -> Result<Option<Term>, TextTooLong> {
    let Some(strings) = args.iter().map(parts).collect::<Option<Vec<_>>>() else {
        return Ok(None);
    };
    limited(strings.iter().map(|(text, _)| text.len()).sum(), most)?;
    let first = strings.first().and_then(|(_, tag)| *tag);
    let tag = first.filter(|first| strings.iter().all(|(_, tag)| *tag == Some(*first)));
    Ok(string(strings.iter().map(|(text, _)| *text).collect(), tag))
}

fn changed(
    args: &[Term],
    most: usize,
    change: impl Fn(&str) -> String,
) -> Result<Option<Term>, TextTooLong> {
    let [arg] = args else { return Ok(None) };
    let Some((text, tag)) = parts(arg) else {
        return Ok(None);
    };
    limited(text.len(), most / GROWTH)?;
    Ok(string(change(text), tag))
}

fn encode_for_uri(args: &[Term], most: usize) -> Result<Option<Term>, TextTooLong> {
    let encoded = changed(args, most, |text| {
        let mut out = String::with_capacity(text.len());
        for byte in text.bytes() {
            match byte {
                b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'_' | b'.' | b'~' => {
                    out.push(char::from(byte))
                }
                _ => out.push_str(&format!("%{byte:02X}")),
            }
        }
        out
    })?;
    Ok(match encoded {
        Some(Term::LangString(text, _)) => Some(Term::String(text)),
        other => other,
    })
}

fn replace(args: &[Term], most: usize) -> Result<Option<Term>, TextTooLong> {
    let (text, pattern, replacement, flags) = match args {
        [text, Term::String(pattern), Term::String(replacement)] => {
            (text, pattern, replacement, "")
        }
        [
            text,
            Term::String(pattern),
            Term::String(replacement),
            Term::String(flags),
        ] => (text, pattern, replacement, flags.as_ref()),
        _ => return Ok(None),
    };
    let (Some((text, tag)), Some(pattern)) = (parts(text), compiled(pattern, flags)) else {
        return Ok(None);
    };
    let groups = replacement.matches('$').count();
    let (mut out, mut end) = (String::new(), 0);
    for found in pattern.captures_iter(text) {
        let Some(whole) = found.get(0) else { continue };
        let length = groups
            .saturating_mul(whole.len())
            .saturating_add(replacement.len() + whole.start() - end);
        limited(out.len().saturating_add(length), most)?;
        out.push_str(&text[end..whole.start()]);
        found.expand(replacement, &mut out);
        end = whole.end();
    }
    limited(out.len() + text.len() - end, most)?;
    out.push_str(&text[end..]);
    Ok(string(out, tag))
}

/// Compiles a pattern with the flags of SPARQL. Returns `None` if either is invalid.
fn compiled(pattern: &str, flags: &str) -> Option<Regex> {
    let literal = flags.contains('q').then(|| regex::escape(pattern));
    let mut builder = RegexBuilder::new(literal.as_deref().unwrap_or(pattern));
    builder.size_limit(PATTERN_LIMIT);
    for flag in flags.chars() {
        match flag {
            's' => builder.dot_matches_new_line(true),
            'm' => builder.multi_line(true),
            'i' => builder.case_insensitive(true),
            'x' => builder.ignore_whitespace(true),
            'q' => &mut builder,
            _ => return None,
        };
    }
    builder.build().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deeply_nested_calls_are_found() {
        let nested = |call: &str, depth: usize| {
            format!(
                "ASK {{ FILTER({}1{}) }}",
                call.repeat(depth),
                ")".repeat(depth)
            )
        };
        for call in ["CONCAT(", "replace (", "<http://x#f>(", "f:g # (\n("] {
            assert_eq!(
                check_calls(&nested(call, MOST_NESTED_CALLS)),
                Ok(()),
                "{call}"
            );
            assert!(
                check_calls(&nested(call, MOST_NESTED_CALLS + 1)).is_err(),
                "{call}"
            );
        }
        for fine in ["STRLEN(", "(", "\"<f>\" + (", "?x < ("] {
            assert_eq!(check_calls(&nested(fine, 40)), Ok(()), "{fine}");
        }
        assert_eq!(check_calls(&"CONCAT(1) ".repeat(40)), Ok(()));
    }

    #[test]
    fn only_calls_are_renamed() {
        let text = "SELECT ?concat (ConCat (\"CONCAT(\", ?x, ex:UCASE(1)) AS ?y) { # LCASE(\n ?concat <http://x/REPLACE(> 'UCASE(' }";
        let wanted = text.replace("ConCat (", "<urn:actcheck:text:concat> (");
        assert_eq!(bounded_texts(text), wanted);
        assert_eq!(
            bounded_texts("replace #(\n(1)"),
            "<urn:actcheck:text:replace> #(\n(1)"
        );
        let text = "(GROUP_CONCAT (DISTINCT STR((?x)) ; separator = \";)\") AS ?y) (group_concat(?z) AS ?w)";
        let wanted = "(GROUP_CONCAT (DISTINCT <C>(STR((?x)) ); separator = \";)\") AS ?y) (group_concat(<C>(?z)) AS ?w)";
        assert_eq!(
            bounded_texts(text),
            wanted.replace("<C>", &format!("<{COUNTED_TEXT}>"))
        );
    }

    #[test]
    fn functions_have_the_values_of_sparql() {
        let call = |name: &str, args: &[Term]| {
            let (.., function) = TEXT_FUNCTIONS
                .iter()
                .find(|(known, ..)| *known == name)
                .expect("it is in the table");
            function(args, 1000).expect("it is short")
        };
        let text = Term::string;
        let german = |text: &str| Term::LangString(text.into(), "de".into());
        assert_eq!(call("CONCAT", &[text("a"), text("b")]), Some(text("ab")));
        assert_eq!(call("CONCAT", &[]), Some(text("")));
        assert_eq!(
            call("CONCAT", &[german("a"), german("b")]),
            Some(german("ab"))
        );
        assert_eq!(call("CONCAT", &[german("a"), text("b")]), Some(text("ab")));
        assert_eq!(call("CONCAT", &[text("a"), Term::Integer(1)]), None);
        assert_eq!(call("UCASE", &[german("ä")]), Some(german("Ä")));
        assert_eq!(call("LCASE", &[text("Ä")]), Some(text("ä")));
        assert_eq!(
            call("ENCODE_FOR_URI", &[german("a b/c")]),
            Some(text("a%20b%2Fc"))
        );
        assert_eq!(
            call("REPLACE", &[text("abab"), text("a(.)"), text("[$1]")]),
            Some(text("[b][b]"))
        );
        assert_eq!(
            call("REPLACE", &[german("aB"), text("b"), text(""), text("i")]),
            Some(german("a"))
        );
        assert_eq!(
            call("REPLACE", &[text("a.b"), text("."), text("-"), text("q")]),
            Some(text("a-b"))
        );
        assert_eq!(
            call("REPLACE", &[text("a"), text("a"), text("b"), text("?")]),
            None
        );
    }

    #[test]
    fn long_texts_are_refused() {
        let long = || Term::string("a".repeat(600));
        for (name, args) in [
            ("CONCAT", vec![long(), long()]),
            ("UCASE", vec![long()]),
            (
                "REPLACE",
                vec![long(), Term::string("a"), Term::string("bb")],
            ),
            (
                "REPLACE",
                vec![long(), Term::string("a+"), Term::string("$0$0")],
            ),
        ] {
            let (.., function) = TEXT_FUNCTIONS
                .iter()
                .find(|(known, ..)| *known == name)
                .expect("it is in the table");
            assert_eq!(function(&args, 1000), Err(TextTooLong), "{name}");
        }
    }
}
