//! Parses and validates a TOML configuration into a [`Campaign`], including its models, worlds and
//! robot.
//!
//! Never: samples a choice, interprets actions, or reads the ontology.

mod campaign;
mod case;
mod case_text;
mod designators;
mod duration;
mod foreign;
mod load;
pub mod model;
mod model_library;
#[cfg(test)]
#[path = "../../tests/support/mutations.rs"]
mod mutations;
mod other_counts;
mod paths;
mod ranges;
mod relations;
pub mod robot;
mod robot_cup;
mod robot_place;
mod robot_roles;
mod schema;
mod skill;
mod starts;
mod step;
mod table;
mod template;
mod value;
mod visuals;
mod words;
mod world_map;
mod xacro;

pub use campaign::{Campaign, Limits, Overrides};
pub use case::Case;
pub use case_text::{CaseText, WrittenPaths, case_text, with_skills, written_paths};
pub use duration::{DurationFault, duration_secs};
pub use load::{in_order_of_place, load, load_text, mended_robot};
pub use other_counts::OtherCounts;
pub use paths::{check_unnamed, resolve_path};
pub use relations::{Relation, SceneChange};
pub use schema::SCHEMA;
pub use skill::{Launcher, Skill};
pub use starts::{Starts, starts};
pub use step::Step;
pub use table::Table;
pub use template::{CampaignTemplate, LinksOntology, campaign_template, link_ontology};
pub use value::Located;
pub use visuals::VisualFiles;
pub use words::quoted;
pub use world_map::{Furniture, Wall, WorldMap};
