//! Counts and times of a node since its start.

use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// How many of the latest times are kept.
const WINDOW: usize = 4096;

/// What the threads count. All of it only ever grows.
#[derive(Debug, Default)]
pub struct Stats {
    /// Images that came whole.
    pub received: AtomicU64,
    /// Images that never came, told by gaps in the publisher's numbering.
    pub missed: AtomicU64,
    /// Images with a layout that cannot be used.
    pub rejected: AtomicU64,
    /// Images that were overwritten by newer ones.
    pub skipped: AtomicU64,
    /// Images with a message on `~/tracks`.
    pub published: AtomicU64,
    /// Messages that could not be published.
    pub unsent: AtomicU64,
    times: Mutex<Times>,
}

#[derive(Debug, Default)]
struct Times {
    /// From an image's arrival to its message, without the tracker's own time.
    overhead: Ring,
    /// The tracker's own time.
    processing: Ring,
}

/// The latest times, in nanoseconds.
#[derive(Debug, Default)]
struct Ring {
    values: Vec<i64>,
    next: usize,
}

impl Ring {
    fn push(&mut self, value: i64) {
        if self.values.len() < WINDOW {
            self.values.push(value);
        } else {
            self.values[self.next] = value;
        }
        self.next = (self.next + 1) % WINDOW;
    }

    /// The value below which `share` of all lie, in milliseconds.
    fn quantile(&self, share: f64) -> f64 {
        let mut sorted = self.values.clone();
        sorted.sort_unstable();
        let at = ((sorted.len() as f64 * share) as usize).min(sorted.len().saturating_sub(1));
        sorted.get(at).map_or(0.0, |&ns| ns as f64 / 1e6)
    }
}

/// Adds to a count.
pub fn count(counter: &AtomicU64, n: u64) {
    counter.fetch_add(n, Relaxed);
}

impl Stats {
    /// Notes a published message: `latency` nanoseconds after its image came, `processing` of them the tracker's.
    pub fn published(&self, latency: i64, processing: Duration) {
        count(&self.published, 1);
        let processing = i64::try_from(processing.as_nanos()).unwrap_or(i64::MAX);
        let mut times = self.times.lock().unwrap_or_else(PoisonError::into_inner);
        times.overhead.push(latency - processing);
        times.processing.push(processing);
    }
}

impl fmt::Display for Stats {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let times = self.times.lock().unwrap_or_else(PoisonError::into_inner);
        write!(
            f,
            "images: {} received, {} missed, {} rejected, {} skipped; {} track messages, {} messages unsent; \
             tracker: median {:.2} ms, 95 % {:.2} ms; the rest from arrival to publication: median {:.2} ms, 95 % {:.2} ms",
            self.received.load(Relaxed),
            self.missed.load(Relaxed),
            self.rejected.load(Relaxed),
            self.skipped.load(Relaxed),
            self.published.load(Relaxed),
            self.unsent.load(Relaxed),
            times.processing.quantile(0.5),
            times.processing.quantile(0.95),
            times.overhead.quantile(0.5),
            times.overhead.quantile(0.95),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_kept_for_a_window_and_told_apart() {
        let stats = Stats::default();
        for n in 0..2 * WINDOW as i64 {
            // The first half is overwritten by the second.
            let overhead = if n < WINDOW as i64 { 900_000_000 } else { 2_000_000 };
            stats.published(overhead + 5_000_000, Duration::from_millis(5));
        }
        let text = stats.to_string();
        assert!(text.contains("tracker: median 5.00 ms"), "{text}");
        assert!(text.contains("publication: median 2.00 ms, 95 % 2.00 ms"), "{text}");
        assert!(text.contains("8192 track messages"), "{text}");
    }
}
