//! Writer of a run's terms and triples.

use std::collections::HashMap;

use actcheck_base::names::escaped;
use actcheck_base::{Term, TermId, Terms, Triple, names};
use foldhash::fast::RandomState;

/// Returns the IRI of an object with this ID in the simulation: `w:robot`, `w:floor`, `w:link/NAME`
/// for `robot/NAME`, and `obj:ID` for the rest.
///
/// Characters not allowed in an IRI are percent-encoded.
pub fn thing_iri(id: &str) -> String {
    match id {
        "robot" | "floor" => names::w(id),
        _ => match id.strip_prefix("robot/") {
            Some(link) => names::w(&format!("link/{}", escaped(link))),
            None => names::obj(&escaped(id)),
        },
    }
}

/// Returns the number with the fewest digits that rounds to the same f32. Physics has f32
/// precision, and 0.3 stays 0.3.
///
/// Both zeros become `0.0`, so that they are one term. NaN and infinities are unchanged.
pub(super) fn shortest(value: f64) -> f64 {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "rounding to the precision of physics is intended"
    )]
    let single = value as f32;
    if single == 0.0 {
        return 0.0;
    }
    if !single.is_finite() {
        return f64::from(single);
    }
    // Halfway between two numbers of the fewest digits, as 30.8515625 is, the standard library
    // takes the larger one, and the faster library the even one. Such a number has at most 14
    // binary digits after the point.
    let parsed = match (single * HALFWAY).fract() == 0.0 {
        true => format!("{single:e}").parse(),
        false => zmij::Buffer::new().format_finite(single).parse(),
    };
    parsed.unwrap_or(f64::from(single))
}

/// 2¹⁴.
const HALFWAY: f32 = 16_384.0;

/// Interns terms and collects the triples of one state or action.
#[derive(Default)]
pub(super) struct Writer {
    /// Terms of the whole run.
    pub(super) terms: Terms,
    triples: Vec<Triple>,
    iri: String,
    /// IDs of numbers, by the bits of their f32: most are the same before and after an action.
    numbers: HashMap<u32, TermId, RandomState>,
    /// IDs of terms that the program itself names, by the place and the length of their texts.
    constants: HashMap<(usize, usize), TermId, RandomState>,
    /// IDs of the objects in the simulation, by their IDs there.
    things: HashMap<String, TermId, RandomState>,
    /// ID of `rdf:type`, once it is in use.
    rdf_type: Option<TermId>,
}

/// Room for the terms of a usual run.
const TERMS: usize = 1024;

impl Writer {
    /// Creates a writer for a run.
    pub(super) fn new() -> Self {
        let terms = Terms::with_capacity(TERMS);
        let numbers = HashMap::with_capacity_and_hasher(TERMS, RandomState::default());
        Self {
            terms,
            numbers,
            ..Self::default()
        }
    }

    /// Returns the collected triples, sorted and deduplicated, and starts an empty list.
    pub(super) fn take(&mut self) -> Vec<Triple> {
        let mut triples = std::mem::take(&mut self.triples);
        triples.sort_unstable();
        triples.dedup();
        triples
    }

    /// Interns the IRI of an object in the simulation.
    pub(super) fn thing(&mut self, id: &str) -> TermId {
        if let Some(known) = self.things.get(id) {
            return *known;
        }
        let thing = self.terms.intern_iri(&thing_iri(id));
        self.things.insert(id.to_owned(), thing);
        thing
    }

    /// Interns a term of the world vocabulary.
    pub(super) fn w(&mut self, local: &str) -> TermId {
        self.world_iri(&[local])
    }

    /// Interns the IRI of the world vocabulary that ends in these parts.
    fn world_iri(&mut self, parts: &[&str]) -> TermId {
        self.iri.clear();
        self.iri.push_str(names::W);
        self.iri.extend(parts.iter().copied());
        self.terms.intern_iri(&self.iri)
    }

    /// Interns a term of the world vocabulary that the program itself names: a property or a class.
    fn constant(&mut self, local: &'static str) -> TermId {
        // A text of the program has one place in memory, which is compared faster than the text.
        let place = (local.as_ptr() as usize, local.len());
        if let Some(id) = self.constants.get(&place) {
            return *id;
        }
        let id = self.w(local);
        self.constants.insert(place, id);
        id
    }

