//! The commands that wait for the worker, as few as can be: what peers send at any rate takes bounded memory, and no
//! mark is obeyed that a later one has made void.
//!
//! * Of the marks of a target only the newest waits, in the place of the first, so that one target's marks never hold
//!   up another's. Where a single target is followed, every mark is of that target.
//! * A stop makes earlier marks void: those of its target, or all of them.
//! * Requests for the same service wait as one, and each of them is answered.

use std::collections::VecDeque;
use std::time::Duration;

use smol::channel::Sender;

use super::convert::{Mark, Start};
use super::messages::TriggerResponse;

/// Stops by id that wait at the same time, and new names: no more targets than that can be followed.
const MOST_STOPS: usize = 64;

/// Whoever waits for the answer of a service.
pub type Replies = Vec<Sender<TriggerResponse>>;

/// What is to be done between two frames.
#[derive(Debug)]
pub enum Command {
    /// A mark was given.
    Mark(Mark),
    /// Forget the targets.
    Stop(Replies),
    /// Take up the targets of the last marks again.
    Restart(Replies),
    /// Call a target otherwise.
    Rename {
        /// Its name until then.
        id: String,
        /// Its name from then on.
        to: String,
    },
}

impl Command {
    fn start(&self) -> Option<&Start> {
        if let Self::Mark(Mark::Start(start)) = self { Some(start) } else { None }
    }

    fn stopped(&self) -> Option<&String> {
        if let Self::Mark(Mark::Stop(id)) = self { id.as_ref() } else { None }
    }
}

/// Gives everybody the same answer. One who has gone away meanwhile needs none.
pub fn answer(replies: &Replies, success: bool, message: &str) {
    for reply in replies {
        let _ = reply.try_send(TriggerResponse { success, message: message.to_owned() });
    }
}

#[derive(Debug)]
struct Waiting {
    command: Command,
    /// Whether it can only be done on an image that has not come yet.
    asleep: bool,
}

/// Commands in the order in which they are to be done.
#[derive(Debug, Default)]
pub struct Queue {
    waiting: VecDeque<Waiting>,
    most_starts: usize,
    superseded: u64,
}

impl Queue {
    /// From now on so many targets may be followed.
    pub fn limit(&mut self, max_targets: usize) {
        self.most_starts = max_targets;
    }

    /// Whether nothing waits.
    pub fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    /// How many marks have become void unobeyed since the last call.
    pub fn take_superseded(&mut self) -> u64 {
        std::mem::take(&mut self.superseded)
    }

    /// Adds a command, and takes out what it makes void.
    pub fn push(&mut self, command: Command) {
        match command {
            Command::Mark(Mark::Start(start)) => self.push_start(start),
            Command::Mark(Mark::Stop(Some(id))) => {
                self.drop_marks(|c| c.start().is_some_and(|s| s.id.as_ref() == Some(&id)) || c.stopped() == Some(&id));
                if self.waiting.iter().filter(|w| w.command.stopped().is_some()).count() >= MOST_STOPS {
                    self.drop_first(|c| c.stopped().is_some());
                }
                self.add(Command::Mark(Mark::Stop(Some(id))));
            }
            Command::Mark(Mark::Stop(None)) => {
                let replies = self.stop_all();
                self.add(if replies.is_empty() { Command::Mark(Mark::Stop(None)) } else { Command::Stop(replies) });
            }
            Command::Stop(reply) => {
                let mut replies = self.stop_all();
                replies.extend(reply);
                self.add(Command::Stop(replies));
            }
            Command::Restart(reply) => {
                let mut replies = self.take_replies(|c| matches!(c, Command::Restart(_)));
                replies.extend(reply);
                self.add(Command::Restart(replies));
            }
            Command::Rename { id, to } => {
                let is_rename = |c: &Command| matches!(c, Command::Rename { .. });
                if self.waiting.iter().filter(|w| is_rename(&w.command)).count() >= MOST_STOPS {
                    self.drop_first(is_rename);
                }
                self.add(Command::Rename { id, to });
            }
        }
    }

    /// Puts a mark back, before all others, until the next image wakes it; unless a later one stands for it.
    pub fn put_off(&mut self, start: Start) {
        if self.rival(&start).is_some() || self.starts() >= self.most_starts {
            self.superseded += 1;
        } else {
            self.waiting.push_front(Waiting { command: Command::Mark(Mark::Start(start)), asleep: true });
        }
    }

    /// A new image has come.
    pub fn wake(&mut self) {
        self.waiting.iter_mut().for_each(|waiting| waiting.asleep = false);
    }

