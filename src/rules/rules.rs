//! The rules of one property, applied to facts: the simplest interface of this crate.

use actcheck_base::{Diagnostics, Findings, Outcome, RuleFault, Source, WitnessRow};
use actcheck_ontology::{Ontology, Property, RuleFile, triples_of};

use crate::book::RuleBook;
use crate::engine::budget::Budget;
use crate::explain::Explanation;
use crate::facts::Facts;

/// IRI of the property that the rules decide.
const PROPERTY: &str = "https://w3id.org/actcheck/property/rules";

/// The rules of one property, checked and planned. Can be shared between threads.
///
/// The rules derive `success` or `violation`. The property holds if there is a `success`, or if
/// there is no `violation`. Further predicates give the evidence: `margin(?m)`, the distance from
/// flipping; `because(?text)`, an explanation; `applicable(…)`, without which the property is
/// inapplicable.
///
/// To decide many properties at once, describe them in an [`Ontology`] and use [`RuleBook`].
///
/// ```
/// use actcheck_base::Outcome;
/// use actcheck_rules::{Facts, Rules};
///
/// let rules = Rules::parse(
///     "@prefix ex: <http://example.org/> .
///      % No object is on the floor.
///      violation(?object) :- after(?object, ex:on, ex:floor) .",
/// )?;
/// let facts = Facts::from_turtle("@prefix ex: <http://example.org/> . ex:cup ex:on ex:floor .")?;
/// let decision = rules.judge(&facts);
/// assert_eq!(decision.outcome, Outcome::Failed);
/// assert_eq!(decision.witness()[0].to_string(), "violation(object = <http://example.org/cup>)");
/// # Ok::<(), actcheck_base::Diagnostics>(())
/// ```
#[derive(Debug)]
pub struct Rules {
    book: RuleBook,
    budget: Budget,
}

impl Rules {
    /// Parses, checks and plans a rule text.
    ///
    /// # Errors
    /// All errors of the text, each with its code, place and remedy.
    pub fn parse(text: &str) -> Result<Self, Diagnostics> {
        Self::builder().build("rules.rls", text)
    }

    /// Returns a builder, for rules with libraries, background knowledge or another budget.
    pub fn builder() -> RulesBuilder {
        RulesBuilder::default()
    }

    /// Applies the rules to facts.
    pub fn judge(&self, facts: &Facts) -> Decision {
        let property = PROPERTY.to_owned();
        let mut results = self.book.judge(
            &facts.as_action(),
            std::slice::from_ref(&property),
            &self.budget,
        );
        let result = results.remove(PROPERTY);
        Decision::new(
            result
                .unwrap_or_else(|| Err(RuleFault::Value("the property was not judged".to_owned()))),
        )
    }

    /// Explains the outcome: the proofs of `success` or `violation`, or the rule that came closest.
    ///
    /// # Errors
    /// The fault because of which the property could not be decided.
    pub fn why(&self, facts: &Facts) -> Result<Explanation, RuleFault> {
        self.book
            .explain(&facts.as_action(), PROPERTY, &self.budget)
    }

    /// Explains why a statement such as `near(ex:cup, _)` is not derived: the closest rule, its
    /// satisfied conditions and the one that failed. If it is derived, explains it by its proofs.
    /// `_` matches any value; the statement may use the prefixes of the rule text.
    ///
    /// # Errors
    /// The statement is invalid or its predicate unknown, or the rules could not be evaluated.
    pub fn why_not(&self, facts: &Facts, statement: &str) -> Result<Explanation, RuleFault> {
        self.book
            .explain_statement(&facts.as_action(), PROPERTY, statement, &self.budget)
    }

    /// Returns the warnings about the rule texts.
    pub fn warnings(&self) -> &Diagnostics {
        self.book.warnings()
    }
}

/// Builds [`Rules`] with libraries, background knowledge and a budget.
///
/// ```
/// use actcheck_base::Outcome;
/// use actcheck_rules::{Budget, Facts, Rules};
///
/// let rules = Rules::builder()
///     .library(
///         "above.rls",
///         "@prefix ex: <http://example.org/> .
///          above(?a, ?b) :- after(?a, ex:on, ?b) .
///          above(?a, ?c) :- above(?a, ?b), above(?b, ?c) .",
///     )
///     .background(
///         "kinds.ttl",
///         "@prefix ex: <http://example.org/> . @prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
///          ex:Mug rdfs:subClassOf ex:Dish . ex:mug a ex:Mug .",
///     )
///     .budget(Budget { secs: 1.0, ..Budget::default() })
///     .build(
///         "dish_on_table.rls",
///         "@prefix ex: <http://example.org/> .
///          success(?dish) :- ontology(?dish, rdf:type, ex:Dish), above(?dish, ex:table) .",
///     )?;
/// let facts =
///     Facts::from_turtle("@prefix ex: <http://example.org/> . ex:mug ex:on ex:tray . ex:tray ex:on ex:table .")?;
/// assert_eq!(rules.judge(&facts).outcome, Outcome::Passed);
/// # Ok::<(), actcheck_base::Diagnostics>(())
/// ```
#[derive(Debug, Clone, Default)]
pub struct RulesBuilder {
    libraries: Vec<Source>,
    background: Vec<Source>,
    budget: Budget,
}

