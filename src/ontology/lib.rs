//! Reads and checks the ontology: actions, properties, designators, categories and the vocabulary,
//! from RDF files.
//!
//! Never: parses a rule, reads a configuration, or accesses the network.

mod assemble;
mod by_name;
mod check;
mod file_iri;
mod graph;
mod literal;
mod model;
mod read;
mod rule_files;
mod template;
mod unlinked;

pub use assemble::{load, load_to_report, load_vocabulary};
pub use file_iri::encoded;
pub use model::{Action, Ontology, Property, RuleFile, RuleLanguage, Vocabulary, VocabularyTerm};
pub use read::triples_of;
pub use template::{Template, property_template};
