//! Searches a unit cube for failures: proposes batches of points from earlier results, and
//! estimates without bias the probability of a failure in the whole cube.
//!
//! Every strategy draws from a known density, so that each point has an importance weight. The
//! guided strategies (cross-entropy, bandit, boundary) learn from margins, even before the first
//! failure. For each point that they choose they draw at least four plain random points, the same
//! points as `random`. So even if margins mislead them, they need at most 1.25 times as many points
//! to the first counterexample, plus a few of a generation. If the space declares unusual values
//! (much noise, many objects), four of five of the points not chosen by margins are unusual.
//! Failures that don't depend on these values are found as fast as before; failures that need usual
//! values are found later.
//!
//! Never: depends on scenes, rules, runs or the number of workers, or decides outcomes.

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

pub use archive::PropertyResult;
