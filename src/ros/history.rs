//! The frames of the last moments, so that a mark may name the one it was made on: a detector takes its time.
//!
//! Frames are shared with whoever works on them and never copied; what they may take is bounded by number and by bytes.

use std::collections::VecDeque;
use std::sync::Arc;

use super::convert::Received;
use crate::frame::Stamp;
use crate::params;

/// How far ahead of the newest frame a mark may be, in nanoseconds: what is further does not come from these images.
const MOST_AHEAD: i64 = 1_000_000_000;
/// How far stamps may go back within a stream, in nanoseconds: those of a poor clock do, from one image to the next.
const MOST_BACK: i64 = 1_000_000_000;

/// Frames with stamps, the oldest first.
#[derive(Debug, Default)]
pub struct ImageHistory {
    frames: VecDeque<Arc<Received>>,
    bytes: usize,
    limits: params::HistoryParams,
    /// Frames that pages of the live page show while they stand still, one a page, beside those limits.
    held: Vec<(u64, Arc<Received>)>,
}

impl ImageHistory {
    /// Keeps no more than that from now on.
    pub fn limit(&mut self, limits: &params::HistoryParams) {
        self.limits = limits.clone();
        self.shrink();
    }

    /// Keeps the frame. One without a stamp cannot be named, and so is not kept; one of a much earlier stamp than the
    /// last begins a new stream.
    pub fn push(&mut self, frame: &Arc<Received>) {
        let Some(stamp) = frame.frame().stamp() else { return };
        let goes_back = |last: &Arc<Received>| last.frame().stamp() > Some(stamp.saturating_add(MOST_BACK));
        if self.frames.back().is_some_and(goes_back) {
            self.frames.clear();
            self.held.clear();
            self.bytes = 0;
        }
        self.bytes += frame.bytes();
        self.frames.push_back(frame.clone());
        self.shrink();
    }

    /// The frames that are kept, the oldest first; what lies between one that is held and the next may be gone.
    pub fn frames(&self) -> impl Iterator<Item = &Arc<Received>> {
        let is_gone = |held: &Arc<Received>| !self.frames.iter().any(|kept| Arc::ptr_eq(kept, held));
        let mut held: Vec<_> = self.held.iter().map(|(_, frame)| frame).filter(|frame| is_gone(frame)).collect();
        held.sort_by_key(|frame| frame.frame().stamp());
        held.dedup_by(|a, b| Arc::ptr_eq(a, b));
        held.into_iter().chain(&self.frames)
    }

    /// Keeps the frame of this stamp for the page until it is released, in the place of one that was held for it.
    pub fn hold(&mut self, page: u64, stamp: Stamp) -> Result<(), String> {
        let Some(wanted) = stamp else { return Err("the images have no stamps".to_owned()) };
        let frame = self.frames().find(|frame| frame.frame().stamp() == stamp).cloned();
        let frame = frame.ok_or_else(|| format!("no image with stamp {} is kept", told(wanted)))?;
        self.release(page);
        self.held.push((page, frame));
        Ok(())
    }

    /// Keeps no frame for the page any more.
    pub fn release(&mut self, page: u64) {
        self.held.retain(|(other, _)| *other != page);
    }

    /// The newest of them.
    pub fn newest(&self) -> Option<&Arc<Received>> {
        self.frames.back()
    }

    fn shrink(&mut self) {
        let (frames, bytes) = (self.limits.frames as usize, self.limits.megabytes as usize * 1_000_000);
        while self.frames.len() > frames || (self.bytes > bytes && !self.frames.is_empty()) {
            self.bytes -= self.frames.pop_front().map_or(0, |frame| frame.bytes());
        }
    }
}

/// Where the frame is that a mark names.
#[derive(Debug)]
pub enum Named {
    /// Here, with those that came after it; the last is the newest.
    Here(Vec<Arc<Received>>),
    /// Not there yet.
    Ahead,
    /// Nowhere, for this reason.
    Unknown(String),
}

/// Looks for the frame of this stamp among those that were kept and the newest that is worked on.
pub fn find(stamp: Stamp, kept: &[Arc<Received>], newest: &Arc<Received>) -> Named {
    let now = newest.frame().stamp();
    let Some(wanted) = stamp.filter(|_| stamp != now) else {
        return Named::Here(vec![newest.clone()]);
    };
    let Some(now) = now else {
        return Named::Unknown(format!("no image with stamp {} is known: the images have no stamps", told(wanted)));
    };
    let end = kept.iter().rposition(|frame| Arc::ptr_eq(frame, newest)).map_or(0, |last| last + 1);
    let kept = &kept[..end];
    if let Some(first) = kept.iter().rposition(|frame| frame.frame().stamp() == stamp) {
        return Named::Here(kept[first..].to_vec());
    }
    if wanted > now && wanted - now <= MOST_AHEAD {
        return Named::Ahead;
    }
    let oldest = kept.first().and_then(|frame| frame.frame().stamp()).unwrap_or(now);
    Named::Unknown(format!(
        "no image with stamp {} is kept: the {} kept ones have stamps from {} to {}",
        told(wanted),
        kept.len().max(1),
        told(oldest),
        told(now)
    ))
}

/// A stamp as seconds.
fn told(nanos: i64) -> String {
    const SECOND: i64 = 1_000_000_000;
    format!("{}.{:09}", nanos.div_euclid(SECOND), nanos.rem_euclid(SECOND))
}

#[cfg(test)]
mod tests {
    use super::super::messages::{Header, Image, Time};
    use super::*;

