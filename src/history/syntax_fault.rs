//! Reports syntax errors of queries at their place.
//!
//! The parser reports the furthest place where one of its alternatives failed, and every token that
//! it expected there. The reported place of a failed keyword is off by the keyword's length; this
//! module corrects it, so that the place is the one that users expect.

use actcheck_base::{Diagnostic, Source, names, unclosed_braces};

/// Expected words that a message lists; a syntax error can have a hundred.
const EXPECTED_SHOWN: usize = 8;

/// Converts a syntax error of the parser, such as `error at 1:8: expected one of …`, into a
/// diagnostic with its place.
pub(super) fn syntax_fault(text: &Source, error: &str) -> Diagnostic {
    let place = error.strip_prefix("error at ").and_then(|rest| {
        let (place, expected) = rest.split_once(": ")?;
        let (line, column) = place.split_once(':')?;
        Some((
            offset(&text.text, line.parse().ok()?, column.parse().ok()?),
            expected,
        ))
    });
    let Some((end, expected)) = place else {
        return Diagnostic::error("H010", format!("this is not a SPARQL query: {error}"))
            .in_source(text);
    };
    let expected = expected.strip_prefix("expected ").unwrap_or(expected);
    let expected: Vec<&str> = expected
        .strip_prefix("one of ")
        .unwrap_or(expected)
        .split(", ")
        .map(str::trim)
        .collect();
    // Every other item is a keyword, a quoted character or a character class in brackets.
    match expected
        .iter()
        .find(|item| item.contains(' ') && !item.starts_with(['[', '"', '\'']))
    {
        Some(reason) => with_reason(text, end, reason),
        None => unexpected(text, end, &expected),
    }
}

/// Reports a reason in the parser's own words. Its place is after the word that it concerns.
fn with_reason(text: &Source, end: usize, reason: &str) -> Diagnostic {
    let before = text.text[..end].trim_end();
    let start = before.rfind(char::is_whitespace).map_or(0, |at| at + 1);
    let word = &before[start..];
    let fault = |message: String| Diagnostic::error("H010", message).at(text, start..before.len());
    if reason == "Prefix not found" {
        let known: Vec<&str> = names::PREFIXES.iter().map(|(prefix, _)| *prefix).collect();
        return fault(format!("the prefix of `{word}` is unknown")).help(format!(
            "declare it with `PREFIX`, or use a known one: {}",
            known.join(", ")
        ));
    }
    let mut letters = reason.chars();
    let first = letters.next().map(char::to_lowercase).into_iter().flatten();
    let fault = fault(first.chain(letters).collect());
    if reason.contains("unbound") {
        return fault
            .help("every variable after `SELECT` must be in `GROUP BY` or in an aggregate such as `COUNT(?x)`");
    }
    fault
}

/// Reports text that is not valid at its place.
fn unexpected(text: &Source, end: usize, expected: &[&str]) -> Diagnostic {
    let keyword = |item: &&str| item.len() > 1 && item.chars().all(|c| c.is_ascii_alphanumeric());
    // `[_]` is any character: a keyword was expected, but the text is shorter than it.
    let only_keywords = expected.iter().all(|item| *item == "[_]" || keyword(item));
    let shortest = expected
        .iter()
        .filter(|item| keyword(item))
        .map(|item| item.len())
        .min();
    let start = match shortest {
        Some(length) if only_keywords => back(&text.text, end, length),
        _ => end,
    };
    let rest = &text.text[start..];
    let skipped = rest.len() - rest.trim_start().len();
    let start = start + skipped;
    let length = rest[skipped..]
        .find(char::is_whitespace)
        .unwrap_or(rest.len() - skipped);
    let stop = end.max(start + length).min(text.text.len()).max(start);
    let found: String = text.text[start..stop]
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
        .chars()
        .take(40)
        .collect();
    let message = match found.as_str() {
        "" => "the query ends too early".to_owned(),
        found => format!("this is not a SPARQL query: unexpected `{found}`"),
    };
    let fault = Diagnostic::error("H010", message).at(text, start..stop);
    if let Some(help) = unclosed_braces(&text.text).filter(|_| found.is_empty()) {
        return fault.help(help);
    }
    if !text.text.contains('{') {
        return fault.help("a query is a pattern of triples in braces, such as `SELECT ?run WHERE { ?run a act:Run }`");
    }
    match listed(expected) {
        Some(list) => fault.help(format!("expected {list}")),
        None => {
            fault.help("a query is `SELECT … WHERE { … }`, `ASK { … }`, `CONSTRUCT` or `DESCRIBE`")
        }
    }
}

/// Lists the expected tokens, without character classes, shortened to a readable number. Returns
/// `None` if none is left.
fn listed(expected: &[&str]) -> Option<String> {
    let words: Vec<String> = expected
        .iter()
        .filter(|item| !item.starts_with(['[', '\'', '|']) && !item.contains('\n'))
        .map(|item| format!("`{}`", item.trim_matches('"')))
        .collect();
    match words.len() {
        0 => None,
        count if count <= EXPECTED_SHOWN => Some(words.join(", ")),
        count => Some(format!(
            "{} and {} more",
            words[..EXPECTED_SHOWN].join(", "),
            count - EXPECTED_SHOWN
        )),
    }
}

/// Returns the offset of the place that many characters before another.
fn back(text: &str, end: usize, characters: usize) -> usize {
    text[..end]
        .char_indices()
        .rev()
        .nth(characters.saturating_sub(1))
        .map_or(0, |(at, _)| at)
}

/// Byte offset of a line and a column (in characters), both counted from 1. Returns the text's
/// length if there is no such place.
fn offset(text: &str, line: usize, column: usize) -> usize {
    let start = match line.checked_sub(2) {
        None => 0,
        Some(idx) => text
            .match_indices('\n')
            .nth(idx)
            .map_or(text.len(), |(at, _)| at + 1),
    };
    text[start..]
        .char_indices()
        .nth(column.saturating_sub(1))
        .map_or(text.len(), |(at, _)| start + at)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_position_becomes_a_byte_offset() {
        assert_eq!(offset("äb\ncd", 1, 2), 2);
        assert_eq!(offset("äb\ncd", 2, 2), 5);
        assert_eq!(offset("äb\ncd", 9, 9), 6);
        assert_eq!(back("äb\ncd", 5, 3), 2);
        assert_eq!(back("ä", 2, 9), 0);
    }

    #[test]
    fn unparsable_parser_errors_are_still_reported() {
        let text = Source::new("q", "SELECT");
        for error in [
            "no place",
            "error at 1:x: expected a",
            "error at 9:9: expected one of ",
            "error at 1:3: expected é",
        ] {
            assert_eq!(syntax_fault(&text, error).code, "H010");
        }
    }
}
