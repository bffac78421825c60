//! String functions. Positions count characters from 1. Results keep the language tag if possible.

use std::sync::Arc;
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::time::Duration;

use crate::builtins::Value;
use crate::watch::Watch;
use actcheck_base::Term;

/// Maximum size of a compiled pattern. Unit: bytes.
const PATTERN_LIMIT: usize = 1 << 20;
/// Compiling a pattern may take as long as reading this much text. Unit: bytes.
const COMPILING: usize = 1 << 16;
/// Matching a text of this length with the largest pattern takes under a second. Unit: bytes.
const LONG_TEXT: usize = 1 << 12;
/// Interval at which the clock is checked while a long text is matched.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// Returns the text and language of a string, or `None` for another term.
fn parts(term: &Term) -> Option<(&str, Option<&Arc<str>>)> {
    match term {
        Term::String(text) => Some((text, None)),
        Term::LangString(text, tag) => Some((text, Some(tag))),
        _ => None,
    }
}

/// Returns two comparable strings: the second has no language, or the same as the first. Returns
/// `None` otherwise.
fn pair<'a>(args: &'a [Value<'_>]) -> Option<(&'a str, &'a str)> {
    let (a, tag_a) = parts(&args[0])?;
    let (b, tag_b) = parts(&args[1])?;
    (tag_b.is_none() || tag_a == tag_b).then_some((a, b))
}

fn tagged(text: impl Into<Arc<str>>, tag: Option<&Arc<str>>) -> Term {
    match tag {
        Some(tag) => Term::LangString(text.into(), tag.clone()),
        None => Term::String(text.into()),
    }
}