impl RulesBuilder {
    /// Adds a library: Datalog rules whose predicates the rules may use. Messages and proofs cite
    /// its name.
    #[must_use]
    pub fn library(mut self, name: &str, text: &str) -> Self {
        self.libraries.push(Source::new(name, text));
        self
    }

    /// Adds statements that hold for all facts, in Turtle or RDF/XML. Rules read them and their OWL
    /// 2 RL closure as `ontology(s, p, o)`.
    #[must_use]
    pub fn background(mut self, name: &str, text: &str) -> Self {
        self.background.push(Source::new(name, text));
        self
    }

    /// Sets the limits of each evaluation.
    #[must_use]
    pub fn budget(mut self, budget: Budget) -> Self {
        self.budget = budget;
        self
    }

    /// Parses, checks and plans the rules of the property. Messages and proofs cite the name. A
    /// name that ends in `.rq` is a SPARQL query, which needs the feature `sparql`; any other text
    /// is Datalog.
    ///
    /// # Errors
    /// All errors of all texts, each with its code, place and remedy.
    pub fn build(self, name: &str, text: &str) -> Result<Rules, Diagnostics> {
        let mut ontology = Ontology::default();
        let mut found = Diagnostics::new();
        for (document, source) in self.background.iter().enumerate() {
            match triples_of(source, document) {
                Ok(triples) => ontology.triples.extend(triples),
                Err(faults) => found.extend(faults),
            }
        }
        found.or(())?;
        ontology.libraries = self.libraries.into_iter().map(RuleFile::new).collect();
        let mut property = Property::new(PROPERTY, RuleFile::new(Source::new(name, text)));
        property.label = name
            .rsplit_once('.')
            .map_or(name, |(stem, _)| stem)
            .to_owned();
        ontology.properties.insert(PROPERTY.to_owned(), property);
        Ok(Rules {
            book: RuleBook::prepare_within(&ontology, &self.budget)?,
            budget: self.budget,
        })
    }
}

/// The outcome of rules for facts, with its evidence.
///
/// ```
/// use actcheck_base::Outcome;
/// use actcheck_rules::{Facts, Rules};
///
/// let rules = Rules::parse(
///     "@prefix ex: <http://example.org/> .
///      success(?cup) :- after(?cup, ex:height, ?h), ?h >= 0.5 .
///      margin(?m) :- after(_, ex:height, ?h), ?m = ?h - 0.5 .",
/// )?;
/// let facts = Facts::from_turtle("<http://example.org/cup> <http://example.org/height> 0.75e0 .")?;
/// let decision = rules.judge(&facts);
/// assert_eq!((decision.outcome, decision.margin()), (Outcome::Passed, Some(0.25)));
/// # Ok::<(), actcheck_base::Diagnostics>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Decision {
    /// The outcome.
    pub outcome: Outcome,
    /// The findings, or the fault because of which the property could not be decided.
    pub result: Result<Findings, RuleFault>,
}

impl Decision {
    fn new(result: Result<Findings, RuleFault>) -> Self {
        let outcome = result
            .as_ref()
            .map_or_else(RuleFault::outcome, Findings::outcome);
        Self { outcome, result }
    }

    /// Returns the distance from flipping: positive if the property passed. Returns `None` if the
    /// rules derive no `margin`.
    pub fn margin(&self) -> Option<f64> {
        self.result.as_ref().ok()?.margin
    }

    /// Returns the tuples of `success` or `violation` that prove the outcome, at most
    /// [`Findings::WITNESS_LIMIT`].
    pub fn witness(&self) -> &[WitnessRow] {
        self.result
            .as_ref()
            .map_or(&[], |findings| &findings.witness)
    }

