//! A rule engine with explanations: Datalog rules over facts, judged with a witness, a margin, and
//! proofs.
//!
//! Rules decide whether a property holds for the facts of an action: the triples before, during and
//! after it. They derive `success` or `violation`; every outcome has an explanation, as text or as
//! a tree.
//!
//! ```
//! use actcheck_base::Outcome;
//! use actcheck_rules::{Facts, Rules};
//!
//! let rules = Rules::parse(
//!     r#"
//!     @prefix ex: <http://example.org/> .
//!
//!     % Objects whose centres are at most 10 cm apart are near each other.
//!     near(?a, ?b) :- after(?a, ex:x, ?x), after(?b, ex:x, ?y), ?a != ?b, ABS(?x - ?y) <= 0.1 .
//!
//!     % The cup is near the plate.
//!     success(?cup) :- near(?cup, ex:plate), after(?cup, rdf:type, ex:Cup) .
//!     margin(?m) :- after(ex:cup, ex:x, ?x), after(ex:plate, ex:x, ?y), ?m = 0.1 - ABS(?x - ?y) .
//!     "#,
//! )?;
//!
//! let mut facts = Facts::from_turtle(
//!     "@prefix ex: <http://example.org/> .
//!      ex:cup a ex:Cup ; ex:x 0.25e0 . ex:plate ex:x 0.3e0 . ex:spoon ex:x 0.9e0 .",
//! )?;
//! let decision = rules.judge(&facts);
//! assert_eq!(decision.outcome, Outcome::Passed);
//! assert!(decision.margin().is_some_and(|margin| (margin - 0.05).abs() < 1e-9));
//!
//! // Why? The proof, down to the facts.
//! let why = rules.why(&facts)?.to_text();
//! assert!(why.contains("by rules.rls:8: The cup is near the plate."));
//! assert!(why.contains("after(<http://example.org/cup>, <http://example.org/x>, 0.25)  (fact)"));
//!
//! // Why not? The closest rule, and the condition that failed.
//! let why_not = rules.why_not(&facts, "near(ex:spoon, ex:plate)")?.to_text();
//! assert!(why_not.contains("missing ABS(?x - ?y) <= 0.1, with 0.6 <= 0.1"));
//! assert!(why_not.contains("missed by 0.5"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | type | purpose |
//! | --- | --- |
//! | [`Rules`] | the rules of one property; [`RulesBuilder`] adds libraries, background knowledge and a [`Budget`] |
//! | [`Facts`] | triples by [`When`], from Turtle text or from terms |
//! | [`Decision`] | the outcome with witness and margin |
//! | [`explain::Explanation`] | proofs, or the closest attempt: a tree, text, Graphviz, JSON |
//! | [`RuleBook`] | the rules of all properties of an ontology, evaluated together |
//! | [`standalone::Program`] | a Datalog program with predicates of its own, without actions |
//!
//! Two languages query the same facts: Datalog in `.rls` files (Nemo's dialect) and, with the
//! feature `sparql`, SPARQL in `.rq` files. The stages in order: [`syntax`], `check`, `engine`
//! (with `naive`, its oracle), `book`, [`explain`].
//!
//! # Features
//!
//! | feature | purpose |
//! | --- | --- |
//! | `sparql` | properties written in SPARQL |
//! | `gzip` | `@import` of files compressed with gzip |
//! | `json` | [`explain::Explanation`] as JSON |
//!
//! Never: steps the simulation, writes to a history, or prints.

#![forbid(unsafe_code)]
#![warn(missing_docs, clippy::unwrap_used)]

mod book;
mod builtins;
mod check;
mod engine;
pub mod explain;
mod facts;
mod model;
mod rules;
#[cfg(feature = "sparql")]
mod sparql;
pub mod standalone;
pub mod syntax;
mod temporal;
mod watch;

pub use book::{RuleBook, owl_closure};
pub use engine::budget::Budget;
pub use facts::{Facts, When};
pub use rules::{Decision, Rules, RulesBuilder};
#[cfg(feature = "sparql")]
pub use sparql::query::unknown_terms;
pub use syntax::parse;

/// Compiles and runs the example of the README.
#[cfg(doctest)]
#[doc = include_str!("README.md")]
struct Readme;
