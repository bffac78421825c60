//! The number of threads.

use std::num::NonZero;
use std::thread::available_parallelism;

/// Number of this machine's cores.
pub(super) fn cores() -> usize {
    available_parallelism().map_or(1, NonZero::get)
}
