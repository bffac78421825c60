//! The page of a text: its width, and whether it has colours.

use std::ops::Range;

use actcheck_base::{ShellLine, printable_in_colour};

/// Narrowest page whose lines are broken. Unit: columns.
const NARROWEST: usize = 20;
/// A space at which no line is broken, as in a command to copy. The finished text has plain spaces.
const TIED: char = '\u{a0}';

/// How a text is set.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Page {
    /// Width of the terminal; `None` for files and pipes, whose lines are not broken. Unit:
    /// columns.
    pub width: Option<usize>,
    /// Whether it has colours, as ANSI sequences.
    pub colour: bool,
}

/// A command to copy, which stays in one line.
pub(crate) fn command(line: &ShellLine) -> String {
    line.to_string().replace(' ', &TIED.to_string())
}

impl Page {
    /// Breaks the lines that are longer than the page between words, and indents the rest of each.
    /// Words, and text in backquotes, are never broken.
    pub fn set(self, text: &str) -> String {
        let broken = match self.width {
            Some(width) if width >= NARROWEST => text
                .split_inclusive('\n')
                .map(|line| set_line(line, width))
                .collect(),
            _ => text.to_owned(),
        };
        // Texts of skills, models and histories may have control characters, and pipes often end at
        // a terminal.
        printable_in_colour(&broken.replace(TIED, " ")).into_owned()
    }

    /// As [`Page::set`], but does not indent the rest of a line.
    pub fn fill(self, text: &str) -> String {
        match self.width {
            Some(width) if width >= NARROWEST => text
                .split_inclusive('\n')
                .map(|line| break_line(line, width, 0))
                .collect::<String>()
                .replace(TIED, " "),
            _ => self.set(text),
        }
    }
}

fn set_line(line: &str, width: usize) -> String {
    break_line(line, width, hang(line, width))
}

/// Breaks a line that is longer than `width` between words, and indents all but its first part by
/// `hang` columns.
fn break_line(line: &str, width: usize, hang: usize) -> String {
    let (text, end) = line
        .strip_suffix('\n')
        .map_or((line, ""), |text| (text, "\n"));
    if shown_width(text) <= width {
        return line.to_owned();
    }
    let text = text.trim_end_matches(' ');
    let (mut out, mut column) = (String::new(), 0);
    for Word { gap, letters } in words(text) {
        let wide = shown_width(&text[letters.clone()]);
        if column > hang && column + gap + wide > width {
            out.push('\n');
            out.push_str(&" ".repeat(hang));
            column = hang;
        } else {
            out.push_str(&" ".repeat(gap));
            column += gap;
        }
        out.push_str(&text[letters]);
        column += wide;
    }
    out + end
}

/// A word of a line and the number of spaces before it.
struct Word {
    gap: usize,
    letters: Range<usize>,
}

/// The words of a line. Text in backquotes is one word.
fn words(line: &str) -> Vec<Word> {
    let mut words = Vec::new();
    let (mut gap, mut begin, mut quoted) = (0, None, false);
    for (at, letter) in line.char_indices() {
        if letter == ' ' && !quoted {
            if let Some(begin) = begin.take() {
                words.push(Word {
                    gap,
                    letters: begin..at,
                });
                gap = 0;
            }
            gap += 1;
            continue;
        }
        // A quote without an end ties nothing.
        quoted ^= letter == '`' && (quoted || line[at + 1..].contains('`'));
        begin.get_or_insert(at);
    }
    words.extend(begin.map(|begin| Word {
        gap,
        letters: begin..line.len(),
    }));
    words
}

/// Indentation of the further lines: two columns more than the first, or the column of the value if
/// the line is a name and a value.
fn hang(line: &str, width: usize) -> usize {
    let indent = line.len() - line.trim_start_matches(' ').len();
    let value = words(line)
        .into_iter()
        .skip(1)
        .find(|word| word.gap >= 3)
        .map(|word| word.letters.start);
    value
        .map(|at| line[..at].chars().count())
        .filter(|column| *column <= width / 2)
        .unwrap_or(indent + 2)
}

/// Number of columns of a text, without its colours.
pub(crate) fn shown_width(text: &str) -> usize {
    let (mut count, mut in_colour) = (0, false);
    for letter in text.chars() {
        match (in_colour, letter) {
            (false, '\u{1b}') => in_colour = true,
            (false, _) => count += 1,
            (true, 'm') => in_colour = false,
            (true, _) => {}
        }
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(text: &str, width: usize) -> String {
        Page {
            width: Some(width),
            colour: false,
        }
        .set(text)
    }

    #[test]
    fn lines_are_broken_between_words_and_never_within_them() {
        let text = "  Pick failed: CloseObject: glass_1 is 94.2 cm from the gripper\nshort\n";
        let expected =
            "  Pick failed: CloseObject:\n    glass_1 is 94.2 cm from\n    the gripper\nshort\n";
        assert_eq!(set(text, 28), expected);
        assert_eq!(
            set(&set(text, 28), 28),
            expected,
            "a text that fits is not changed"
        );
        assert_eq!(set(text, 200), text);
        assert_eq!(Page::default().set(text), text);
        let page = Page {
            width: Some(20),
            colour: false,
        };
        assert_eq!(
            page.fill("write it like `seed = 7` or not\n"),
            "write it like\n`seed = 7` or not\n"
        );
        let name = "NoGraspCollisionsWithAnythingButTheTarget";
        assert_eq!(
            set(&format!("the {name} b"), 20),
            format!("the\n  {name}\n  b")
        );
    }

    #[test]
    fn commands_and_text_in_backquotes_stay_in_one_line() {
        let text = "more: ".to_owned()
            + &command(
                &ShellLine::default().fixed("actcheck show k7f3-1 --history configs/.actcheck"),
            )
            + "\n";
        assert_eq!(
            set(&text, 30),
            "more:\n  actcheck show k7f3-1 --history configs/.actcheck\n"
        );
        assert_eq!(
            Page::default().set(&text),
            "more: actcheck show k7f3-1 --history configs/.actcheck\n"
        );
        assert_eq!(
            set("write `seed = 7` (a whole number)", 20),
            "write `seed = 7` (a\n  whole number)"
        );
        assert_eq!(
            set("it's a lone ` and some words more", 20),
            "it's a lone ` and\n  some words more"
        );
    }

    #[test]
    fn a_value_is_indented_below_its_beginning_and_colours_have_no_width() {
        assert_eq!(
            set(" iri     one two three four five\n", 24),
            " iri     one two three\n         four five\n"
        );
        let red = "\u{1b}[31mred\u{1b}[0m and more";
        assert_eq!(shown_width(red), 12);
        assert_eq!(set(&format!("{red} words"), 20), format!("{red} words"));
    }
}
