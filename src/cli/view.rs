//! `track --view`: the live page over a recording.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use super::player::Player;
use super::{Error, tell};
use crate::geometry::Rect;
use crate::params::Params;
use crate::viewer::{self, Asked, Command, Event, Host, Hub, Part, Playback, Replay};

/// From frame to frame at the speed 1.
const PERIOD: Duration = Duration::from_nanos(33_333_333);
/// Speeds that can be asked for; 0 is as fast as can be.
const SLOWEST: f64 = 0.05;
const FASTEST: f64 = 100.0;
/// How soon a page that has come is shown the frame that stands still.
const LOOK: Duration = Duration::from_millis(100);
/// Frames whose figures are kept.
pub const SAMPLES: usize = 200_000;

/// What a page asks for, and where the answer goes.
type Request = (Command, smol::channel::Sender<Result<Option<String>, String>>);

/// Hands what pages ask for to the thread of the player.
struct ViewHost {
    params: Mutex<Params>,
    requests: Sender<Request>,
}

impl Host for ViewHost {
    fn params(&self) -> Params {
        self.params.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn ask(&self, command: Command) -> Asked {
        let (answer, answered) = smol::channel::bounded(1);
        let sent = self.requests.send((command, answer));
        Box::pin(async move {
            sent.map_err(|_| "the program ends".to_owned())?;
            answered.recv().await.unwrap_or_else(|_| Err("the program ends".to_owned()))
        })
    }
}

/// Shows the recording, and does what pages ask for, until the program is ended. A target that is given is marked on
/// the first frame.
pub fn run(player: Player, hub: &Hub, title: &str, target: Option<Rect>, bag: Option<PathBuf>) -> Result<(), Error> {
    let (requests, asked) = channel();
    let params = player.params().clone();
    let host = Arc::new(ViewHost { params: Mutex::new(params.clone()), requests });
    let listening = viewer::listen(&params.viewer, title, hub.clone(), host.clone()).map_err(Error::Viewer)?;
    tell(format_args!("live page: {}", listening.link));
    let serve = std::thread::Builder::new().name("viewer".to_owned());
    let serve = serve.spawn(move || listening.run(std::future::pending()));
    serve.map_err(|why| Error::Write { to: "the live page".to_owned(), why: why.to_string() })?;
    let mut stage = Stage { player, hub: hub.clone(), host, bag, is_playing: false, speed: 1.0, rush_to: None };
    stage.attempt(|player| player.go(0).map(drop));
    if let Some(rect) = target {
        stage.attempt(|player| player.mark(0, rect, None));
    }
    stage.obey(&asked);
    Ok(())
}

/// The player, and how it goes on.
struct Stage {
    player: Player,
    hub: Hub,
    host: Arc<ViewHost>,
    bag: Option<PathBuf>,
    is_playing: bool,
    speed: f64,
    /// The frame up to which the tracker runs as fast as it can.
    rush_to: Option<usize>,
}

impl Stage {
    fn obey(&mut self, asked: &Receiver<Request>) {
        let mut due = Instant::now();
        loop {
            self.tell();
            let goes_on = self.is_playing || self.rush_to.is_some();
            let wait = if goes_on { due.saturating_duration_since(Instant::now()) } else { LOOK };
            match asked.recv_timeout(wait) {
                Ok((command, answer)) => {
                    // A page that has gone away needs no answer.
                    let _ = answer.try_send(self.act(command));
                }
                Err(RecvTimeoutError::Timeout) if goes_on => {
                    due = Instant::now().max(due + self.period());
                    self.advance();
                }
                Err(RecvTimeoutError::Timeout) => {
                    if self.hub.is_waited_for() {
                        self.player.show();
                    }
                }
                Err(RecvTimeoutError::Disconnected) => return,
            }
        }
    }

    fn period(&self) -> Duration {
        if self.rush_to.is_some() || self.speed == 0.0 { Duration::ZERO } else { PERIOD.div_f64(self.speed) }
    }

