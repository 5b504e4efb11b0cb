//! The receive thread: takes each image as it comes, checks it, and leaves the newest in the inbox.

use std::mem::{Discriminant, discriminant};
use std::sync::Arc;
use std::time::{Duration, Instant};

use futures::{FutureExt, StreamExt, pin_mut, select};
use log::{error, info, warn};
use ros2_client::builtin_interfaces::Time;
use ros2_client::{Context, Gid, MessageInfo, Name, ReadError, Subscription};
use smol::channel::Receiver;

use super::convert::Received;
use super::inbox::Inbox;
use super::logging::{Throttle, held_back};
use super::messages::{Image, Topic};
use super::stats::{Stats, count};
use crate::error::FrameError;

/// How long no image may come before the log says what is waited for.
const PATIENCE: Duration = Duration::from_secs(5);

/// All that the thread needs.
pub struct Receive {
    /// Where images come from.
    pub subscription: Subscription<Image>,
    /// The name of that topic.
    pub topic: Name,
    /// To see who else is there.
    pub context: Context,
    /// Where images go.
    pub inbox: Arc<Inbox>,
    /// What is counted.
    pub stats: Arc<Stats>,
    /// Closed when the node ends.
    pub end: Receiver<()>,
}

/// What is complained about at most once a second.
#[derive(PartialEq)]
enum Complaint {
    Frame(Discriminant<FrameError>),
    Read(Discriminant<ReadError>),
}

impl Receive {
    /// Runs until the node ends.
    pub fn run(self) {
        smol::block_on(self.receive());
    }

    async fn receive(&self) {
        let images = self.subscription.async_stream();
        let end = self.end.recv().fuse();
        let patience = FutureExt::fuse(smol::Timer::after(PATIENCE));
        pin_mut!(images, end, patience);
        let mut throttle = Throttle::default();
        let mut sequence = None;
        let mut first = true;
        loop {
            let result = select! {
                _ = end => return,
                _ = patience => {
                    if first {
                        warn!("{}", self.waiting());
                    }
                    continue;
                }
                image = images.select_next_some() => image,
            };
            let (complaint, message) = match result {
                Ok((image, about)) => {
                    count(&self.stats.received, 1);
                    count(&self.stats.missed, missed(&mut sequence, &about));
                    match Received::new(image, arrival(&about)) {
                        Ok(frame) => {
                            if std::mem::take(&mut first) {
                                let f = frame.frame();
                                let (w, h, encoding) = (f.width(), f.height(), f.encoding().name());
                                info!("first image on {}: {w} x {h} {encoding}", self.topic);
                            }
                            self.inbox.put(frame);
                            continue;
                        }
                        Err(why) => (Complaint::Frame(discriminant(&why)), why.to_string()),
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

    /// What is waited for, and what there is that might be meant.
    fn waiting(&self) -> String {
        let wire = |name: &str| name.strip_prefix("rt").map(str::to_owned);
        let kind = Image::type_name().dds_msg_type();
        let (mut here, mut elsewhere) = (Vec::new(), Vec::new());
        for writer in self.context.domain_participant().discovered_writers() {
            let data = &writer.publication_topic_data;
            let Some(name) = wire(&data.topic_name) else { continue };
            if name == self.topic.to_string() {
                here.push(format!("{} with {:?}", data.type_name, data.reliability));
            } else if data.type_name == kind {
                elsewhere.push(name);
            }
        }
        elsewhere.sort_unstable();
        elsewhere.dedup();
        let listed = |items: Vec<String>| if items.is_empty() { "none".to_owned() } else { items.join(", ") };
        format!(
            "no image on {} after {} s; publishers there: {}; other topics with images: {}",
            self.topic,
            PATIENCE.as_secs(),
            listed(here),
            listed(elsewhere)
        )
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
