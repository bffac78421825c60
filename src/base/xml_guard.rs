//! A reader that bounds the work that an XML document demands of a parser.

use std::cell::RefCell;
use std::collections::HashMap;
use std::io::{BufRead, BufReader, Error, Read};
use std::rc::Rc;

/// Maximum size of a text, comment, CDATA section or instruction. Unit: bytes.
const MAX_TEXT: usize = 64 << 20;
/// Maximum size of a tag, and of the document type. Unit: bytes.
const MAX_TAG: usize = 1 << 20;
/// Maximum number of attributes of one tag; parsers compare all pairs.
const MAX_ATTRIBUTES: usize = 256;
/// Maximum number of namespaces declared around one place; parsers search all of them for each
/// name.
const MAX_NAMESPACES: usize = 256;
/// Maximum number of namespaces around all elements that declare one, added up: some parsers copy
/// them each time.
const MAX_COPIED_NAMESPACES: usize = 10_000_000;
/// Maximum number of elements inside each other.
const MAX_DEPTH: usize = 10_000;
/// Maximum size of one entity after its expansion. Those of ontologies are IRIs. Unit: bytes.
const MAX_ENTITY: usize = 1 << 16;
/// Maximum number of entity declarations.
const MAX_ENTITIES: usize = 10_000;
/// Entities may together expand to this size, and beyond it to [`MAX_AMPLIFICATION`] times the
/// document. Unit: bytes.
const FREE_EXPANSION: usize = 8 << 20;
const MAX_AMPLIFICATION: usize = 100;

/// Reads an XML document in parts: a text with the `<` after it, or a tag up to its `>`. Fails if
/// the document ends within an element, or demands too much: deep nesting, long tags, many
/// attributes, namespaces or entities.
///
/// Parsers of RDF/XML treat the end of a cut file as its regular end, and expand entities without a
/// bound.
///
/// ```
/// use std::io::Read;
///
/// use actcheck_base::XmlGuard;
///
/// let mut text = String::new();
/// let (mut guard, progress) = XmlGuard::new("<a>\n <b/>\n".as_bytes());
/// assert!(guard.read_to_string(&mut text).is_err());
/// assert_eq!(progress.fault().as_deref(), Some("the file ends inside `<a>` of line 1"));
/// assert_eq!(progress.line_and_column(), (3, 1));
/// ```
#[derive(Debug)]
pub struct XmlGuard<R> {
    inner: BufReader<R>,
    progress: XmlProgress,
    /// The part that is being handed on, and how much of it was.
    part: Vec<u8>,
    given: usize,
    /// Whether the next part is markup, after its `<`.
    in_markup: bool,
    open: Vec<Open>,
    /// Whether an element was found.
    any: bool,
    namespaces: usize,
    copied_namespaces: usize,
    /// Size of each declared entity after its expansion.
    entities: HashMap<Vec<u8>, usize>,
    expanded: usize,
    /// Bytes read so far.
    total: usize,
}

/// An element that has not ended.
#[derive(Debug)]
struct Open {
    name: String,
    line: u64,
    namespaces: usize,
}

/// How far an [`XmlGuard`] has read; shared, because a parser owns the guard.
#[derive(Debug, Clone, Default)]
pub struct XmlProgress(Rc<RefCell<Progress>>);

#[derive(Debug, Default)]
struct Progress {
    /// Newlines before the part that was handed on last, and characters after the last of them.
    lines: u64,
    characters: u64,
    /// The same place as a number of bytes.
    offset: usize,
    fault: Option<String>,
    /// Whether the document is incomplete, not excessive.
    is_cut: bool,
}

impl XmlProgress {
    /// Returns the place of the part that was read last, or of the fault. Both count from 1.
    pub fn line_and_column(&self) -> (u64, u64) {
        let progress = self.0.borrow();
        (progress.lines + 1, progress.characters + 1)
    }

    /// Returns the same place as the number of bytes before it.
    pub fn offset(&self) -> usize {
        self.0.borrow().offset
    }

    /// Returns the reason for which the guard refused the document, if it did.
    pub fn fault(&self) -> Option<String> {
        self.0.borrow().fault.clone()
    }

    /// Returns the reason for which the guard refused the document, unless the document is only
    /// incomplete.
    pub fn excess(&self) -> Option<String> {
        let progress = self.0.borrow();
        progress.fault.clone().filter(|_| !progress.is_cut)
    }
}

impl<R: Read> XmlGuard<R> {
    /// Wraps a reader.
    pub fn new(inner: R) -> (Self, XmlProgress) {
        let progress = XmlProgress::default();
        let guard = Self {
            inner: BufReader::with_capacity(1 << 16, inner),
            progress: progress.clone(),
            part: Vec::new(),
            given: 0,
            in_markup: false,
            open: Vec::new(),
            any: false,
            namespaces: 0,
            copied_namespaces: 0,
            entities: HashMap::new(),
            expanded: 0,
            total: 0,
        };
        (guard, progress)
    }

