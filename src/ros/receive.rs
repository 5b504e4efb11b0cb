//! The receive thread: takes each image as it comes, checks it, and leaves the newest in the inbox, or in the slot of
//! the decode thread.

use std::sync::Arc;
use std::time::Duration;

use futures::stream::LocalBoxStream;
use futures::{FutureExt, StreamExt, pin_mut, select};
use log::warn;
use ros2_client::builtin_interfaces::Time;
use ros2_client::{Context, Gid, MessageInfo, MessageTypeName, Name, ReadError, Subscription};
use serde::de::DeserializeOwned;
use smol::channel::Receiver;

use super::convert::Received;
use super::decoder::{Packed, Slot};
use super::image_qos::ImageQos;
use super::inbox::Inbox;
use super::intake::{Intake, Refusal};
use super::messages::{self, CompressedImage, Topic};
use super::stats::{Stats, count};
use super::waiting;
use crate::viewer::{Hub, Part};

/// How long no image may come, at first or later, before the log says what is waited for.
const PATIENCE: Duration = Duration::from_secs(5);

/// All that the thread needs.
pub struct Receive {
    /// Where images come from.
    pub source: ImageSource,
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
    /// The live page, where there is one.
    pub page: Option<Hub>,
    /// Closed when the node ends.
    pub end: Receiver<()>,
}

/// Where images come from.
pub enum ImageSource {
    /// As they are.
    Raw(Subscription<messages::Image>),
    /// As JPEG or PNG.
    Compressed(Subscription<CompressedImage>, Arc<Slot<Packed>>),
}

/// An image that came, or why it cannot be read.
type Taken = Result<(Image, MessageInfo), ReadError>;

/// An image as it came.
enum Image {
    Raw(Box<messages::Image>),
    Compressed(Box<CompressedImage>),
}

impl ImageSource {
    fn type_name(&self) -> MessageTypeName {
        match self {
            Self::Raw(_) => messages::Image::type_name(),
            Self::Compressed(..) => CompressedImage::type_name(),
        }
    }

    fn images(&self) -> LocalBoxStream<'_, Taken> {
        fn taken<M: Topic + DeserializeOwned>(
            subscription: &Subscription<M>,
            image: impl Fn(Box<M>) -> Image + 'static,
        ) -> LocalBoxStream<'_, Taken> {
            let image = move |(message, about)| (image(Box::new(message)), about);
            subscription.async_stream().map(move |message| message.map(&image)).boxed_local()
        }
        match self {
            Self::Raw(images) => taken(images, Image::Raw),
            Self::Compressed(images, _) => taken(images, Image::Compressed),
        }
    }

    /// Passes an image on: one that is compressed to the decode thread, unless a newer one comes before it is taken
    /// there.
    fn pass(&self, image: Image, arrival: i64, inbox: &Inbox, intake: &mut Intake) {
        match (self, image) {
            (_, Image::Raw(image)) => intake.take(Received::new(*image, arrival).map_err(Refusal::from)),
            (Self::Compressed(_, slot), Image::Compressed(image)) => {
                if slot.put((*image, arrival)) {
                    inbox.skip();
                }
            }
            (Self::Raw(_), Image::Compressed(_)) => {}
        }
    }

    /// No more images come.
    fn close(&self) {
        if let Self::Compressed(_, slot) = self {
            slot.close();
        }
    }
}

impl Receive {
    /// Runs until the node ends.
    pub fn run(self) {
        smol::block_on(self.receive());
        self.source.close();
    }

    async fn receive(&self) {
        let images = self.source.images().fuse();
        let end = self.end.recv().fuse();
        pin_mut!(images, end);
        let mut intake = Intake::new(self.inbox.clone(), self.stats.clone(), self.topic.to_string());
        let mut sequence = None;
        let mut is_told = false;
        loop {
            let patience = if is_told { smol::Timer::never() } else { smol::Timer::after(PATIENCE) };
            let result = select! {
                _ = end => return,
                _ = FutureExt::fuse(patience) => {
                    self.tell(self.waiting());
                    is_told = true;
                    continue;
                }
                image = images.select_next_some() => image,
            };
            is_told = false;
            match result {
                Ok((image, about)) => {
                    count(&self.stats.received, 1);
                    count(&self.stats.missed, missed(&mut sequence, &about));
                    self.source.pass(image, arrival(&about), &self.inbox, &mut intake);
                }
                Err(why) => intake.take(Err(why.into())),
            }
        }
    }

    /// Tells the log and the live page what is waited for.
    fn tell(&self, line: String) {
        warn!("{line}");
        if let Some(page) = &self.page {
            page.report([Part { name: "waiting".to_owned(), level: 1, message: line, values: Vec::new() }]);
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
