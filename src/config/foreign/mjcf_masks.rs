//! Masks of collisions of geoms in MJCF.

use crate::foreign::mjcf_compiler::{Compiler, MjcfAttributes};

/// Whether a geom can touch others.
pub(super) fn collides(attributes: &MjcfAttributes<'_>, compiler: &Compiler) -> bool {
    let is_solid =
        attributes.get("contype") != Some("0") || attributes.get("conaffinity") != Some("0");
    is_solid
        || attributes
            .get("name")
            .is_some_and(|name| compiler.paired.contains(name))
}

/// The bits of a geom that decide about its collisions: `contype` and `conaffinity`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Mask {
    kinds: u32,
    with: u32,
}

impl Mask {
    pub(super) fn of(attributes: &MjcfAttributes<'_>) -> Self {
        let bits = |name: &str| {
            attributes
                .get(name)
                .and_then(|text| text.parse().ok())
                .unwrap_or(1)
        };
        Self {
            kinds: bits("contype"),
            with: bits("conaffinity"),
        }
    }

    /// Whether two geoms collide.
    pub(super) fn meets(self, other: Self) -> bool {
        self.kinds & other.with != 0 || other.kinds & self.with != 0
    }
}
