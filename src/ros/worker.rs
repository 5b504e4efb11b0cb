//! The worker thread: steps the session on the newest image, does what was asked for between two images, publishes the
//! tracks.

use std::mem::{Discriminant, discriminant};
use std::sync::Arc;
use std::time::{Duration, Instant};

use log::{Level, debug, info, log};
use ros2_client::Publisher;
use ros2_client::builtin_interfaces::Time;

use super::budget::{Budget, Cost};
use super::convert::{Mark, Received, Start, detections, tracks};
use super::debug::{Feed, Job};
use super::history::{Named, find};
use super::inbox::{Inbox, Task, Work};
use super::logging::{Throttle, held_back};
use super::messages::{Detection2DArray, TrackArray};
use super::queue::{Command, answer};
use super::stats::{Stats, count};
use crate::draw::Scene;
use crate::error::StartError;
use crate::frame::{Frame, Stamp};
use crate::loader::FailureLog;
use crate::session::Session;
use crate::trace::Trace;
use crate::tracker::State;
use crate::viewer::{Event, Hub, KeptThresholds, Said};

/// Why nothing was started again.
#[derive(Debug, thiserror::Error)]
enum RestartError {
    #[error("no image has come yet")]
    NoImage,
    #[error(transparent)]
    Start(#[from] StartError),
}

/// All that the thread needs.
pub struct Worker {
    /// Where work comes from.
    pub inbox: Arc<Inbox>,
    /// The tracker with its target.
    pub session: Session,
    /// `~/tracks`.
    pub tracks: Publisher<TrackArray>,
    /// `~/detections`.
    pub detections: Publisher<Detection2DArray>,
    /// The way to debug images.
    pub debug: Feed,
    /// The live page, where there is one.
    pub page: Option<Hub>,
    /// What is counted.
    pub stats: Arc<Stats>,
}

/// What is remembered from one piece of work to the next.
struct Memory {
    /// The newest image, on which a mark starts.
    newest: Option<Arc<Received>>,
    /// How many images were skipped before it, until that is told.
    skipped: u32,
    /// When marks are due.
    budget: Budget,
    /// The targets that the log was last told are lost.
    lost: Vec<Arc<str>>,
    throttle: Throttle<Line>,
    failures: FailureLog,
}

/// Kinds of lines that peers can cause, each of which is written at most once a second.
#[derive(PartialEq)]
enum Line {
    Marked,
    Restarted,
    Waits,
    Refused(Discriminant<StartError>),
    NoImage,
    Stopped,
    Renamed,
    NoTarget,
    Unsent(&'static str),
}

impl Worker {
    /// Runs until the inbox is closed.
    pub fn run(mut self) {
        let mut memory = Memory {
            newest: None,
            skipped: 0,
            budget: Budget::new(Instant::now()),
            lost: Vec::new(),
            throttle: Throttle::default(),
            failures: FailureLog::default(),
        };
        while let Some(work) = self.inbox.wait(|command| memory.budget.wait(Self::cost(command), Instant::now())) {
            self.process(work, &mut memory);
        }
    }

    fn process(&mut self, work: Work, memory: &mut Memory) {
        let Work { params, task, superseded } = work;
        count(&self.stats.superseded, superseded);
        if let Some(tuning) = params {
            self.session.retune(tuning.params, tuning.networks);
        }
        let Some(task) = task else { return };
        if let Task::Image(frame, skipped) = &task {
            count(&self.stats.skipped, (*skipped).into());
            memory.newest = Some(frame.clone());
            memory.skipped = *skipped;
        }
        let newest = memory.newest.clone();
        let scene = newest.as_ref().and_then(|_| self.debug.scene());
        let mut trace = (scene, self.page.as_ref().map(|_| KeptThresholds::default()));
        let began = Instant::now();
        let has_changed = match task {
            Task::Image(frame, _) => {
                self.session.step(&frame.frame(), &mut trace);
                true
            }
            Task::Command(command) => self.obey(command, memory, &mut trace),
        };
        let (scene, thresholds) = trace;
        memory.failures.watch(&self.session);
        let Some(newest) = newest.filter(|_| has_changed) else {
            if let Some(scene) = scene {
                self.debug.keep(scene);
            }
            return;
        };
        let (skipped, latency) = self.publish(&newest, began.elapsed(), memory);
        let is_moment = self.page.as_ref().zip(thresholds).is_some_and(|(page, thresholds)| {
            let targets = &self.session.output().targets;
            page.note(&Said { stamp: newest.frame().stamp(), targets, thresholds: &thresholds, skipped, latency })
        });
        self.tell(memory);
        if let Some(scene) = scene.or_else(|| is_moment.then(Scene::default)) {
            let output = self.session.output().clone();
            let params = self.session.params();
            let (levels, debug) = (params.levels.range(), params.debug.clone());
            self.debug.submit(Job { frame: newest, output, scene, levels, debug });
        }
    }