    fn refuse(&self, why: impl Into<String>) -> Error {
        let why = why.into();
        self.progress.0.borrow_mut().fault = Some(why.clone());
        Error::other(why)
    }

    fn refuse_cut(&self, why: impl Into<String>) -> Error {
        self.progress.0.borrow_mut().is_cut = true;
        self.refuse(why)
    }

    /// Moves the place behind the current part.
    fn advance(&mut self) {
        let mut progress = self.progress.0.borrow_mut();
        progress.offset += self.part.len();
        let last_line = match self.part.iter().rposition(|byte| *byte == b'\n') {
            Some(end) => {
                progress.lines += self.part.iter().filter(|byte| **byte == b'\n').count() as u64;
                progress.characters = 0;
                &self.part[end + 1..]
            }
            None => &self.part[..],
        };
        // Bytes that continue a character have the high bits `10`.
        progress.characters += last_line
            .iter()
            .filter(|byte| **byte & 0xc0 != 0x80)
            .count() as u64;
    }

    /// Appends bytes up to and including `end`. Returns whether it was found.
    fn until(&mut self, end: u8, limit: usize) -> std::io::Result<bool> {
        let rest = (limit + 1).saturating_sub(self.part.len());
        let before = self.part.len();
        self.inner
            .by_ref()
            .take(rest as u64)
            .read_until(end, &mut self.part)?;
        self.total += self.part.len() - before;
        if self.part.len() > limit {
            return Err(self.refuse(format!(
                "a part of the document is larger than {limit} bytes"
            )));
        }
        Ok(self.part.len() > before && self.part.last() == Some(&end))
    }

    /// Reads the next part. It is empty at the end of the document.
    fn next_part(&mut self) -> std::io::Result<()> {
        self.advance();
        self.part.clear();
        self.given = 0;
        if self.in_markup {
            self.in_markup = false;
            return self.markup();
        }
        self.in_markup = self.until(b'<', MAX_TEXT)?;
        self.references()?;
        if !self.in_markup && self.part.is_empty() {
            if let Some(open) = self.open.last() {
                return Err(self.refuse_cut(format!(
                    "the file ends inside `<{}>` of line {}",
                    open.name, open.line
                )));
            }
            if !self.any {
                return Err(self.refuse_cut("the file has no XML element"));
            }
        }
        Ok(())
    }

    /// Whether the markup after a `<` can be a comment or CDATA section, as far as it is known.
    fn is_long_markup(&mut self) -> std::io::Result<bool> {
        if self.part.is_empty() {
            return Ok(self.inner.fill_buf()?.first() == Some(&b'!'));
        }
        Ok(self.part.starts_with(b"!--") || self.part.starts_with(b"!["))
    }

    /// Reads the markup after a `<`.
    fn markup(&mut self) -> std::io::Result<()> {
        let (mut seen, mut quote, mut inner) = (0, None, 0);
        loop {
            let limit = if self.is_long_markup()? {
                MAX_TEXT
            } else {
                MAX_TAG
            };
            if !self.until(b'>', limit)? {
                return Err(self.refuse_cut("the file ends inside a tag or comment"));
            }
            let part = self.part.as_slice();
            let new = &part[seen..];
            seen = part.len();
            let complete = match part {
                [b'!', b'-', b'-', rest @ ..] => rest.len() >= 3 && rest.ends_with(b"-->"),
                [b'!', b'[', ..] => part.ends_with(b"]]>"),
                // The declarations inside a document type end with a `>` each.
                [b'!', ..] => {
                    inner += new.iter().filter(|byte| **byte == b'<').count();
                    let outer = inner == 0;
                    inner = inner.saturating_sub(1);
                    outer
                }
                [b'?', rest @ ..] => rest.len() >= 2 && rest.ends_with(b"?>"),
                _ => {
                    quote = new.iter().fold(quote, after);
                    quote.is_none()
                }
            };
            if complete {
                break;
            }
        }
        match self.part.first() {
            Some(b'!') if self.part.starts_with(b"!--") || self.part.starts_with(b"![") => Ok(()),
            Some(b'!') => self.document_type(),
            Some(b'?') => Ok(()),
            Some(b'/') => {
                if let Some(open) = self.open.pop() {
                    self.namespaces -= open.namespaces;
                }
                Ok(())
            }
            _ => self.element(),
        }
    }