    /// The first command whose turn it is: `wait` says how long it is until then. One that still has to wait lets
    /// others pass.
    pub fn ready(&self, wait: impl Fn(&Command) -> Duration) -> Option<usize> {
        self.waiting.iter().position(|waiting| !waiting.asleep && wait(&waiting.command).is_zero())
    }

    /// How long it is until the turn of any command.
    pub fn soonest(&self, wait: impl Fn(&Command) -> Duration) -> Option<Duration> {
        self.waiting.iter().filter(|waiting| !waiting.asleep).map(|waiting| wait(&waiting.command)).min()
    }

    /// Takes the command out.
    pub fn take(&mut self, at: usize) -> Option<Command> {
        self.waiting.remove(at).map(|waiting| waiting.command)
    }

    fn push_start(&mut self, start: Start) {
        let Some(at) = self.rival(&start) else {
            if self.starts() >= self.most_starts {
                self.drop_first(|c| c.start().is_some());
            }
            self.add(Command::Mark(Mark::Start(start)));
            return;
        };
        self.superseded += 1;
        self.waiting.remove(at);
        // It does not jump a restart that was asked for before it.
        let is_behind = self.waiting.range(at..).any(|w| matches!(w.command, Command::Restart(_)));
        let at = if is_behind { self.waiting.len() } else { at };
        self.waiting.insert(at, Waiting { command: Command::Mark(Mark::Start(start)), asleep: false });
    }

    /// Where a mark waits that is of the same target.
    fn rival(&self, start: &Start) -> Option<usize> {
        let is_rival = |other: &Start| self.most_starts == 1 || (other.id.is_some() && other.id == start.id);
        self.waiting.iter().position(|w| w.command.start().is_some_and(is_rival))
    }

    fn starts(&self) -> usize {
        self.waiting.iter().filter(|w| w.command.start().is_some()).count()
    }

    fn add(&mut self, command: Command) {
        self.waiting.push_back(Waiting { command, asleep: false });
    }

    /// All that waits is void; gives those who wait for the answer of a stop.
    fn stop_all(&mut self) -> Replies {
        let restarts = self.take_replies(|c| matches!(c, Command::Restart(_)));
        answer(&restarts, false, "stopped before it was done");
        let stops = self.take_replies(|c| matches!(c, Command::Stop(_)));
        self.drop_marks(|_| true);
        stops
    }

    fn take_replies(&mut self, which: impl Fn(&Command) -> bool) -> Replies {
        let mut replies = Replies::new();
        self.waiting.retain_mut(|waiting| match &mut waiting.command {
            command if !which(command) => true,
            Command::Stop(own) | Command::Restart(own) => {
                replies.append(own);
                false
            }
            Command::Mark(_) | Command::Rename { .. } => true,
        });
        replies
    }

    fn drop_marks(&mut self, which: impl Fn(&Command) -> bool) {
        let before = self.starts();
        self.waiting.retain(|waiting| !which(&waiting.command));
        self.superseded += (before - self.starts()) as u64;
    }