    /// Interns a term of the world vocabulary with a heading, such as `w:joint/NAME`.
    pub(super) fn named(&mut self, heading: &str, name: &str) -> TermId {
        self.world_iri(&[heading, "/", &escaped(name)])
    }

    /// Adds a triple with a property of the world vocabulary.
    pub(super) fn state(&mut self, subject: TermId, property: &'static str, value: TermId) {
        let property = self.constant(property);
        self.triples.push([subject, property, value]);
    }

    /// Adds a number.
    pub(super) fn number(&mut self, subject: TermId, property: &'static str, value: f64) {
        let value = self.number_term(value);
        self.state(subject, property, value);
    }

    fn number_term(&mut self, value: f64) -> TermId {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "rounding to the precision of physics is intended"
        )]
        let bits = (value as f32).to_bits();
        *self
            .numbers
            .entry(bits)
            .or_insert_with(|| self.terms.intern(Term::Double(shortest(value))))
    }

    /// Adds several numbers, one for each property.
    pub(super) fn numbers<const N: usize>(
        &mut self,
        subject: TermId,
        properties: [&'static str; N],
        values: [f64; N],
    ) {
        for (property, value) in properties.into_iter().zip(values) {
            self.number(subject, property, value);
        }
    }

    /// Adds a Boolean.
    pub(super) fn boolean(&mut self, subject: TermId, property: &'static str, value: bool) {
        let value = self.terms.intern(Term::Boolean(value));
        self.state(subject, property, value);
    }

    /// Adds a string.
    pub(super) fn text(&mut self, subject: TermId, property: &'static str, value: &str) {
        let value = self.terms.intern_string(value);
        self.state(subject, property, value);
    }

    /// Adds a relation to an IRI.
    pub(super) fn iri(&mut self, subject: TermId, property: &'static str, iri: &str) {
        let value = self.terms.intern_iri(iri);
        self.state(subject, property, value);
    }

    /// Adds a relation to each of several objects.
    pub(super) fn things(&mut self, subject: TermId, property: &'static str, ids: &[String]) {
        for id in ids {
            let thing = self.thing(id);
            self.state(subject, property, thing);
        }
    }

    /// Adds the class of the subject, an IRI.
    pub(super) fn class(&mut self, subject: TermId, iri: &str) {
        let property = self.rdf_type();
        let class = self.terms.intern_iri(iri);
        self.triples.push([subject, property, class]);
    }

    /// Adds the class of the subject, from the world vocabulary.
    pub(super) fn world_class(&mut self, subject: TermId, local: &'static str) {
        let property = self.rdf_type();
        let class = self.constant(local);
        self.triples.push([subject, property, class]);
    }

    fn rdf_type(&mut self) -> TermId {
        *self
            .rdf_type
            .get_or_insert_with(|| self.terms.intern(Term::iri(format!("{}type", names::RDF))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_has_the_fewest_digits_that_identify_its_f32() {
        for (value, expected) in [
            (f64::from(0.3f32), 0.3),
            (-0.0, 0.0),
            (1e-40, 1e-40),
            (f64::from(f32::MAX), 3.402_823_5e38),
        ] {
            assert_eq!(shortest(value).to_bits(), f64::to_bits(expected), "{value}");
        }
        assert!(shortest(f64::NAN).is_nan());
        assert_eq!(shortest(f64::NEG_INFINITY), f64::NEG_INFINITY);
    }

    #[test]
    fn numbers_of_all_sizes_have_the_digits_of_the_standard_library() {
        // A prime, so that all exponents and many fractions occur.
        for bits in (0..f32::INFINITY.to_bits()).step_by(10_007) {
            let single = f32::from_bits(bits);
            let expected: f64 = format!("{single:e}").parse().unwrap_or(f64::NAN);
            assert_eq!(
                shortest(single.into()).to_bits(),
                (expected + 0.0).to_bits(),
                "{single:e}"
            );
            assert_eq!(shortest((-single).into()), -expected, "{single:e}");
        }
    }

    #[test]
    fn a_name_with_spaces_is_an_iri() {
        assert_eq!(
            thing_iri("robot/left finger"),
            names::w("link/left%20finger")
        );
        assert_eq!(thing_iri("glass_1"), names::obj("glass_1"));
        assert_eq!(thing_iri("floor"), names::w("floor"));
    }
}
