//! What all pages share: the newest picture of each size, the figures and events of the last minutes, and who waits.
//!
//! The tracker's side writes, the pages' side reads, and neither waits for the other: a page that is slow, or that has
//! stopped reading, finds newer things when it comes back, and what it missed of pictures is gone. So what is kept is
//! bounded, and the same for one page as for many.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use jpeg_encoder::EncodingError;

use super::host::Playback;
use super::picture::{self, View};
use super::story::{Event, Happened, Part, Said, Sample};
use crate::frame::Stamp;
use crate::tracker::State;

/// Frames whose figures are kept: three minutes at 30 a second.
const SAMPLES: usize = 5400;
/// Events that are kept.
const EVENTS: usize = 60;
/// Pictures that a page may wait for: one is on its way while the next is made.
const MOST_WISHES: u8 = 2;
/// Moments that wait for their picture.
const MOST_MOMENTS: usize = 8;

/// Things in order, of which the oldest go; each keeps its number.
struct Ring<T> {
    items: VecDeque<T>,
    most: usize,
    /// The number of the next.
    next: u64,
}

impl<T> Ring<T> {
    fn new(most: usize) -> Self {
        Self { items: VecDeque::new(), most, next: 0 }
    }

    fn push(&mut self, item: T) {
        if self.items.len() >= self.most {
            self.items.pop_front();
        }
        self.items.push_back(item);
        self.next += 1;
    }

    /// Those from this number on, as far as they are kept.
    fn since(&self, number: u64) -> impl Iterator<Item = &T> {
        let first = self.next - self.items.len() as u64;
        self.items.iter().skip(number.saturating_sub(first) as usize)
    }
}

/// A page that is open.
struct Page {
    number: u64,
    wishes: u8,
    side: u32,
    /// The number of the picture that it got last, 0 where that was of another size or there was none.
    got: u64,
    wake: Box<dyn Fn() + Send>,
}

/// A picture that was made.
#[derive(Clone)]
pub(super) struct Picture {
    /// Counts the frames that were shown.
    pub(super) number: u64,
    side: u32,
    /// The message, shared by all who are sent it.
    pub(super) message: Arc<[u8]>,
}

/// How much a page knows.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Known {
    pub(super) picture: u64,
    pub(super) samples: u64,
    pub(super) run: u64,
    pub(super) playback: u64,
    pub(super) events: u64,
    pub(super) parts: u64,
    pub(super) params: u64,
}

/// What a page does not know yet.
pub(super) struct News {
    /// The figures of the run before, where another has begun.
    pub(super) previous: Option<Vec<Sample>>,
    pub(super) samples: Vec<Sample>,
    pub(super) playback: Option<Playback>,
    pub(super) events: Vec<Happened>,
    pub(super) parts: Option<Vec<Part>>,
    pub(super) has_new_params: bool,
}

struct Inner {
    pages: Vec<Page>,
    next_page: u64,
    /// The newest of each size that is asked for.
    pictures: Vec<Picture>,
    shown: u64,
    samples: Ring<Sample>,
    /// Those of the run before.
    previous: Vec<Sample>,
    run: u64,
    playback: Option<Playback>,
    playback_version: u64,
    events: Ring<Happened>,
    /// Changes of state whose picture is still to be made.
    moments: Vec<Happened>,
    /// The targets that are lost.
    lost: Vec<Arc<str>>,
    parts: Vec<Part>,
    parts_version: u64,
    params_version: u64,
}

struct Shared {
    began: Instant,
    inner: Mutex<Inner>,
}

/// The state that all pages share.
#[derive(Clone)]
pub struct Hub(Arc<Shared>);

impl Default for Hub {
    fn default() -> Self {
        Self::keeping(SAMPLES)
    }
}

impl Hub {
    /// A hub that keeps the figures of so many frames.
    pub fn keeping(samples: usize) -> Self {
        let inner = Inner {
            pages: Vec::new(),
            next_page: 0,
            pictures: Vec::new(),
            shown: 0,
            samples: Ring::new(samples),
            previous: Vec::new(),
            run: 0,
            playback: None,
            playback_version: 0,
            events: Ring::new(EVENTS),
            moments: Vec::new(),
            lost: Vec::new(),
            parts: Vec::new(),
            parts_version: 0,
            params_version: 0,
        };
        Self(Arc::new(Shared { began: Instant::now(), inner: Mutex::new(inner) }))
    }
}

