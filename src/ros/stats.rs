//! Counts and times of a node since its start.

use std::fmt;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering::Relaxed};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use crate::tracker::{State, Target};

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
    /// Marks that later ones or stops made void before they were obeyed.
    pub superseded: AtomicU64,
    /// Images with a message on `~/tracks`.
    pub published: AtomicU64,
    /// Messages that could not be published.
    pub unsent: AtomicU64,
    /// Targets on the latest image: tracking, uncertain, lost.
    targets: [AtomicUsize; 3],
    times: Mutex<Times>,
}

/// Shortest, mean and longest of some times, in nanoseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Span {
    count: u32,
    sum: i64,
    shortest: i64,
    longest: i64,
}

impl Span {
    fn add(&mut self, value: i64) {
        self.shortest = if self.count == 0 { value } else { self.shortest.min(value) };
        self.longest = if self.count == 0 { value } else { self.longest.max(value) };
        self.count += 1;
        self.sum += value;
    }
}

impl fmt::Display for Span {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ms = |nanos: i64| nanos as f64 / 1e6;
        let mean = ms(self.sum) / f64::from(self.count.max(1));
        write!(f, "{:.2} / {mean:.2} / {:.2}", ms(self.shortest), ms(self.longest))
    }
}

#[derive(Debug, Default)]
struct Times {
    /// From arrival to publication, since they were last asked for.
    latest: Span,
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
        times.latest.add(latency);
        times.overhead.push(latency - processing);
        times.processing.push(processing);
    }
}

impl Stats {
    /// Notes the state of each target on the latest image.
    pub fn states(&self, targets: &[Target]) {
        for (state, counter) in [State::Tracking, State::Uncertain, State::Lost].into_iter().zip(&self.targets) {
            counter.store(targets.iter().filter(|t| t.state == state).count(), Relaxed);
        }
    }

    /// How many targets are tracked, uncertain and lost.
    pub fn targets(&self) -> [usize; 3] {
        [0, 1, 2].map(|i| self.targets[i].load(Relaxed))
    }

    /// The times from arrival to publication since the last call.
    pub fn take_latency(&self) -> Span {
        std::mem::take(&mut self.times.lock().unwrap_or_else(PoisonError::into_inner).latest)
    }
}

impl fmt::Display for Stats {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let times = self.times.lock().unwrap_or_else(PoisonError::into_inner);
        write!(
            f,
            "images: {} received, {} missed, {} rejected, {} skipped; {} marks superseded; {} track messages, \
             {} messages unsent; \
             tracker: median {:.2} ms, 95 % {:.2} ms; the rest from arrival to publication: median {:.2} ms, 95 % \
             {:.2} ms",
            self.received.load(Relaxed),
            self.missed.load(Relaxed),
            self.rejected.load(Relaxed),
            self.skipped.load(Relaxed),
            self.superseded.load(Relaxed),
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