    /// What the command asks of this thread.
    fn cost(command: &Command) -> Cost {
        match command {
            Command::Mark(Mark::Stop(_)) | Command::Stop(_) | Command::Rename { .. } => Cost::None,
            Command::Mark(Mark::Start(_)) => Cost::Mark,
            Command::Restart(_) => Cost::Restart,
        }
    }

    /// Does what was asked for; says whether a target was taken up.
    fn obey(&mut self, command: Command, memory: &mut Memory, trace: &mut dyn Trace) -> bool {
        let cost = Self::cost(&command);
        let began = Instant::now();
        let followed = match command {
            Command::Mark(Mark::Start(start)) => self.start(start, memory, trace),
            Command::Mark(Mark::Stop(None)) => {
                self.stop(memory);
                None
            }
            Command::Mark(Mark::Stop(Some(id))) => {
                if self.session.stop_target(&id) {
                    self.show(None, || Event::Stopped(Some(id.clone())));
                    memory.say(Line::Stopped, Level::Info, format!("target {id} stopped"));
                } else {
                    memory.say(Line::NoTarget, Level::Info, format!("there was no target {id}"));
                }
                None
            }
            Command::Rename { id, to } => {
                match self.session.rename(&id, &to) {
                    Ok(()) => {
                        memory.say(Line::Renamed, Level::Info, format!("target {id} is now called {to}"));
                        self.show(None, || Event::Renamed { id, to });
                    }
                    Err(why) => memory.say(Line::NoTarget, Level::Info, why.to_string()),
                }
                None
            }
            Command::Stop(replies) => {
                let message = self.stop(memory);
                answer(&replies, true, message);
                None
            }
            Command::Restart(replies) => {
                let result = self.restart(memory, trace);
                let success = result.is_ok();
                answer(&replies, success, &result.unwrap_or_else(|why| why.to_string()));
                success.then_some(0)
            }
        };
        if cost != Cost::None {
            memory.budget.charge(began.elapsed(), followed.unwrap_or(0), Instant::now());
        }
        followed.is_some()
    }

    /// Takes up a target on the image that the mark names, and follows it up to the newest, unless the node is to end.
    /// Gives the number of images that it was followed through, if it was taken up.
    fn start(&mut self, start: Start, memory: &mut Memory, trace: &mut dyn Trace) -> Option<usize> {
        let rect = start.rect;
        let named = match &memory.newest {
            Some(newest) => find(start.stamp, &self.inbox.kept(), newest),
            None => {
                memory.say(Line::Waits, Level::Info, format!("mark {rect} waits for the first image"));
                self.inbox.put_off(start);
                return None;
            }
        };
        let images = match named {
            Named::Here(images) => images,
            Named::Ahead => {
                memory.say(Line::Waits, Level::Info, format!("mark {rect} waits for its image"));
                self.inbox.put_off(start);
                return None;
            }
            Named::Unknown(why) => {
                memory.say(Line::NoImage, Level::Error, format!("mark {rect} refused: {why}"));
                self.show(start.stamp, || Event::Refused { rect, why });
                return None;
            }
        };
        let frames: Vec<Frame> = images.iter().map(|image| image.frame()).collect();
        let later = frames[1..].iter().take_while(|_| !self.inbox.is_closed());
        match self.session.start_from(start.id.as_deref(), &frames[0], later, rect, trace) {
            Ok(output) => {
                let id = output.targets.last().map_or("", |target| &*target.id).to_owned();
                let line = match frames.len() - 1 {
                    0 => format!("target {id} marked: {rect}"),
                    later => format!("target {id} marked: {rect}, {later} images ago"),
                };
                memory.say(Line::Marked, Level::Info, line);
                self.show(start.stamp, || Event::Marked { id, rect });
                (!self.inbox.is_closed()).then_some(frames.len() - 1)
            }
            Err(why) => {
                memory.say(Line::Refused(discriminant(&why)), Level::Error, format!("mark refused: {why}"));
                self.show(start.stamp, || Event::Refused { rect, why: why.to_string() });
                None
            }
        }
    }

