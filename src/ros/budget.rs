//! The share of the worker's time that marks may take: images win, however many marks a peer sends and however slow
//! the machine is.
//!
//! To take a target up costs many times what it costs to follow it into one image, and every image that comes
//! meanwhile but the newest is skipped. So a mark that took a time `t` is followed by `t / SHARE` in which no other is
//! obeyed, and the share of images that marks can cost is no more than [`SHARE`]. Marks may run ahead of that by a little,
//! so that a user who marks anew at once does not wait; and by more where a place is free, for a detector that marks a handful
//! of targets at once. A restart goes at once. What they took counts all the same.

use std::time::{Duration, Instant};

/// Marks may take no more of the time than this.
const SHARE: f64 = 1.0 / 16.0;
/// How much time marks of what is followed already may take before its share has passed.
const AHEAD_AGAIN: Duration = Duration::from_millis(100);
/// How much time marks of new targets may.
const AHEAD: Duration = Duration::from_millis(500);

/// No mark of a new target waits longer, even on a machine so slow or busy that marks take seconds.
const LONGEST: Duration = Duration::from_secs(10);

/// What a command asks of the worker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cost {
    /// Next to nothing.
    None,
    /// To take up those that were followed before: a service, whose client waits for the answer.
    Restart,
    /// To take a target up where a place is free.
    Start,
    /// To take up what is followed already.
    Again,
}

/// When marks are due.
#[derive(Clone, Copy, Debug)]
pub struct Budget {
    /// When the share of all that marks took so far has passed.
    paid: Instant,
}

impl Budget {
    /// With nothing taken yet.
    pub fn new(now: Instant) -> Self {
        Self { paid: now }
    }

    /// Notes that a mark took `time` up to `now`.
    pub fn charge(&mut self, time: Duration, now: Instant) {
        let most = now + LONGEST + AHEAD.div_f64(SHARE);
        self.paid = most.min(self.paid.max(now) + time.div_f64(SHARE));
    }

    /// How long a command has to wait.
    pub fn wait(&self, cost: Cost, now: Instant) -> Duration {
        let ahead = match cost {
            Cost::None | Cost::Restart => return Duration::ZERO,
            Cost::Start => AHEAD,
            Cost::Again => AHEAD_AGAIN,
        };
        self.paid.saturating_duration_since(now).saturating_sub(ahead.div_f64(SHARE))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    /// The share of 30 s that marks take which each cost so much and wait at all times.
    fn share(cost: Cost, each: Duration) -> f64 {
        let begin = Instant::now();
        let (mut now, mut taken) = (begin, Duration::ZERO);
        let mut budget = Budget::new(begin);
        while now < begin + 30_000 * MS {
            let wait = budget.wait(cost, now);
            now += wait.max(MS);
            if wait.is_zero() {
                now += each;
                taken += each;
                budget.charge(each, now);
            }
        }
        taken.as_secs_f64() / 30.0
    }

    #[test]
    fn marks_take_no_more_than_their_share_whatever_they_cost() {
        for each in [1, 5, 60, 500] {
            for (cost, ahead) in [(Cost::Again, AHEAD_AGAIN), (Cost::Start, AHEAD)] {
                let taken = share(cost, each * MS);
                // The last of them may end after its time.
                let most = SHARE + (ahead + each * MS).as_secs_f64() / 30.0;
                assert!(taken > 0.8 * SHARE && taken < most, "{cost:?} of {each} ms: {taken}");
            }
        }
    }

    #[test]
    fn new_targets_run_ahead_and_services_go_at_once() {
        let now = Instant::now();
        let mut budget = Budget::new(now);
        for _ in 0..8 {
            assert_eq!(budget.wait(Cost::Start, now), Duration::ZERO);
            budget.charge(60 * MS, now);
        }
        assert_eq!(budget.wait(Cost::Again, now), 16 * 380 * MS);
        budget.charge(60 * MS, now);
        assert_eq!(budget.wait(Cost::Start, now), 16 * 40 * MS);
        assert_eq!([Cost::None, Cost::Restart].map(|cost| budget.wait(cost, now)), [Duration::ZERO; 2]);
        assert_eq!(budget.wait(Cost::Again, now + 16 * 440 * MS), Duration::ZERO);
        (0..9).for_each(|_| budget.charge(9000 * MS, now));
        assert_eq!(budget.wait(Cost::Start, now), LONGEST);
    }
}
