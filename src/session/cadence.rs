//! The rhythm of a stream: how many frame periods have passed since the frame before.
//!
//! A camera's stamps are one period apart, or a whole number of them where frames were skipped. Stamps that are given
//! when an image is read from a link that stalls, or by a clock that is set, are not like that: they lie much closer
//! than a period, stand still or go back, fit no period, or most are close and a few very far apart. While they are
//! like that they tell nothing of motion, and each frame counts as one period.

use crate::frame::Stamp;

/// How many intervals are remembered: those of a second of a usual camera.
const REMEMBERED: usize = 30;
/// So many must be known before they tell a period: bursts may be that long.
const ENOUGH: usize = 8;
/// A longer gap, in periods, tells nothing of motion: the clock was set, or the target has to be searched for.
const MAX_PERIODS: f64 = 30.0;
/// The shortest that an interval may be, in lower quartiles.
const SHORTEST: f64 = 0.2;
/// The longest that intervals may be on the average, in lower quartiles. Where more frames than that are skipped, the
/// lower quartile grows as well; in bursts it does not.
const LONGEST_MEAN: f64 = 4.0;
/// The lower quartile is of no more periods than these, so many frames are seldom skipped all the time.
const MOST_PARTS: u32 = 3;
/// How far intervals are from whole numbers of periods on the average, at most; it is 0.25 of any intervals. A few
/// milliseconds of jitter at 30 Hz make 0.1.
const MOST_MISFIT: f64 = 0.15;
/// Rounds by which a period is fitted to the intervals.
const ROUNDS: usize = 2;
/// A longer gap than this, in nanoseconds, and than [`MAX_PERIODS`], is not part of the frame rate: the clock was set,
/// or the stream was halted.
const PAUSE: f64 = 2e9;
/// No camera that is tracked with takes more frames a second; stamps that say so do not count time.
const MAX_RATE: f64 = 1000.0;

/// Turns stamps into whole numbers of frame periods, so that the jitter of a camera's clock does not reach the
/// tracker and a stream gives the same boxes as the same images in a folder.
#[derive(Clone, Debug, Default)]
pub(super) struct Cadence {
    last: Stamp,
    /// The latest intervals in nanoseconds, a ring; 0 where the clock did not go on.
    intervals: [i64; REMEMBERED],
    count: usize,
    /// Longer intervals than this are gaps that tell nothing of motion.
    longest: f64,
    /// The frame period in nanoseconds; `None` while stamps do not tell.
    period: Option<f64>,
}

impl Cadence {
    /// Counts on from a frame of this stamp.
    pub(super) fn set_out(&mut self, stamp: Stamp) {
        self.last = stamp;
    }

    /// The number of frame periods since the last frame, at least 1: 1 where stamps do not tell.
    pub(super) fn advance(&mut self, stamp: Stamp) -> f64 {
        let last = std::mem::replace(&mut self.last, stamp);
        let (Some(last), Some(now)) = (last, stamp) else {
            return 1.0;
        };
        let interval = now.saturating_sub(last).max(0);
        self.intervals[self.count % REMEMBERED] = interval;
        self.count += 1;
        let quartile = self.lower_quartile();
        self.longest = MAX_PERIODS * quartile;
        self.period = if self.could_be_a_camera(quartile) { self.fitting(quartile) } else { None };
        self.periods(interval as f64)
    }

    /// Frames a second; 1 where no stamps tell.
    pub(super) fn frame_rate(&self) -> f64 {
        let longest = self.longest.max(PAUSE);
        let (mut frames, mut nanos) = (0.0, 0.0);
        let since_it_went_on = self.known().skip_while(|&interval| interval == 0.0);
        for interval in since_it_went_on.filter(|&interval| interval <= longest) {
            frames += self.periods(interval);
            nanos += interval;
        }
        let rate = 1e9 * frames / nanos;
        if rate <= MAX_RATE { rate } else { 1.0 }
    }

    /// How many periods an interval is taken for.
    fn periods(&self, interval: f64) -> f64 {
        match self.period {
            Some(period) if interval <= self.longest => whole(interval / period),
            _ => 1.0,
        }
    }

