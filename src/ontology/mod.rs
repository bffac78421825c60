//! Actions, properties, designators, categories and the vocabulary, read from RDF files and checked.
//!
//! Never: parses a rule, knows what a configuration asks for, or goes to the network.

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

pub use assemble::load;
pub use model::{Action, Ontology, Property, RuleFile, RuleLanguage, Vocabulary, VocabularyTerm};
pub use template::{Template, property_template};
