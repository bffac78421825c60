//! Where to look next: batches of points of a unit cube, chosen with what the earlier ones showed, and what a failure's
//! probability is in the whole cube, whatever was looked at.
//!
//! Every strategy draws from a density that it knows, so that each point carries its importance weight. The guided ones
//! (cross-entropy, bandit, boundary) are fed by margins, before anything has failed too, and make at least four plain
//! random points for each that they choose: the same points that `random` makes. So they need at most 1.25 times as many
//! to the first counterexample, and a few of a generation, however a margin may mislead them. Where the space says
//! what is unusual (much noise, many things), four of five of the points that no margin chose are so: a failure that
//! needs neither is found as fast as before, and one that needs everything to be as usual later.
//!
//! Never: knows a scene, a rule or a run, decides what failed, or depends on how many workers ask.

mod archive;
mod bandit;
mod boundary;
mod cross_entropy;
mod estimate;
mod fill;
mod proposal;
mod sampler;
mod space;
mod strategy;
mod unusual;

pub use estimate::{Estimate, Weighted};
pub use proposal::{Component, Marginal, Proposal};
pub use sampler::{Ask, GENERATION, Search};
pub use space::{Dimension, Space};
pub use strategy::Strategy;

pub use archive::Told;
