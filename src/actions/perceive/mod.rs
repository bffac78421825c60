//! From depth pictures to a level surface and the things on it.
//!
//! Each step is a function over points: [`cloud`] places pixels in the world, [`plane`] finds the surface, [`rectangle`] its
//! outline, [`cluster`] what stands out of it, [`kinds`] what that may be, [`interpret`] puts them together. [`gaze`] says
//! how the head has to stand, and only [`skill`] moves it.
//!
//! Never: sees anything but pictures and joint positions, or knows what is in the scene.

mod cloud;
mod cluster;
mod gaze;
mod interpret;
mod kinds;
mod plane;
mod rectangle;
mod skill;

pub use skill::perceive_plane;
