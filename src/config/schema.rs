//! The schema of configurations, for editors.

/// JSON Schema (draft 2020-12) of a campaign's configuration: keys, types, bounds, defaults and meanings.
///
/// `tests/schema.rs` holds it to what [`crate::config::load`] accepts. Relations between keys, files and names of models are not in
/// it: `actcheck check` finds those.
pub const SCHEMA: &str = include_str!("../../configs/campaign.schema.json");
