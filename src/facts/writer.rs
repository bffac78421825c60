//! Terms and triples of one run while they are being written.

use std::fmt::Write as _;

use crate::base::{Term, TermId, Terms, names};
use crate::facts::Triple;

/// IRI of a thing that simulation names: `w:robot`, `w:floor`, `w:link/NAME` for `robot/NAME`, and `obj:ID` for the rest.
///
/// Characters that an IRI can't hold are percent-encoded.
pub fn thing_iri(id: &str) -> String {
    match id {
        "robot" | "floor" => names::w(id),
        _ => match id.strip_prefix("robot/") {
            Some(link) => names::w(&format!("link/{}", escaped(link))),
            None => names::obj(&escaped(id)),
        },
    }
}

/// A name as part of an IRI: letters, digits and `_-.~` as they are, every other byte percent-encoded.
pub(super) fn escaped(name: &str) -> String {
    let mut out = String::with_capacity(name.len());
    for byte in name.bytes() {
        if byte.is_ascii_alphanumeric() || b"_-.~".contains(&byte) {
            out.push(char::from(byte));
        } else {
            // Writing to a string can't fail.
            let _ = write!(out, "%{byte:02X}");
        }
    }
    out
}

/// The number with the fewest digits that is the same f32: physics knows no more, and 0.3 stays 0.3.
///
/// Both zeros become `0.0`, so that they are one term. What is no number stays so.
pub(super) fn shortest(value: f64) -> f64 {
    #[expect(clippy::cast_possible_truncation, reason = "rounding to what physics knows is what this is for")]
    let single = value as f32;
    if single == 0.0 {
        return 0.0;
    }
    let mut text = ShortText::default();
    match write!(text, "{single:e}") {
        Ok(()) => text.as_str().parse().unwrap_or(f64::from(single)),
        Err(_) => f64::from(single),
    }
}

/// Text of a number, without an allocation: facts hold hundreds of them.
#[derive(Default)]
struct ShortText {
    bytes: [u8; 32],
    len: usize,
}

impl ShortText {
    fn as_str(&self) -> &str {
        std::str::from_utf8(&self.bytes[..self.len]).unwrap_or_default()
    }
}

impl std::fmt::Write for ShortText {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        let end = self.len + text.len();
        self.bytes.get_mut(self.len..end).ok_or(std::fmt::Error)?.copy_from_slice(text.as_bytes());
        self.len = end;
        Ok(())
    }
}

/// Interns terms and gathers the triples of one state or action.
#[derive(Default)]
pub(super) struct Writer {
    /// Terms of the whole run.
    pub(super) terms: Terms,
    triples: Vec<Triple>,
    iri: String,
}

impl Writer {
    /// What was gathered, sorted and each once; the next list begins empty.
    pub(super) fn take(&mut self) -> Vec<Triple> {
        let mut triples = std::mem::take(&mut self.triples);
        triples.sort_unstable();
        triples.dedup();
        triples
    }

    /// A thing that simulation names.
    pub(super) fn thing(&mut self, id: &str) -> TermId {
        self.terms.intern(Term::iri(thing_iri(id)))
    }

    /// A term of the world vocabulary.
    pub(super) fn w(&mut self, local: &str) -> TermId {
        self.iri.clear();
        self.iri.push_str(names::W);
        self.iri.push_str(local);
        self.terms.intern(Term::iri(&self.iri))
    }

    /// A term of the world vocabulary below a heading, such as `w:joint/NAME`.
    pub(super) fn named(&mut self, heading: &str, name: &str) -> TermId {
        self.w(&format!("{heading}/{}", escaped(name)))
    }

    /// States that a property of the world vocabulary has a value.
    pub(super) fn state(&mut self, subject: TermId, property: &str, value: TermId) {
        let property = self.w(property);
        self.triples.push([subject, property, value]);
    }

    /// States a number.
    pub(super) fn number(&mut self, subject: TermId, property: &str, value: f64) {
        let value = self.terms.intern(Term::Double(shortest(value)));
        self.state(subject, property, value);
    }

    /// States several numbers, one for each property.
    pub(super) fn numbers<const N: usize>(&mut self, subject: TermId, properties: [&str; N], values: [f64; N]) {
        for (property, value) in properties.into_iter().zip(values) {
            self.number(subject, property, value);
        }
    }

    /// States a truth value.
    pub(super) fn boolean(&mut self, subject: TermId, property: &str, value: bool) {
        let value = self.terms.intern(Term::Boolean(value));
        self.state(subject, property, value);
    }

    /// States a text.
    pub(super) fn text(&mut self, subject: TermId, property: &str, value: &str) {
        let value = self.terms.intern(Term::string(value));
        self.state(subject, property, value);
    }

    /// States a relation to something that has an IRI of its own.
    pub(super) fn iri(&mut self, subject: TermId, property: &str, iri: &str) {
        let value = self.terms.intern(Term::iri(iri));
        self.state(subject, property, value);
    }

    /// States a relation to each of some things.
    pub(super) fn things(&mut self, subject: TermId, property: &str, ids: &[String]) {
        for id in ids {
            let thing = self.thing(id);
            self.state(subject, property, thing);
        }
    }

    /// States the class of something.
    pub(super) fn class(&mut self, subject: TermId, class: &str) {
        let property = self.terms.intern(Term::iri(format!("{}type", names::RDF)));
        let class = self.terms.intern(Term::iri(class));
        self.triples.push([subject, property, class]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_has_the_fewest_digits_of_its_single() {
        for (value, expected) in
            [(f64::from(0.3f32), 0.3), (-0.0, 0.0), (1e-40, 1e-40), (f64::from(f32::MAX), 3.402_823_5e38)]
        {
            assert_eq!(shortest(value).to_bits(), f64::to_bits(expected), "{value}");
        }
        assert!(shortest(f64::NAN).is_nan());
        assert_eq!(shortest(f64::NEG_INFINITY), f64::NEG_INFINITY);
    }

    #[test]
    fn a_name_with_spaces_is_an_iri() {
        assert_eq!(thing_iri("robot/left finger"), names::w("link/left%20finger"));
        assert_eq!(thing_iri("glass_1"), names::obj("glass_1"));
        assert_eq!(thing_iri("floor"), names::w("floor"));
    }
}
