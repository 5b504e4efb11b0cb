//! What waits for the worker: the newest image, commands, and the newest set of parameters. An image that the worker
//! has not taken yet is overwritten, and counted; it stays in the history for a while.
//!
//! The worker takes one thing at a time, and images and commands take turns: a command that is due goes after the image
//! that was waiting with it, and before the next.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use super::convert::{Mark, Received, Start};
use super::history::ImageHistory;
use super::queue::{Command, Queue};
use crate::frame::Stamp;
use crate::network::Networks;
use crate::params::Params;

/// What the worker takes at a time.
#[derive(Debug, Default)]
pub struct Work {
    /// Parameters that hold from now on.
    pub params: Option<Box<Tuning>>,
    /// What is to be done with them, if anything.
    pub task: Option<Task>,
    /// How many marks were made void by later ones since the last time.
    pub superseded: u64,
}

/// A set of parameters, and the networks that it asks for.
#[derive(Debug)]
pub struct Tuning {
    /// The parameters.
    pub params: Params,
    /// The networks, loaded.
    pub networks: Networks,
}

/// One thing to do.
#[derive(Debug)]
pub enum Task {
    /// Follow the targets into the newest image; so many were overwritten since the last.
    Image(Arc<Received>, u32),
    /// Do what was asked for.
    Command(Command),
}

#[derive(Default)]
struct InboxState {
    frame: Option<Arc<Received>>,
    skipped: u32,
    params: Option<Box<Tuning>>,
    commands: Queue,
    /// Whether a command was due beside the last image that was taken: it goes before the next.
    owed: bool,
    history: ImageHistory,
    /// The stamp of the newest image that came, where it has one and is kept.
    newest: Stamp,
}

impl InboxState {
    fn take(&mut self, wait: impl Fn(&Command) -> Duration) -> Option<Work> {
        let task = self.take_task(wait);
        let params = self.params.take();
        let superseded = self.commands.take_superseded();
        (params.is_some() || task.is_some()).then_some(Work { params, task, superseded })
    }

    fn take_task(&mut self, wait: impl Fn(&Command) -> Duration) -> Option<Task> {
        let ready = self.commands.ready(&wait);
        if let Some(at) = ready.filter(|_| self.owed || self.frame.is_none()) {
            self.owed = false;
            return self.commands.take(at).map(Task::Command);
        }
        let frame = self.frame.take()?;
        self.commands.wake();
        self.owed = self.commands.ready(&wait).is_some();
        Some(Task::Image(frame, std::mem::take(&mut self.skipped)))
    }
}

/// The place where the threads meet.
pub struct Inbox {
    state: Mutex<InboxState>,
    changed: Condvar,
    closed: AtomicBool,
}

impl Inbox {
    /// An empty inbox for these parameters.
    pub fn new(params: &Params) -> Self {
        let inbox = Self { state: Mutex::default(), changed: Condvar::new(), closed: AtomicBool::new(false) };
        limit(&mut inbox.lock(), params);
        inbox
    }

    /// Puts the newest image in.
    pub fn put(&self, frame: Received) {
        let frame = Arc::new(frame);
        let mut state = self.lock();
        state.history.push(&frame);
        state.newest =
            frame.frame().stamp().filter(|_| state.history.newest().is_some_and(|kept| Arc::ptr_eq(kept, &frame)));
        if state.frame.replace(frame).is_some() {
            state.skipped = state.skipped.saturating_add(1);
        }
        self.changed.notify_one();
    }

    /// Counts an image that was overwritten before it got here.
    pub fn skip(&self) {
        let state = &mut self.lock();
        state.skipped = state.skipped.saturating_add(1);
    }

    /// Adds a command. A mark on the newest image is one on that which is the newest now, whenever its turn comes;
    /// where images bear no stamps or none are kept, it is on that which is the newest then.
    pub fn send(&self, mut command: Command) {
        let mut state = self.lock();
        if let Command::Mark(Mark::Start(start)) = &mut command {
            start.stamp = start.stamp.or(state.newest);
        }
        state.commands.push(command);
        self.changed.notify_one();
    }

    /// Puts these parameters in force, from the next image on at the latest. Only the newest set counts, for each is
    /// whole.
    pub fn retune(&self, params: Params, networks: Networks) {
        let mut state = self.lock();
        limit(&mut state, &params);
        state.params = Some(Box::new(Tuning { params, networks }));
        self.changed.notify_one();
    }

    /// Keeps a mark for an image that has not come yet.
    pub fn put_off(&self, start: Start) {
        self.lock().commands.put_off(start);
    }

    /// The images that are kept, the oldest first.
    pub fn kept(&self) -> Vec<Arc<Received>> {
        self.lock().history.frames().cloned().collect()
    }

    /// Keeps the image of this stamp for a page of the live page, so that it can be marked however late.
    pub fn hold(&self, page: u64, stamp: Stamp) -> Result<(), String> {
        self.lock().history.hold(page, stamp)
    }

    /// Keeps no image for that page any more.
    pub fn release(&self, page: u64) {
        self.lock().history.release(page);
    }

    /// Ends the worker's waiting for good.
    pub fn close(&self) {
        // Under the lock, so that no wait can begin between the flag and the notice.
        let _state = self.lock();
        self.closed.store(true, Ordering::Relaxed);
        self.changed.notify_all();
    }

    /// Whether the node is shutting down, so that nothing long should go on.
    pub fn is_closed(&self) -> bool {
        self.closed.load(Ordering::Relaxed)
    }

