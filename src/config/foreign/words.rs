//! The elements of a file's own format, for messages about models of any format.

use crate::foreign::root_name;
use actcheck_base::SourceSpan;

/// The names of things in a format.
pub(crate) struct Words {
    /// A shape that collides.
    pub(crate) solid: &'static str,
    /// A shape that is only seen.
    pub(crate) visual: &'static str,
    /// The limits of a joint's position.
    pub(crate) limits: &'static str,
    /// The factor of a coupling.
    pub(crate) factor: &'static str,
}

/// Returns the names in the file that contains a place.
pub(crate) fn words_at(place: &SourceSpan) -> Words {
    match root_name(&place.source.text) {
        Some("mujoco" | "mujocoinclude") => Words {
            solid: "`<geom>` that collides",
            visual: "`<geom>` that is only seen",
            limits: "`range`",
            factor: "coupling",
        },
        _ => Words {
            solid: "`<collision>`",
            visual: "`<visual>`",
            limits: "`<limit>`",
            factor: "multiplier",
        },
    }
}
