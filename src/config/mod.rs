//! Parses and validates a TOML configuration into a [`Campaign`], including its models, worlds and robot.
//!
//! Never: samples a choice, interprets actions, or reads the ontology.

mod campaign;
mod case;
mod case_text;
mod designators;
mod duration;
mod foreign;
mod load;
mod mesh;
pub mod model;
mod other_counts;
mod ranges;
pub mod robot;
mod robot_roles;
mod schema;
mod shape;
mod shelf;
mod skill;
mod table;
mod template;
mod value;
mod words;
mod world_map;
mod xacro;

pub use campaign::{Budget, Camera, Campaign, Launcher, Limits, Odometry, Overrides, Physics, Range, Sensing};
pub use case::Case;
pub use case_text::{CaseText, case_text, written_paths};
pub use duration::duration_secs;
pub(crate) use load::{beside, in_order_of_place};
pub use load::{load, load_text};
pub use mesh::Mesh;
pub use model::{Inertia, ObjectModel, Surface};
pub use other_counts::OtherCounts;
pub use ranges::CONTROL_HZ;
pub use robot::RobotProfile;
pub use schema::SCHEMA;
pub use shape::{Part, Shape};
pub use skill::Skill;
pub use table::Table;
pub use template::{CampaignTemplate, LinksOntology, campaign_template, link_ontology};
pub use value::Located;
pub use world_map::{Furniture, Location, Room, Wall, WorldMap};
