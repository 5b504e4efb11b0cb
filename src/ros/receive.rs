//! The receive thread: takes each image as it comes, decodes and checks it, and leaves the newest in the inbox.

use std::fmt;
use std::mem::{Discriminant, discriminant};
use std::sync::Arc;
use std::time::{Duration, Instant};

use futures::stream::LocalBoxStream;
use futures::{FutureExt, StreamExt, pin_mut, select};
use log::{error, info, warn};
use ros2_client::builtin_interfaces::Time;
use ros2_client::{Context, Gid, MessageInfo, MessageTypeName, Name, ReadError, Subscription};
use serde::de::DeserializeOwned;
use smol::channel::Receiver;

use super::convert::Received;
use super::image_qos::ImageQos;
use super::inbox::Inbox;
use super::logging::{Throttle, held_back};
use super::messages::{CompressedImage, Image, Topic};
use super::stats::{Stats, count};
use super::waiting;
use crate::decode::DecodeError;
use crate::error::FrameError;
use crate::frame::{Encoding, Stamp};

/// How long no image may come, at first or later, before the log says what is waited for.
const PATIENCE: Duration = Duration::from_secs(5);

/// All that the thread needs.
pub struct Receive {
    /// Where images come from.
    pub source: Source,
    /// The name of that topic.
    pub topic: Name,
    /// What was asked for there.
    pub qos: ImageQos,
    /// To see who else is there.
    pub context: Context,
    /// Where images go.
    pub inbox: Arc<Inbox>,
    /// What is counted.
    pub stats: Arc<Stats>,
    /// Closed when the node ends.
    pub end: Receiver<()>,
}

/// Where images come from.
pub enum Source {
    /// As they are.
    Raw(Subscription<Image>),
    /// As JPEG or PNG.
    Compressed(Subscription<CompressedImage>),
}

/// An image that came, or why it cannot be used.
type Taken = Result<(Result<Received, Refusal>, MessageInfo), ReadError>;

#[derive(Debug, thiserror::Error)]
enum Refusal {
    #[error(transparent)]
    Frame(#[from] FrameError),
    #[error("{why} (format '{format}')")]
    Decode { why: DecodeError, format: String },
}

impl Source {
    fn type_name(&self) -> MessageTypeName {
        match self {
            Self::Raw(_) => Image::type_name(),
            Self::Compressed(_) => CompressedImage::type_name(),
        }
    }

    fn images(&self) -> LocalBoxStream<'_, Taken> {
        fn taken<M: Topic + DeserializeOwned>(
            subscription: &Subscription<M>,
            take: impl Fn(M, i64) -> Result<Received, Refusal> + 'static,
        ) -> LocalBoxStream<'_, Taken> {
            let take = move |(message, about)| (take(message, arrival(&about)), about);
            subscription.async_stream().map(move |message| message.map(&take)).boxed_local()
        }
        match self {
            Self::Raw(images) => taken(images, |image, arrival| Ok(Received::new(image, arrival)?)),
            Self::Compressed(images) => taken(images, |image, arrival| {
                let format = image.format.clone();
                Received::decoded(image, arrival).map_err(|why| Refusal::Decode { why, format })
            }),
        }
    }
}

/// What is complained about at most once a second.
#[derive(PartialEq)]
enum Complaint {
    Frame(Discriminant<FrameError>),
    Decode,
    Read(Discriminant<ReadError>),
    Changed,
    JumpedBack,
}

impl Receive {
    /// Runs until the node ends.
    pub fn run(self) {
        smol::block_on(self.receive());
    }

    async fn receive(&self) {
        let images = self.source.images().fuse();
        let end = self.end.recv().fuse();
        pin_mut!(images, end);
        let mut throttle = Throttle::default();
        let mut sequence = None;
        let mut last = None;
        let mut is_told = false;
        loop {
            let patience = if is_told { smol::Timer::never() } else { smol::Timer::after(PATIENCE) };
            let result = select! {
                _ = end => return,
                _ = FutureExt::fuse(patience) => {
                    warn!("{}", self.waiting());
                    is_told = true;
                    continue;
                }
                image = images.select_next_some() => image,
            };
            is_told = false;
            let (complaint, message) = match result {
                Ok((taken, about)) => {
                    count(&self.stats.received, 1);
                    count(&self.stats.missed, missed(&mut sequence, &about));
                    match taken {
                        Ok(frame) => {
                            let look = Look::of(&frame);
                            self.compare(last.replace(look), look, &mut throttle);
                            self.inbox.put(frame);
                            continue;
                        }
                        Err(Refusal::Frame(why)) => (Complaint::Frame(discriminant(&why)), why.to_string()),
                        Err(why) => (Complaint::Decode, why.to_string()),
                    }
                }
                Err(why) => (Complaint::Read(discriminant(&why)), why.to_string()),
            };
            count(&self.stats.rejected, 1);
            if let Some(held) = throttle.pass(complaint, Instant::now()) {
                error!("image refused: {message}{}", held_back(held));
            }
        }
    }

    /// Tells what has changed since the last image. The target is followed on.
    fn compare(&self, last: Option<Look>, now: Look, throttle: &mut Throttle<Complaint>) {
        let Some(last) = last else {
            info!("first image on {}: {now}", self.topic);
            return;
        };
        let mut tell = |complaint, line: String| {
            if let Some(held) = throttle.pass(complaint, Instant::now()) {
                warn!("{line}{}", held_back(held));
            }
        };
        if (last.size, last.encoding) != (now.size, now.encoding) {
            tell(Complaint::Changed, format!("images are {now} now, and were {last}"));
        }
        if let (Some(before), Some(after)) = (last.stamp, now.stamp)
            && after < before
        {
            let seconds = (before - after) as f64 / 1e9;
            tell(Complaint::JumpedBack, format!("the stamps of images jumped back by {seconds:.3} s"));
        }
    }

    /// What is waited for, and what there is that might be meant.
    fn waiting(&self) -> String {
        let writers = self.context.domain_participant().discovered_writers();
        let publishers = writers.iter().map(|writer| &writer.publication_topic_data);
        let kind = self.source.type_name().dds_msg_type();
        waiting::line(&self.topic.to_string(), &kind, self.qos, PATIENCE.as_secs(), publishers)
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

/// When the image was complete, nanoseconds since the epoch.
fn arrival(about: &MessageInfo) -> i64 {
    about.received_timestamp().map_or_else(|| Time::now().to_nanos(), |t| t.to_nanos())
}

/// How many images of the same publisher lie between this one and the last.
fn missed(last: &mut Option<(Gid, i64)>, about: &MessageInfo) -> u64 {
    let now = (about.publisher_gid(), about.sequence_number());
    match last.replace(now) {
        Some((gid, number)) if gid == now.0 => u64::try_from(now.1 - number - 1).unwrap_or(0),
        _ => 0,
    }
}
