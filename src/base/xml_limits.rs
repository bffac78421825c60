//! Limits on the structure of XML texts, checked before a parser sees them.
//!
//! Parsers take quadratic time for the attributes of one tag, copy the namespaces in scope for every element that
//! declares one, and replace entities by texts that can be billions of times as long as their declarations. One pass
//! over the text finds these; it accepts texts that are not XML, which the parser reports.

use std::collections::BTreeMap;

use crate::{Diagnostic, Source};

/// Longest text. Unit: bytes.
const LONGEST: usize = 64 << 20;
/// Deepest nesting of elements. A list without `parseType="Collection"` needs two levels for each member.
const DEEPEST: usize = 10_000;
/// Most attributes of one tag.
const MOST_ATTRIBUTES: usize = 256;
/// Most namespaces in scope.
const MOST_NAMESPACES: usize = 256;
/// Most namespaces in scope, added over all elements that declare one: a parser copies them.
const MOST_COPIED_NAMESPACES: usize = 10_000_000;
/// Most entity declarations.
const MOST_ENTITIES: usize = 10_000;
/// Longest replacement text of an entity, with the entities in it replaced. Unit: bytes.
const LONGEST_ENTITY: usize = 64 << 10;
/// Longest replacement texts of all references to entities together. Unit: bytes.
const LONGEST_EXPANSION: usize = 64 << 20;

/// Checks an XML text against limits that no model and no ontology needs to exceed.
///
/// # Errors
/// The diagnostic with this code, at the place where the first limit is exceeded.
pub fn check_xml(source: &Source, code: &'static str) -> Result<(), Diagnostic> {
    let mut scan = Scan::new(&source.text);
    scan.run().map_err(|excess| {
        let at = (0..=scan.at.min(source.text.len())).rev().find(|at| source.text.is_char_boundary(*at)).unwrap_or(0);
        Diagnostic::error(code, format!("this XML is refused: {excess}"))
            .at(source, at..at)
            .help("such a text can exhaust memory or time; simplify it, or write it in another format")
    })
}

struct Scan<'a> {
    bytes: &'a [u8],
    /// Position in the text.
    at: usize,
    /// Number of namespaces that each open element declares.
    open: Vec<usize>,
    n_namespaces: usize,
    n_copied: usize,
    /// Length of each entity's replacement text, by its name.
    entities: BTreeMap<&'a [u8], usize>,
    n_expanded: usize,
}

impl<'a> Scan<'a> {
    fn new(text: &'a str) -> Self {
        let bytes = text.as_bytes();
        Self { bytes, at: 0, open: Vec::new(), n_namespaces: 0, n_copied: 0, entities: BTreeMap::new(), n_expanded: 0 }
    }

    /// Scans the whole text. Returns the reason if it exceeds a limit.
    fn run(&mut self) -> Result<(), String> {
        if self.bytes.len() > LONGEST {
            return Err(format!("it is longer than {} MiB", LONGEST >> 20));
        }
        while let Some(length) = self.rest().iter().position(|byte| *byte == b'<') {
            self.text(length)?;
            let rest = self.rest();
            match rest.get(1) {
                Some(b'!') if rest.starts_with(b"<!--") => self.skip_past(4, b"-->"),
                Some(b'!') if rest.starts_with(b"<![") => self.skip_past(3, b"]]>"),
                Some(b'!') => self.declarations()?,
                Some(b'?') => self.skip_past(2, b"?>"),
                Some(b'/') => {
                    self.n_namespaces -= self.open.pop().unwrap_or_default();
                    self.skip_past(2, b">");
                }
                _ => self.tag()?,
            }
        }
        self.text(self.rest().len())
    }

