//! The gripper: which joints move its fingers, and how far apart these are at any position of the
//! joints.
//!
//! Two fingers that slide apart from 0 need no table: each is at half of the opening. For all other
//! grippers (turning fingers, other directions, couplings, one moving finger), the opening is
//! measured on the model at evenly spaced positions between open and closed. Hands with more
//! fingers have an opening between two of them; the further ones open and close with these.
//!
//! Never: knows the engine's state, or decides how wide to open.

mod between_fingers;
mod coupling;
mod further;
mod gap;
mod measure;
mod opening;
mod sides;
mod sliding;
mod squeeze;
mod surface;
mod table;

pub(crate) use between_fingers::between_fingers;
pub(crate) use gap::Probe;
pub use opening::Gripper;
pub(crate) use sides::links_of_fingers;
pub(crate) use squeeze::{outward_push, pushes};
pub(crate) use surface::Surface;
