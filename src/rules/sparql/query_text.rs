//! A light scanner of SPARQL text: words, IRIs and variables with their places, and the groups.

use std::collections::{BTreeMap, BTreeSet};

use actcheck_base::{Span, names, string_end};

/// A word of the text.
#[derive(Debug, Clone)]
pub(crate) struct Word {
    /// The word as written.
    pub(crate) word: String,
    /// The IRI of a prefixed name or of `<…>`.
    pub(crate) iri: Option<String>,
    /// Its place.
    pub(crate) span: Span,
}

/// Returns the words of a query, without comments and strings.
pub(crate) fn scan(text: &str) -> Vec<Word> {
    let mut prefixes: BTreeMap<String, String> = names::PREFIXES
        .iter()
        .map(|(prefix, iri)| ((*prefix).to_owned(), (*iri).to_owned()))
        .collect();
    let mut words: Vec<Word> = Vec::new();
    let mut at = 0;
    while let Some(c) = text[at..].chars().next() {
        let start = at;
        match c {
            '#' => at += text[at..].find('\n').unwrap_or(text.len() - at),
            '"' | '\'' => at = string_end(text, at, c),
            '<' => match text[at + 1..].find(|c: char| c == '>' || c.is_whitespace()) {
                Some(length) if text[at + 1 + length..].starts_with('>') => {
                    let iri = text[at + 1..at + 1 + length].to_owned();
                    at += length + 2;
                    if let [.., keyword, name] = words.as_slice()
                        && keyword.word.eq_ignore_ascii_case("prefix")
                    {
                        prefixes.insert(name.word.trim_end_matches(':').to_owned(), iri);
                    } else {
                        words.push(Word {
                            word: String::new(),
                            iri: Some(iri),
                            span: start..at,
                        });
                    }
                }
                _ => at += 1,
            },
            c if c.is_alphanumeric() || "?$_:".contains(c) => {
                let length = text[at..]
                    .find(|c: char| !(c.is_alphanumeric() || "?$_:-".contains(c)))
                    .unwrap_or(text.len() - at);
                at += length;
                let word = text[start..at].to_owned();
                let iri = word
                    .split_once(':')
                    .and_then(|(prefix, local)| Some(format!("{}{local}", prefixes.get(prefix)?)));
                words.push(Word {
                    word,
                    iri,
                    span: start..at,
                });
            }
            c => at += c.len_utf8(),
        }
    }
    words
}

/// Returns the names of the variables in a query.
pub(crate) fn variables(text: &str) -> BTreeSet<String> {
    scan(text)
        .into_iter()
        .filter_map(|word| word.word.strip_prefix(['?', '$']).map(str::to_owned))
        .collect()
}

/// Returns the offset of the first `{` outside strings, IRIs and comments. Returns `None` if it has
/// none.
pub(crate) fn first_group(text: &str) -> Option<usize> {
    braces(text)
        .into_iter()
        .find(|(_, open)| *open)
        .map(|(at, _)| at)
}

/// Returns the span of every `{ … }`, braces included, in the order of the opening braces.
pub(crate) fn groups(text: &str) -> Vec<Span> {
    let mut found: Vec<Span> = Vec::new();
    let mut open = Vec::new();
    for (at, opens) in braces(text) {
        if opens {
            open.push(found.len());
            found.push(at..text.len());
        } else if let Some(group) = open.pop() {
            found[group].end = at + 1;
        }
    }
    found
}

/// Returns the offsets of braces outside strings, IRIs and comments, and whether each is an opening
/// brace.
fn braces(text: &str) -> Vec<(usize, bool)> {
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(c) = text[at..].chars().next() {
        match c {
            '{' | '}' => {
                found.push((at, c == '{'));
                at += 1;
            }
            '#' => at += text[at..].find('\n').unwrap_or(text.len() - at),
            '"' | '\'' => at = string_end(text, at, c),
            '<' => match text[at + 1..].find(|c: char| c == '>' || c.is_whitespace()) {
                Some(length) if text[at + 1 + length..].starts_with('>') => at += length + 2,
                _ => at += 1,
            },
            c => at += c.len_utf8(),
        }
    }
    found
}