/// The tracker's side.
impl Hub {
    /// Whether a page waits for a picture, so that the next frame is worth recording.
    pub fn wants(&self) -> bool {
        self.lock().pages.iter().any(|page| page.wishes > 0)
    }

    /// Takes the figures of a frame. Whether a target was lost or found again on it while somebody looks: then the
    /// frame must be shown, for its picture goes with that event.
    pub fn note(&self, said: &Said) -> bool {
        self.note_at(self.now(), said)
    }

    /// The same for a frame of another time than now.
    pub fn note_at(&self, at: u64, said: &Said) -> bool {
        let Said { stamp, targets, .. } = *said;
        let mut inner = self.lock();
        inner.samples.push(Sample::new(at, said));
        let is_watched = !inner.pages.is_empty();
        let mut changed = false;
        for target in targets {
            let (was_lost, is_lost) = (inner.lost.contains(&target.id), target.state == State::Lost);
            if was_lost == is_lost {
                continue;
            }
            changed = true;
            let event = Event::Changed { id: target.id.to_string(), rect: target.rect, state: target.state };
            let happened = Happened { at, stamp, event, picture: None };
            if is_watched && inner.moments.len() < MOST_MOMENTS {
                inner.moments.push(happened);
            } else {
                inner.events.push(happened);
            }
        }
        inner.lost.clear();
        inner.lost.extend(targets.iter().filter(|t| t.state == State::Lost).map(|t| t.id.clone()));
        inner.wake();
        changed && is_watched
    }

    /// Makes the pictures of a frame that pages wait for, one of each size, and wakes them.
    pub fn show(&self, view: &View) -> Result<(), EncodingError> {
        let at = self.now();
        let (sides, number, moments) = {
            let mut inner = self.lock();
            let inner = &mut *inner;
            inner.shown += 1;
            let waiting = inner.pages.iter().filter(|page| page.wishes > 0);
            let mut sides: Vec<u32> = waiting.map(|page| picture::side(page.side, &view.frame)).collect();
            sides.sort_unstable();
            sides.dedup();
            // The tracker may be at a later frame by now.
            (sides, inner.shown, inner.moments.extract_if(.., |moment| moment.stamp == view.stamp).collect::<Vec<_>>())
        };
        let make = |side| {
            let message = picture::message(view, side, number, at)?.into();
            Ok(Picture { number, side, message })
        };
        let made: Result<_, EncodingError> = sides.into_iter().map(make).collect();
        let moments: Vec<_> = moments.into_iter().map(|moment| with_picture(moment, view)).collect();
        let mut inner = self.lock();
        moments.into_iter().for_each(|moment| inner.events.push(moment));
        inner.pictures = made?;
        inner.wake();
        Ok(())
    }

    /// Another run through a recording begins; the figures of the last are kept beside its own.
    pub fn begin_run(&self) {
        let mut inner = self.lock();
        inner.previous = std::mem::take(&mut inner.samples.items).into();
        inner.samples.next = 0;
        inner.run += 1;
        inner.lost.clear();
        inner.moments.clear();
        inner.wake();
    }

    /// Where the recording stands.
    pub fn play(&self, playback: Playback) {
        let mut inner = self.lock();
        if inner.playback.as_ref() != Some(&playback) {
            inner.playback = Some(playback);
            inner.playback_version += 1;
            inner.wake();
        }
    }

    /// Whether a page waits that was not given the frame that was shown last, or not in its size: where no other
    /// follows, that one is to be shown again.
    pub fn is_waited_for(&self) -> bool {
        let inner = self.lock();
        inner.pages.iter().any(|page| page.wishes > 0 && page.got < inner.shown)
    }

    /// Tells of something that happened to the frame of this stamp, or of none.
    pub fn tell(&self, stamp: Stamp, event: Event) {
        let at = self.now();
        let mut inner = self.lock();
        inner.events.push(Happened { at, stamp, event, picture: None });
        inner.wake();
    }

    /// The parameters are others now.
    pub fn params_changed(&self) {
        let mut inner = self.lock();
        inner.params_version += 1;
        inner.wake();
    }

    /// How the parts of the tracker are; those of the same names are replaced.
    pub fn report(&self, parts: impl IntoIterator<Item = Part>) {
        let mut inner = self.lock();
        for part in parts {
            match inner.parts.iter_mut().find(|known| known.name == part.name) {
                Some(known) => *known = part,
                None => inner.parts.push(part),
            }
        }
        inner.parts_version += 1;
        inner.wake();
    }
}

