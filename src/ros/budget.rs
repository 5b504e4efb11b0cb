//! The share of the worker's time that marks may take: images win, however many marks a peer sends and however slow
//! the machine is.
//!
//! To take a target up costs many times what it costs to follow it into one image, and every image that comes
//! meanwhile but the newest is skipped. So a mark that costs a time `t` in all is followed by `t / SHARE` in which no
//! other is obeyed, and the share of images that marks can cost is no more than `SHARE`. Marks may run ahead of that by
//! a little, so that a user who marks anew at once does not wait, nor a detector that marks a handful of targets. A
//! restart goes at once. What it took counts all the same.

use std::time::{Duration, Instant};

/// Marks may take no more of the time than this.
const SHARE: f64 = 1.0 / 24.0;
/// What a mark costs in all, in times of what it costs at once: altered looks at the target are learned over the next
/// images.
const IN_ALL: f64 = 4.0;
/// How much time marks may take before its share has passed: that of a handful.
const AHEAD: Duration = Duration::from_millis(1500);

/// No mark of a new target waits longer, even on a machine so slow or busy that marks take seconds.
const LONGEST: Duration = Duration::from_secs(10);

/// What a command asks of the worker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cost {
    /// Next to nothing.
    None,
    /// To take up those that were followed before: a service, whose client waits for the answer.
    Restart,
    /// To take a target up.
    Mark,
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

    /// Notes that a mark took `time` up to `now`. One that was followed through `later` images was learned on the way;
    /// another will still take the rest of what it costs in all.
    pub fn charge(&mut self, time: Duration, later: usize, now: Instant) {
        let in_all = if later == 0 { IN_ALL } else { 1.0 };
        let most = now + LONGEST + AHEAD.div_f64(SHARE);
        self.paid = most.min(self.paid.max(now) + time.mul_f64(in_all / SHARE));
    }

    /// How long a command has to wait.
    pub fn wait(&self, cost: Cost, now: Instant) -> Duration {
        match cost {
            Cost::None | Cost::Restart => Duration::ZERO,
            Cost::Mark => self.paid.saturating_duration_since(now).saturating_sub(AHEAD.div_f64(SHARE)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    /// The share of 30 s that marks take which each cost so much at once and wait at all times.
    fn share(each: Duration) -> f64 {
        let begin = Instant::now();
        let (mut now, mut taken) = (begin, Duration::ZERO);
        let mut budget = Budget::new(begin);
        while now < begin + 30_000 * MS {
            let wait = budget.wait(Cost::Mark, now);
            now += wait.max(MS);
            if wait.is_zero() {
                now += each;
                taken += each.mul_f64(IN_ALL);
                budget.charge(each, 0, now);
            }
        }
        taken.as_secs_f64() / 30.0
    }

    #[test]
    fn marks_take_no_more_than_their_share_whatever_they_cost() {
        for each in [1, 5, 60, 120] {
            let taken = share(each * MS);
            // The last of them may end after its time.
            let most = SHARE + (AHEAD + (each * MS).mul_f64(IN_ALL)).as_secs_f64() / 30.0;
            assert!(taken > 0.8 * SHARE && taken < most, "{each} ms: {taken}");
        }
    }

    #[test]
    fn a_handful_of_marks_runs_ahead_and_services_go_at_once() {
        let now = Instant::now();
        let mut budget = Budget::new(now);
        for _ in 0..6 {
            assert_eq!(budget.wait(Cost::Mark, now), Duration::ZERO);
            budget.charge(60 * MS, 0, now);
        }
        // 6 x 240 ms, and one that was learned on the way.
        budget.charge(100 * MS, 5, now);
        assert_eq!(budget.wait(Cost::Mark, now), 24 * 40 * MS);
        assert_eq!([Cost::None, Cost::Restart].map(|cost| budget.wait(cost, now)), [Duration::ZERO; 2]);
        assert_eq!(budget.wait(Cost::Mark, now + 24 * 40 * MS), Duration::ZERO);
        (0..9).for_each(|_| budget.charge(9000 * MS, 0, now));
        assert_eq!(budget.wait(Cost::Mark, now), LONGEST);
    }
}
