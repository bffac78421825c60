//! Limits on the nesting and length of SPARQL queries.
//!
//! Parser, optimizer and evaluator call themselves for each level of nesting and for each link of a
//! chain such as `1 + 1 + …` or `{ … } UNION { … } UNION …`, so a long query could exhaust the
//! stack, which ends the process.

use crate::{Span, string_end};

/// Maximum nesting depth of parentheses, brackets and braces. A thread of 2 MiB bears about 400.
const DEPTH_LIMIT: usize = 100;
/// Maximum number of nested negations. The parser takes twice as long for each.
const NEGATION_LIMIT: usize = 12;
/// Maximum number of patterns and operators. A thread of 2 MiB bears about 3000.
const LINK_LIMIT: usize = 1_000;
/// Keywords that add a link to a chain of patterns or of computed columns.
const LINKS: [&str; 8] = [
    "union", "optional", "minus", "bind", "filter", "graph", "as", "exists",
];

/// Returns the place where a query exceeds a limit and what to say about it, or `None` if it is
/// within all limits.
///
/// ```
/// use actcheck_base::sparql_excess;
///
/// assert_eq!(sparql_excess("ASK { ?s ?p ?o FILTER((?o + 1) * 2 > 3) }"), None);
/// let deep = format!("ASK {{ FILTER({}true{}) }}", "(".repeat(5_000), ")".repeat(5_000));
/// let (place, message) = sparql_excess(&deep).expect("it is nested too deeply");
/// assert_eq!((place, message.as_str()), (111..112, "the query is nested more than 100 levels deep"));
/// ```
pub fn sparql_excess(text: &str) -> Option<(Span, String)> {
    let mut open: Vec<Bracket> = Vec::new();
    let (mut links, mut at, mut negated, mut rows_follow) = (0, 0, false, false);
    while let Some(c) = text[at..].chars().next() {
        let start = at;
        at += token_length(&text[at..], c);
        let word = &text[start..at];
        let inside = open.last().copied().unwrap_or_default();
        let link = match c {
            '(' | '[' | '{' => {
                let rows = inside.rows || (c == '{' && std::mem::take(&mut rows_follow));
                open.push(Bracket {
                    round: c == '(',
                    rows,
                    negations: inside.negations + usize::from(negated),
                });
                c == '{'
            }
            ')' | ']' | '}' => {
                open.pop();
                false
            }
            '+' | '-' | '*' | '/' | '|' | '&' | '^' | '<' | '>' | '=' => word.len() == 1,
            // Separators of triples, but not of arguments or of decimals.
            '.' | ';' | ',' => !inside.round,
            _ => LINKS.iter().any(|link| word.eq_ignore_ascii_case(link)),
        };
        rows_follow |= word.eq_ignore_ascii_case("values");
        negated = c == '!' || (negated && c.is_whitespace());
        links += usize::from(link && !inside.rows);
        let message = if open.len() > DEPTH_LIMIT {
            format!("the query is nested more than {DEPTH_LIMIT} levels deep")
        } else if open
            .last()
            .is_some_and(|bracket| bracket.negations > NEGATION_LIMIT)
        {
            format!("the query has more than {NEGATION_LIMIT} nested negations")
        } else if links > LINK_LIMIT {
            format!("the query has more than {LINK_LIMIT} patterns and operators")
        } else {
            continue;
        };
        return Some((start..at, message));
    }
    None
}

#[derive(Debug, Clone, Copy, Default)]
struct Bracket {
    round: bool,
    /// Inside the rows of `VALUES`, which may be long.
    rows: bool,
    /// Number of negations around it.
    negations: usize,
}

/// Returns the length of the comment, string, IRI, name or character at the start of a text. Unit:
/// bytes.
fn token_length(text: &str, first: char) -> usize {
    match first {
        '#' => text.find('\n').unwrap_or(text.len()),
        '"' | '\'' => string_end(text, 0, first),
        '<' => {
            match text[1..].find(|c: char| c == '>' || c == '<' || c == '"' || c.is_whitespace()) {
                Some(length) if text[1 + length..].starts_with('>') => length + 2,
                _ => 1,
            }
        }
        c if continues_name(c) => text
            .find(|c: char| !continues_name(c))
            .unwrap_or(text.len()),
        c => c.len_utf8(),
    }
}

fn continues_name(c: char) -> bool {
    c.is_alphanumeric() || matches!(c, '?' | '$' | '_' | ':')
}

/// Returns a help text about the braces of a query that are not closed, or `None` if all are.
pub fn unclosed_braces(text: &str) -> Option<String> {
    let (mut open, mut closed, mut at) = (0usize, 0usize, 0);
    while let Some(c) = text[at..].chars().next() {
        match c {
            '"' | '\'' => {
                at = string_end(text, at, c);
                continue;
            }
            '{' => open += 1,
            '}' => closed += 1,
            _ => {}
        }
        at += c.len_utf8();
    }
    (open > closed).then(|| format!("it has {open} `{{` and {closed} `}}`: add `}}`"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(text: &str) -> Option<String> {
        sparql_excess(text).map(|(_, message)| message)
    }

    #[test]
    fn long_chains_and_deep_nesting_are_found() {
        let n = 5_000;
        for text in [
            format!("ASK {}{}", "{".repeat(n), "}".repeat(n)),
            format!("ASK {{ ?s ?p {}{} }}", "[ ?p ".repeat(n), "]".repeat(n)),
            format!("ASK {{ FILTER({}true) }}", "true || ".repeat(n)),
            format!("ASK {{ FILTER({}1 > 0) }}", "1 + ".repeat(n)),
            format!(
                "ASK {{ {}{{ ?s ?p ?o }} }}",
                "{ ?s ?p ?o } UNION ".repeat(n)
            ),
            format!("ASK {{ {} }}", "?s ?p ?o . ".repeat(n)),
            format!("ASK {{ ?s {}?o ?o }}", "<http://x/p>/".repeat(n)),
            format!("ASK {{ {} }}", "BIND(1 AS ?x) ".repeat(n)),
            format!("SELECT {} {{ }}", "(1 AS ?x) ".repeat(n)),
            format!(
                "ASK {{ FILTER({}true{}) }}",
                "! (".repeat(20),
                ")".repeat(20)
            ),
        ] {
            assert!(message(&text).is_some(), "{}", &text[..40]);
        }
    }

    #[test]
    fn data_strings_and_comments_don_t_count() {
        let n = 5_000;
        for text in [
            format!(
                "ASK {{ VALUES ?x {{ {} }} }}",
                "1.5 -2 <http://x/p> ".repeat(n)
            ),
            format!("ASK {{ VALUES (?x ?y) {{ {} }} }}", "(1 2) ".repeat(n)),
            format!("ASK {{ ?s ?p ?o FILTER(?o IN ({}1)) }}", "1, ".repeat(n)),
            format!(
                "ASK {{ ?s ?p \"{}\", '''{}''' }}",
                "{".repeat(n),
                "(\\'' ".repeat(n)
            ),
            format!("ASK {{ ?s ?p ?o # {}\n }}", "(".repeat(n)),
        ] {
            assert_eq!(message(&text), None, "{}", &text[..40]);
        }
    }

    #[test]
    fn unbalanced_text_is_left_to_the_parser() {
        for text in [
            "",
            ")",
            "ASK }}} {",
            "ASK { 'x",
            "<",
            "\"\\",
            "VALUES {",
            "é!(",
        ] {
            assert_eq!(message(text), None, "{text}");
        }
    }
}
