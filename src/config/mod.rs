//! TOML text to a `Campaign` in which nothing is left to check; models and robots are read here too.
//!
//! Never: draws a choice, knows an action's meaning, or reads the ontology.

mod campaign;
pub mod model;
pub mod robot;
mod table;

pub use campaign::{Budget, Campaign, Launcher, Physics, Range, Sensing};
pub use model::{ObjectModel, Part, Shape, Surface};
pub use robot::RobotProfile;
pub use table::{Located, Table};
