//! Counters of a server: answers by kind, and response times.

use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Number of buckets of the response times: four for each power of two microseconds, up to a day.
const BUCKETS: usize = 4 * 37;

/// Counts since a server started.
#[derive(Debug)]
pub struct Counts {
    served: AtomicU64,
    refused: AtomicU64,
    failed: AtomicU64,
    moved: AtomicU64,
    times: [AtomicU64; BUCKETS],
}

impl Default for Counts {
    fn default() -> Self {
        let [served, refused, failed, moved] = [0; 4].map(AtomicU64::new);
        Self {
            served,
            refused,
            failed,
            moved,
            times: [0; BUCKETS].map(AtomicU64::new),
        }
    }
}

impl Counts {
    /// Counts a response.
    pub(super) fn record(&self, status: u16, time: Duration) {
        let counter = match status {
            ..400 => &self.served,
            400..500 => &self.refused,
            _ => &self.failed,
        };
        counter.fetch_add(1, Ordering::Relaxed);
        if let Some(bucket) = self.times.get(bucket(time)) {
            bucket.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Counts a query that took longer than its first slice of time.
    pub(super) fn record_moved(&self) {
        self.moved.fetch_add(1, Ordering::Relaxed);
    }

    /// The time within which this share of the requests was answered, to 19 %. `None` before the
    /// first. Unit: milliseconds.
    pub fn quantile_ms(&self, share: f64) -> Option<f64> {
        let counts: Vec<u64> = self
            .times
            .iter()
            .map(|count| count.load(Ordering::Relaxed))
            .collect();
        let all: u64 = counts.iter().sum();
        #[expect(
            clippy::cast_precision_loss,
            reason = "a rank among requests need not be exact"
        )]
        let wanted = share * all as f64;
        let mut so_far = 0;
        for (bucket, count) in (0u16..).zip(counts) {
            so_far += count;
            #[expect(
                clippy::cast_precision_loss,
                reason = "a rank among requests need not be exact"
            )]
            if count > 0 && so_far as f64 >= wanted {
                return Some(2f64.powf(f64::from(bucket + 1) / 4.0) / 1000.0);
            }
        }
        None
    }

    /// The counts as JSON.
    pub(super) fn json(&self) -> String {
        let of = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        let time = |share| {
            self.quantile_ms(share)
                .map_or_else(|| "null".to_owned(), |ms| format!("{ms:.3}"))
        };
        format!(
            "{{\"served\":{},\"refused\":{},\"failed\":{},\"moved\":{},\"p50_ms\":{},\"p99_ms\":{}}}\n",
            of(&self.served),
            of(&self.refused),
            of(&self.failed),
            of(&self.moved),
            time(0.5),
            time(0.99)
        )
    }
}

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let of = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        write!(
            f,
            "{} requests served, {} refused, {} failed",
            of(&self.served),
            of(&self.refused),
            of(&self.failed)
        )?;
        match self.quantile_ms(0.99) {
            Some(ms) => write!(f, "; 99 % of them within {ms:.1} ms"),
            None => Ok(()),
        }
    }
}

fn bucket(time: Duration) -> usize {
    let micros = time.as_secs_f64() * 1e6;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "it is between 0 and 4 × 37"
    )]
    let bucket = (micros.max(1.0).log2() * 4.0) as usize;
    bucket.min(BUCKETS - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_close_to_the_times() {
        let counts = Counts::default();
        assert_eq!(counts.quantile_ms(0.99), None);
        (0..99).for_each(|_| counts.record(200, Duration::from_millis(2)));
        counts.record(503, Duration::from_secs(7));
        counts.record(404, Duration::ZERO);
        for (share, ms) in [(0.5, 2.0), (0.97, 2.0), (1.0, 7000.0)] {
            let found = counts.quantile_ms(share).unwrap();
            assert!(found >= ms && found <= ms * 1.2, "{share}: {found}");
        }
        assert!(
            counts
                .to_string()
                .starts_with("99 requests served, 1 refused, 1 failed; 99 % of them within 2.")
        );
        assert!(
            counts
                .json()
                .starts_with("{\"served\":99,\"refused\":1,\"failed\":1,\"moved\":0,\"p50_ms\":2.")
        );
    }
}