    /// Returns the explanations that the rules derive with `because`.
    pub fn because(&self) -> &[String] {
        self.result
            .as_ref()
            .map_or(&[], |findings| &findings.because)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_base::{Course, Signal, names};

    const RULES: &str = "@prefix ex: <http://example.org/> .
        near(?a, ?b) :- after(?a, ex:x, ?x), after(?b, ex:x, ?y), ?a != ?b, ABS(?x - ?y) < 0.5 .
        success(?a) :- near(?a, ex:goal) .";

    fn facts(x: f64) -> Facts {
        let turtle =
            format!("@prefix ex: <http://example.org/> . ex:cup ex:x {x:?} . ex:goal ex:x 1.0 .");
        Facts::from_turtle(&turtle).expect("the text is valid")
    }

    #[test]
    fn the_outcome_follows_the_facts() {
        let rules = Rules::parse(RULES).expect("the rules are valid");
        assert_eq!(rules.judge(&facts(0.75)).outcome, Outcome::Passed);
        assert_eq!(rules.judge(&facts(0.25)).outcome, Outcome::Failed);
        assert_eq!(rules.judge(&Facts::new()).outcome, Outcome::Failed);
    }

    #[test]
    fn why_not_names_the_failed_condition() {
        let rules = Rules::parse(RULES).expect("the rules are valid");
        let text = rules
            .why_not(&facts(0.25), "near(ex:cup, ex:goal)")
            .expect("it is derivable")
            .to_text();
        assert!(
            text.contains("is not derived") && text.contains("missing ABS(?x - ?y) < 0.5"),
            "{text}"
        );
        let text = rules
            .why_not(&facts(0.75), "near(ex:cup, _)")
            .expect("it is derivable")
            .to_text();
        assert!(
            text.contains("is derived") && text.contains("(fact)"),
            "{text}"
        );
    }

    #[test]
    fn why_not_of_a_term_without_facts_names_the_closest_rule() {
        let rules = Rules::parse(RULES).expect("the rules are valid");
        let text = rules
            .why_not(&facts(0.75), "success(ex:mug)")
            .expect("it is derivable")
            .to_text();
        assert!(
            text.contains("success(<http://example.org/mug>) came closest"),
            "{text}"
        );
    }

    #[test]
    fn invalid_statements_are_reported() {
        let rules = Rules::parse(RULES).expect("the rules are valid");
        for (statement, reason) in [
            ("after(ex:cup, ex:x, _)", "is given"),
            ("nearby(ex:cup)", "no predicate `nearby`"),
            ("near(ex:cup)", "`near` has 2 arguments, not 1"),
            ("near(ex:cup, ", "expected"),
            ("near(ex:cup, 1 + 1)", "only constants"),
        ] {
            let fault = rules.why_not(&facts(0.75), statement).expect_err(statement);
            assert!(fault.to_string().contains(reason), "{statement}: {fault}");
        }
    }

    #[test]
    fn errors_of_all_texts_have_places() {
        let found =
            Rules::parse("success(?x) :- after(?y, <http://x/p>, 1) .").expect_err("?x is unbound");
        assert!(found.to_string().contains("rules.rls:1:"), "{found}");
        let builder = Rules::builder()
            .background("a.ttl", "x")
            .background("b.ttl", "y");
        let found = builder
            .build("rules.rls", RULES)
            .expect_err("both backgrounds are invalid")
            .to_string();
        assert!(
            found.contains("a.ttl") && found.contains("b.ttl"),
            "{found}"
        );
    }

    #[test]
    fn a_formula_in_a_helper_predicate_is_noted() {
        let warned = |text: &str| {
            let prefixes = "@prefix w: <https://w3id.org/actcheck/world#> .";
            let rules = Rules::parse(&format!("{prefixes} {text}")).expect("the rules are valid");
            rules
                .warnings()
                .iter()
                .any(|warning| warning.code == "R057" && warning.place().is_some())
        };
        let kept = "kept(?o) :- after(?o, w:z, _), always(w:tilt(?o) < 0.5) .";
        assert!(warned(&format!("{kept} success(?o) :- kept(?o) .")));
        assert!(warned(&format!(
            "{kept} held(?o) :- kept(?o) . violation(?o) :- after(?o, w:z, _), ~held(?o) ."
        )));
        assert!(!warned(&format!(
            "{kept} success(?o) :- kept(?o) . margin(0.1) :- kept(_) ."
        )));
        assert!(!warned(
            "success(?o) :- after(?o, w:z, _), always(w:tilt(?o) < 0.5) ."
        ));
    }

    #[test]
    #[cfg(feature = "sparql")]
    fn a_property_is_a_function_of_the_facts() {
        for query in [
            "ASK { FILTER(RAND() < 0.5) }",
            "SELECT (NOW() AS ?because) { ?s ?p ?o }",
        ] {
            let found = Rules::builder()
                .build("rules.rq", query)
                .expect_err("it varies");
            assert!(
                found
                    .iter()
                    .any(|fault| fault.code == "R064" && fault.place().is_some()),
                "{found}"
            );
        }
    }

    /// The next sample of a quantity, in the ways in which a property may say it: 20 s of five
    /// objects at 60 Hz.
    #[test]
    fn a_property_may_compare_each_sample_with_the_next() {
        let mut course = Course::new(1.0 / 60.0, 1200);
        for object in 0..5 {
            let values = (0..1200)
                .map(|sample| f64::from(sample) * 0.001 + f64::from(object))
                .collect();
            let key = [
                names::w("z"),
                format!("http://example.org/o{object}"),
                String::new(),
            ];
            course.set(key, Signal::Values(values));
        }
        let mut facts = Facts::new();
        facts.set_course(course);
        let sample = "sample(?o, ?i, ?z) :- course(?o, w:z, ?t, ?z), ?i = INT(ROUND(?t * 60)) .";
        for (rules, body) in [
            (
                "",
                "course(?o, w:z, ?t, ?a), course(?o, w:z, ?u, ?b), ROUND(?u * 60) = ROUND(?t * 60) + 1",
            ),
            (
                "",
                "course(?o, w:z, ?t, ?a), ROUND(?t * 60) + 1 = ROUND(?u * 60), course(?o, w:z, ?u, ?b)",
            ),
            (
                "",
                "course(?o, w:z, ?t, ?a), course(?o, w:z, ?u, ?b), ?i = ROUND(?t * 60), ?i + 1 = ROUND(?u * 60)",
            ),
            (
                sample,
                "sample(?o, ?i, ?a), ?j = ?i + 1, sample(?o, ?j, ?b)",
            ),
            (
                sample,
                "sample(?o, ?i, ?a), sample(?o, ?j, ?b), ?i = ?j - 1",
            ),
            (sample, "sample(?o, ?i, ?a), sample(?o, ?i + 1, ?b)"),
        ] {
            let count = "steps(?o, #count(?a)) :- step(?o, ?a) . success(?o) :- steps(?o, 1199) .";
            let text = format!("{rules} step(?o, ?a) :- {body}, ABS(?b - ?a) < 0.002 . {count}");
            let rules = Rules::builder()
                .budget(Budget {
                    secs: 5.0,
                    ..Budget::default()
                })
                .build("rules.rls", &text);
            let decision = rules.expect("the rules are valid").judge(&facts);
            assert_eq!(
                (decision.outcome, decision.witness().len()),
                (Outcome::Passed, 5),
                "{text}: {decision:?}"
            );
        }
    }

    #[test]
    fn an_exceeded_budget_is_a_timeout() {
        let rules = Rules::builder()
            .budget(Budget {
                tuples: 1,
                ..Budget::default()
            })
            .build("rules.rls", RULES)
            .expect("the rules are valid");
        assert_eq!(rules.judge(&facts(0.75)).outcome, Outcome::Timeout);
    }

    #[test]
    #[cfg(not(feature = "sparql"))]
    fn a_query_without_the_feature_is_reported() {
        let found = Rules::builder()
            .build("rules.rq", "ASK {}")
            .expect_err("the feature is off");
        assert!(
            found
                .iter()
                .any(|diagnostic| diagnostic.code == "R062" && diagnostic.help.is_some()),
            "{found}"
        );
    }

    #[test]
    #[cfg(feature = "sparql")]
    fn a_query_that_is_nested_too_deeply_is_refused_at_its_place() {
        for query in [
            format!(
                "ASK {{ FILTER({}true{}) }}",
                "(".repeat(5_000),
                ")".repeat(5_000)
            ),
            format!("ASK {}{}", "{".repeat(5_000), "}".repeat(5_000)),
            format!(
                "ASK {{ {}{{ ?s ?p ?o }} }}",
                "{ ?s ?p ?o } UNION ".repeat(20_000)
            ),
        ] {
            let found = Rules::builder()
                .build("rules.rq", &query)
                .expect_err("it would exhaust the stack");
            assert!(
                found
                    .iter()
                    .any(|fault| fault.code == "R060" && fault.place().is_some()),
                "{found}"
            );
        }
    }

    #[test]
    #[cfg(feature = "sparql")]
    fn a_query_may_use_the_facts() {
        let ask = "ASK { GRAPH act:after { ?a <http://example.org/x> ?x FILTER(?x < 0.5) } }";
        let rules = Rules::builder()
            .build("rules.rq", ask)
            .expect("the query is valid");
        assert_eq!(rules.judge(&facts(0.25)).outcome, Outcome::Passed);
        assert_eq!(rules.judge(&facts(0.75)).outcome, Outcome::Failed);
    }
}
