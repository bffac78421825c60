//! Reads a JSON file as facts, with the triples that Nemo makes of it.
//!
//! Each value has a number, and 0 is the whole document. `(n, type, "object")` gives the type of a
//! value: `object`, `array`, `string`, `number`, `bool` or `null`. `(n, value, v)` gives the value
//! of a string, number or bool, and `(n, key, m)` the member of an object, or the element of an
//! array, of which the first has the key 0.

use std::collections::BTreeSet;
use std::io::Read;

use crate::model::values::{double_term, integer};
use crate::standalone::faults::{Faults, Place};
use crate::standalone::sink::ImportSink;
use actcheck_base::{Term, TermId, Terms};

/// Maximum nesting of arrays and objects, so that recursion over them is safe.
const DEPTH_LIMIT: usize = 500;
/// Values between two checks of the memory.
const VALUES_PER_CHECK: usize = 4096;

/// Reads the facts of a document, at most `limit`. A document that is not valid is a fault, and has
/// no facts.
///
/// # Errors
/// Reading failed, or a limit was reached.
pub(super) fn read_json(
    mut reader: impl Read,
    limit: usize,
    sink: &mut ImportSink<'_>,
    faults: &mut Faults,
) -> std::io::Result<()> {
    let mut bytes = Vec::new();
    loop {
        let before = bytes.len();
        reader.by_ref().take(1 << 16).read_to_end(&mut bytes)?;
        if bytes.len() == before {
            break;
        }
        sink.limits
            .check_with(sink.other_bytes + sink.terms.bytes() + bytes.len())?;
    }
    let text = match std::str::from_utf8(&bytes) {
        Ok(text) => text,
        Err(error) => {
            let valid = String::from_utf8_lossy(&bytes[..error.valid_up_to()]);
            faults.add(place(&valid, valid.len()), || {
                "the text is not UTF-8".to_owned()
            });
            return Ok(());
        }
    };
    let mut parser = JsonParser {
        text,
        at: 0,
        depth: 0,
        values: Vec::new(),
        sink,
    };
    match parser.document() {
        Ok(root) => emit(&parser.values, root, limit, parser.sink),
        Err(JsonHalt::Fault(at, reason)) => {
            faults.add(place(text, at), || reason);
            Ok(())
        }
        Err(JsonHalt::Limit(error)) => Err(error),
    }
}

/// Returns the line and column of a byte of a text.
fn place(text: &str, at: usize) -> Place {
    let before = &text[..at];
    let line = before.matches('\n').count() as u64 + 1;
    let column = before
        .rsplit('\n')
        .next()
        .unwrap_or_default()
        .chars()
        .count() as u64
        + 1;
    Place { line, column }
}

/// A value; members and elements are indices of values.
enum JsonValue {
    Null,
    Bool(TermId),
    Number(TermId),
    Text(TermId),
    Array(Vec<usize>),
    /// Sorted by key.
    Object(Vec<(TermId, usize)>),
}

/// Why parsing ended.
enum JsonHalt {
    /// The text is not valid JSON at a byte.
    Fault(usize, String),
    Limit(std::io::Error),
}

struct JsonParser<'a, 's, 'l> {
    text: &'a str,
    /// Unit: bytes.
    at: usize,
    depth: usize,
    values: Vec<JsonValue>,
    sink: &'s mut ImportSink<'l>,
}