fn map(args: &[Value<'_>], change: impl Fn(&str) -> String) -> Option<Term> {
    let (text, tag) = parts(&args[0])?;
    Some(tagged(change(text), tag))
}

fn count(number: usize) -> Term {
    Term::Integer(i64::try_from(number).unwrap_or(i64::MAX))
}

pub(super) fn concat(args: &[Value<'_>]) -> Option<Term> {
    let strings: Vec<_> = args.iter().map(|a| parts(a)).collect::<Option<_>>()?;
    let first = strings.first()?.1;
    let tag = if strings.iter().all(|(_, tag)| *tag == first) {
        first
    } else {
        None
    };
    Some(tagged(
        strings.iter().map(|(text, _)| *text).collect::<String>(),
        tag,
    ))
}

pub(super) fn contains(args: &[Value<'_>]) -> Option<Term> {
    pair(args).map(|(a, b)| Term::Boolean(a.contains(b)))
}

pub(super) fn starts(args: &[Value<'_>]) -> Option<Term> {
    pair(args).map(|(a, b)| Term::Boolean(a.starts_with(b)))
}

pub(super) fn ends(args: &[Value<'_>]) -> Option<Term> {
    pair(args).map(|(a, b)| Term::Boolean(a.ends_with(b)))
}

pub(super) fn compare(args: &[Value<'_>]) -> Option<Term> {
    pair(args).map(|(a, b)| Term::Integer(a.cmp(b) as i64))
}

pub(super) fn before(args: &[Value<'_>]) -> Option<Term> {
    let (a, b) = pair(args)?;
    Some(match a.find(b) {
        Some(at) => tagged(&a[..at], parts(&args[0])?.1),
        None => Term::string(""),
    })
}

pub(super) fn after(args: &[Value<'_>]) -> Option<Term> {
    let (a, b) = pair(args)?;
    Some(match a.find(b) {
        Some(at) => tagged(&a[at + b.len()..], parts(&args[0])?.1),
        None => Term::string(""),
    })
}

pub(super) fn substr(args: &[Value<'_>]) -> Option<Term> {
    let (text, tag) = parts(&args[0])?;
    let Term::Integer(start) = *args[1].as_ref() else {
        return None;
    };
    let length = match args.get(2).map(AsRef::as_ref) {
        Some(Term::Integer(length)) => usize::try_from(*length).ok()?,
        Some(_) => return None,
        None => usize::MAX,
    };
    let skipped = usize::try_from(start.max(1) - 1).ok()?;
    let found: String = text.chars().skip(skipped).take(length).collect();
    Some(tagged(found, tag))
}

pub(super) fn strlen(args: &[Value<'_>]) -> Option<Term> {
    parts(&args[0]).map(|(text, _)| count(text.chars().count()))
}

pub(super) fn strrev(args: &[Value<'_>]) -> Option<Term> {
    map(args, |text| text.chars().rev().collect())
}

pub(super) fn ucase(args: &[Value<'_>]) -> Option<Term> {
    map(args, str::to_uppercase)
}

pub(super) fn lcase(args: &[Value<'_>]) -> Option<Term> {
    map(args, str::to_lowercase)
}

pub(super) fn trim(args: &[Value<'_>]) -> Option<Term> {
    map(args, |text| text.trim().to_owned())
}

pub(super) fn ltrim(args: &[Value<'_>]) -> Option<Term> {
    map(args, |text| text.trim_start().to_owned())
}

pub(super) fn rtrim(args: &[Value<'_>]) -> Option<Term> {
    map(args, |text| text.trim_end().to_owned())
}

/// Compiles the pattern and the optional flags that begin at an argument.
fn pattern_of(args: &[Value<'_>], flags: usize, watch: &Watch) -> Option<regex::Regex> {
    pair(args)?;
    let flags = match args.get(flags) {
        Some(flags) => parts(flags)?.0,
        None => "",
    };
    watch.work(COMPILING)?;
    compile_pattern_as(parts(&args[1])?.0, flags).ok()
}

pub(super) fn regex(args: &[Value<'_>], watch: &Watch) -> Option<Term> {
    let pattern = pattern_of(args, 2, watch)?;
    let (Term::String(text) | Term::LangString(text, _)) = args[0].as_ref() else {
        return None;
    };
    matches(&pattern, text, watch).map(Term::Boolean)
}

/// Replaces all matches of a pattern: `$1` is the text of the first group. A pattern that matches
/// the empty text has no result, as in SPARQL.
pub(super) fn replace(args: &[Value<'_>], watch: &Watch) -> Option<Term> {
    let pattern = pattern_of(args, 3, watch)?;
    let (Term::String(text) | Term::LangString(text, _)) = args[0].as_ref() else {
        return None;
    };
    let by = replacement(parts(&args[2])?.0)?;
    if pattern.is_match("") {
        return None;
    }
    let most = watch.left();
    let found = bounded(text, watch, move |text| {
        let (mut out, mut last) = (String::new(), 0);
        for found in pattern.captures_iter(text) {
            let whole = found.get_match();
            out.push_str(&text[last..whole.start()]);
            found.expand(&by, &mut out);
            last = whole.end();
            if out.len() > most {
                return out;
            }
        }
        out.push_str(&text[last..]);
        out
    })?;
    watch.make(found.len())?;
    Some(tagged(found, parts(&args[0])?.1))
}

/// Converts a replacement of SPARQL, with `$1`, `\\$` and `\\\\`, to one of the library. Returns
/// `None` if it is invalid.
fn replacement(text: &str) -> Option<String> {
    let mut out = String::new();
    let mut chars = text.chars().peekable();
    while let Some(c) = chars.next() {
        match c {
            '\\' => match chars.next()? {
                '$' => out.push_str("$$"),
                '\\' => out.push('\\'),
                _ => return None,
            },
            '$' => {
                let mut number = String::new();
                while let Some(digit) = chars.next_if(char::is_ascii_digit) {
                    number.push(digit);
                }
                if number.is_empty() {
                    return None;
                }
                out.push_str(&format!("${{{number}}}"));
            }
            c => out.push(c),
        }
    }
    Some(out)
}

/// Returns whether a text contains a match. Returns `None` if the time is over.
pub(crate) fn matches(pattern: &regex::Regex, text: &Arc<str>, watch: &Watch) -> Option<bool> {
    let pattern = pattern.clone();
    bounded(text, watch, move |text| pattern.is_match(text))
}

/// Applies a pattern to a text. Returns `None` if the time is over.
///
/// Matching takes time linear in the text, but the factor may be the size of the pattern, and it
/// can't be interrupted. A long text is therefore matched in a thread, which is left to itself if
/// the time is over.
fn bounded<T: Send + 'static>(
    text: &Arc<str>,
    watch: &Watch,
    apply: impl FnOnce(&str) -> T + Send + 'static,
) -> Option<T> {
    if text.len() <= LONG_TEXT {
        watch.work(text.len())?;
        return Some(apply(text));
    }
    let (sender, receiver) = sync_channel(1);
    let text = Arc::clone(text);
    // If no thread can be created, the sender is dropped and the receiver reports it.
    let _ = std::thread::Builder::new().spawn(move || {
        let _ = sender.send(apply(&text));
    });
    loop {
        match receiver.recv_timeout(LOOK_EVERY) {
            Ok(found) => return Some(found),
            Err(RecvTimeoutError::Timeout) => watch.check().ok()?,
            Err(RecvTimeoutError::Disconnected) => return None,
        }
    }
}

/// Why a pattern is invalid.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(crate) enum PatternFault {
    #[error("unknown flag `{0}`; the flags are i, m, s, x and q")]
    Flag(char),
    /// The last line of the library's message.
    #[error("{0}")]
    Syntax(String),
}

/// Compiles a pattern without flags.
///
/// # Errors
/// [`PatternFault`] if the pattern is invalid.
pub(crate) fn compile_pattern(pattern: &str) -> Result<regex::Regex, PatternFault> {
    compile_pattern_as(pattern, "")
}

/// Compiles a pattern with the flags of SPARQL: `i`, `m`, `s`, `x` and `q`. Matching takes time
/// linear in the text.
///
/// # Errors
/// [`PatternFault`] if the pattern or a flag is invalid.
pub(crate) fn compile_pattern_as(pattern: &str, flags: &str) -> Result<regex::Regex, PatternFault> {
    if let Some(flag) = flags.chars().find(|flag| !"imsxq".contains(*flag)) {
        return Err(PatternFault::Flag(flag));
    }
    let has = |flag| flags.contains(flag);
    let escaped = if has('q') {
        regex::escape(pattern)
    } else {
        pattern.to_owned()
    };
    let mut builder = regex::RegexBuilder::new(&escaped);
    builder
        .size_limit(PATTERN_LIMIT)
        .case_insensitive(has('i'))
        .multi_line(has('m'));
    builder
        .dot_matches_new_line(has('s'))
        .ignore_whitespace(has('x') && !has('q'));
    builder.build().map_err(|error| {
        let message = error.to_string();
        let last = message.lines().last().unwrap_or("syntax error");
        PatternFault::Syntax(last.trim_start_matches("error: ").to_owned())
    })
}

/// The number of edits between two texts, by rows of the distance table. The clock is checked at
/// every row.
pub(super) fn levenshtein(args: &[Value<'_>], watch: &Watch) -> Option<Term> {
    let (a, b) = pair(args)?;
    let (long, short) = if a.len() < b.len() { (b, a) } else { (a, b) };
    watch.make(
        short
            .len()
            .saturating_mul(size_of::<char>() + size_of::<usize>()),
    )?;
    let short: Vec<char> = short.chars().collect();
    let mut row: Vec<usize> = (1..=short.len()).collect();
    let mut distance = short.len();
    for (above, first) in long.chars().enumerate() {
        watch.work(short.len().max(1))?;
        let mut diagonal = above;
        distance = above + 1;
        for (cell, second) in row.iter_mut().zip(&short) {
            let substituted = diagonal + usize::from(first != *second);
            diagonal = *cell;
            distance = substituted.min(*cell + 1).min(distance + 1);
            *cell = distance;
        }
    }
    Some(count(distance))
}

pub(super) fn uri_encode(args: &[Value<'_>]) -> Option<Term> {
    map(args, |text| {
        text.bytes()
            .map(|byte| match byte {
                b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'_' | b'.' | b'~' => {
                    char::from(byte).to_string()
                }
                _ => format!("%{byte:02X}"),
            })
            .collect()
    })
}

pub(super) fn uri_decode(args: &[Value<'_>]) -> Option<Term> {
    let (text, tag) = parts(&args[0])?;
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let Some((first, tail)) = rest.split_first() {
        let escaped = (*first == b'%').then(|| tail.get(..2)).flatten();
        let decoded =
            escaped.and_then(|hex| u8::from_str_radix(std::str::from_utf8(hex).ok()?, 16).ok());
        bytes.push(decoded.unwrap_or(*first));
        rest = if decoded.is_some() { &tail[2..] } else { tail };
    }
    String::from_utf8(bytes).ok().map(|text| tagged(text, tag))
}