    /// Whether no interval is much shorter than most, and most are not much shorter than the mean. What is but one long
    /// gap does not count as more than [`MAX_PERIODS`].
    fn could_be_a_camera(&self, quartile: f64) -> bool {
        let count = self.known().count();
        let sum: f64 = self.known().map(|interval| interval.min(self.longest)).sum();
        let is_even = sum <= LONGEST_MEAN * quartile * count as f64;
        count >= ENOUGH && is_even && self.known().all(|interval| interval >= SHORTEST * quartile)
    }

    /// The longest period that intervals are whole numbers of.
    fn fitting(&self, quartile: f64) -> Option<f64> {
        let fitted = (1..=MOST_PARTS).map(|parts| self.fitted(quartile / f64::from(parts)));
        fitted.into_iter().find(|&period| self.misfit(period) <= MOST_MISFIT)
    }

    /// A period near this one that intervals are nearer to whole numbers of.
    fn fitted(&self, period: f64) -> f64 {
        (0..ROUNDS).fold(period, |period, _| {
            let count: f64 = self.telling().map(|interval| whole(interval / period)).sum();
            self.telling().sum::<f64>() / count
        })
    }

    /// How far intervals are from whole numbers of periods on the average.
    fn misfit(&self, period: f64) -> f64 {
        let off = |interval: f64| (interval / period - whole(interval / period)).abs();
        self.telling().map(off).sum::<f64>() / self.telling().count() as f64
    }

    /// The lower quartile of the intervals in which the clock went on, 0 where there is none. Skipped frames make
    /// intervals longer and never shorter.
    fn lower_quartile(&self) -> f64 {
        let mut sorted = self.intervals;
        sorted.sort_unstable();
        // Those at 0 are in front, and among them those that are not known yet.
        let standing = sorted.partition_point(|&interval| interval == 0);
        sorted.get(standing + (REMEMBERED - standing) / 4).map_or(0.0, |&interval| interval as f64)
    }

    /// The intervals that are not too long to tell of motion.
    fn telling(&self) -> impl Iterator<Item = f64> {
        self.known().filter(|&interval| interval <= self.longest)
    }

    /// The intervals that are remembered, the newest first.
    fn known(&self) -> impl Iterator<Item = f64> {
        let back = 1..=self.count.min(REMEMBERED);
        back.map(|back| self.intervals[(self.count - back) % REMEMBERED] as f64)
    }
}