    fn drop_first(&mut self, which: impl Fn(&Command) -> bool) {
        if let Some(at) = self.waiting.iter().position(|waiting| which(&waiting.command)) {
            self.waiting.remove(at);
            self.superseded += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use smol::channel::{Receiver, bounded};

    use super::*;
    use crate::geometry::Rect;

    const NOW: fn(&Command) -> Duration = |_| Duration::ZERO;

    fn queue(max_targets: usize) -> Queue {
        let mut queue = Queue::default();
        queue.limit(max_targets);
        queue
    }

    fn start(id: &str, x: f64) -> Command {
        let id = Some(id.to_owned()).filter(|id| !id.is_empty());
        Command::Mark(Mark::Start(Start { rect: Rect::new(x, 0.0, 9.0, 9.0), id, stamp: None }))
    }

    fn stop(id: Option<&str>) -> Command {
        Command::Mark(Mark::Stop(id.map(str::to_owned)))
    }

    fn reply() -> (Replies, Receiver<TriggerResponse>) {
        let (reply, answer) = bounded(1);
        (vec![reply], answer)
    }

    /// What waits, in words.
    fn told(queue: &Queue) -> Vec<String> {
        let told = |command: &Command| match command {
            Command::Mark(Mark::Start(s)) => format!("{}{}", s.id.as_deref().unwrap_or("-"), s.rect.x),
            Command::Mark(Mark::Stop(id)) => format!("stop {}", id.as_deref().unwrap_or("all")),
            Command::Stop(replies) => format!("stop for {}", replies.len()),
            Command::Restart(replies) => format!("restart for {}", replies.len()),
            Command::Rename { id, to } => format!("rename {id} to {to}"),
        };
        queue.waiting.iter().map(|waiting| told(&waiting.command)).collect()
    }

    #[test]
    fn of_each_targets_marks_the_newest_waits_in_the_place_of_the_first() {
        let mut several = queue(3);
        for n in 0..1000 {
            ["a", "b"].iter().for_each(|id| several.push(start(id, f64::from(n))));
        }
        assert_eq!(told(&several), ["a999", "b999"]);
        assert_eq!(several.take_superseded(), 1998);
        several.push(start("", 1.0));
        several.push(start("", 2.0));
        assert_eq!(told(&several), ["b999", "-1", "-2"], "no more than can be followed");
        let mut single = queue(1);
        ["", "a", "", "b"].iter().zip(0..).for_each(|(id, n)| single.push(start(id, f64::from(n))));
        assert_eq!((told(&single), single.take_superseded()), (vec!["b3".to_owned()], 3));
    }

    #[test]
    fn stops_make_earlier_marks_void_and_stand_before_later_ones() {
        let mut queue = queue(4);
        [start("a", 1.0), start("b", 1.0), stop(Some("a")), stop(Some("a")), start("a", 2.0)]
            .into_iter()
            .for_each(|c| queue.push(c));
        assert_eq!(told(&queue), ["b1", "stop a", "a2"]);
        [stop(None), start("c", 1.0)].into_iter().for_each(|c| queue.push(c));
        assert_eq!(told(&queue), ["stop all", "c1"]);
        for n in 0..1000 {
            queue.push(stop(Some(&n.to_string())));
        }
        assert_eq!(queue.waiting.len(), 2 + MOST_STOPS);
    }

    #[test]
    fn requests_wait_as_one_and_each_is_answered() {
        let mut queue = queue(1);
        let (restarts, told_of_restart): (Vec<_>, Vec<_>) = (0..5).map(|_| reply()).unzip();
        restarts.into_iter().for_each(|r| queue.push(Command::Restart(r)));
        assert_eq!(told(&queue), ["restart for 5"]);
        let (stops, told_of_stop): (Vec<_>, Vec<_>) = (0..3).map(|_| reply()).unzip();
        stops.into_iter().for_each(|r| queue.push(Command::Stop(r)));
        queue.push(stop(None));
        assert_eq!(told(&queue), ["stop for 3"]);
        let void = told_of_restart.iter().map(|r| r.try_recv().unwrap());
        assert!(void.into_iter().all(|a| !a.success && a.message == "stopped before it was done"));
        let Some(Command::Stop(replies)) = queue.take(0) else { panic!("a stop") };
        answer(&replies, true, "stopped");
        assert!(told_of_stop.iter().all(|r| r.try_recv().unwrap().success));
    }

    #[test]
    fn what_has_to_wait_lets_others_pass_and_no_mark_jumps_a_restart() {
        let mut queue = queue(4);
        let late = |c: &Command| Duration::from_secs(u64::from(c.start().is_some()));
        for command in [start("a", 1.0), stop(Some("b"))] {
            queue.push(command);
        }
        assert_eq!((queue.ready(late), queue.ready(NOW)), (Some(1), Some(0)));
        assert_eq!(queue.soonest(late), Some(Duration::ZERO));
        queue.take(1);
        assert_eq!((queue.ready(late), queue.soonest(late)), (None, Some(Duration::from_secs(1))));
        queue.push(Command::Restart(reply().0));
        queue.push(start("a", 2.0));
        assert_eq!(told(&queue), ["restart for 1", "a2"], "the restart was asked for before it");
    }

    #[test]
    fn a_mark_that_is_put_off_sleeps_until_the_next_image_unless_a_later_one_came() {
        let mut queue = queue(2);
        let mark = |queue: &mut Queue, x| {
            queue.push(start("a", x));
            let Some(Command::Mark(Mark::Start(mark))) = queue.take(queue.waiting.len() - 1) else { panic!("a mark") };
            mark
        };
        let first = mark(&mut queue, 1.0);
        queue.put_off(first);
        assert_eq!((queue.ready(NOW), queue.soonest(NOW)), (None, None));
        queue.wake();
        assert_eq!(queue.ready(NOW), Some(0));
        let first = mark(&mut queue, 2.0);
        queue.push(start("a", 3.0));
        queue.put_off(first);
        assert_eq!(told(&queue), ["a3"]);
    }
}
