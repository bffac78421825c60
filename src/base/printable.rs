//! Foreign text on a terminal.

use std::borrow::Cow;

/// Escapes the characters of a text from a file, a skill or a client that could control a terminal,
/// or show the text in another order than it has: control characters other than line feed and tab,
/// and marks of the direction of writing. `ESC` becomes `\u{1b}`. Other text is unchanged.
pub fn printable(text: &str) -> Cow<'_, str> {
    if !text.contains(is_unsafe) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 8);
    for c in text.chars() {
        if is_unsafe(c) {
            out.extend(c.escape_unicode())
        } else {
            out.push(c)
        }
    }
    Cow::Owned(out)
}

/// As [`printable`], but keeps sequences that only set colours and weights, as our own output has
/// them: `ESC [ … m`.
pub fn printable_in_colour(text: &str) -> Cow<'_, str> {
    if !text.contains(is_unsafe) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 8);
    let mut rest = text;
    while let Some(at) = rest.find(ESCAPE) {
        out.push_str(&printable(&rest[..at]));
        let length = colour_length(&rest[at..]);
        match length {
            0 => out.push_str(&printable(&rest[at..=at])),
            _ => out.push_str(&rest[at..at + length]),
        }
        rest = &rest[at + length.max(1)..];
    }
    out.push_str(&printable(rest));
    Cow::Owned(out)
}

const ESCAPE: char = '\u{1b}';

/// Length of the colour sequence with which the text begins; 0 if it begins with something else.
fn colour_length(text: &str) -> usize {
    let Some(parameters) = text.strip_prefix("\u{1b}[") else {
        return 0;
    };
    let length = parameters
        .find(|c: char| !c.is_ascii_digit() && c != ';')
        .unwrap_or(parameters.len());
    if parameters[length..].starts_with('m') {
        length + 3
    } else {
        0
    }
}

fn is_unsafe(c: char) -> bool {
    let turns =
        matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    (c.is_control() && c != '\n' && c != '\t') || turns
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_become_visible() {
        for (text, shown) in [
            (
                "a cup\n\tof tea, Größe 3 \u{1f375}",
                "a cup\n\tof tea, Größe 3 \u{1f375}",
            ),
            (
                "\u{1b}[2J\u{1b}]0;title\u{7}",
                "\\u{1b}[2J\\u{1b}]0;title\\u{7}",
            ),
            (
                "a\rb\u{8}\u{9b}31m\u{7f}",
                "a\\u{d}b\\u{8}\\u{9b}31m\\u{7f}",
            ),
            ("\u{202e}gpj.exe", "\\u{202e}gpj.exe"),
        ] {
            assert_eq!(printable(text), shown);
        }
    }

    #[test]
    fn only_colours_remain_in_coloured_text() {
        for (text, shown) in [
            ("\u{1b}[1;31merror\u{1b}[0m", "\u{1b}[1;31merror\u{1b}[0m"),
            ("\u{1b}[31mred\u{1b}[2J", "\u{1b}[31mred\\u{1b}[2J"),
            ("\u{1b}[", "\\u{1b}["),
            ("\u{1b}[1;", "\\u{1b}[1;"),
            ("\u{1b}\u{1b}[m", "\\u{1b}\u{1b}[m"),
            (
                "\u{1b}]8;;http://a\u{1b}\\text",
                "\\u{1b}]8;;http://a\\u{1b}\\text",
            ),
        ] {
            assert_eq!(printable_in_colour(text), shown);
        }
    }
}
