//! All integration tests in one program: the large libraries are linked once.

mod replay;

mod broken;
mod campaign;
mod commands;
mod config;
mod diagnostics;
mod facts;
mod floors;
mod history;
mod no_panic;
mod ontology;
mod oracle;
mod physics;
mod readme;
mod recheck;
mod rules;
mod scenario;
mod shrink;
mod stops;
mod support;
mod trust;
