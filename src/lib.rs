//! actcheck: QuickCheck for robot actions.
//!
//! Generates randomised tabletop scenes, lets a robot act in them in physics simulation, writes the world before, during
//! and after each action as RDF facts, judges the actions by rules that people edit without recompiling, and keeps
//! every run.
//!
//! # One straight line
//!
//! ```text
//! config → scenario → world → actions → facts → rules → verdict → history → analysis → report
//!  TOML    choices   physics  motion     RDF   Datalog  outcomes  RDF store  polars    text, JSON
//!                                            + SPARQL
//! ```
//!
//! Each stage is a function from the products of earlier stages to its own; nothing flows back. [`campaign`] conducts,
//! [`cli`] is the rim where arguments, clock, signals and streams are.
//!
//! | module | what it does | its library |
//! | --- | --- | --- |
//! | [`base`] | sources and diagnostics, terms, poses, recorded choices, shipped files | |
//! | [`search`] | where in a cube to look next, learnt from margins; failure rates whatever was looked at | statrs |
//! | [`config`] | TOML text to a `Campaign` in which nothing is left to check; models, ours and other people's | toml, roxmltree, mesh-loader, shlex |
//! | [`ontology`] | actions, properties, designators, categories and the vocabulary | oxigraph (parsers) |
//! | [`scenario`] | recorded choices to one concrete `Scene`; what "simpler" means | parry3d (overlaps) |
//! | [`world`] | a `Scene` to a stepping simulation; the only place that knows the engine | rapier3d, parry3d, urdf-rs |
//! | [`actions`] | the robot's actions over commands and observations; the `Trace` | |
//! | [`protocol`] | actions performed by a program of somebody's, in lockstep over a socket | nix |
//! | [`facts`] | a `Trace` to RDF facts, interned once | |
//! | [`rules`] | rule text to what it finds in the facts; SPARQL properties | datafrog, oxigraph (evaluator) |
//! | [`verdict`] | findings to outcomes with witness and margin; the scores | |
//! | [`history`] | the run store: transactions, queries, traces | oxigraph (store) |
//! | [`campaign`] | the conductor; the only module that calls many stages | rayon |
//! | [`analysis`] | history to tables and patterns: rates with intervals, failure modes, campaigns side by side, when it fails | polars, statrs |
//! | [`report`] | verdicts and tables as text, JSON and pages, in the formats of other people's tools; runs as pictures and in 3D | rerun (feature `rerun`) |
//! | [`serve`] | a history over HTTP: SPARQL endpoint, a page to ask from, the report | oxhttp |
//! | [`cli`] | arguments, exit codes, progress; the one place that prints errors | clap, clap_complete, clap_mangen |
//!
//! A module imports only from modules above it in this table ([`campaign`] and [`cli`] from all), and a library of the field is used
//! only where the table names it: `tests/floors.rs` holds both.

#![forbid(unsafe_code)]
#![warn(missing_docs, clippy::unwrap_used)]

pub mod base;

pub mod search;

pub mod config;

pub mod ontology;

pub mod scenario;

pub mod world;

pub mod actions;

pub mod protocol;

pub mod facts;

pub mod rules;

pub mod verdict;

pub mod history;

pub mod campaign;

pub mod analysis;

pub mod report;

pub mod serve;

pub mod cli;
