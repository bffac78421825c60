//! Facts of an action for users of the library.

use actcheck_base::{ActionFacts, Course, Diagnostics, Source, Term, TermId, Terms, Triple};
use actcheck_ontology::triples_of;

/// The snapshot of an action that a fact belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum When {
    /// The state before the action: `before(s, p, o)` in rules.
    Before,
    /// Events during the action: `during(s, p, o)`.
    During,
    /// The state after the action: `after(s, p, o)`.
    After,
}

/// The facts that rules judge: triples before, during and after an action, and the values of its
/// parameters.
///
/// Triples come from Turtle text or from terms. Facts about a single state belong to
/// [`When::After`].
///
/// ```
/// use actcheck_base::Term;
/// use actcheck_rules::{Facts, When};
///
/// let mut facts = Facts::from_turtle("@prefix ex: <http://example.org/> . ex:cup ex:on ex:table .")?;
/// let ex = |local: &str| Term::iri(format!("http://example.org/{local}"));
/// facts.add(When::Before, [ex("cup"), ex("on"), ex("shelf")]);
/// facts.add(When::After, [ex("cup"), ex("height"), Term::Double(0.12)]);
/// facts.set_parameter(ex("target"), ex("cup"));
/// assert_eq!(facts.len(), 3);
/// # Ok::<(), actcheck_base::Diagnostics>(())
/// ```
#[derive(Debug, Clone, Default)]
pub struct Facts {
    terms: Terms,
    before: Vec<Triple>,
    during: Vec<Triple>,
    after: Vec<Triple>,
    parameters: Vec<[TermId; 2]>,
    /// Number of Turtle texts, which distinguishes their blank nodes.
    documents: usize,
    course: Option<Course>,
}

impl Facts {
    /// Creates an empty set of facts.
    pub fn new() -> Self {
        Self::default()
    }

    /// Creates facts from Turtle text that describes the state after the action.
    ///
    /// # Errors
    /// `O002` for each syntax error, at most five.
    pub fn from_turtle(text: &str) -> Result<Self, Diagnostics> {
        let mut facts = Self::new();
        facts.add_turtle(When::After, text)?;
        Ok(facts)
    }

    /// Adds a triple: subject, predicate and object.
    pub fn add(&mut self, when: When, triple: [Term; 3]) -> &mut Self {
        let triple = triple.map(|term| self.terms.intern(term));
        match when {
            When::Before => self.before.push(triple),
            When::During => self.during.push(triple),
            When::After => self.after.push(triple),
        }
        self
    }

    /// Adds the triples of Turtle text.
    ///
    /// Literals keep their datatype: `0.5` is a decimal, as in Turtle, and `0.5e0` a double. Both
    /// are numbers in arithmetic and in comparisons such as `<`. In atoms and with `=`, rules
    /// compare terms: `0.5` in a rule is the double, which differs from the decimal.
    ///
    /// # Errors
    /// `O002` for each syntax error, at most five; then no triple is added.
    pub fn add_turtle(&mut self, when: When, text: &str) -> Result<&mut Self, Diagnostics> {
        let triples = triples_of(&Source::new("facts.ttl", text), self.documents)?;
        self.documents += 1;
        for triple in triples {
            self.add(when, triple);
        }
        Ok(self)
    }

    /// Sets a parameter of the action. Rules read it as `parameter(ex:target, ?value)` if its name
    /// is `ex:target`.
    pub fn set_parameter(&mut self, name: Term, value: Term) -> &mut Self {
        let (name, value) = (self.terms.intern(name), self.terms.intern(value));
        self.parameters.retain(|[known, _]| *known != name);
        self.parameters.push([name, value]);
        self
    }

    /// Sets the quantities over time, which temporal operators and `course` read.
    pub fn set_course(&mut self, course: Course) -> &mut Self {
        self.course = Some(course);
        self
    }

    /// Returns the number of triples, including duplicates.
    pub fn len(&self) -> usize {
        self.before.len() + self.during.len() + self.after.len()
    }

    /// Returns whether there are no triples.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the facts as the input of [`RuleBook::judge`](crate::RuleBook::judge).
    pub fn as_action(&self) -> ActionFacts<'_> {
        ActionFacts {
            terms: &self.terms,
            before: &self.before,
            after: &self.after,
            during: &self.during,
            parameters: &self.parameters,
            course: self.course.as_ref(),
            lacks: &[],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blank_nodes_of_two_texts_differ() {
        let mut facts = Facts::new();
        for _ in 0..2 {
            facts
                .add_turtle(When::After, "_:a <http://x/p> 1 .")
                .expect("the text is valid");
        }
        assert_ne!(facts.after[0], facts.after[1]);
    }

    #[test]
    fn a_syntax_error_is_reported_with_its_place() {
        let mut facts = Facts::new();
        let found = facts
            .add_turtle(When::Before, "<http://x/a> <http://x/p>")
            .expect_err("the object is missing");
        assert!(found.to_string().contains("facts.ttl:1:"), "{found}");
        assert!(facts.is_empty());
    }

    #[test]
    fn a_parameter_has_one_value() {
        let mut facts = Facts::new();
        let name = Term::iri("http://example.org/target");
        facts
            .set_parameter(name.clone(), Term::Integer(1))
            .set_parameter(name, Term::Integer(2));
        assert_eq!(facts.as_action().parameters.len(), 1);
    }
}
