//! The JSON schema of configurations, for editors.

/// JSON Schema (draft 2020-12) of a campaign's configuration: keys, types, bounds, defaults and
/// meanings.
///
/// `tests/schema.rs` checks that it accepts the same configurations as [`crate::load`]. It does not
/// cover relations between keys, files and names of models; `actcheck check` does.
pub const SCHEMA: &str = include_str!("shipped/campaign.schema.json");
