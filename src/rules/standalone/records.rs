//! Splits delimited text into rows and fields, without copying them.
//!
//! As RFC 4180, and as the crate `csv` where that is silent: a row ends with `\n`, `\r\n` or `\r`,
//! empty lines are skipped, and a quote inside an unquoted field is a character. Unlike `csv`, it
//! knows the place of each field, and finds quotes that do not end and text after a closing quote.

use std::borrow::Cow;
use std::io::Read;
use std::ops::Range;

use crate::standalone::faults::Place;

/// Maximum size of a row. Unit: bytes.
const MAX_ROW: usize = 64 << 20;

/// Reads rows.
pub(super) struct Records<R> {
    reader: R,
    delimiter: u8,
    quoting: bool,
    /// The bytes read and not yet dropped.
    buffer: Vec<u8>,
    /// How much of the buffer is filled.
    filled: usize,
    at_end: bool,
    /// Where the row begins, and how far it was scanned.
    start: usize,
    at: usize,
    /// Line of the row's beginning, from 1, and the newlines inside it.
    line: u64,
    newlines: u64,
    fields: Vec<Field>,
}

/// A field of the row: offsets from its beginning.
#[derive(Debug, Clone)]
struct Field {
    bytes: Range<usize>,
    form: FieldForm,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum FieldForm {
    /// The bytes are the text.
    Plain,
    /// The bytes have doubled quotes. They include the opening quote, and the closing one if text
    /// follows it.
    Escaped { torn: bool },
}

/// Whether another row was found.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum RowRead {
    Row,
    End,
    /// The file ends in a quoted field, or the row is too long: nothing else can be read.
    Broken(Place, &'static str),
}

/// The state in a field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    /// At the beginning of a field.
    Start,
    Plain,
    Quoted,
    /// After a quote in a quoted field: it closes the field, or is the first of a doubled one.
    Quote,
    /// In the text after a closing quote.
    Torn,
}

impl<R: Read> Records<R> {
    pub(super) fn new(reader: R, delimiter: u8, quoting: bool) -> Self {
        Self {
            reader,
            delimiter,
            quoting,
            buffer: vec![0; 1 << 16],
            filled: 0,
            at_end: false,
            start: 0,
            at: 0,
            line: 1,
            newlines: 0,
            fields: Vec::new(),
        }
    }

    /// Finds the next row, of which the fields are then available.
    ///
    /// # Errors
    /// Reading failed.
    pub(super) fn next(&mut self) -> std::io::Result<RowRead> {
        self.line += std::mem::take(&mut self.newlines);
        self.start = self.at;
        self.fields.clear();
        let (mut state, mut field, mut doubled) = (State::Start, 0, false);
        loop {
            if self.at == self.filled && !self.more()? {
                return Ok(self.end(state, field, doubled));
            }
            if self.at - self.start > MAX_ROW {
                let place = self.place(field);
                return Ok(RowRead::Broken(
                    place,
                    "the row that begins here is longer than 64 MiB; a quote may be missing",
                ));
            }
            let byte = self.buffer[self.at];
            let offset = self.at - self.start;
            self.at += 1;
            let closes = byte == self.delimiter || byte == b'\n' || byte == b'\r';
            state = match state {
                State::Quoted if byte == b'"' => State::Quote,
                State::Quoted => {
                    self.newlines += u64::from(byte == b'\n');
                    State::Quoted
                }
                State::Quote if byte == b'"' => {
                    doubled = true;
                    State::Quoted
                }
                _ if closes => {
                    let empty_line =
                        byte != self.delimiter && state == State::Start && self.fields.is_empty();
                    if byte == b'\n' || (byte == b'\r' && !self.at_newline()?) {
                        self.newlines += 1;
                    }
                    if empty_line {
                        self.line += std::mem::take(&mut self.newlines);
                        self.start = self.at;
                        continue;
                    }
                    self.push(state, field, offset, doubled);
                    if byte != self.delimiter {
                        return Ok(RowRead::Row);
                    }
                    (field, doubled) = (offset + 1, false);
                    State::Start
                }
                State::Start if byte == b'"' && self.quoting => State::Quoted,
                State::Start | State::Plain => {
                    self.skip_plain();
                    State::Plain
                }
                State::Quote | State::Torn => State::Torn,
            };
        }
    }

