//! How many things stand around.

/// How many other objects a scene has. Shape of each: least, most; none by default.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct OtherCounts {
    /// On the surface of the target (`[surfaceObjects] count`).
    pub beside_target: (u32, u32),
    /// On the surface that the target is to be placed on (`[placeSurface] count`).
    pub at_place: (u32, u32),
}

impl OtherCounts {
    /// Whether there can be any.
    pub fn any(&self) -> bool {
        self.beside_target.1 > 0 || self.at_place.1 > 0
    }

    /// The bounds of the count that a choice of this name decides; nothing where it decides something else.
    pub fn of_choice(&self, name: &str) -> Option<(u32, u32)> {
        match name {
            "other.count" => Some(self.beside_target),
            "place_other.count" => Some(self.at_place),
            _ => None,
        }
    }
}
