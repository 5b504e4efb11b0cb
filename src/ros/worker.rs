//! The worker thread: applies commands between frames, steps the session on the newest image, publishes the tracks.

use std::sync::Arc;
use std::time::{Duration, Instant};

use log::{debug, error, info, warn};
use ros2_client::Publisher;
use ros2_client::builtin_interfaces::Time;

use super::convert::{Mark, Received, Start, detections, tracks};
use super::debug::{Feed, Job};
use super::history::{Named, find};
use super::inbox::{Command, Inbox, Work};
use super::logging::{Throttle, held_back};
use super::messages::{Detection2DArray, TrackArray, TriggerResponse};
use super::stats::{Stats, count};
use crate::frame::Frame;
use crate::session::Session;
use crate::trace::Trace;
use crate::tracker::State;

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
    /// What is counted.
    pub stats: Arc<Stats>,
}

/// What is remembered from one piece of work to the next.
#[derive(Default)]
struct Memory {
    /// The newest image, on which a mark starts.
    newest: Option<Arc<Received>>,
    /// Marks on images that have not come yet.
    pending: Vec<Start>,
    /// The targets that the log was last told are lost.
    lost: Vec<Arc<str>>,
    throttle: Throttle<&'static str>,
}

impl Worker {
    /// Runs until the inbox is closed.
    pub fn run(mut self) {
        let mut memory = Memory::default();
        while let Some(work) = self.inbox.wait() {
            self.process(work, &mut memory);
        }
    }

    fn process(&mut self, work: Work, memory: &mut Memory) {
        let Work { commands, frame, skipped } = work;
        count(&self.stats.skipped, skipped.into());
        let is_new = frame.is_some();
        if is_new {
            memory.newest = frame;
        }
        let newest = memory.newest.clone();
        let mut scene = newest.as_ref().and_then(|_| self.debug.scene());
        let mut silent = ();
        let trace: &mut dyn Trace = match scene.as_mut() {
            Some(scene) => scene,
            None => &mut silent,
        };
        let began = Instant::now();
        let mut is_due = is_new;
        let mut has_changed = false;
        for command in commands {
            // Parameters hold from the newest image on; and what is followed stands there before others join it.
            if is_due && !matches!(command, Command::Retune(_)) {
                is_due = false;
                self.step(newest.as_ref(), memory, trace);
            }
            has_changed |= self.obey(command, newest.as_ref(), memory, trace);
        }
        if is_due {
            self.step(newest.as_ref(), memory, trace);
        }
        let Some(newest) = newest.filter(|_| is_new || has_changed) else {
            if let Some(scene) = scene {
                self.debug.keep(scene);
            }
            return;
        };
        let processing = began.elapsed();
        self.publish(&newest, skipped, processing, memory);
        self.tell(memory);
        if let Some(scene) = scene {
            let output = self.session.output().clone();
            let params = self.session.params();
            let (levels, debug) = (params.levels.range(), params.debug.clone());
            self.debug.submit(Job { frame: newest, output, scene, levels, debug });
        }
    }

    /// Follows what there is into a new image, and takes up what was marked on it beforehand.
    fn step(&mut self, newest: Option<&Arc<Received>>, memory: &mut Memory, trace: &mut dyn Trace) {
        let Some(frame) = newest else { return };
        self.session.step(&frame.frame(), trace);
        for start in std::mem::take(&mut memory.pending) {
            self.start(start, newest, memory, trace);
        }
    }

