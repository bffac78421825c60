//! From a thing in the hand to a thing on a surface.
//!
//! [`carry`] brings the hand close to the base and the base to the surface, [`spot`] chooses where the thing shall stand and
//! how the hand gets there, [`touch`] feels when it stands, and [`skill`] puts them together.
//!
//! Never: knows where anything is but by sight, by the map and by what the hand feels.

mod carry;
mod skill;
mod spot;
mod touch;

pub use skill::place;