    fn advance(&mut self) {
        let next = match self.rush_to {
            // To where it has been already it goes at once.
            Some(to) => to,
            None => self.player.position() + 1,
        };
        match self.player.go(next) {
            Ok(true) if self.rush_to.is_some_and(|to| self.player.position() >= to) => self.rush_to = None,
            Ok(true) => {}
            Ok(false) => self.stand(),
            Err(why) => self.fail(&why.to_string()),
        }
    }

    fn stand(&mut self) {
        self.is_playing = false;
        self.rush_to = None;
    }

    fn fail(&mut self, why: &str) {
        self.stand();
        log::warn!("{why}");
        let message = why.to_owned();
        self.hub.report([Part { name: "recording".to_owned(), level: 2, message, values: Vec::new() }]);
    }

    fn attempt<E: ToString>(&mut self, deed: impl FnOnce(&mut Player) -> Result<(), E>) {
        if let Err(why) = deed(&mut self.player) {
            self.fail(&why.to_string());
        }
    }

    /// Tells pages where the recording stands.
    fn tell(&self) {
        self.hub.play(Playback {
            frame: self.player.position(),
            frames: self.player.frames,
            ran: self.player.ran(),
            is_playing: self.is_playing,
            speed: self.speed,
            has_bag: self.bag.is_some(),
            run: self.player.run,
        });
    }

    fn act(&mut self, command: Command) -> Result<Option<String>, String> {
        match command {
            Command::Mark { rect, id, stamp } => self.mark(rect, id, stamp).map(|()| None),
            Command::Stop(id) => {
                self.player.stop(id.as_deref());
                Ok(None)
            }
            Command::Restart => self.replay(Replay::Again),
            Command::Rename { id, to } => self.player.rename(&id, &to).map(|()| None),
            // A frame of a recording is there at any time.
            Command::Hold { .. } | Command::Release { .. } => Ok(None),
            Command::Set { name, value } => {
                let told = Event::Set { name: name.clone(), value: value.to_string() };
                self.player.set(&(name, value)).map_err(|why| why.to_string())?;
                *self.host.params.lock().unwrap_or_else(PoisonError::into_inner) = self.player.params().clone();
                self.hub.tell(None, told);
                self.hub.params_changed();
                Ok(None)
            }
            Command::Replay(replay) => self.replay(replay),
        }
    }

    fn mark(&mut self, rect: Rect, id: Option<String>, stamp: Option<i64>) -> Result<(), String> {
        let number = stamp.and_then(|stamp| usize::try_from(stamp).ok()).unwrap_or(self.player.position());
        self.rush_to = None;
        let marked = self.player.mark(number, rect, id);
        if let Err(why) = &marked {
            self.hub.tell(stamp, Event::Refused { rect, why: why.to_string() });
        }
        Ok(())
    }

    fn replay(&mut self, replay: Replay) -> Result<Option<String>, String> {
        match replay {
            Replay::Play(is_playing) => {
                self.rush_to = None;
                self.is_playing = is_playing;
            }
            Replay::Jump(to) => {
                self.is_playing = false;
                self.rush_to = Some(to);
            }
            Replay::Speed(speed) if speed == 0.0 || (SLOWEST..=FASTEST).contains(&speed) => self.speed = speed,
            Replay::Speed(speed) => return Err(format!("the speed must be 0 or {SLOWEST} to {FASTEST}, got {speed}")),
            Replay::Rows => return Ok(Some(self.player.rows())),
            Replay::Bag => return self.write_bag(self.bag.as_deref()).map(|()| None),
            Replay::Again => {
                self.rush_to = None;
                self.player.again().map_err(|why| why.to_string())?;
                self.is_playing = true;
            }
        }
        Ok(None)
    }

    fn write_bag(&self, path: Option<&Path>) -> Result<(), String> {
        let path = path.ok_or("no bag was named: start with --bag FILE.mcap")?;
        self.player.bag(path).map_err(|why| why.to_string())
    }
}
