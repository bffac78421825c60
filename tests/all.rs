//! All integration tests in one program: the large libraries are linked once.

mod bounds;
mod broken;
mod campaign;
mod commands;
mod compare;
mod config;
mod diagnostics;
mod facts;
mod floors;
mod fuzz_corpus;
mod history;
mod no_panic;
mod ontology;
mod oracle;
mod physics;
mod proofs;
mod readme;
mod recheck;
mod repeat;
mod replay;
mod rules;
mod scenario;
mod shrink;
mod stops;
mod support;
mod trust;