    /// Of 500 kB.
    fn frame(stamp: i64) -> Arc<Received> {
        let header = Header { stamp: Time::from_nanos(stamp), frame_id: String::new() };
        let (width, height) = (1000, 500);
        let data = vec![0; 500_000];
        let encoding = "mono8".to_owned();
        Arc::new(
            Received::new(Image { header, height, width, encoding, is_bigendian: 0, step: width, data }, 0).unwrap(),
        )
    }

    fn history(frames: i64, megabytes: i64) -> ImageHistory {
        let mut history = ImageHistory::default();
        history.limit(&params::HistoryParams { frames, megabytes });
        history
    }

    fn stamps<'a>(frames: impl IntoIterator<Item = &'a Arc<Received>>) -> Vec<i64> {
        frames.into_iter().map(|f| f.frame().stamp().unwrap()).collect()
    }

    #[test]
    fn frames_are_bounded_by_number_and_by_bytes() {
        let mut few = history(3, 4096);
        (1..=5).for_each(|n| few.push(&frame(n)));
        assert_eq!(stamps(few.frames()), [3, 4, 5]);
        let mut small = history(1000, 2);
        (1..=9).for_each(|n| small.push(&frame(n)));
        assert_eq!(stamps(small.frames()), [6, 7, 8, 9], "4 x 500 kB");
        small.limit(&params::HistoryParams { frames: 30, megabytes: 1 });
        assert_eq!(stamps(small.frames()), [8, 9]);
        let mut none = history(0, 64);
        none.push(&frame(1));
        assert_eq!((none.frames().count(), none.bytes), (0, 0));
    }

    #[test]
    fn a_jump_back_begins_anew_and_frames_without_stamps_are_not_kept() {
        let mut history = history(30, 64);
        let s = MOST_BACK;
        [s + 10, s + 20, s + 20, s + 30, 5, 0, 6].iter().for_each(|n| history.push(&frame(*n)));
        assert_eq!(stamps(history.frames()), [5, 6]);
        assert_eq!(history.bytes, 1_000_000);
    }

    #[test]
    fn a_frame_that_is_held_stays_until_it_is_released_or_the_stream_begins_anew() {
        let mut history = history(2, 64);
        (1..=2).for_each(|n| history.push(&frame(n)));
        history.hold(7, Some(1)).unwrap();
        (3..=9).for_each(|n| history.push(&frame(n)));
        assert_eq!(stamps(history.frames()), [1, 8, 9]);
        history.hold(8, Some(1)).unwrap();
        history.hold(7, Some(8)).unwrap();
        assert_eq!(stamps(history.frames()), [1, 8, 9], "one a page");
        history.release(8);
        assert_eq!(stamps(history.frames()), [8, 9]);
        assert_eq!(history.hold(8, Some(1)).unwrap_err(), "no image with stamp 0.000000001 is kept");
        assert!(history.hold(8, None).is_err());
        history.push(&frame(-2 * MOST_BACK));
        assert_eq!(stamps(history.frames()), [-2 * MOST_BACK]);
    }

    /// The clock of a camera that is stamped when its images are read goes back and stands: each can be named all the
    /// same.
    #[test]
    fn small_steps_back_are_of_the_same_stream() {
        let mut history = history(30, 64);
        [10, 40, 20, 20, 30].iter().for_each(|n| history.push(&frame(*n)));
        let kept: Vec<_> = history.frames().cloned().collect();
        let here = |stamp: i64| match find(Some(stamp), &kept, &kept[4]) {
            Named::Here(frames) => stamps(&frames),
            other => panic!("{other:?}"),
        };
        assert_eq!(here(40), [40, 20, 20, 30]);
        assert_eq!(here(20), [20, 30], "of two the later");
        assert_eq!(here(10), [10, 40, 20, 20, 30]);
    }

    #[test]
    fn a_named_frame_comes_with_those_after_it_up_to_the_newest_that_is_worked_on() {
        let kept: Vec<_> = [10, 20, 30, 40].map(frame).into();
        let here = |stamp: i64, newest: &Arc<Received>| match find(Some(stamp).filter(|s| *s != 0), &kept, newest) {
            Named::Here(frames) => Ok(stamps(&frames)),
            Named::Ahead => Err(String::new()),
            Named::Unknown(why) => Err(why),
        };
        assert_eq!(here(20, &kept[2]).unwrap(), [20, 30]);
        assert_eq!(here(30, &kept[2]).unwrap(), [30]);
        assert_eq!(here(0, &kept[2]).unwrap(), [30], "no stamp is the newest");
        assert_eq!(here(40, &kept[2]).unwrap_err(), "", "40 is not worked on yet");
        assert_eq!(here(30 + MOST_AHEAD, &kept[2]).unwrap_err(), "");
        assert_eq!(
            here(15, &kept[2]).unwrap_err(),
            "no image with stamp 0.000000015 is kept: the 3 kept ones have stamps from 0.000000010 to 0.000000030"
        );
        assert!(here(31 + MOST_AHEAD, &kept[2]).unwrap_err().starts_with("no image with stamp 1.000000031 is kept"));
        let newest = frame(50);
        assert_eq!(here(50, &newest).unwrap(), [50], "the newest need not be kept");
        assert!(
            here(40, &newest).unwrap_err().ends_with("the 1 kept ones have stamps from 0.000000050 to 0.000000050")
        );
        assert!(here(7, &frame(0)).unwrap_err().contains("have no stamps"));
    }
}
