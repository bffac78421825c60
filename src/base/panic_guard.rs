//! Panics of libraries that read files of others.

use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind};
use std::sync::Once;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Number of calls that are guarded now, in any thread: a library may panic in a thread of its own.
static GUARDED: AtomicUsize = AtomicUsize::new(0);

/// Calls a function of a library that panics on damaged data. Returns `None` if it panics; nothing
/// is printed then.
pub fn guarded<T>(call: impl FnOnce() -> T) -> Option<T> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic: &PanicHookInfo<'_>| {
            if GUARDED.load(Ordering::Acquire) == 0 {
                before(panic);
            }
        }));
    });
    GUARDED.fetch_add(1, Ordering::AcqRel);
    let returned = catch_unwind(AssertUnwindSafe(call));
    GUARDED.fetch_sub(1, Ordering::AcqRel);
    returned.ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_none() {
        assert_eq!(guarded(|| [1, 2, 3].iter().sum::<i32>()), Some(6));
        assert_eq!(guarded(|| Vec::<i32>::new()[std::hint::black_box(1)]), None);
        assert_eq!(GUARDED.load(Ordering::Acquire), 0);
    }
}