/// The pages' side.
impl Hub {
    /// A page is there, to be woken when there is news; `None` where there are `most` already.
    pub(super) fn enter(&self, most: usize, wake: Box<dyn Fn() + Send>) -> Option<u64> {
        let mut inner = self.lock();
        if inner.pages.len() >= most {
            return None;
        }
        inner.next_page += 1;
        let number = inner.next_page;
        inner.pages.push(Page { number, wishes: 0, side: 0, got: 0, wake });
        Some(number)
    }

    /// A page is gone.
    pub(super) fn leave(&self, page: u64) {
        let mut inner = self.lock();
        inner.pages.retain(|other| other.number != page);
        if inner.pages.is_empty() {
            inner.pictures.clear();
        }
    }

    /// A page waits for one more picture of about this side.
    pub(super) fn wish(&self, page: u64, side: u32) {
        if let Some(page) = self.lock().pages.iter_mut().find(|other| other.number == page) {
            page.wishes = (page.wishes + 1).min(MOST_WISHES);
            if page.side != side {
                (page.side, page.got) = (side, 0);
            }
        }
    }

    /// The newest picture, if the page waits for one and does not have it; then it waits for one less.
    pub(super) fn picture(&self, page: u64, known: u64) -> Option<Picture> {
        let mut inner = self.lock();
        let Inner { pages, pictures, .. } = &mut *inner;
        let page = pages.iter_mut().find(|other| other.number == page && other.wishes > 0)?;
        // The smallest that is large enough, or else the largest.
        let fits = |picture: &&Picture| picture.side >= page.side;
        let newer = pictures.iter().filter(|picture| picture.number > known);
        let best = newer.clone().filter(fits).min_by_key(|picture| picture.side);
        let best = best.or_else(|| newer.max_by_key(|picture| picture.side))?;
        page.wishes -= 1;
        page.got = best.number;
        Some(best.clone())
    }

    /// What the page does not know; from now on it does.
    pub(super) fn news(&self, known: &mut Known) -> News {
        let inner = self.lock();
        let has_new_run = known.run != inner.run;
        if has_new_run {
            known.samples = 0;
        }
        let news = News {
            previous: has_new_run.then(|| inner.previous.clone()),
            playback: inner.playback.clone().filter(|_| known.playback != inner.playback_version),
            samples: inner.samples.since(known.samples).cloned().collect(),
            events: inner.events.since(known.events).cloned().collect(),
            parts: (known.parts != inner.parts_version).then(|| inner.parts.clone()),
            has_new_params: known.params != inner.params_version,
        };
        known.samples = inner.samples.next;
        known.run = inner.run;
        known.playback = inner.playback_version;
        known.events = inner.events.next;
        known.parts = inner.parts_version;
        known.params = inner.params_version;
        news
    }