    /// Checks a start tag.
    fn element(&mut self) -> std::io::Result<()> {
        self.any = true;
        self.references()?;
        let (attributes, namespaces) = attributes(&self.part);
        if self.namespaces + namespaces > MAX_NAMESPACES {
            return Err(self.refuse(format!(
                "more than {MAX_NAMESPACES} namespaces are declared around one element"
            )));
        }
        if attributes > MAX_ATTRIBUTES {
            return Err(self.refuse(format!(
                "an element has more than {MAX_ATTRIBUTES} attributes"
            )));
        }
        if namespaces > 0 {
            self.copied_namespaces += self.namespaces + namespaces;
        }
        if self.copied_namespaces > MAX_COPIED_NAMESPACES {
            return Err(self.refuse("too many elements declare namespaces"));
        }
        if self.part.ends_with(b"/>") {
            return Ok(());
        }
        if self.open.len() == MAX_DEPTH {
            return Err(self.refuse(format!("more than {MAX_DEPTH} elements are nested")));
        }
        self.namespaces += namespaces;
        let end = |byte: &u8| byte.is_ascii_whitespace() || b"/>".contains(byte);
        let name = &self.part[..self.part.iter().position(end).unwrap_or(0).min(80)];
        let line = self.progress.line_and_column().0;
        self.open.push(Open {
            name: String::from_utf8_lossy(name).into_owned(),
            line,
            namespaces,
        });
        Ok(())
    }

    /// Counts the size of the expanded entities in a text or tag.
    fn references(&mut self) -> std::io::Result<()> {
        if self.entities.is_empty() {
            return Ok(());
        }
        self.expanded = self
            .expanded
            .saturating_add(expansion(&self.part, &self.entities));
        if self.expanded > FREE_EXPANSION && self.expanded / MAX_AMPLIFICATION > self.total {
            return Err(self.refuse(format!(
                "its entities expand to more than {MAX_AMPLIFICATION} times the document"
            )));
        }
        Ok(())
    }

    /// Computes the sizes of the declared entities, in the order of their declaration.
    fn document_type(&mut self) -> std::io::Result<()> {
        for declaration in self
            .part
            .split(|byte| *byte == b'<')
            .filter_map(|text| text.strip_prefix(b"!ENTITY"))
        {
            let declaration = declaration.trim_ascii_start();
            let declaration = declaration
                .strip_prefix(b"%")
                .unwrap_or(declaration)
                .trim_ascii_start();
            let Some(end) = declaration.iter().position(u8::is_ascii_whitespace) else {
                continue;
            };
            let (name, value) = declaration.split_at(end);
            let size = value.len().saturating_add(expansion(value, &self.entities));
            if size > MAX_ENTITY {
                let name = String::from_utf8_lossy(&name[..name.len().min(80)]);
                return Err(self.refuse(format!(
                    "the entity `{name}` expands to more than {MAX_ENTITY} bytes"
                )));
            }
            self.entities.insert(name.to_vec(), size);
            if self.entities.len() > MAX_ENTITIES {
                return Err(self.refuse(format!("it declares more than {MAX_ENTITIES} entities")));
            }
        }
        Ok(())
    }
}

impl<R: Read> Read for XmlGuard<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        if self.given == self.part.len() {
            self.next_part()?;
        }
        let count = buffer.len().min(self.part.len() - self.given);
        buffer[..count].copy_from_slice(&self.part[self.given..self.given + count]);
        self.given += count;
        Ok(count)
    }
}

/// Returns the size of the entities that a text refers to.
fn expansion(text: &[u8], entities: &HashMap<Vec<u8>, usize>) -> usize {
    let references = text.split(|byte| *byte == b'&').skip(1);
    let names = references.filter_map(|rest| {
        rest.iter()
            .position(|byte| *byte == b';')
            .map(|end| &rest[..end])
    });
    names
        .filter_map(|name| entities.get(name))
        .fold(0, |sum, size| sum.saturating_add(*size))
}

/// Returns the quote that is open after a byte of a tag, given the one before it.
fn after(quote: Option<u8>, byte: &u8) -> Option<u8> {
    match (quote, byte) {
        (None, b'"' | b'\'') => Some(*byte),
        (Some(open), byte) if open == *byte => None,
        (quote, _) => quote,
    }
}