    fn rest(&self) -> &'a [u8] {
        self.bytes.get(self.at..).unwrap_or_default()
    }

    /// Moves past the next occurrence of `end`, or to the end of the text.
    fn skip_past(&mut self, begun: usize, end: &[u8]) {
        let inside = self.rest().get(begun..).unwrap_or_default();
        let length = inside.windows(end.len()).position(|window| window == end);
        self.at = length.map_or(self.bytes.len(), |length| self.at + begun + length + end.len());
    }

    /// Moves past text between tags.
    fn text(&mut self, length: usize) -> Result<(), String> {
        let text = &self.rest()[..length];
        self.n_expanded = self.n_expanded.saturating_add(self.expansion_of(text));
        self.at += length;
        self.check_expansion()
    }

    fn check_expansion(&self) -> Result<(), String> {
        if self.n_expanded > LONGEST_EXPANSION {
            return Err(format!("its entities expand to more than {} MiB", LONGEST_EXPANSION >> 20));
        }
        Ok(())
    }

    /// Length of the replacement texts of all entities that a text refers to.
    fn expansion_of(&self, text: &'a [u8]) -> usize {
        if self.entities.is_empty() {
            return 0;
        }
        self.references(text).fold(0, |sum: usize, (_, length)| sum.saturating_add(length))
    }

    /// The known entities that a text refers to, with the lengths of their replacement texts.
    fn references<'t>(&'t self, text: &'t [u8]) -> impl Iterator<Item = (&'t [u8], usize)> {
        let names = text.split(|byte| *byte == b'&').skip(1).filter_map(|rest| rest.split(|byte| *byte == b';').next());
        names.filter_map(|name| Some((name, *self.entities.get(name)?)))
    }

    /// Reads a start tag or an empty element.
    fn tag(&mut self) -> Result<(), String> {
        let rest = self.rest();
        let (mut quote, mut n_attributes, mut n_declared) = (None, 0, 0);
        // Start of the last word, and whether a new one begins at the next character that is not blank.
        let (mut word, mut between) = (0, false);
        let mut length = rest.len();
        for (at, byte) in rest.iter().enumerate().skip(1) {
            match (quote, byte) {
                (Some(open), byte) if open == *byte => (quote, between) = (None, true),
                (Some(_), _) => {}
                (None, b'"' | b'\'') => quote = Some(*byte),
                (None, b'=') => {
                    n_attributes += 1;
                    n_declared += usize::from(rest[word..at].starts_with(b"xmlns"));
                }
                (None, b'>') => {
                    length = at + 1;
                    break;
                }
                (None, byte) if byte.is_ascii_whitespace() => between = true,
                (None, _) if std::mem::take(&mut between) => word = at,
                (None, _) => {}
            }
        }
        self.n_expanded = self.n_expanded.saturating_add(self.expansion_of(&rest[..length]));
        self.check_expansion()?;
        self.n_namespaces += n_declared;
        if self.n_namespaces > MOST_NAMESPACES {
            return Err(format!("more than {MOST_NAMESPACES} namespaces are in scope"));
        }
        if n_attributes > MOST_ATTRIBUTES {
            return Err(format!("a tag has more than {MOST_ATTRIBUTES} attributes"));
        }
        if n_declared > 0 {
            self.n_copied += self.n_namespaces;
        }
        if self.n_copied > MOST_COPIED_NAMESPACES {
            return Err("too many elements declare namespaces".to_owned());
        }
        match rest[..length].ends_with(b"/>") {
            true => self.n_namespaces -= n_declared,
            false => self.open.push(n_declared),
        }
        if self.open.len() > DEEPEST {
            return Err(format!("its elements are nested more than {DEEPEST} levels deep"));
        }
        self.at += length;
        Ok(())
    }

    /// Reads a document type: it ends at the `>` that closes its first `<`.
    fn declarations(&mut self) -> Result<(), String> {
        let rest = self.rest();
        let mut level = 0_usize;
        let end = rest.iter().position(|byte| {
            match byte {
                b'<' => level += 1,
                b'>' => level = level.saturating_sub(1),
                _ => {}
            }
            *byte == b'>' && level == 0
        });
        let length = end.map_or(rest.len(), |end| end + 1);
        for declared in rest[..length].split(|byte| *byte == b'<') {
            if let Some(declared) = declared.strip_prefix(b"!ENTITY") {
                self.entity(declared)?;
            }
        }
        self.at += length;
        Ok(())
    }

    /// Reads an entity's declaration: its name, and its text in quotation marks. Others have no replacement text.
    fn entity(&mut self, declared: &'a [u8]) -> Result<(), String> {
        let declared = declared.trim_ascii_start();
        let declared = declared.strip_prefix(b"%").unwrap_or(declared).trim_ascii_start();
        let end = declared.iter().position(u8::is_ascii_whitespace).unwrap_or(declared.len());
        let (name, value) = declared.split_at(end);
        let value = value.trim_ascii_start();
        let Some(quote @ (b'"' | b'\'')) = value.first() else { return Ok(()) };
        let text = value[1..].split(|byte| byte == quote).next().unwrap_or_default();
        let written: usize = self.references(text).map(|(name, _)| name.len() + "&;".len()).sum();
        let length = text.len().saturating_sub(written).saturating_add(self.expansion_of(text));
        if length > LONGEST_ENTITY {
            let name = String::from_utf8_lossy(name.get(..40).unwrap_or(name)).into_owned();
            return Err(format!("the entity `{name}` expands to more than {} KiB", LONGEST_ENTITY >> 10));
        }
        self.entities.insert(name, length);
        if self.entities.len() > MOST_ENTITIES {
            return Err(format!("it declares more than {MOST_ENTITIES} entities"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The message without its beginning; empty if the text is accepted.
    fn said(text: &str) -> String {
        let said =
            check_xml(&Source::new("a.xml", text), "W055").map_or_else(|fault| fault.message, |()| String::new());
        said.trim_start_matches("this XML is refused: ").to_owned()
    }

    #[test]
    fn ordinary_documents_and_texts_that_are_not_xml_are_accepted() {
        let owl = "<?xml version=\"1.0\"?>\n<!DOCTYPE rdf:RDF [\n <!ENTITY owl \"http://www.w3.org/2002/07/owl#\" >\n \
            <!ENTITY xsd 'http://www.w3.org/2001/XMLSchema#' >\n]>\n<!-- a > b, don't <i> --><r xmlns=\"&owl;\" a='>'>\
            <![CDATA[<x>]]><b/></r>";
        for text in
            [owl, "", "<", "<!", "<!--", "<![", "<?", "</", "</a>", "a &b; c", "<a b=", "<!DOCTYPE a [<!ENTITY", "<é"]
        {
            assert_eq!(said(text), "", "{text}");
        }
    }

    #[test]
    fn entities_that_grow_are_refused() {
        let mut laughs = "<!DOCTYPE a [<!ENTITY l0 \"lol\">".to_owned();
        for level in 1..10 {
            let text = format!("&l{};", level - 1).repeat(10);
            laughs.push_str(&format!("<!ENTITY l{level} \"{text}\">"));
        }
        assert_eq!(said(&format!("{laughs}]><a>&l9;</a>")), "the entity `l5` expands to more than 64 KiB");
        // Entities of entities are avoided, but one is referred to often.
        let long = format!("<!DOCTYPE a [<!ENTITY l '{}'>]><a b=\"{}\"/>", "x".repeat(60_000), "&l;".repeat(2_000));
        assert_eq!(said(&long), "its entities expand to more than 64 MiB");
        let many: String = (0..10_001).map(|number| format!("<!ENTITY e{number} \"\">")).collect();
        assert_eq!(said(&format!("<!DOCTYPE a [{many}]>")), "it declares more than 10000 entities");
    }

    #[test]
    fn attributes_namespaces_and_nesting_are_bounded() {
        let attributes = |n: usize, name: &str| (0..n).map(|i| format!(" {name}{i} = \"1\"")).collect::<String>();
        assert_eq!(said(&format!("<a{}/>", attributes(256, "b"))), "");
        assert_eq!(said(&format!("<a{}/>", attributes(257, "b"))), "a tag has more than 256 attributes");
        let nested: String = (0..257).map(|i| format!("<a xmlns:b{i}='c'>")).collect();
        assert_eq!(said(&nested), "more than 256 namespaces are in scope");
        let nested: String = (0..257).map(|i| format!("<a b='1'xmlns:b{i}  \n = 'c'>")).collect();
        assert_eq!(said(&nested), "more than 256 namespaces are in scope");
        let beside = format!("<a{}>{}</a>", attributes(250, "xmlns:b"), "<c xmlns='d'/>".repeat(40_000));
        assert_eq!(said(&beside), "too many elements declare namespaces");
        assert_eq!(said(&"<c xmlns='d'/>".repeat(40_000)), "");
        assert_eq!(said(&"<a>".repeat(10_001)), "its elements are nested more than 10000 levels deep");
        assert_eq!(said(&"<a></a>".repeat(20_000)), "");
    }

    /// Marks in comments, sections and instructions don't hide a tag.
    #[test]
    fn quotation_marks_outside_of_tags_hide_nothing() {
        let tag = format!("<a{}/>", (0..300).map(|i| format!(" b{i}=\"1\"")).collect::<String>());
        for before in ["<!-- ' \" -->", "<![CDATA[ ' \" ]]>", "<?p ' \" ?>", "<!DOCTYPE a [<!-- ' \" -->]>", "' \""] {
            assert!(said(&format!("{before}{tag}")).starts_with("a tag has"), "{before}");
        }
    }
}