    /// Skips the bytes of an unquoted field.
    fn skip_plain(&mut self) {
        let delimiter = self.delimiter;
        let rest = &self.buffer[self.at..self.filled];
        let closes = |byte: &u8| *byte == delimiter || *byte == b'\n' || *byte == b'\r';
        self.at += rest.iter().position(closes).unwrap_or(rest.len());
    }

    /// Returns whether the next byte is a newline, which is then counted with the carriage return
    /// before it.
    fn at_newline(&mut self) -> std::io::Result<bool> {
        Ok((self.at < self.filled || self.more()?) && self.buffer[self.at] == b'\n')
    }

    /// Ends the last row at the end of the file.
    fn end(&mut self, state: State, field: usize, doubled: bool) -> RowRead {
        if state == State::Start && self.fields.is_empty() {
            return RowRead::End;
        }
        if state == State::Quoted {
            return RowRead::Broken(self.place(field), "the quote that begins here has no end");
        }
        self.push(state, field, self.at - self.start, doubled);
        RowRead::Row
    }

    fn push(&mut self, state: State, start: usize, end: usize, doubled: bool) {
        let field = match state {
            State::Torn => Field {
                bytes: start..end,
                form: FieldForm::Escaped { torn: true },
            },
            State::Quote if doubled => Field {
                bytes: start..end - 1,
                form: FieldForm::Escaped { torn: false },
            },
            State::Quote => Field {
                bytes: start + 1..end - 1,
                form: FieldForm::Plain,
            },
            _ => Field {
                bytes: start..end,
                form: FieldForm::Plain,
            },
        };
        self.fields.push(field);
    }

    /// Reads more bytes. Returns `false` at the end of the file.
    fn more(&mut self) -> std::io::Result<bool> {
        if self.at_end {
            return Ok(false);
        }
        self.buffer.copy_within(self.start..self.filled, 0);
        self.filled -= self.start;
        self.at -= self.start;
        self.start = 0;
        if self.filled == self.buffer.len() {
            self.buffer.resize(self.filled * 2, 0);
        }
        let count = loop {
            match self.reader.read(&mut self.buffer[self.filled..]) {
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
                result => break result?,
            }
        };
        self.filled += count;
        self.at_end = count == 0;
        Ok(count > 0)
    }

    /// Returns the number of fields of the row.
    pub(super) fn len(&self) -> usize {
        self.fields.len()
    }

    /// Returns the text of a field.
    ///
    /// # Errors
    /// The text is not UTF-8.
    pub(super) fn text(&self, field: usize) -> Result<Cow<'_, str>, std::str::Utf8Error> {
        let Field { bytes, form } = &self.fields[field];
        let text =
            std::str::from_utf8(&self.buffer[self.start + bytes.start..self.start + bytes.end])?;
        Ok(match form {
            FieldForm::Plain => Cow::Borrowed(text),
            FieldForm::Escaped { .. } => Cow::Owned(unescaped(text)),
        })
    }

    /// Returns whether text follows the closing quote of a field.
    pub(super) fn is_torn(&self, field: usize) -> bool {
        self.fields[field].form == FieldForm::Escaped { torn: true }
    }

    /// Returns the place of a field, or of the row's beginning if it has no such field.
    pub(super) fn place_of(&self, field: usize) -> Place {
        self.place(self.fields.get(field).map_or(0, |field| field.bytes.start))
    }

    fn place(&self, offset: usize) -> Place {
        let before = &self.buffer[self.start..self.start + offset];
        let newlines = before.iter().filter(|byte| **byte == b'\n').count() as u64;
        let line_start = before
            .iter()
            .rposition(|byte| *byte == b'\n')
            .map_or(0, |end| end + 1);
        // Bytes that continue a character have the high bits `10`.
        let characters = before[line_start..]
            .iter()
            .filter(|byte| **byte & 0xc0 != 0x80)
            .count() as u64;
        Place {
            line: self.line + newlines,
            column: characters + 1,
        }
    }
}