    /// Waits until there is something to do, and takes it; `None` once the inbox is closed. `wait` says how long it is
    /// until the turn of a command.
    pub fn wait(&self, wait: impl Fn(&Command) -> Duration) -> Option<Work> {
        let mut state = self.lock();
        while !self.is_closed() {
            if let Some(work) = state.take(&wait) {
                return Some(work);
            }
            state = match state.commands.soonest(&wait) {
                Some(left) => self.changed.wait_timeout(state, left).unwrap_or_else(PoisonError::into_inner).0,
                None => self.changed.wait(state).unwrap_or_else(PoisonError::into_inner),
            };
        }
        None
    }

    fn lock(&self) -> MutexGuard<'_, InboxState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Keeps as many images and lets as many marks wait as the parameters say.
fn limit(state: &mut InboxState, params: &Params) {
    state.history.limit(&params.history);
    state.commands.limit(params.general.max_targets as usize);
}

#[cfg(test)]
mod tests {
    use super::super::messages::{Header, Image, Time};
    use super::*;
    use crate::geometry::Rect;

    const NOW: fn(&Command) -> Duration = |_| Duration::ZERO;

    fn image() -> Image {
        let encoding = "mono8".to_owned();
        Image { header: Header::default(), height: 1, width: 1, encoding, is_bigendian: 0, step: 1, data: vec![0] }
    }

    fn frame(arrival: i64) -> Received {
        Received::new(image(), arrival).unwrap()
    }

    fn inbox() -> Inbox {
        Inbox::new(&Params::default())
    }

    fn stop() -> Command {
        Command::Mark(Mark::Stop(None))
    }

    /// What is taken next: when the image arrived and how many were skipped, or nothing for a command.
    fn next(inbox: &Inbox) -> Option<(i64, u32)> {
        match inbox.wait(NOW).unwrap().task.unwrap() {
            Task::Image(frame, skipped) => Some((frame.arrival, skipped)),
            Task::Command(_) => None,
        }
    }

    #[test]
    fn the_newest_frame_stands_and_the_others_are_counted() {
        let inbox = inbox();
        (1..=3).for_each(|n| inbox.put(frame(n)));
        assert_eq!(next(&inbox), Some((3, 2)));
        inbox.put(frame(4));
        assert_eq!(next(&inbox), Some((4, 0)));
    }

    #[test]
    fn of_parameter_changes_the_last_stands_and_holds_for_the_next_image() {
        let inbox = inbox();
        for side in [100, 101, 102] {
            let mut params = Params::default();
            params.debug.max_side = side;
            inbox.retune(params, Networks::default());
        }
        inbox.put(frame(1));
        let work = inbox.wait(NOW).unwrap();
        assert_eq!(work.params.unwrap().params.debug.max_side, 102);
        assert!(matches!(work.task, Some(Task::Image(..))));
        inbox.retune(Params::default(), Networks::default());
        assert!(inbox.wait(NOW).unwrap().task.is_none());
    }

    #[test]
    fn images_and_commands_take_turns() {
        let inbox = inbox();
        let flood = |n| {
            inbox.send(stop());
            inbox.put(frame(n));
        };
        flood(1);
        assert_eq!(next(&inbox), Some((1, 0)), "the image that was there with it goes first");
        flood(2);
        assert_eq!(next(&inbox), None);
        flood(3);
        assert_eq!(next(&inbox), Some((3, 1)));
        assert_eq!(next(&inbox), None);
        inbox.send(stop());
        assert_eq!(next(&inbox), None, "without an image there is nothing to wait for");
    }

    #[test]
    fn a_mark_stays_on_the_image_that_was_the_newest_when_it_came() {
        let stamped = |stamp| {
            let header = Header { stamp: Time::from_nanos(stamp), frame_id: String::new() };
            Received::new(Image { header, ..image() }, 0).unwrap()
        };
        let mark = || Start { rect: Rect::new(0.0, 0.0, 9.0, 9.0), id: None, stamp: None };
        let inbox = inbox();
        let stamp_of_mark = || match inbox.wait(NOW).unwrap().task {
            Some(Task::Command(Command::Mark(Mark::Start(start)))) => start.stamp,
            other => panic!("{other:?} is no mark"),
        };
        inbox.send(Command::Mark(Mark::Start(mark())));
        assert_eq!(stamp_of_mark(), None, "there is none yet");
        inbox.put(stamped(5));
        inbox.send(Command::Mark(Mark::Start(mark())));
        inbox.put(stamped(7));
        assert_eq!(next(&inbox), Some((0, 1)));
        assert_eq!(stamp_of_mark(), Some(5));
        inbox.put(stamped(0));
        inbox.send(Command::Mark(Mark::Start(Start { stamp: Some(3), ..mark() })));
        assert_eq!(next(&inbox), Some((0, 0)));
        assert_eq!(stamp_of_mark(), Some(3));
    }

    #[test]
    fn commands_that_are_not_due_hold_up_no_image_and_are_due_in_time() {
        let inbox = inbox();
        inbox.send(stop());
        let due = std::time::Instant::now() + Duration::from_millis(50);
        let wait = |_: &Command| due.saturating_duration_since(std::time::Instant::now());
        inbox.put(frame(1));
        assert!(matches!(inbox.wait(wait).unwrap().task, Some(Task::Image(..))));
        assert!(matches!(inbox.wait(wait).unwrap().task, Some(Task::Command(_))));
        assert!(std::time::Instant::now() >= due);
    }

    #[test]
    fn commands_wake_the_worker_and_closing_ends_it() {
        let inbox = Arc::new(inbox());
        let worker = std::thread::spawn({
            let inbox = inbox.clone();
            move || {
                let first = inbox.wait(NOW).is_some();
                (first, inbox.wait(NOW).is_none())
            }
        });
        inbox.send(stop());
        // The worker has taken the command once the inbox is empty again.
        while !inbox.lock().commands.is_empty() {
            std::thread::yield_now();
        }
        inbox.close();
        assert_eq!(worker.join().unwrap(), (true, true));
    }
}
