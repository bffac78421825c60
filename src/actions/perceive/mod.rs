//! From depth pictures to a level surface and the things on it.
//!
//! Each step is a function over points: [`cloud`] places pixels in the world, [`plane`] finds the
//! surface, [`rectangle`] its outline, [`cluster`] separates the objects on it, [`kinds`]
//! recognises them, and [`interpret`] combines these steps. [`gaze`] computes head postures, and
//! only [`sight`] moves the head: for [`skill`], which looks for any surface, and for [`survey`],
//! which looks again at a known one.
//!
//! Never: uses anything but pictures and joint positions, or reads the contents of the scene.

mod cloud;
mod cluster;
mod gaze;
mod interpret;
mod kinds;
mod plane;
mod rectangle;
mod sight;
mod skill;
mod survey;

pub use gaze::{safely_towards, towards};
pub use skill::perceive_plane;
pub use survey::{Survey, look_again, survey};
