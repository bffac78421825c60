//! Draws colour images: the nearest surface at each sample of a pixel, lit by one distant light with
//! shadows.
//!
//! Surfaces are filled as triangles into a buffer of depths, once from the eye and once from the
//! light. All arithmetic is that of the processor's sums, products, quotients and square roots, in a
//! fixed order, so that the same scene has the same bits everywhere.
//!
//! Never: knows a scene, a robot, or the roles of bodies.

mod buffer;
mod finish;
mod image;
mod shadow;
mod skin;
mod tessellate;

pub use finish::Finish;
pub use image::{Drawn, Light, RgbImage, draw};
pub use skin::Skin;
