//! A limit on the brackets of Turtle and TriG texts, because parsers keep every open one in memory.

use std::io::{Error, Read};

use crate::{Diagnostic, Diagnostics, Source};

/// Maximum number of brackets inside each other.
const MAX_DEPTH: usize = 10_000;

/// Follows the brackets of a text that is read in pieces.
#[derive(Debug, Clone, Default)]
struct Brackets {
    depth: usize,
    state: State,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum State {
    #[default]
    Plain,
    /// After a backslash; then as before.
    Escape(Inside),
    Comment,
    /// After `<`.
    Less,
    Iri,
    /// After one or two quotation marks, which may begin a text or be an empty one.
    Begin(u8, usize),
    Text(u8),
    /// In a text of several lines, after some quotation marks.
    LongText(u8, usize),
}

/// Where an escape is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Inside {
    Plain,
    Text(u8),
    LongText(u8),
}

impl Brackets {
    /// Reads a piece. Returns the offset of the first bracket that is too deep, if there is one.
    fn read(&mut self, piece: &[u8]) -> Option<usize> {
        for (at, byte) in piece.iter().enumerate() {
            self.state = match (self.state, *byte) {
                (State::Escape(Inside::Plain), _) => State::Plain,
                (State::Escape(Inside::Text(mark)), _) => State::Text(mark),
                (State::Escape(Inside::LongText(mark)), _) => State::LongText(mark, 0),
                (State::Comment | State::Iri | State::Text(_), b'\n') => State::Plain,
                (State::Comment, _) => State::Comment,
                (State::Iri, b'>') => State::Plain,
                (State::Iri, _) => State::Iri,
                (State::Text(mark), b'\\') => State::Escape(Inside::Text(mark)),
                (State::Text(mark), byte) if byte == mark => State::Plain,
                (State::Text(mark), _) => State::Text(mark),
                (State::LongText(mark, _), b'\\') => State::Escape(Inside::LongText(mark)),
                (State::LongText(mark, 2), byte) if byte == mark => State::Plain,
                (State::LongText(mark, count), byte) if byte == mark => {
                    State::LongText(mark, count + 1)
                }
                (State::LongText(mark, _), _) => State::LongText(mark, 0),
                (State::Begin(mark, 2), byte) if byte == mark => State::LongText(mark, 0),
                (State::Begin(mark, count), byte) if byte == mark => State::Begin(mark, count + 1),
                (State::Begin(mark, 1), b'\\') => State::Escape(Inside::Text(mark)),
                (State::Begin(mark, 1), byte) if byte != b'\n' => State::Text(mark),
                // `<<` begins a triple that is a term.
                (State::Less, b'<') => State::Plain,
                (State::Less, b'>' | b'\n') => State::Plain,
                (State::Less, _) => State::Iri,
                (State::Plain | State::Begin(..), byte) => self.plain(byte),
            };
            if self.depth > MAX_DEPTH {
                return Some(at);
            }
        }
        None
    }

    fn plain(&mut self, byte: u8) -> State {
        match byte {
            b'(' | b'[' | b'{' => self.depth += 1,
            b')' | b']' | b'}' => self.depth = self.depth.saturating_sub(1),
            b'#' => return State::Comment,
            b'<' => return State::Less,
            b'"' | b'\'' => return State::Begin(byte, 1),
            b'\\' => return State::Escape(Inside::Plain),
            _ => {}
        }
        State::Plain
    }
}

/// Hands on a Turtle or TriG text, and fails if its brackets are nested too deeply.
///
/// ```
/// use actcheck_base::TurtleGuard;
///
/// let read = |text: String| std::io::copy(&mut TurtleGuard::new(text.as_bytes()), &mut std::io::sink());
/// assert!(read("<a> <b> (1 (2)), \"((((\" .".to_owned()).is_ok());
/// assert!(read("(".repeat(100_000)).is_err());
/// ```
#[derive(Debug)]
pub struct TurtleGuard<R> {
    inner: R,
    brackets: Brackets,
}

impl<R: Read> TurtleGuard<R> {
    /// Wraps a reader.
    pub fn new(inner: R) -> Self {
        Self {
            inner,
            brackets: Brackets::default(),
        }
    }
}

impl<R: Read> Read for TurtleGuard<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let count = self.inner.read(buffer)?;
        match self.brackets.read(&buffer[..count]) {
            None => Ok(count),
            Some(_) => Err(Error::other(excess())),
        }
    }
}

fn excess() -> String {
    format!("brackets are nested more than {MAX_DEPTH} levels deep")
}

/// Checks the brackets of a Turtle text.
///
/// # Errors
/// The diagnostic with this code, at the first bracket that is too deep.
pub fn check_turtle(source: &Source, code: &'static str) -> Result<(), Diagnostics> {
    let Some(at) = Brackets::default().read(source.text.as_bytes()) else {
        return Ok(());
    };
    Err(
        Diagnostic::error(code, format!("this Turtle is refused: {}", excess()))
            .at(source, at..at + 1)
            .help("such a text can exhaust memory; name the inner nodes instead")
            .into(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The depth after a text, which is read in pieces of any length.
    fn depth(text: &str) -> usize {
        let depths: Vec<usize> = (1..=text.len())
            .map(|length| {
                let mut brackets = Brackets::default();
                text.as_bytes()
                    .chunks(length)
                    .for_each(|piece| assert_eq!(brackets.read(piece), None));
                brackets.depth
            })
            .collect();
        assert!(
            depths.iter().all(|depth| *depth == depths[0]),
            "{text}: {depths:?}"
        );
        depths[0]
    }

    #[test]
    fn only_brackets_of_the_structure_count() {
        for (text, expected) in [
            ("<a> <b> ( [ <p> 1 ] {", 2),
            ("<a(b> <p> <(((> .", 0),
            ("<a> <p> \"((\", '[[', \"\", '', \"a\\\"((\", '\\'((' (", 1),
            ("<a> <p> \"\"\"(\"(\"\"(\\\"\"\"(\"\"\" (", 1),
            ("<a> <p> '''((''(''' , \"\"\"\"\"\" (", 1),
            ("# ((( \n ( # (", 1),
            ("ex:a\\(\\( ex:p (", 1),
            ("<< <a> <p> (1) >> <q> (", 1),
            ("\"not closed (\n(", 1),
            ("<not closed (\n(", 1),
            (")))(", 1),
        ] {
            assert_eq!(depth(text), expected, "{text}");
        }
    }

    #[test]
    fn deep_nesting_is_refused_at_its_place() {
        let text = format!("<a> <p>\n{}", "(".repeat(20_000));
        let found = check_turtle(&Source::new("a.ttl", text), "O013")
            .expect_err("it is too deep")
            .to_string();
        assert!(
            found.contains("a.ttl:2:10001") && found.contains("more than 10000 levels"),
            "{found}"
        );
        let text = format!("<a> <p> {}1{} .", "(".repeat(5_000), ")".repeat(5_000)).repeat(4);
        assert!(check_turtle(&Source::new("a.ttl", text), "O013").is_ok());
    }
}
