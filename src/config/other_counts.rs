//! Numbers of other objects in a scene.

use actcheck_data::ChoiceName;

/// Numbers of other objects in a scene. Each is the least and the most; 0 by default.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct OtherCounts {
    /// On the surface of the target (`[surfaceObjects] count`).
    pub beside_target: (u32, u32),
    /// On the surface where the target is to be placed (`[placeSurface] count`).
    pub at_place: (u32, u32),
}

impl OtherCounts {
    /// Whether a scene can have other objects.
    pub fn any(&self) -> bool {
        self.beside_target.1 > 0 || self.at_place.1 > 0
    }

    /// Returns the bounds of the count that this choice sets, or `None` if it sets something else.
    pub fn of_choice(&self, name: &ChoiceName) -> Option<(u32, u32)> {
        match name {
            ChoiceName::OtherCount => Some(self.beside_target),
            ChoiceName::PlaceOtherCount => Some(self.at_place),
            _ => None,
        }
    }
}