/// Returns the numbers of attributes and of namespace declarations of a tag.
fn attributes(tag: &[u8]) -> (usize, usize) {
    let (mut attributes, mut namespaces, mut quote) = (0, 0, None);
    for (idx, byte) in tag.iter().enumerate() {
        quote = after(quote, byte);
        if quote.is_none() && *byte == b'=' {
            let name = tag[..idx].trim_ascii_end();
            let before = |byte: &u8| byte.is_ascii_whitespace() || b"\"'=".contains(byte);
            let start = name.iter().rposition(before).map_or(0, |idx| idx + 1);
            attributes += 1;
            namespaces += usize::from(name[start..].starts_with(b"xmlns"));
        }
    }
    (attributes, namespaces)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The text that the guard hands on, or the reason and place of its refusal.
    fn guarded(text: &str) -> Result<String, (String, (u64, u64))> {
        let (mut guard, progress) = XmlGuard::new(text.as_bytes());
        let mut out = String::new();
        match guard.read_to_string(&mut out) {
            Ok(_) => Ok(out),
            Err(_) => Err((
                progress.fault().expect("only the guard fails"),
                progress.line_and_column(),
            )),
        }
    }

    fn refused(text: &str, why: &str) {
        let (fault, _) = guarded(text).expect_err(why);
        assert!(fault.contains(why), "{fault}");
    }

    #[test]
    fn documents_pass_unchanged() {
        for text in [
            "<a/>",
            "\u{feff}<?xml version='1.0'?>\n<!-- <b> > --><a b='>' c=\"</a>\">é<![CDATA[</a> ]] >]]></a>\n<!---->",
            "<!DOCTYPE a [<!ENTITY b \"http://x#\"> <!ENTITY c \"&b;c\">]><a d=\"&c;\" xmlns:e = '&b;'>&c;<e:f/></a>",
        ] {
            assert_eq!(guarded(text).as_deref(), Ok(text));
        }
    }

    #[test]
    fn a_cut_document_is_refused_with_its_place() {
        let cut = |text: &str| guarded(text).expect_err("it is cut");
        assert_eq!(
            cut("<a>\n<bé>x\n"),
            ("the file ends inside `<bé>` of line 2".to_owned(), (3, 1))
        );
        assert_eq!(
            cut("<a>\n  <b"),
            ("the file ends inside a tag or comment".to_owned(), (2, 4))
        );
        assert_eq!(
            cut("<a><!-- >"),
            ("the file ends inside a tag or comment".to_owned(), (1, 5))
        );
        assert_eq!(cut(" "), ("the file has no XML element".to_owned(), (1, 2)));
    }

    #[test]
    fn documents_that_demand_too_much_are_refused() {
        let attributes: String = (0..257).map(|n| format!(" a{n}=''")).collect();
        refused(&format!("<a{attributes}/>"), "attributes");
        let namespaces: String = (0..150).map(|n| format!(" xmlns:a{n}=''")).collect();
        refused(
            &format!("<a{namespaces}><b{namespaces}/></a>"),
            "namespaces",
        );
        assert!(
            guarded(&format!("<a><b{namespaces}/><b{namespaces}></b></a>")).is_ok(),
            "of siblings"
        );
        let beside = format!("<a{namespaces}>{}</a>", "<c xmlns='d'/>".repeat(70_000));
        refused(&beside, "too many elements declare namespaces");
        refused(&"<a>".repeat(10_001), "nested");
        let many: String = (0..10_001)
            .map(|number| format!("<!ENTITY e{number} \"\">"))
            .collect();
        refused(
            &format!("<!DOCTYPE a [{many}]><a/>"),
            "more than 10000 entities",
        );
        refused(&format!("<a b='{}'/>", "x".repeat(MAX_TAG)), "larger than");
        let bomb: String = (1..9)
            .map(|n| format!("<!ENTITY e{n} \"{}\">", format!("&e{};", n - 1).repeat(10)))
            .collect();
        refused(
            &format!("<!DOCTYPE a [<!ENTITY e0 \"ha\">{bomb}]><a>&e8;</a>"),
            "the entity `e4`",
        );
        let entity = format!("<!DOCTYPE a [<!ENTITY e \"{}\">]>", "x".repeat(50_000));
        refused(
            &format!("{entity}<a>{}</a>", "&e;<b c='&e;'/>".repeat(1000)),
            "100 times",
        );
    }

    /// Each `>` in a value, and each space before a name, was once a reason to look at the whole
    /// tag again.
    #[test]
    fn long_tags_are_read_in_linear_time() {
        for inside in ["'>>>>'", "'  '   ", "= = ", "\"=\""] {
            let text = format!("<a b={}/>", inside.repeat(100_000));
            let (mut guard, _) = XmlGuard::new(text.as_bytes());
            let _ = std::io::copy(&mut guard, &mut std::io::sink());
        }
        let text = format!("<!DOCTYPE a [{}]><a/>", "<!ELEMENT b ANY>".repeat(50_000));
        assert_eq!(guarded(&text).as_deref(), Ok(text.as_str()));
    }

    #[test]
    fn endless_parts_are_refused() {
        for begin in ["", "<a>", "<!--"] {
            let (mut guard, progress) =
                XmlGuard::new(begin.as_bytes().chain(std::io::repeat(b'x')));
            assert!(std::io::copy(&mut guard, &mut std::io::sink()).is_err());
            assert!(
                progress
                    .fault()
                    .is_some_and(|fault| fault.contains("larger than 67108864"))
            );
        }
    }
}
