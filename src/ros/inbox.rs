//! What waits for the worker: the newest image, and commands. An image that the worker has not taken yet is
//! overwritten, and counted; it stays in the history for a while.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use smol::channel::Sender;

use super::convert::{Mark, Received};
use super::history::History;
use super::messages::TriggerResponse;
use crate::params::{self, Params};

/// What is to be done between two frames.
#[derive(Debug)]
pub enum Command {
    /// A mark was given.
    Mark(Mark),
    /// Forget the target.
    Stop(Sender<TriggerResponse>),
    /// Take up the target of the last mark again.
    Restart(Sender<TriggerResponse>),
    /// Use these parameters.
    Retune(Box<Params>),
}

/// What the worker takes at a time.
#[derive(Debug, Default)]
pub struct Work {
    /// In the order of their arrival.
    pub commands: VecDeque<Command>,
    /// The newest image, where one came since the last time.
    pub frame: Option<Arc<Received>>,
    /// How many images were overwritten since the last time.
    pub skipped: u32,
}

#[derive(Default)]
struct State {
    work: Work,
    history: History,
    closed: bool,
}

/// The place where the threads meet.
#[derive(Default)]
pub struct Inbox {
    state: Mutex<State>,
    changed: Condvar,
}

impl Inbox {
    /// Puts the newest image in.
    pub fn put(&self, frame: Received) {
        let frame = Arc::new(frame);
        let mut state = self.lock();
        state.history.push(&frame);
        if state.work.frame.replace(frame).is_some() {
            state.work.skipped = state.work.skipped.saturating_add(1);
        }
        self.changed.notify_one();
    }

    /// Adds a command. Of several changes of parameters in a row only the last counts, for each holds the whole set.
    pub fn send(&self, command: Command) {
        let mut state = self.lock();
        let commands = &mut state.work.commands;
        if let (Command::Retune(_), Some(Command::Retune(_))) = (&command, commands.back()) {
            commands.pop_back();
        }
        commands.push_back(command);
        drop(state);
        self.changed.notify_one();
    }

    /// Keeps no more images than that from now on.
    pub fn limit_history(&self, limits: &params::History) {
        self.lock().history.limit(limits);
    }

    /// The images that are kept, the oldest first.
    pub fn kept(&self) -> Vec<Arc<Received>> {
        self.lock().history.frames().cloned().collect()
    }

    /// Ends the worker's waiting for good.
    pub fn close(&self) {
        self.lock().closed = true;
        self.changed.notify_all();
    }

    /// Waits until there is something to do and takes all of it; `None` once the inbox is closed.
    pub fn wait(&self) -> Option<Work> {
        let idle = |s: &mut State| !s.closed && s.work.frame.is_none() && s.work.commands.is_empty();
        let mut state = self.changed.wait_while(self.lock(), idle).unwrap_or_else(PoisonError::into_inner);
        (!state.closed).then(|| std::mem::take(&mut state.work))
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::super::messages::{Header, Image};
    use super::*;

    fn frame(arrival: i64) -> Received {
        let image = Image {
            header: Header::default(),
            height: 1,
            width: 1,
            encoding: "mono8".to_owned(),
            is_bigendian: 0,
            step: 1,
            data: vec![0],
        };
        Received::new(image, arrival).unwrap()
    }

    #[test]
    fn the_newest_frame_stands_and_the_others_are_counted() {
        let inbox = Inbox::default();
        (1..=3).for_each(|n| inbox.put(frame(n)));
        let work = inbox.wait().unwrap();
        assert_eq!((work.frame.unwrap().arrival, work.skipped), (3, 2));
        inbox.put(frame(4));
        let work = inbox.wait().unwrap();
        assert_eq!((work.frame.unwrap().arrival, work.skipped), (4, 0));
    }

    #[test]
    fn of_parameter_changes_in_a_row_the_last_stands() {
        let inbox = Inbox::default();
        let retune = |side| {
            let mut params = Params::default();
            params.debug.max_side = side;
            inbox.send(Command::Retune(Box::new(params)));
        };
        retune(100);
        retune(101);
        inbox.send(Command::Mark(Mark::Stop(None)));
        retune(102);
        let side = |c: &Command| if let Command::Retune(p) = c { p.debug.max_side } else { 0 };
        let sides: Vec<i64> = inbox.wait().unwrap().commands.iter().map(side).collect();
        assert_eq!(sides, [101, 0, 102]);
    }

    #[test]
    fn commands_wake_the_worker_and_closing_ends_it() {
        let inbox = Arc::new(Inbox::default());
        let worker = std::thread::spawn({
            let inbox = inbox.clone();
            move || {
                let first = inbox.wait().map(|w| w.commands.len());
                (first, inbox.wait().is_none())
            }
        });
        inbox.send(Command::Mark(Mark::Stop(None)));
        // The worker has taken the command once the inbox is empty again.
        while !inbox.lock().work.commands.is_empty() {
            std::thread::yield_now();
        }
        inbox.close();
        assert_eq!(worker.join().unwrap(), (Some(1), true));
    }
}
