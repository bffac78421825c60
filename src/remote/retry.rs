//! When a request is sent again.

use std::time::Duration;

/// The wait before the second try.
const FIRST_WAIT: Duration = Duration::from_millis(200);
/// The longest wait between two tries.
const LONGEST_WAIT: Duration = Duration::from_secs(10);
/// The longest wait that a server may ask for, at once and in all tries together.
pub(crate) const LONGEST_ASKED: Duration = Duration::from_secs(60);
/// Number of tries of a request: all waits together are about 40 seconds, enough for a server that
/// restarts.
const TRIES: u32 = 10;

/// The wait after a number of failed tries, at least 1. `asked` is the wait that the server asked
/// for. Returns `None` if the request is given up, because of too many tries or too long a wait.
pub(crate) fn wait_after(tries: u32, asked: Option<Duration>) -> Option<Duration> {
    if tries >= TRIES {
        return None;
    }
    let doubled = FIRST_WAIT
        .saturating_mul(1 << (tries.saturating_sub(1)).min(16))
        .min(LONGEST_WAIT);
    let wait = asked.map_or(doubled, |asked| asked.max(doubled));
    // A server may ask for hours; then it is better to give up and to resume later.
    Some(wait).filter(|wait| *wait <= LONGEST_ASKED)
}

/// Whether the same request may succeed later: the server is busy, restarting, or behind a proxy
/// that doesn't reach it.
pub(crate) fn is_temporary(status: u16) -> bool {
    matches!(status, 408 | 425 | 429 | 500 | 502 | 503 | 504)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_double_up_to_a_limit_and_end() {
        let waits: Vec<Duration> = (1..).map_while(|tries| wait_after(tries, None)).collect();
        assert_eq!(waits.len(), TRIES as usize - 1);
        assert_eq!(waits[..3], [200, 400, 800].map(Duration::from_millis));
        assert!(waits.iter().sum::<Duration>() < Duration::from_secs(45));
        assert_eq!(
            wait_after(1, Some(Duration::from_secs(5))),
            Some(Duration::from_secs(5))
        );
        assert_eq!(wait_after(1, Some(Duration::from_secs(86_400))), None);
        assert_eq!(wait_after(1, Some(Duration::from_secs(u64::MAX))), None);
        assert!(is_temporary(503) && !is_temporary(404) && !is_temporary(501));
    }
}
