//! The tracker on a recording that is played: forwards by itself or frame by frame, and back to what was seen.
//!
//! The tracker goes through the frames in order and leaves none out, however they are looked at; what it said of a
//! frame is kept. So a run gives the rows of `track`, and one that begins again with the same marks and parameters
//! gives the same.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::rows;
use crate::draw::Scene;
use crate::error::{NetworkError, StartError};
use crate::frame::FrameBuffer;
use crate::geometry::Rect;
use crate::loader::Loaded;
use crate::params::{Algorithm, Assignment, Params, Phase};
use crate::record::{RecordError, Recorder};
use crate::replay::{self, FrameSource, ReplayError};
use crate::session::Session;
use crate::tracker::Output;
use crate::viewer::{Event, Hub, KeptThresholds, Said, View};

/// Where frames come from, as often as they are asked for.
pub struct Recording {
    /// The folder or bag.
    pub path: PathBuf,
    /// The topic of a bag.
    pub topic: Option<String>,
}

/// Where a target was marked.
#[derive(Clone, Debug)]
struct Mark {
    frame: usize,
    rect: Rect,
    id: Option<String>,
}

/// What was said of a frame, and how long that took.
struct Answer {
    output: Output,
    processing: Duration,
}

/// Why something was not done with a recording.
#[derive(Debug, thiserror::Error)]
pub enum PlayError {
    /// A frame cannot be read.
    #[error(transparent)]
    Read(#[from] ReplayError),
    /// The target cannot be followed.
    #[error(transparent)]
    Start(#[from] StartError),
    /// The network that the parameters ask for cannot be loaded.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// A parameter is refused.
    #[error(transparent)]
    Params(#[from] crate::error::ParamsError),
    /// The bag cannot be written.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// There is no such frame.
    #[error("there is no frame {0}")]
    NoFrame(usize),
}

/// The recording and the tracker on it.
pub struct Player {
    recording: Recording,
    source: Box<dyn FrameSource>,
    /// The frame that the source gives next.
    next: usize,
    /// The frame that is shown.
    shown: Option<(usize, FrameBuffer)>,
    session: Session,
    loaded: Loaded,
    /// Of the frames that the tracker has been through.
    answers: Vec<Answer>,
    marks: Vec<Mark>,
    scene: Scene,
    hub: Hub,
    /// How many runs have begun.
    pub run: usize,
    /// How many frames there are, where that is known.
    pub frames: Option<usize>,
}

impl Player {
    /// A recording that was opened, before its first frame.
    pub fn new(
        recording: Recording,
        source: Box<dyn FrameSource>,
        params: Params,
        hub: Hub,
    ) -> Result<Self, NetworkError> {
        let loaded = Loaded::new(&params)?;
        Ok(Self {
            recording,
            next: 0,
            shown: None,
            session: Session::with_networks(params, loaded.networks()),
            loaded,
            answers: Vec::new(),
            marks: Vec::new(),
            scene: Scene::default(),
            hub,
            run: 1,
            frames: source.remaining(),
            source,
        })
    }

    /// The parameters in force.
    pub fn params(&self) -> &Params {
        self.session.params()
    }

    /// The frame that is shown.
    pub fn position(&self) -> usize {
        self.shown.as_ref().map_or(0, |(number, _)| *number)
    }

    /// How many frames the tracker has been through.
    pub fn ran(&self) -> usize {
        self.answers.len()
    }

    /// Goes to a frame that the tracker has been through, or to the one after them; `false` where there is none.
    pub fn go(&mut self, number: usize) -> Result<bool, PlayError> {
        let number = number.min(self.answers.len());
        if !self.read(number)? {
            self.frames = Some(number);
            return Ok(false);
        }
        if number < self.answers.len() {
            self.scene.clear();
        } else {
            self.track(number);
        }
        self.show();
        Ok(true)
    }

    fn read(&mut self, number: usize) -> Result<bool, ReplayError> {
        if self.shown.as_ref().is_some_and(|(shown, _)| *shown == number) {
            return Ok(true);
        }
        if number < self.next {
            self.source = self.open()?;
            self.next = 0;
        }
        while self.next < number {
            if !self.source.skip_frame()? {
                return Ok(false);
            }
            self.next += 1;
        }
        let Some(frame) = self.source.next_frame()? else { return Ok(false) };
        self.next = number + 1;
        self.shown = Some((number, frame));
        Ok(true)
    }

    fn open(&self) -> Result<Box<dyn FrameSource>, ReplayError> {
        let Recording { path, topic } = &self.recording;
        replay::open(path, topic.as_deref(), &self.session.params().limits)
    }

    /// Takes the tracker into the frame that is shown, and takes up what was marked there in this run.
    fn track(&mut self, number: usize) {
        let Some((_, buffer)) = &self.shown else { return };
        let frame = buffer.frame();
        self.scene.clear();
        let mut thresholds = KeptThresholds::default();
        let begun = Instant::now();
        self.session.step(&frame, &mut (&mut thresholds, &mut self.scene));
        for mark in self.marks.iter().filter(|mark| mark.frame == number) {
            if let Err(why) = self.session.start_as(mark.id.as_deref(), &frame, mark.rect, &mut self.scene) {
                let why = why.to_string();
                self.hub.tell(stamp(number), Event::Refused { rect: mark.rect, why });
            }
        }
        let answer = Answer { output: self.session.output().clone(), processing: begun.elapsed() };
        let said = Said {
            stamp: stamp(number),
            targets: &answer.output.targets,
            thresholds: &thresholds,
            skipped: 0,
            latency: answer.processing.as_secs_f32() * 1e3,
        };
        self.hub.note_at(number as u64, &said);
        self.answers.push(answer);
    }

    /// Shows the frame to the pages that wait.
    pub fn show(&self) {
        let Some((number, buffer)) = &self.shown else { return };
        let Some(answer) = self.answers.get(*number) else { return };
        let params = self.session.params();
        let view = View {
            frame: buffer.frame().with_levels(params.levels.range()),
            stamp: stamp(*number),
            output: &answer.output,
            scene: &self.scene,
            quality: params.debug.jpeg_quality as u8,
        };
        if let Err(why) = self.hub.show(&view) {
            log::warn!("frame {number} cannot be shown: {why}");
        }
    }

    /// Marks a target on a frame that the tracker has been through. On the last of them it joins the run; on one
    /// before, another run begins there.
    pub fn mark(&mut self, number: usize, rect: Rect, id: Option<String>) -> Result<(), PlayError> {
        if number >= self.answers.len() || !self.read(number)? {
            return Err(PlayError::NoFrame(number));
        }
        let Some((_, buffer)) = &self.shown else { return Err(PlayError::NoFrame(number)) };
        if number + 1 < self.answers.len() {
            // It must be known to be good before the run is left.
            let mut session = Session::with_networks(self.session.params().clone(), self.session.networks());
            session.start_as(id.as_deref(), &buffer.frame(), rect, &mut ())?;
            self.marks = vec![Mark { frame: number, rect, id }];
            self.begin()?;
            while self.answers.len() <= number && self.go(self.answers.len())? {}
        } else {
            let begun = Instant::now();
            self.session.start_as(id.as_deref(), &buffer.frame(), rect, &mut self.scene)?;
            self.marks.push(Mark { frame: number, rect, id });
            self.answers[number] = Answer { output: self.session.output().clone(), processing: begun.elapsed() };
        }
        let named = self.session.output().targets.last().map_or_else(String::new, |target| target.id.to_string());
        self.hub.tell(stamp(number), Event::Marked { id: named, rect });
        self.show();
        Ok(())
    }

    /// Runs again from the first frame on, with the same marks and the parameters of now.
    pub fn again(&mut self) -> Result<(), PlayError> {
        self.begin()?;
        self.go(0).map(drop)
    }

    fn begin(&mut self) -> Result<(), PlayError> {
        let params = self.session.params().clone();
        self.session = Session::with_networks(params, self.loaded.networks());
        self.answers.clear();
        self.run += 1;
        self.hub.begin_run();
        Ok(())
    }

    /// Forgets one target, or all, from the frame on that the tracker is at.
    pub fn stop(&mut self, id: Option<&str>) {
        match id {
            Some(id) => drop(self.session.stop_target(id)),
            None => self.session.stop(),
        }
        self.hub.tell(None, Event::Stopped(id.map(str::to_owned)));
        if let Some(last) = self.answers.last_mut() {
            last.output = self.session.output().clone();
        }
        self.show();
    }

    /// Calls a target otherwise.
    pub fn rename(&mut self, id: &str, to: &str) -> Result<(), String> {
        self.session.rename(id, to).map_err(|why| why.to_string())?;
        for mark in self.marks.iter_mut().filter(|mark| mark.id.as_deref() == Some(id)) {
            mark.id = Some(to.to_owned());
        }
        if let Some(last) = self.answers.last_mut() {
            last.output = self.session.output().clone();
        }
        self.hub.tell(None, Event::Renamed { id: id.to_owned(), to: to.to_owned() });
        self.show();
        Ok(())
    }

    /// Gives a parameter another value: it holds from the next frame on, and for the runs to come.
    pub fn set(&mut self, change: &Assignment) -> Result<(), PlayError> {
        let params = self.session.params().with([(change.0.as_str(), &change.1)], Phase::Running)?;
        if !self.loaded.suits(&params) {
            self.loaded = Loaded::new(&params)?;
        }
        self.session.retune(params, self.loaded.networks());
        Ok(())
    }

    /// The rows of this run, as `track` writes them.
    pub fn rows(&self) -> String {
        let finds = self.params().general.algorithm == Algorithm::Maptrack;
        let mut text = Vec::new();
        if !finds {
            text.extend_from_slice(format!("{}\n", rows::HEADER).as_bytes());
        }
        for (number, Answer { output, .. }) in self.answers.iter().enumerate() {
            // Memory takes whatever is written to it.
            let _ = match finds {
                true => rows::write_mot(&mut text, number + 1, output),
                false => rows::write(&mut text, output).map(|()| text.push(b'\n')),
            };
        }
        String::from_utf8_lossy(&text).into_owned()
    }

    /// Writes a new bag with the images and what was said of them in this run.
    pub fn bag(&self, path: &Path) -> Result<(), PlayError> {
        let mut source = self.open()?;
        let mut bag = Recorder::create(path, self.params().general.algorithm.name())?;
        for Answer { output, processing } in &self.answers {
            if source.next_frame()?.is_none() {
                break;
            }
            bag.write(source.origin(), output, *processing)?;
        }
        Ok(bag.finish()?)
    }
}

/// What pages name a frame by.
fn stamp(number: usize) -> Option<i64> {
    i64::try_from(number).ok()
}