/// The nearest whole number of periods.
fn whole(periods: f64) -> f64 {
    periods.round().max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    /// The periods counted of frames this many milliseconds apart, and the cadence then.
    fn counted(intervals: &[i64]) -> (Vec<f64>, Cadence) {
        let mut cadence = Cadence::default();
        let mut now = 1_700_000_000_000 * MS;
        cadence.set_out(Some(now));
        let mut advance = |&interval: &i64| {
            now += interval * MS;
            cadence.advance(Some(now))
        };
        (intervals.iter().map(&mut advance).collect(), cadence)
    }

    fn repeated(intervals: &[i64], times: usize) -> Vec<i64> {
        intervals.repeat(times)
    }

    #[test]
    fn jitter_counts_as_one_period_and_gaps_as_whole_ones() {
        let (periods, cadence) = counted(&[33, 35, 31, 34, 33, 29, 38, 67, 32, 99, 100, 33, 165]);
        assert_eq!(periods, [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 2.0, 1.0, 3.0, 3.0, 1.0, 5.0]);
        // 22 periods in 729 ms.
        assert!((cadence.frame_rate() - 22.0 / 0.729).abs() < 1e-9, "{}", cadence.frame_rate());
    }

    #[test]
    fn the_lower_quartile_is_that_of_the_intervals_in_which_the_clock_went_on() {
        let quartile = |intervals: &[i64]| counted(intervals).1.lower_quartile() / MS as f64;
        // Of three the 0th, of four the 1st.
        assert_eq!([quartile(&[99, 66, 33]), quartile(&[99, 66, 33, 132]), quartile(&[0, -5])], [33.0, 66.0, 0.0]);
        // The 30 latest hold seven of 10 and then eight: their 7th is 20, and then 10.
        let mut long = repeated(&[20], 30);
        long.extend([10; 7]);
        assert_eq!(quartile(&long), 20.0);
        long.push(10);
        assert_eq!(quartile(&long), 10.0);
    }

    #[test]
    fn the_period_is_what_intervals_are_whole_numbers_of() {
        // The lower quartile is 66, two periods: 99 is no whole number of it.
        let (periods, cadence) = counted(&repeated(&[66, 99, 66, 132], 3));
        assert_eq!(periods, [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 4.0, 2.0, 3.0, 2.0, 4.0]);
        assert!((cadence.period.unwrap() / MS as f64 - 33.0).abs() < 1e-9);
        // One of three periods, where none is of a single one.
        let (periods, _) = counted(&repeated(&[99, 132, 165], 4));
        assert_eq!(periods[7..], [4.0, 5.0, 3.0, 4.0, 5.0]);
        // Of no period.
        let (periods, cadence) = counted(&[30, 43, 51, 30, 47, 64, 37, 44, 30, 52, 41, 30]);
        assert_eq!((periods, cadence.period), (vec![1.0; 12], None));
    }

    #[test]
    fn frames_in_bursts_count_as_one_each() {
        // The first ten, with the second gap: 8 x 8 + 2 x 134 = 332, above 4 x 8 x 10 = 320.
        let (periods, cadence) = counted(&repeated(&[8, 8, 8, 8, 134], 20));
        assert!(periods.iter().all(|&n| n == 1.0), "{periods:?}");
        assert!((cadence.frame_rate() - 5.0 / 0.166).abs() < 1e-9);
        for burst in [vec![1, 65], vec![2, 2, 2, 2, 158], vec![0, 66], vec![0, 0, 0, 132]] {
            let (periods, cadence) = counted(&repeated(&burst, 20));
            assert!(periods.iter().all(|&n| n == 1.0), "{burst:?}: {periods:?}");
            let seconds = burst.iter().sum::<i64>() as f64 / 1e3;
            assert!((cadence.frame_rate() * seconds / burst.len() as f64 - 1.0).abs() < 0.1, "{burst:?}");
        }
    }

    #[test]
    fn a_link_that_stalls_is_not_believed_for_a_while() {
        let mut intervals = repeated(&[33], 20);
        intervals.push(260);
        intervals.extend([1; 7]);
        intervals.extend([33; 10]);
        intervals.extend([66; 3]);
        let (periods, _) = counted(&intervals);
        assert_eq!(periods[20], 8.0, "a gap may be of skipped frames");
        assert!(periods[21..].iter().all(|&n| n == 1.0), "{periods:?}");
        intervals.extend([33; REMEMBERED]);
        intervals.push(66);
        assert_eq!(counted(&intervals).0.last(), Some(&2.0));
    }

    #[test]
    fn a_clock_that_is_set_is_no_motion() {
        for step in [3_600_000, 1_700_000_000_000, 1_001, -3_600_000, -5] {
            let mut intervals = repeated(&[33], 20);
            intervals.push(step);
            intervals.extend([33; 20]);
            let (periods, cadence) = counted(&intervals);
            assert!(periods.iter().all(|&n| n == 1.0), "{step}: {periods:?}");
            let rate = cadence.frame_rate();
            assert!(step == 1_001 || (rate - 1.0 / 0.033).abs() < 2.0, "{step}: {rate}");
        }
        let mut cadence = Cadence::default();
        for stamp in [i64::MIN, i64::MAX, i64::MIN, 0, i64::MAX, i64::MAX] {
            assert_eq!(cadence.advance(Some(stamp)), 1.0);
            assert!(cadence.frame_rate() <= 1.0);
        }
    }

    #[test]
    fn frames_without_stamps_are_one_period_apart() {
        let mut cadence = Cadence::default();
        assert_eq!(cadence.advance(None), 1.0);
        assert_eq!(cadence.advance(None), 1.0);
        assert_eq!(cadence.frame_rate(), 1.0);
    }

    #[test]
    fn a_clock_that_stands_or_counts_frames_tells_no_rate() {
        let (_, mut cadence) = counted(&repeated(&[33], 40));
        let stamp = cadence.last;
        for n in 1..=REMEMBERED {
            assert_eq!(cadence.advance(stamp), 1.0);
            let rate = if n < REMEMBERED { 1.0 / 0.033 } else { 1.0 };
            assert!((cadence.frame_rate() - rate).abs() < 1e-9, "{n}");
        }
        let mut cadence = Cadence::default();
        for frame in 0..40 {
            assert_eq!((cadence.advance(Some(frame)), cadence.frame_rate()), (1.0, 1.0));
        }
    }
}
