//! What users ask of the node: marks on `~/init_roi` and `~/init_detection`, and the services `~/stop` and `~/restart`.

use std::sync::Arc;

use futures::{StreamExt, join};
use log::error;
use ros2_client::Subscription;
use serde::de::DeserializeOwned;
use smol::channel::{Sender, bounded};

use super::convert::Mark;
use super::endpoints::Endpoints;
use super::fault::Fault;
use super::inbox::{Command, Inbox};
use super::messages::{Detection2D, RegionOfInterest, Topic, TriggerRequest, TriggerResponse, trigger};
use super::service::Service;

type Trigger = Service<TriggerRequest, TriggerResponse>;

/// The topics and the services.
pub struct Commands {
    init_roi: Subscription<RegionOfInterest>,
    init_detection: Subscription<Detection2D>,
    stop: Trigger,
    restart: Trigger,
    inbox: Arc<Inbox>,
}

impl Commands {
    /// Offers them.
    pub fn new(endpoints: &mut Endpoints, inbox: Arc<Inbox>) -> Result<Self, Fault> {
        Ok(Self {
            init_roi: endpoints.subscription("~/init_roi")?,
            init_detection: endpoints.subscription("~/init_detection")?,
            stop: endpoints.server("~/stop", &trigger())?,
            restart: endpoints.server("~/restart", &trigger())?,
            inbox,
        })
    }

    /// Passes what comes to the worker, for ever.
    pub async fn serve(&self) {
        join!(
            self.marks(&self.init_roi),
            self.marks(&self.init_detection),
            self.answer(&self.stop, Command::Stop),
            self.answer(&self.restart, Command::Restart)
        );
    }

    async fn marks<M: Topic + DeserializeOwned>(&self, topic: &Subscription<M>)
    where
        Mark: for<'a> From<&'a M>,
    {
        let mut marks = Box::pin(topic.async_stream());
        while let Some(mark) = marks.next().await {
            match mark {
                Ok((mark, _)) => self.inbox.send(Command::Mark(Mark::from(&mark))),
                Err(why) => error!("mark refused: {why}"),
            }
        }
    }

    /// Each request waits for the worker's answer, which comes between two frames.
    async fn answer(&self, service: &Trigger, command: impl Fn(Sender<TriggerResponse>) -> Command) {
        let answer = async |_| {
            let (reply, answer) = bounded(1);
            self.inbox.send(command(reply));
            let message = "the node is shutting down".to_owned();
            answer.recv().await.unwrap_or(TriggerResponse { success: false, message })
        };
        service.serve(answer).await;
    }
}