impl JsonParser<'_, '_, '_> {
    fn document(&mut self) -> Result<usize, JsonHalt> {
        let root = self.value()?;
        match self.peek() {
            None => Ok(root),
            Some(_) => self.fault("text follows the value; a file holds one value"),
        }
    }

    fn fault<T>(&self, reason: impl Into<String>) -> Result<T, JsonHalt> {
        Err(JsonHalt::Fault(self.at, reason.into()))
    }

    /// Skips white space and returns the next byte.
    fn peek(&mut self) -> Option<u8> {
        let rest = &self.text.as_bytes()[self.at..];
        self.at += rest
            .iter()
            .take_while(|byte| b" \t\r\n".contains(byte))
            .count();
        self.text.as_bytes().get(self.at).copied()
    }

    fn take(&mut self, byte: u8) -> bool {
        let found = self.peek() == Some(byte);
        self.at += usize::from(found);
        found
    }

    /// Adds a value and returns its index.
    fn add(&mut self, value: JsonValue) -> Result<usize, JsonHalt> {
        self.values.push(value);
        if self.values.len().is_multiple_of(VALUES_PER_CHECK) {
            let bytes = self.text.len() + self.values.len() * 2 * size_of::<JsonValue>();
            let sink = &self.sink;
            sink.limits
                .check_with(sink.other_bytes + sink.terms.bytes() + bytes)
                .map_err(JsonHalt::Limit)?;
        }
        Ok(self.values.len() - 1)
    }

    fn value(&mut self) -> Result<usize, JsonHalt> {
        match self.peek() {
            Some(b'{' | b'[') if self.depth == DEPTH_LIMIT => self.fault(format!(
                "more than {DEPTH_LIMIT} arrays and objects in each other"
            )),
            Some(b'{') => self.nested(Self::object),
            Some(b'[') => self.nested(Self::array),
            Some(b'"') => {
                let text = self.string()?;
                let id = self.sink.terms.intern_string(&text);
                self.add(JsonValue::Text(id))
            }
            Some(b'-' | b'0'..=b'9') => self.number(),
            _ => self.word(),
        }
    }

    fn nested(
        &mut self,
        parse: fn(&mut Self) -> Result<JsonValue, JsonHalt>,
    ) -> Result<usize, JsonHalt> {
        self.at += 1;
        self.depth += 1;
        let value = parse(self)?;
        self.depth -= 1;
        self.add(value)
    }

    fn array(&mut self) -> Result<JsonValue, JsonHalt> {
        let mut elements = Vec::new();
        if self.take(b']') {
            return Ok(JsonValue::Array(elements));
        }
        loop {
            elements.push(self.value()?);
            if self.take(b']') {
                return Ok(JsonValue::Array(elements));
            }
            if !self.take(b',') {
                return self.fault("expected `,` or `]`");
            }
        }
    }

    fn object(&mut self) -> Result<JsonValue, JsonHalt> {
        let mut members: Vec<(String, usize)> = Vec::new();
        let mut keys = BTreeSet::new();
        if !self.take(b'}') {
            loop {
                if self.peek() != Some(b'"') {
                    return self.fault("expected a key in quotes");
                }
                let start = self.at;
                let key = self.string()?;
                if !keys.insert(key.clone()) {
                    self.at = start;
                    return self.fault(format!("the key {key:?} occurs twice in an object"));
                }
                if !self.take(b':') {
                    return self.fault("expected `:` after the key");
                }
                members.push((key, self.value()?));
                if self.take(b'}') {
                    break;
                }
                if !self.take(b',') {
                    return self.fault("expected `,` or `}`");
                }
            }
        }
        members.sort();
        let terms = &mut *self.sink.terms;
        Ok(JsonValue::Object(
            members
                .into_iter()
                .map(|(key, value)| (terms.intern_string(&key), value))
                .collect(),
        ))
    }

    fn word(&mut self) -> Result<usize, JsonHalt> {
        for (word, truth) in [("true", Some(true)), ("false", Some(false)), ("null", None)] {
            if self.text[self.at..].starts_with(word) {
                self.at += word.len();
                let value = truth.map(|truth| self.sink.terms.intern(Term::Boolean(truth)));
                return self.add(value.map_or(JsonValue::Null, JsonValue::Bool));
            }
        }
        self.fault("expected a value")
    }

    fn digits(&mut self) -> usize {
        let count = self.text.as_bytes()[self.at..]
            .iter()
            .take_while(|byte| byte.is_ascii_digit())
            .count();
        self.at += count;
        count
    }

    fn number(&mut self) -> Result<usize, JsonHalt> {
        let (start, bytes) = (self.at, self.text.as_bytes());
        let is = |at: usize, wanted: &[u8]| bytes.get(at).is_some_and(|byte| wanted.contains(byte));
        self.at += usize::from(is(self.at, b"-"));
        let first = self.at;
        if self.digits() == 0 {
            return self.fault("expected a digit");
        }
        if is(first, b"0") && self.at > first + 1 {
            self.at = first;
            return self.fault("a number does not begin with 0");
        }
        let mut whole = true;
        if is(self.at, b".") {
            (self.at, whole) = (self.at + 1, false);
            if self.digits() == 0 {
                return self.fault("expected a digit after the point");
            }
        }
        if is(self.at, b"eE") {
            (self.at, whole) = (self.at + 1, false);
            self.at += usize::from(is(self.at, b"+-"));
            if self.digits() == 0 {
                return self.fault("expected a digit of the exponent");
            }
        }
        let text = &self.text[start..self.at];
        let double = || {
            text.parse()
                .ok()
                .filter(|value: &f64| value.is_finite())
                .map(double_term)
        };
        let Some(term) = (if whole { integer(text) } else { double() }) else {
            self.at = start;
            return self.fault("the number is out of range");
        };
        let id = self.sink.terms.intern(term);
        self.add(JsonValue::Number(id))
    }

    /// Reads a string from its opening quote on.
    fn string(&mut self) -> Result<String, JsonHalt> {
        let start = self.at;
        self.at += 1;
        let mut text = String::new();
        loop {
            let plain = self.text[self.at..].find(|c: char| c == '"' || c == '\\' || c < ' ');
            let Some(length) = plain else {
                self.at = start;
                return self.fault("the string that begins here has no end");
            };
            text.push_str(&self.text[self.at..self.at + length]);
            self.at += length;
            match self.text.as_bytes()[self.at] {
                b'"' => {
                    self.at += 1;
                    return Ok(text);
                }
                b'\\' => text.push(self.escape()?),
                _ => return self.fault("a control character or end of line in a string"),
            }
        }
    }

    /// Reads an escape from its backslash on.
    fn escape(&mut self) -> Result<char, JsonHalt> {
        let found = match self.text.as_bytes().get(self.at + 1) {
            Some(b'u') => return self.code_point(),
            Some(b'n') => '\n',
            Some(b't') => '\t',
            Some(b'r') => '\r',
            Some(b'b') => '\u{8}',
            Some(b'f') => '\u{c}',
            Some(byte @ (b'"' | b'\\' | b'/')) => char::from(*byte),
            _ => return self.fault("unknown escape"),
        };
        self.at += 2;
        Ok(found)
    }

    /// Reads `\uXXXX`, or the two escapes of a surrogate pair.
    fn code_point(&mut self) -> Result<char, JsonHalt> {
        let unit = |at: usize| {
            let digits = self.text.get(at..at + 6)?.strip_prefix("\\u")?;
            let is_hex = digits.bytes().all(|byte| byte.is_ascii_hexdigit());
            u16::from_str_radix(digits, 16).ok().filter(|_| is_hex)
        };
        let units: Vec<u16> = [self.at, self.at + 6].into_iter().map_while(unit).collect();
        let Some(Ok(found)) = char::decode_utf16(units).next() else {
            return self.fault("`\\u` needs four hexadecimal digits of a character");
        };
        self.at += 6 * found.len_utf16();
        Ok(found)
    }
}