    /// Milliseconds since the start.
    pub(super) fn now(&self) -> u64 {
        self.0.began.elapsed().as_millis() as u64
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.0.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Inner {
    fn wake(&self) {
        self.pages.iter().for_each(|page| (page.wake)());
    }
}

/// The event of this frame with its picture, if that can be drawn.
fn with_picture(mut moment: Happened, view: &View) -> Happened {
    if let Event::Changed { rect, state, .. } = &moment.event {
        moment.picture = picture::moment(&view.frame, rect, *state).ok();
    }
    moment
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::Scene;
    use crate::frame::{Encoding, Frame};
    use crate::geometry::Rect;
    use crate::trace::{Event as Shown, Thresholds, Trace as _};
    use crate::tracker::{Output, Target};
    use crate::viewer::KeptThresholds;

    fn target(state: State) -> Target {
        Target::standing("0", Rect::new(10.0, 10.0, 20.0, 20.0), state)
    }

    fn note(hub: &Hub, stamp: i64, targets: &[Target], skipped: u32) -> bool {
        let thresholds = KeptThresholds::default();
        hub.note(&Said { stamp: Some(stamp), targets, thresholds: &thresholds, skipped, latency: 1.0 })
    }

    fn show(hub: &Hub) {
        let data = [90; 64 * 48];
        let frame = Frame::new(&data, 64, 48, 64, Encoding::Mono8, Some(5)).unwrap();
        let view =
            View { frame, stamp: frame.stamp(), output: &Output::default(), scene: &Scene::default(), quality: 80 };
        hub.show(&view).unwrap();
    }

    #[test]
    fn pictures_are_made_for_those_who_wait_and_only_the_newest_is_given() {
        let hub = Hub::default();
        let page = hub.enter(1, Box::new(|| {})).unwrap();
        assert!(hub.enter(1, Box::new(|| {})).is_none(), "no more than are allowed");
        assert!(!hub.wants());
        show(&hub);
        hub.wish(page, 64);
        assert!(hub.wants() && hub.picture(page, 0).is_none(), "nothing was made while nobody waited");
        (0..2).for_each(|_| show(&hub));
        let first = hub.picture(page, 0).unwrap();
        assert_eq!((first.number, hub.wants()), (3, false));
        (0..9).for_each(|_| hub.wish(page, 64));
        assert!(hub.picture(page, first.number).is_none(), "it has that one");
        show(&hub);
        assert!(hub.picture(page, first.number).is_some() && hub.wants());
        hub.leave(page);
        assert!(!hub.wants() && hub.lock().pictures.is_empty());
    }

    #[test]
    fn the_last_frame_is_shown_again_to_who_was_busy_or_needs_another_size() {
        let hub = Hub::default();
        let page = hub.enter(1, Box::new(|| {})).unwrap();
        let mut known = 0;
        // It is busy while the frame is shown, then it asks twice for each size.
        show(&hub);
        for side in [64, 320] {
            hub.wish(page, side);
            assert!(hub.is_waited_for());
            show(&hub);
            known = hub.picture(page, known).unwrap().number;
            hub.wish(page, side);
            assert!(hub.wants() && !hub.is_waited_for(), "it has that frame");
        }
    }

    #[test]
    fn a_loss_is_told_at_once_or_with_its_picture_while_somebody_looks() {
        let hub = Hub::default();
        let mut known = Known::default();
        assert!(!note(&hub, 5, &[target(State::Lost)], 0));
        let told = hub.news(&mut known);
        assert_eq!((told.samples.len(), told.events.len()), (1, 1));
        let page = hub.enter(1, Box::new(|| {})).unwrap();
        assert!(!note(&hub, 5, &[target(State::Lost)], 0), "it was lost before");
        assert!(note(&hub, 5, &[target(State::Tracking)], 0));
        assert!(note(&hub, 6, &[target(State::Lost)], 0), "before the frame of the first is shown");
        assert!(hub.news(&mut known).events.is_empty());
        show(&hub);
        let told = hub.news(&mut known).events;
        assert!(told.len() == 1 && told[0].picture.is_some(), "the other waits for its own frame");
        assert_eq!(serde_json::to_value(&told[0]).unwrap()["kind"], "found");
        hub.leave(page);
    }

    #[test]
    fn figures_bear_the_thresholds_of_their_own_target_and_frame() {
        let hub = Hub::default();
        let mut thresholds = KeptThresholds::default();
        for (id, certain) in [("0", 0.25), ("1", 0.75), ("0", 0.5)] {
            let held = Thresholds { certain, lost: 0.25, found: 1.0 };
            thresholds.event(Shown::Thresholds { id, thresholds: held });
        }
        let targets = [target(State::Tracking), Target::standing("2", Rect::default(), State::Lost)];
        hub.note(&Said { stamp: None, targets: &targets, thresholds: &thresholds, skipped: 0, latency: 1.0 });
        let told = serde_json::to_value(&hub.news(&mut Known::default()).samples[0]).unwrap();
        assert_eq!(told[3][0][4], serde_json::json!([0.5, 0.25, 1.0]), "of the last frame that it was followed into");
        assert_eq!(told[3][1][4], serde_json::Value::Null);
    }

    #[test]
    fn what_is_kept_is_bounded_and_the_newest_stands() {
        let hub = Hub::default();
        let mut known = Known::default();
        for n in 0..2 * SAMPLES {
            note(&hub, 5, &[], n as u32);
            hub.tell(None, Event::Stopped(None));
        }
        let news = hub.news(&mut known);
        assert_eq!((news.samples.len(), news.events.len()), (SAMPLES, EVENTS));
        let last = serde_json::to_value(&news.samples[SAMPLES - 1]).unwrap();
        assert_eq!(last[1], 2 * SAMPLES as u32 - 1);
        assert!(hub.news(&mut known).samples.is_empty());
        note(&hub, 5, &[], 7);
        assert_eq!(hub.news(&mut known).samples.len(), 1);
    }
}
