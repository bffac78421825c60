//! actcheck: QuickCheck for robot actions.
//!
//! Generates randomised tabletop scenes, lets a robot act in them in a physics simulation, records
//! the world before, during and after each action as RDF facts, judges the actions by rules that
//! can be edited without recompiling, and stores every run.
//!
//! # One straight line
//!
//! ```text
//! config → scenario → world → actions → facts → rules → verdict → history → analysis → report
//!  TOML    choices   physics  motion     RDF   Datalog  outcomes  segments   polars    text, JSON
//!                                            + SPARQL
//! ```
//!
//! Each stage is a function from the products of earlier stages to its own product; nothing flows
//! back. [`campaign`] runs the stages; [`cli`] handles arguments, the clock, signals and streams.
//!
//! Each stage is a crate of its own in the folder of its name (`src/rules` is `actcheck-rules`), so
//! that a part can be used without the rest of the program.
//!
//! | crate | purpose | libraries |
//! | --- | --- | --- |
//! | [`base`] | sources and diagnostics, terms, facts, findings and outcomes, shipped files, lines for a shell | encoding_rs, shlex |
//! | [`data`] | poses, recorded choices, models, scenes, traces | |
//! | [`search`] | adaptive sampling of the unit cube, guided by margins; failure rates by importance weighting | statrs |
//! | [`config`] | TOML text to a fully checked `Campaign`; models in our own and in third-party formats | toml, roxmltree, mesh-loader, urdf-rs (writer), shlex |
//! | [`ontology`] | actions, properties, designators, categories and the vocabulary | oxrdf, oxrdfio (parsers) |
//! | [`scenario`] | recorded choices to one concrete `Scene`; the order of simplicity for shrinking | parry3d (overlaps) |
//! | [`geometry`] | shapes, hulls, distances and depths | parry3d |
//! | [`robot`] | a robot compiled from its typed tree: kinematics, inverse kinematics, gripper, dynamics; the proposal of a profile | parry3d |
//! | [`world`] | a `Scene` to a stepping simulation; the only crate that uses the physics engine | rapier3d, parry3d |
//! | [`actions`] | the robot's actions through commands and observations; the `Trace` | |
//! | [`protocol`] | actions performed by an external program, in lockstep over a socket | nix |
//! | [`facts`] | a `Trace` to RDF facts, interned once | |
//! | [`episodes`] | recordings of other simulators to the same `Trace` | mcap, prost, parry3d (distances) |
//! | [`rules`] | rule text to derived facts; SPARQL properties | datafrog, oxrdf, oxrdfio (imports), oxigraph (evaluator, feature `sparql`), spargebra (parser) |
//! | [`verdict`] | findings to outcomes with witness and margin; the scores | |
//! | `judge` | plain values of one action to outcomes; the module of Python programs | pyo3 (feature `python`) |
//! | [`history`] | the run store: transactions, queries, traces | oxigraph (store), spargebra (parser) |
//! | [`campaign`] | runs the stages of a campaign; the only crate that calls many stages | rayon |
//! | [`analysis`] | history to tables and patterns: rates with intervals, failure modes, comparison of campaigns, failure conditions | polars, statrs |
//! | [`report`] | verdicts and tables as text, JSON and HTML, and in the formats of other tools; runs as pictures, in 3D and as bags of ROS 2 | mcap, rerun (feature `rerun`) |
//! | [`serve`] | a history over HTTP: SPARQL endpoint, query page, report | hyper, tokio |
//! | [`remote`] | HTTP client: sends statements to stores of others, and asks there | ureq, rustls (feature `https`) |
//! | [`cli`] | arguments, exit codes, progress; the one place that prints errors | clap, clap_complete, clap_mangen |
//!
//! A crate depends only on crates above it in this table ([`campaign`] on many, [`cli`] on all),
//! and on a listed library only if the table names it there. `tests/floors.rs` enforces both.

#![forbid(unsafe_code)]
#![warn(missing_docs, clippy::unwrap_used)]

// In the order of the table; blank lines keep rustfmt from sorting them.
pub use actcheck_base as base;

pub use actcheck_data as data;

pub use actcheck_search as search;

pub use actcheck_config as config;

pub use actcheck_ontology as ontology;

pub use actcheck_scenario as scenario;

pub use actcheck_geometry as geometry;

pub use actcheck_robot as robot;

pub use actcheck_world as world;

pub use actcheck_actions as actions;

pub use actcheck_protocol as protocol;

pub use actcheck_facts as facts;

pub use actcheck_episodes as episodes;

pub use actcheck_rules as rules;

pub use actcheck_verdict as verdict;

pub use actcheck_history as history;

pub use actcheck_campaign as campaign;

pub use actcheck_analysis as analysis;

pub use actcheck_report as report;

pub use actcheck_serve as serve;

pub use actcheck_remote as remote;

pub use actcheck_cli as cli;