    /// Does what was asked for; says whether a target was taken up.
    fn obey(
        &mut self,
        command: Command,
        newest: Option<&Arc<Received>>,
        memory: &mut Memory,
        trace: &mut dyn Trace,
    ) -> bool {
        match command {
            Command::Retune(params) => {
                self.inbox.limit_history(&params.history);
                if let Err(why) = self.session.retune(*params) {
                    error!("parameters refused: {why}");
                }
            }
            Command::Mark(Mark::Start(start)) => return self.start(start, newest, memory, trace),
            Command::Mark(Mark::Stop(None)) => info!("{}", self.stop(memory)),
            Command::Mark(Mark::Stop(Some(id))) => {
                memory.pending.retain(|start| start.id.as_ref() != Some(&id));
                let was = self.session.stop_target(&id);
                info!("{}", if was { format!("target {id} stopped") } else { format!("no target {id} was followed") });
            }
            Command::Stop(reply) => {
                let message = self.stop(memory).to_owned();
                info!("{message}");
                let _ = reply.try_send(TriggerResponse { success: true, message });
            }
            Command::Restart(reply) => {
                let result = self.restart(newest.map(|frame| &**frame), trace);
                let success = result.is_ok();
                let message = result.unwrap_or_else(|why| why);
                let _ = reply.try_send(TriggerResponse { success, message });
                return success;
            }
        }
        false
    }

    /// Takes up a target on the image that the mark names, and follows it up to the newest.
    fn start(
        &mut self,
        start: Start,
        newest: Option<&Arc<Received>>,
        memory: &mut Memory,
        trace: &mut dyn Trace,
    ) -> bool {
        let rect = start.rect;
        let Some(newest) = newest else {
            info!("mark {rect} waits for the first image");
            self.defer(start, memory);
            return false;
        };
        let images = match find(start.stamp, &self.inbox.kept(), newest) {
            Named::Here(images) => images,
            Named::Ahead => {
                info!("mark {rect} waits for its image");
                self.defer(start, memory);
                return false;
            }
            Named::Unknown(why) => {
                error!("mark {rect} refused: {why}");
                return false;
            }
        };
        let frames: Vec<Frame> = images.iter().map(|image| image.frame()).collect();
        match self.session.start_from(start.id.as_deref(), &frames[0], &frames[1..], rect, trace) {
            Ok(output) => {
                let id = output.targets.last().map_or("", |target| &*target.id);
                match frames.len() - 1 {
                    0 => info!("target {id} marked: {rect}"),
                    later => info!("target {id} marked: {rect}, {later} images ago"),
                }
                true
            }
            Err(why) => {
                error!("mark refused: {why}");
                false
            }
        }
    }

    /// Puts a mark by until its image comes. A later one for the same target takes its place, and of more than can be
    /// followed the latest stand.
    fn defer(&self, start: Start, memory: &mut Memory) {
        memory.pending.retain(|other| other.id.is_none() || other.id != start.id);
        if memory.pending.len() >= self.session.params().general.max_targets as usize {
            memory.pending.remove(0);
        }
        memory.pending.push(start);
    }

    fn stop(&mut self, memory: &mut Memory) -> &'static str {
        memory.pending.clear();
        let was = self.session.is_active();
        self.session.stop();
        if was { "stopped" } else { "no target was followed" }
    }

    fn restart(&mut self, newest: Option<&Received>, trace: &mut dyn Trace) -> Result<String, String> {
        let frame = newest.ok_or("no image has come yet")?;
        let output = self.session.restart(&frame.frame(), trace).map_err(|why| why.to_string())?;
        let boxes: Vec<_> = output.targets.iter().map(|target| target.rect.to_string()).collect();
        let message = format!("restarted: {}", boxes.join(", "));
        info!("{message}");
        Ok(message)
    }

    fn publish(&self, frame: &Received, skipped: u32, processing: Duration, memory: &mut Memory) {
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
            if let Some(held) = memory.throttle.pass(what, Instant::now()) {
                warn!("{what} not published: {why}{}", held_back(held));
            }
        }
        let stamp = &frame.header().stamp;
        debug!(
            "image {}.{:09}: tracks {:.2} ms after arrival, {:.2} ms of them the tracker's",
            stamp.sec,
            stamp.nanosec,
            latency as f64 / 1e6,
            processing.as_secs_f64() * 1e3
        );
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
