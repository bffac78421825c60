//! Entry points of the fuzz targets: each accepts any text, and must return quickly without a
//! panic.
//!
//! The targets below `fuzz_targets/` give libFuzzer's inputs to these functions;
//! `tests/fuzz_corpus.rs` of the program includes this file and gives them the corpus as a
//! regression test.

pub mod frames;
pub mod histories;
pub mod imports;

use std::path::Path;
use std::sync::OnceLock;

use actcheck::base::{Diagnostics, Files, RuleFault, RunFacts, Source, Term, Terms, names};
use actcheck::ontology::{self, Ontology, Property, RuleFile, RuleLanguage};
use actcheck::rules::standalone::{Engine, Program};
use actcheck::rules::{Budget, RuleBook, parse as parse_rules};

/// Small enough for many inputs per second; a correct engine returns from any input within it.
fn budget() -> Budget {
    Budget {
        tuples: 500,
        secs: 0.2,
        ..Budget::default()
    }
}

const TESTED: &str = "http://actions#Tested";

/// The rule parser.
pub fn parse(text: &str) {
    let (syntax, diagnostics) = parse_rules(&Source::new("fuzz.rls", text));
    assert_eq!(syntax.whole, !diagnostics.has_errors());
    places_are_in(text, &diagnostics);
}

/// The checker: the text as a standalone program, and as the rules of a property of the shipped
/// ontology.
pub fn check(text: &str) {
    drop(program(text));
    // Preparing a rule book takes some milliseconds; most inputs are invalid as programs already.
    if !parse_rules(&Source::new("fuzz.rls", text)).0.whole {
        return;
    }
    match RuleBook::prepare(&with_property(text, RuleLanguage::Datalog)) {
        Ok(book) => places_are_in(text, book.warnings()),
        Err(found) => {
            assert!(found.has_errors());
            places_are_in(text, &found);
        }
    }
}

/// Both evaluators on a standalone program, which must derive the same, and the explanations.
pub fn evaluate(text: &str) {
    let Some(program) = program(text) else { return };
    let (fast, naive) = (
        program.close(Engine::Fast, &budget()),
        program.close(Engine::Naive, &budget()),
    );
    let (Ok(fast), Ok(naive)) = (fast, naive) else {
        return;
    };
    for predicate in fast.predicates() {
        let tuples = fast.tuples(predicate);
        assert_eq!(tuples, naive.tuples(predicate), "{predicate}");
        if let Some(tuple) = tuples.first() {
            let args: Vec<String> = tuple.iter().map(Term::to_string).collect();
            // A term that the language can't express is refused with a message.
            let _ = program
                .explain(&format!("{predicate}({})", args.join(", ")), &budget())
                .map(|why| why.to_text());
        }
    }
}

/// A property in SPARQL: prepared and judged over the facts of one action.
pub fn sparql_property(text: &str) {
    let book = match RuleBook::prepare(&with_property(text, RuleLanguage::Sparql)) {
        Ok(book) => book,
        Err(found) => return places_are_in(text, &found),
    };
    let Some(action) = facts().action(0) else {
        unreachable!("the facts hold one action")
    };
    for (_, result) in book.judge(&action, &[TESTED.to_owned()], &budget()) {
        match result {
            Ok(findings) => assert!(findings.witness.len() <= findings.witness_count),
            Err(RuleFault::Interrupted) => unreachable!("no stop is requested"),
            Err(fault) => assert!(!fault.reason().is_empty()),
        }
    }
}

/// A standalone program. Returns `None` if it has a fault or could name a file: fuzzing never reads
/// one.
fn program(text: &str) -> Option<Program> {
    if text.contains("@import") && text.contains(['/', '\\']) {
        return None;
    }
    match Program::load(&Source::new("fuzz.rls", text), Path::new("no such folder")) {
        Ok(program) => {
            places_are_in(text, &program.warnings);
            Some(program)
        }
        Err(found) => {
            assert!(found.has_errors());
            places_are_in(text, &found);
            None
        }
    }
}

/// Checks that every diagnostic can be shown: its span is in the text and at character boundaries.
fn places_are_in(text: &str, diagnostics: &Diagnostics) {
    for found in diagnostics.iter() {
        assert!(!found.message.is_empty());
        if let (Some(span), Some(source)) = (&found.span, &found.source)
            && source.text.as_ref() == text
        {
            assert!(
                text.get(span.clone()).is_some(),
                "{span:?} is not a valid span: {found}"
            );
        }
    }
    let _ = diagnostics.to_string();
}

/// The shipped ontology with the text as its only property.
fn with_property(text: &str, language: RuleLanguage) -> Ontology {
    static SHIPPED: OnceLock<Ontology> = OnceLock::new();
    let shipped = SHIPPED.get_or_init(|| {
        let path = Path::new("ontology/actions.ttl");
        let mut ontology =
            ontology::load(&Files::Shipped, path).unwrap_or_else(|found| panic!("{found}"));
        // The OWL closure takes longer than everything else, and is the same for every input.
        ontology.triples.clear();
        ontology
    });
    let name = if language == RuleLanguage::Sparql {
        "fuzz.rq"
    } else {
        "fuzz.rls"
    };
    let mut property = Property::new(TESTED, RuleFile::new(Source::new(name, text)));
    property.label = "the tested property".into();
    property.unit = Some("m".into());
    let mut ontology = shipped.clone();
    ontology.properties = [(TESTED.to_owned(), property)].into();
    ontology
}

/// A glass that is lifted by 0.1 m, beside a box.
fn facts() -> &'static RunFacts {
    static FACTS: OnceLock<RunFacts> = OnceLock::new();
    FACTS.get_or_init(|| {
        let mut terms = Terms::new();
        let [glass, other] =
            ["glass", "box"].map(|name| terms.intern(Term::iri(format!("{}{name}", names::OBJ))));
        let [x, y, z, touches] = ["x", "y", "z", "touches"]
            .map(|name| terms.intern(Term::iri(format!("{}{name}", names::W))));
        let mut state = |height: f64| {
            let mut triples = vec![[glass, touches, other]];
            for (body, position) in [(glass, [0.4, 0.0, height]), (other, [0.5, 0.1, 0.05])] {
                for (axis, value) in [x, y, z].into_iter().zip(position) {
                    triples.push([body, axis, terms.intern(Term::Double(value))]);
                }
            }
            triples.sort_unstable();
            triples
        };
        let snapshots = vec![state(0.06), state(0.16)];
        let designator = terms.intern(Term::iri(format!("{}pickObject", names::ACT)));
        let (during, parameters) = (vec![Vec::new()], vec![vec![[designator, glass]]]);
        RunFacts {
            terms,
            snapshots,
            during,
            parameters,
            courses: vec![None],
            lacks: Vec::new(),
        }
    })
}
