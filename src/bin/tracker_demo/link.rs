//! The camera and the user: publishes the clip as a driver would, marks the person, and collects the tracks.
//!
//! Where the kernel's receive buffers are too small for a burst of whole frames, frames of half the size are published.
//! What is given back is in the clip's own pixels either way.

use std::error::Error;
use std::future::Future;
use std::time::{Duration, Instant, SystemTime};

use image::{RgbImage, imageops};
use long_term_tracker::ros::endpoints::Endpoints;
use long_term_tracker::ros::env::{self, Environment, Reach};
use long_term_tracker::ros::messages::{Header, Image, RegionOfInterest, Time, Track, TrackArray};
use long_term_tracker::ros::names::{Names, Rule};
use long_term_tracker::{Rect, params::NodeName};
use ros2_client::{Publisher, Subscription, WriteError};
use smol::Timer;
use smol::future::or;

/// How long the node may take to appear.
const APPEAR: Duration = Duration::from_secs(60);
/// How long an answer is waited for.
const ANSWER: Duration = Duration::from_secs(1);
/// The same where to say it twice would matter: a second mark begins anew.
const CERTAIN: Duration = Duration::from_secs(20);
/// How often the state is told.
const SECOND: Duration = Duration::from_secs(1);
/// How often something is said that has no answer, and what must not be said twice without need.
const TRIES: usize = 30;
const CERTAIN_TRIES: usize = 5;

/// What the node said of the clip.
pub struct Run {
    /// By frame; `None` where no message bears the frame's stamp.
    pub tracks: Vec<Option<TrackArray>>,
    /// From the moment an image was published to its tracks, in seconds.
    pub latencies: Vec<f64>,
    /// From the first frame to the last, in seconds.
    pub seconds: f64,
}

/// How fast frames are shown.
pub struct Pace {
    /// At most so many a second.
    pub rate: f64,
    /// Each only once the last is answered.
    pub in_step: bool,
}

/// Plays the frames to the node in the domain and marks `mark` in the first of them.
pub fn play(frames: &[RgbImage], mark: Rect, pace: Pace, domain: u16) -> Result<Run, Box<dyn Error>> {
    let shrink = if env::buffer_warning().is_some() { 2 } else { 1 };
    if shrink > 1 {
        println!("the kernel's receive buffers are small: frames are published at half their size");
    }
    let context = Environment { domain, reach: Reach::Localhost, peers: Vec::new(), warnings: Vec::new() }.context()?;
    // "~" means the tracker here, so that topics are called as its documentation calls them.
    let own = NodeName { namespace: "/".to_owned(), name: "demo".to_owned() };
    let rules = ["~/init_roi:=/tracker/init_roi", "~/tracks:=/tracker/tracks"].map(Rule::parse);
    let rules = rules.into_iter().collect::<Result<Vec<_>, _>>()?;
    let mut endpoints = Endpoints::new(context, Names::new(own, rules)?)?;
    let mut link = Link {
        images: endpoints.image_publisher("image")?.0,
        marks: endpoints.publisher("~/init_roi")?,
        tracks: endpoints.subscription("~/tracks")?,
        shrink,
        start: SystemTime::now().duration_since(SystemTime::UNIX_EPOCH)?,
        period: Duration::from_secs_f64(1.0 / pace.rate),
        in_step: pace.in_step,
        published: vec![None; frames.len()],
        run: Run { tracks: vec![None; frames.len()], latencies: Vec::new(), seconds: 0.0 },
    };
    let spinner = endpoints.node.spinner()?;
    let node = endpoints.node;
    smol::block_on(async {
        let work = async {
            let met = async {
                link.images.wait_for_subscription(&node).await;
                link.marks.wait_for_subscription(&node).await;
                link.tracks.wait_for_publisher(&node).await;
            };
            println!("loading the network and waiting for the node to appear");
            let begin = Instant::now();
            within(APPEAR, met).await.ok_or("the node did not appear")?;
            println!("the node appeared after {:.1} s: sending the first frame", begin.elapsed().as_secs_f64());
            link.begin(&frames[0], mark).await?;
            link.go_on(frames).await
        };
        let spin = async {
            spinner.spin().await?;
            Err("the connection to ROS 2 ended".into())
        };
        or(work, spin).await
    })?;
    Ok(link.run)
}

struct Link {
    images: Publisher<Image>,
    marks: Publisher<RegionOfInterest>,
    tracks: Subscription<TrackArray>,
    /// A published pixel is a square of this many of the clip's.
    shrink: u32,
    /// Stamp of the first frame, since the epoch.
    start: Duration,
    period: Duration,
    in_step: bool,
    published: Vec<Option<Instant>>,
    run: Run,
}

impl Link {
    /// Shows the first frame until the node has seen it, then marks the person until the node follows her.
    async fn begin(&mut self, frame: &RgbImage, mark: Rect) -> Result<(), Box<dyn Error>> {
        for _ in 0..TRIES {
            self.show(0, frame)?;
            if within(ANSWER, self.next_answer()).await.is_some() {
                break;
            }
        }
        println!("marking the person in it");
        let [x_offset, y_offset, width, height] =
            [mark.x, mark.y, mark.w, mark.h].map(|v| (v / f64::from(self.shrink)).round() as u32);
        for _ in 0..CERTAIN_TRIES {
            sent(self.marks.publish(RegionOfInterest { x_offset, y_offset, height, width, do_rectify: false }))?;
            let followed = async { while self.next_answer().await.is_none_or(|(_, track)| track.is_none()) {} };
            if within(CERTAIN, followed).await.is_some() {
                println!("the node follows {mark}: playing {} frames", self.published.len());
                return Ok(());
            }
        }
        Err("the node does not take the mark up".into())
    }