    fn stop(&mut self, memory: &mut Memory) -> &'static str {
        let was = self.session.is_active();
        self.session.stop();
        if was {
            self.show(None, || Event::Stopped(None));
        }
        let (line, message) = if was { (Line::Stopped, "stopped") } else { (Line::NoTarget, "there was no target") };
        memory.say(line, Level::Info, message.to_owned());
        message
    }

    fn restart(&mut self, memory: &mut Memory, trace: &mut dyn Trace) -> Result<String, RestartError> {
        let frame = memory.newest.clone().ok_or(RestartError::NoImage)?;
        let output = self.session.restart(&frame.frame(), trace)?;
        let boxes: Vec<_> = output.targets.iter().map(|target| target.rect.to_string()).collect();
        let message = format!("restarted: {}", boxes.join(", "));
        memory.say(Line::Restarted, Level::Info, message.clone());
        for target in &self.session.output().targets {
            self.show(frame.frame().stamp(), || Event::Marked { id: target.id.to_string(), rect: target.rect });
        }
        Ok(message)
    }

    /// Tells the live page, if there is one.
    fn show(&self, stamp: Stamp, event: impl FnOnce() -> Event) {
        if let Some(page) = &self.page {
            page.tell(stamp, event());
        }
    }

    /// Publishes what is known of the image. Gives how many images were skipped before it, and the milliseconds from
    /// its arrival to its tracks.
    fn publish(&self, frame: &Received, processing: Duration, memory: &mut Memory) -> (u32, f32) {
        let skipped = std::mem::take(&mut memory.skipped);
        let output = self.session.output();
        self.stats.states(&output.targets);
        let algorithm = self.session.params().general.algorithm.name();
        let message = tracks(frame.header(), algorithm, output, skipped, processing);
        let mut unsent = Vec::new();
        if let Err(why) = self.tracks.publish(message) {
            unsent.push(("tracks", why.to_string()));
        }
        let latency = Time::now().to_nanos() - frame.arrival;
        self.stats.published(latency, processing);
        if let Err(why) = self.detections.publish(detections(frame.header(), output)) {
            unsent.push(("detections", why.to_string()));
        }
        for (what, why) in unsent {
            count(&self.stats.unsent, 1);
            memory.say(Line::Unsent(what), Level::Warn, format!("{what} not published: {why}"));
        }
        let stamp = &frame.header().stamp;
        debug!(
            "image {}.{:09}: tracks {:.2} ms after arrival, {:.2} ms of them the tracker's",
            stamp.sec,
            stamp.nanosec,
            latency as f64 / 1e6,
            processing.as_secs_f64() * 1e3
        );
        (skipped, latency as f32 / 1e6)
    }

    /// Tells the log when a target is lost or found again.
    fn tell(&self, memory: &mut Memory) {
        let targets = &self.session.output().targets;
        for target in targets {
            match (memory.lost.contains(&target.id), target.state == State::Lost) {
                (false, true) => info!("target {} lost at {}", target.id, target.rect),
                (true, false) => info!("target {} found again at {}", target.id, target.rect),
                _ => {}
            }
        }
        memory.lost.clear();
        memory.lost.extend(targets.iter().filter(|t| t.state == State::Lost).map(|t| t.id.clone()));
    }
}

impl Memory {
    /// Writes a line, unless one of its kind was written just now.
    fn say(&mut self, kind: Line, level: Level, line: String) {
        if let Some(held) = self.throttle.pass(kind, Instant::now()) {
            log!(level, "{line}{}", held_back(held));
        }
    }
}
