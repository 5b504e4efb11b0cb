//! The worker thread: applies commands between frames, steps the session on the newest image, publishes the tracks.

use std::sync::Arc;
use std::time::{Duration, Instant};

use log::{debug, error, info, warn};
use ros2_client::Publisher;
use ros2_client::builtin_interfaces::Time;

use super::convert::{Mark, Received, detections, tracks};
use super::debug::{Feed, Job};
use super::inbox::{Command, Inbox, Work};
use super::logging::{Throttle, held_back};
use super::messages::{Detection2DArray, TrackArray, TriggerResponse};
use super::stats::{Stats, count};
use crate::geometry::Rect;
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
    /// A mark that came before any image.
    pending: Option<Rect>,
    /// The state that was last told in the log.
    told: Option<State>,
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
        let mut started = false;
        if let (Some(rect), Some(frame)) = (memory.pending, &newest) {
            memory.pending = None;
            started = self.start(frame, rect, trace);
        }
        for command in commands {
            match command {
                Command::Retune(params) => {
                    if let Err(why) = self.session.retune(*params) {
                        error!("parameters refused: {why}");
                    }
                }
                Command::Mark(Mark::Start(rect)) => match &newest {
                    Some(frame) => started |= self.start(frame, rect, trace),
                    None => {
                        info!("mark {rect} waits for the first image");
                        memory.pending = Some(rect);
                    }
                },
                Command::Mark(Mark::Stop) => {
                    memory.pending = None;
                    info!("{}", self.stop());
                }
                Command::Stop(reply) => {
                    memory.pending = None;
                    let message = self.stop().to_owned();
                    info!("{message}");
                    let _ = reply.try_send(TriggerResponse { success: true, message });
                }
                Command::Restart(reply) => {
                    let result = self.restart(newest.as_deref(), trace);
                    started |= result.is_ok();
                    let success = result.is_ok();
                    let message = result.unwrap_or_else(|why| why);
                    let _ = reply.try_send(TriggerResponse { success, message });
                }
            }
        }
        let Some(newest) = newest.filter(|_| is_new || started) else {
            if let Some(scene) = scene {
                self.debug.keep(scene);
            }
            return;
        };
        if !started {
            self.session.step(&newest.frame(), trace);
        }
        let processing = began.elapsed();
        self.publish(&newest, skipped, processing, memory);
        self.tell(memory);
        if let Some(scene) = scene {
            let output = self.session.output().clone();
            let debug = self.session.params().debug.clone();
            self.debug.submit(Job { frame: newest, output, scene, debug });
        }
    }

    fn start(&mut self, frame: &Received, rect: Rect, trace: &mut dyn Trace) -> bool {
        match self.session.start(&frame.frame(), rect, trace) {
            Ok(output) => {
                let id = output.targets.first().map_or("", |t| &*t.id);
                info!("target {id} marked: {rect}");
                true
            }
            Err(why) => {
                error!("mark refused: {why}");
                false
            }
        }
    }

    fn stop(&mut self) -> &'static str {
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
        let Some(target) = self.session.output().targets.first() else {
            memory.told = None;
            return;
        };
        let was_lost = memory.told.replace(target.state) == Some(State::Lost);
        match (was_lost, target.state == State::Lost) {
            (false, true) => info!("target {} lost at {}", target.id, target.rect),
            (true, false) => info!("target {} found again at {}", target.id, target.rect),
            _ => {}
        }
    }
}
