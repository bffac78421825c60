//! Placing: from an object in the hand to an object on a surface.
//!
//! [`carry`] brings the hand close to the base and the base to the surface, [`spot`] chooses the
//! spot for the object and the grasp poses above it, [`touch`] detects contact with the surface,
//! and [`skill`] combines them.
//!
//! Never: knows positions other than by sight, by the map and by touch.

mod carry;
mod skill;
mod slim;
mod spot;
mod touch;

pub(crate) use carry::straight;
pub use skill::place;
pub(crate) use touch::{Touch, carried_n};
