//! What is done with an image that came, or with one that cannot be used: it goes into the inbox, or is told and
//! counted.

use std::fmt;
use std::mem::{Discriminant, discriminant};
use std::sync::Arc;
use std::time::Instant;

use log::{error, info, warn};
use ros2_client::ReadError;

use super::convert::Received;
use super::inbox::Inbox;
use super::logging::{Throttle, held_back};
use super::stats::{Stats, count};
use crate::decode::DecodeError;
use crate::error::FrameError;
use crate::frame::{Encoding, Stamp};

/// Why an image is not used.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum Refusal {
    /// Its bytes do not hold what its fields say.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// It cannot be decoded, or may not.
    #[error("{why} (format '{format}')")]
    Decode { why: DecodeError, format: String },
    /// The message cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
}

/// What is complained about at most once a second.
#[derive(PartialEq)]
enum Complaint {
    Frame(Discriminant<FrameError>),
    Decode(Discriminant<DecodeError>),
    Read(Discriminant<ReadError>),
    Changed,
    JumpedBack,
}

/// The way into the inbox.
pub struct Intake {
    inbox: Arc<Inbox>,
    stats: Arc<Stats>,
    topic: String,
    last: Option<Look>,
    throttle: Throttle<Complaint>,
}

impl Intake {
    /// For images of a topic.
    pub fn new(inbox: Arc<Inbox>, stats: Arc<Stats>, topic: String) -> Self {
        Self { inbox, stats, topic, last: None, throttle: Throttle::default() }
    }

    /// Puts the image into the inbox, or tells why not.
    pub fn take(&mut self, image: Result<Received, Refusal>) {
        match image {
            Ok(frame) => {
                let look = Look::of(&frame);
                self.compare(look);
                self.inbox.put(frame);
            }
            Err(why) => self.refuse(&why),
        }
    }

    fn refuse(&mut self, why: &Refusal) {
        count(&self.stats.rejected, 1);
        let complaint = match why {
            Refusal::Frame(why) => Complaint::Frame(discriminant(why)),
            Refusal::Decode { why, .. } => Complaint::Decode(discriminant(why)),
            Refusal::Read(why) => Complaint::Read(discriminant(why)),
        };
        if let Some(held) = self.throttle.pass(complaint, Instant::now()) {
            error!("image refused: {why}{}", held_back(held));
        }
    }

    /// Tells what has changed since the last image. The target is followed on.
    fn compare(&mut self, now: Look) {
        let Some(last) = self.last.replace(now) else {
            info!("first image on {}: {now}", self.topic);
            return;
        };
        let mut tell = |complaint, line: String| {
            if let Some(held) = self.throttle.pass(complaint, Instant::now()) {
                warn!("{line}{}", held_back(held));
            }
        };
        if (last.size, last.encoding) != (now.size, now.encoding) {
            tell(Complaint::Changed, format!("images are now {now}, and were {last}"));
        }
        if let (Some(before), Some(after)) = (last.stamp, now.stamp)
            && after < before
        {
            let seconds = (before - after) as f64 / 1e9;
            tell(Complaint::JumpedBack, format!("image stamps jumped back by {seconds:.3} s"));
        }
    }
}

/// What is compared from image to image.
#[derive(Clone, Copy)]
struct Look {
    size: [u32; 2],
    encoding: Encoding,
    stamp: Stamp,
}

impl Look {
    fn of(image: &Received) -> Self {
        let frame = image.frame();
        Self { size: frame.grid(), encoding: frame.encoding(), stamp: frame.stamp() }
    }
}

impl fmt::Display for Look {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [width, height] = self.size;
        write!(f, "{width} x {height} {}", self.encoding.name())
    }
}