    /// Shows the other frames at their pace and tells once a second how the person is followed.
    async fn go_on(&mut self, frames: &[RgbImage]) -> Result<(), Box<dyn Error>> {
        let begin = Instant::now();
        let mut told = begin;
        let last = frames.len() - 1;
        for (index, frame) in frames.iter().enumerate().skip(1) {
            let due = begin + self.period * index as u32;
            while within(due.saturating_duration_since(Instant::now()), self.next_answer()).await.is_some() {}
            self.show(index, frame)?;
            if self.in_step {
                self.answered(index, frame).await?;
            }
            if told.elapsed() >= SECOND {
                told = Instant::now();
                println!("{}", self.line(index));
            }
        }
        while self.run.tracks[last].is_none() && within(ANSWER, self.next_answer()).await.is_some() {}
        println!("{}", self.line(last));
        self.run.seconds = begin.elapsed().as_secs_f64();
        Ok(())
    }

    /// Waits until something is said of the frame, which is shown again where it was lost on the way.
    async fn answered(&mut self, index: usize, frame: &RgbImage) -> Result<(), Box<dyn Error>> {
        for _ in 0..CERTAIN_TRIES {
            let answered = async {
                while self.run.tracks[index].is_none() {
                    self.next_answer().await;
                }
            };
            if within(CERTAIN, answered).await.is_some() {
                return Ok(());
            }
            self.show(index, frame)?;
        }
        Err(format!("frame {index} is not answered").into())
    }

    /// Publishes a frame as a camera driver does.
    fn show(&mut self, index: usize, frame: &RgbImage) -> Result<(), Box<dyn Error>> {
        let (width, height) = (frame.width() / self.shrink, frame.height() / self.shrink);
        let data = match self.shrink {
            1 => frame.as_raw().clone(),
            _ => imageops::thumbnail(frame, width, height).into_raw(),
        };
        let header = Header { stamp: Time::from_nanos(self.stamp(index)), frame_id: "camera".to_owned() };
        let encoding = "rgb8".to_owned();
        self.published[index] = Some(Instant::now());
        sent(self.images.publish(Image { header, height, width, encoding, is_bigendian: 0, step: 3 * width, data }))
    }

    /// Waits for the next message of tracks and files it under the frame whose stamp it bears. Gives the frame and
    /// the track, if there is one; `None` for a message that cannot be read or bears the stamp of no frame.
    async fn next_answer(&mut self) -> Option<(usize, Option<Track>)> {
        let (mut message, _) = self.tracks.async_take().await.ok()?;
        for track in &mut message.tracks {
            let Track { center_x, center_y, size_x, size_y, velocity_x, velocity_y, .. } = track;
            for length in [center_x, center_y, size_x, size_y, velocity_x, velocity_y] {
                *length *= f64::from(self.shrink);
            }
        }
        let nanos = message.header.stamp.nanos();
        let index = (0..self.published.len()).find(|&i| self.stamp(i) == nanos)?;
        let track = message.tracks.first().cloned();
        if track.is_some() {
            let sent = self.published[index].map(|at| at.elapsed().as_secs_f64());
            // The mark is answered with the stamp of an image that was published long before.
            self.run.latencies.extend(sent.filter(|_| index > 0));
            self.run.tracks[index] = Some(message);
        }
        Some((index, track))
    }

    /// Nanoseconds since the epoch.
    fn stamp(&self, index: usize) -> i64 {
        (self.start + self.period * index as u32).as_nanos() as i64
    }

    /// How the person is followed at present.
    fn line(&self, index: usize) -> String {
        let latest = self.run.tracks.iter().enumerate().rev().find_map(|(i, m)| Some((i, m.as_ref()?.tracks.first()?)));
        let Some((at, track)) = latest else { return format!("frame {index:3}: no track") };
        let [x, y] = [track.center_x - track.size_x / 2.0, track.center_y - track.size_y / 2.0];
        format!(
            "frame {at:3}: {:9} {:3.0} x {:3.0} at ({x:3.0}, {y:3.0}), confidence {:.2}, response {:.2}",
            super::report::state(track).name(),
            track.size_x,
            track.size_y,
            track.confidence,
            track.response
        )
    }
}

/// A message for which the network has no time now is lost, as others are on the way: no reason to end.
fn sent<M: std::fmt::Debug + 'static>(result: Result<(), WriteError<M>>) -> Result<(), Box<dyn Error>> {
    match result {
        Ok(()) | Err(WriteError::WouldBlock { .. }) => Ok(()),
        Err(why) => Err(why.into()),
    }
}

/// What the future gives, if it does so in time.
async fn within<T>(limit: Duration, future: impl Future<Output = T>) -> Option<T> {
    let late = async {
        Timer::after(limit).await;
        None
    };
    or(async { Some(future.await) }, late).await
}
