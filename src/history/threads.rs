//! Sharing work between threads.

use std::num::NonZero;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::{ScopedJoinHandle, available_parallelism, scope};

/// Number of this machine's cores.
pub(super) fn cores() -> usize {
    available_parallelism().map_or(1, NonZero::get)
}

/// Does two things side by side with two threads or more, otherwise one after the other.
pub(super) fn side_by_side<A, B: Send>(
    threads: usize,
    first: impl FnOnce() -> A,
    second: impl FnOnce() -> B + Send,
) -> (A, B) {
    if threads < 2 {
        return (first(), second());
    }
    scope(|scope| {
        let second = scope.spawn(second);
        (first(), joined(second))
    })
}

/// The items for which `keep` returns true, in their order. `threads` is the number of threads that
/// examine them.
pub(super) fn filtered<T: Sync>(
    threads: usize,
    items: &[T],
    keep: impl Fn(&T) -> bool + Sync,
) -> Vec<&T> {
    let next = AtomicUsize::new(0);
    let share = || {
        let mut kept = Vec::new();
        loop {
            let place = next.fetch_add(1, Ordering::Relaxed);
            let Some(item) = items.get(place) else {
                return kept;
            };
            if keep(item) {
                kept.push(place);
            }
        }
    };
    let mut kept: Vec<usize> = scope(|scope| {
        let others: Vec<_> = (1..threads.min(items.len()))
            .map(|_| scope.spawn(share))
            .collect();
        let own = share();
        others
            .into_iter()
            .map(joined)
            .fold(own, |kept, more| [kept, more].concat())
    });
    kept.sort_unstable();
    kept.into_iter().map(|place| &items[place]).collect()
}

/// The result of a thread. A panic goes on in the caller's.
pub(super) fn joined<T>(thread: ScopedJoinHandle<'_, T>) -> T {
    thread
        .join()
        .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_have_the_same_result_at_any_number_of_threads() {
        let items: Vec<u32> = (0..1000).collect();
        let expected: Vec<&u32> = items.iter().filter(|item| **item % 7 == 3).collect();
        for threads in [0, 1, 2, 5, 2000] {
            assert_eq!(
                filtered(threads, &items, |item| item % 7 == 3),
                expected,
                "{threads}"
            );
            assert_eq!(
                filtered(threads, &[] as &[u32], |_| true),
                [&0; 0],
                "{threads}"
            );
            assert_eq!(side_by_side(threads, || 1, || 2), (1, 2), "{threads}");
        }
    }
}