/// Returns the text of a field that begins with its opening quote.
fn unescaped(field: &str) -> String {
    let mut out = String::with_capacity(field.len());
    let mut rest = field.get(1..).unwrap_or_default();
    while let Some((before, after)) = rest.split_once('"') {
        out.push_str(before);
        match after.strip_prefix('"') {
            Some(after) => {
                out.push('"');
                rest = after;
            }
            // The closing quote: the text after it is kept unchanged.
            None => {
                rest = after;
                break;
            }
        }
    }
    out.push_str(rest);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rows of a text, read in chunks of one byte, and how it ended.
    fn rows(text: &str, quoting: bool) -> (Vec<Vec<String>>, RowRead) {
        struct Slow<'a>(&'a [u8]);
        impl Read for Slow<'_> {
            fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
                let length = buffer.len().min(1);
                self.0.read(&mut buffer[..length])
            }
        }
        let mut records = Records::new(Slow(text.as_bytes()), b',', quoting);
        let mut rows = Vec::new();
        loop {
            match records.next().expect("a slice can be read") {
                RowRead::Row => rows.push(
                    (0..records.len())
                        .map(|field| records.text(field).expect("it is UTF-8").into_owned())
                        .collect(),
                ),
                end => return (rows, end),
            }
        }
    }

    #[test]
    fn rows_are_those_of_the_crate_csv() {
        let quotes = [
            "\"a\",b",
            "\"a\"\"b\"\"\",\"\"",
            "\"\"\"\"",
            "\"a\nb\"",
            "a\"b\",c",
            "\"a\"b\",c",
            "\"\"\"@en",
        ];
        let plain = [
            "",
            "a",
            ",",
            ",,\n",
            "\n\na,b\n\n",
            "a\r\nb\rc\n\r\nd",
            "é,ü",
            "a,b\n c ,",
            "\r",
            "\n,",
        ];
        for text in quotes.into_iter().chain(plain) {
            for quoting in [true, false] {
                let (found, end) = rows(text, quoting);
                if end != RowRead::End {
                    continue;
                }
                let mut reader = csv::ReaderBuilder::new();
                let mut reader = reader
                    .has_headers(false)
                    .flexible(true)
                    .quoting(quoting)
                    .from_reader(text.as_bytes());
                let wanted: Vec<Vec<String>> = reader
                    .records()
                    .map(|row| {
                        row.expect("it is UTF-8")
                            .iter()
                            .map(str::to_owned)
                            .collect()
                    })
                    .collect();
                assert_eq!(found, wanted, "{text:?}, quoting: {quoting}");
            }
        }
    }

    #[test]
    fn places_count_lines_inside_of_quotes_and_all_line_ends() {
        let text = "a\r\n\r\"é\n\",\"x\"y\n\n\"b";
        let mut records = Records::new(text.as_bytes(), b',', true);
        let place = |line, column| Place { line, column };
        assert_eq!(records.next().ok(), Some(RowRead::Row));
        assert_eq!(
            (records.place_of(0), records.is_torn(0)),
            (place(1, 1), false)
        );
        assert_eq!(records.next().ok(), Some(RowRead::Row));
        assert_eq!(
            (records.place_of(1), records.is_torn(1)),
            (place(4, 3), true)
        );
        assert_eq!(records.text(1).ok().as_deref(), Some("xy"));
        assert_eq!(
            records.next().ok(),
            Some(RowRead::Broken(
                place(6, 1),
                "the quote that begins here has no end"
            ))
        );
    }

    #[test]
    fn an_endless_row_is_refused() {
        let mut records = Records::new(std::io::repeat(b'x'), b',', true);
        assert!(matches!(
            records.next(),
            Ok(RowRead::Broken(Place { line: 1, column: 1 }, _))
        ));
    }
}