/// Adds the facts of the values. They are numbered as Nemo does it: the parts of a value when it is
/// visited, and the last part is visited first.
fn emit(
    values: &[JsonValue],
    root: usize,
    limit: usize,
    sink: &mut ImportSink<'_>,
) -> std::io::Result<()> {
    let [kind, content] = ["type", "value"].map(|name| sink.terms.intern_iri(name));
    let (mut stack, mut last, mut left) = (vec![(0_i64, root)], 0_i64, limit);
    let mut row = |sink: &mut ImportSink<'_>, make: &dyn Fn(&mut Terms) -> [TermId; 3]| {
        if left == 0 {
            return Ok(());
        }
        left -= 1;
        sink.row(|terms, row| {
            row.extend(make(terms));
            true
        })
    };
    while let Some((number, at)) = stack.pop() {
        let id = sink.terms.intern(Term::Integer(number));
        let (name, atom, parts) = match &values[at] {
            JsonValue::Null => ("null", None, Vec::new()),
            JsonValue::Bool(id) => ("bool", Some(*id), Vec::new()),
            JsonValue::Number(id) => ("number", Some(*id), Vec::new()),
            JsonValue::Text(id) => ("string", Some(*id), Vec::new()),
            JsonValue::Array(elements) => {
                let key = |key: usize, sink: &mut ImportSink<'_>| {
                    sink.terms.intern(Term::Integer(key as i64))
                };
                (
                    "array",
                    None,
                    elements
                        .iter()
                        .enumerate()
                        .map(|(idx, at)| (key(idx, sink), *at))
                        .collect(),
                )
            }
            JsonValue::Object(members) => ("object", None, members.clone()),
        };
        row(sink, &|terms| [id, kind, terms.intern_string(name)])?;
        if let Some(atom) = atom {
            row(sink, &|_| [id, content, atom])?;
        }
        for (key, part) in parts {
            last += 1;
            let number = last;
            row(sink, &|terms| {
                [id, key, terms.intern(Term::Integer(number))]
            })?;
            stack.push((number, part));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::standalone::{Engine, Program};
    use actcheck_base::{Diagnostics, Source};

    fn facts(json: &[u8], options: &str) -> Result<Vec<String>, Diagnostics> {
        let folder = tempfile::tempdir().expect("there is a folder for temporary files");
        std::fs::write(folder.path().join("f.json"), json).expect("the folder is writable");
        let text = format!("@import p :- json{{resource = \"f.json\"{options}}} .");
        let program = Program::load(&Source::new("p.rls", text), folder.path())?;
        let closure = program
            .close(Engine::Fast, &crate::Budget::default())
            .expect("it is small");
        let shown = |tuple: &Vec<actcheck_base::Term>| {
            tuple
                .iter()
                .map(ToString::to_string)
                .collect::<Vec<_>>()
                .join(" ")
        };
        Ok(closure.tuples("p").iter().map(shown).collect())
    }

    #[test]
    fn a_document_gives_triples() {
        let json = r#"{"b": [true, null], "a": {"x": -1.55e1, "y": "\u00e9\ud83e\udd80\n", "z": 18446744073709551616}}"#;
        let mut expected = vec![
            r#"0 <type> "object""#,
            r#"0 "a" 1"#,
            r#"0 "b" 2"#,
            r#"2 <type> "array""#,
            "2 0 3",
            "2 1 4",
            r#"4 <type> "null""#,
            r#"3 <type> "bool""#,
            "3 <value> true",
            r#"1 <type> "object""#,
            r#"1 "x" 5"#,
            r#"1 "y" 6"#,
            r#"1 "z" 7"#,
            r#"7 <type> "number""#,
            r#"7 <value> "18446744073709551616"^^xsd:integer"#,
            r#"6 <type> "string""#,
            "6 <value> \"é🦀\\n\"",
            r#"5 <type> "number""#,
            "5 <value> -15.5",
        ];
        expected.sort_unstable();
        let mut found = facts(json.as_bytes(), "").expect("it is valid");
        found.sort_unstable();
        assert_eq!(found, expected);
        assert_eq!(
            facts(json.as_bytes(), ", limit = 3")
                .expect("it is valid")
                .len(),
            3
        );
    }

    #[test]
    fn each_fault_has_its_place() {
        let deep = "[".repeat(600);
        for (json, place, reason) in [
            ("", "f.json:1:1:", "expected a value"),
            ("{\n \"a\": tru }", "f.json:2:7:", "expected a value"),
            ("{\"é\": 1,\n \"b\" 2}", "f.json:2:6:", "expected `:`"),
            ("{\"a\": 1, \"a\": 2}", "f.json:1:10:", "occurs twice"),
            ("{a: 1}", "f.json:1:2:", "key in quotes"),
            ("[1, 2", "f.json:1:6:", "`,` or `]`"),
            ("[1, 02]", "f.json:1:5:", "begin with 0"),
            ("[1.]", "f.json:1:4:", "after the point"),
            ("[1e400]", "f.json:1:2:", "out of range"),
            ("[\"abc]", "f.json:1:2:", "no end"),
            ("[\"a\nb\"]", "f.json:1:4:", "end of line"),
            ("\"\\x\"", "f.json:1:2:", "unknown escape"),
            ("\"\\ud800!\"", "f.json:1:2:", "hexadecimal"),
            ("{} {}", "f.json:1:4:", "one value"),
            (deep.as_str(), "f.json:1:501:", "more than 500"),
        ] {
            let found = facts(json.as_bytes(), "").expect_err(json).to_string();
            assert!(
                found.contains("R074") && found.contains(place) && found.contains(reason),
                "{json}: {found}"
            );
        }
        let found = facts(b"[\"\xff\"]", "")
            .expect_err("it is not UTF-8")
            .to_string();
        assert!(
            found.contains("f.json:1:3: the text is not UTF-8"),
            "{found}"
        );
        let found = facts(b"[]", ", format = (any)")
            .expect_err("not an option of JSON")
            .to_string();
        assert!(found.contains("R071"), "{found}");
    }
}
