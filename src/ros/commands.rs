//! What users ask of the node: marks on `~/init_roi` and `~/init_detection`, and the services `~/stop` and `~/restart`.

use std::mem::discriminant;
use std::sync::Arc;
use std::time::Instant;

use futures::StreamExt;
use log::error;
use ros2_client::{ReadError, Subscription};
use serde::de::DeserializeOwned;
use smol::channel::bounded;

use super::convert::{Mark, Start};
use super::endpoints::Endpoints;
use super::fault::Fault;
use super::inbox::Inbox;
use super::logging::{Throttle, held_back};
use super::messages::{Detection2D, RegionOfInterest, Topic, TriggerRequest, TriggerResponse, trigger};
use super::part::Part;
use super::queue::{Command, Replies};
use super::service::Service;

/// Bytes that the id of a target may have: it is in every message, and in lines of the log.
const MOST_ID: usize = 256;

/// Why a mark is not passed on.
#[derive(Debug, thiserror::Error)]
enum Refusal {
    #[error(transparent)]
    Read(#[from] ReadError),
    #[error("its id has {len} bytes, at most {MOST_ID} are allowed")]
    LongId { len: usize },
}

fn with_short_id(mark: Mark) -> Result<Mark, Refusal> {
    match &mark {
        Mark::Start(Start { id: Some(id), .. }) | Mark::Stop(Some(id)) if id.len() > MOST_ID => {
            Err(Refusal::LongId { len: id.len() })
        }
        _ => Ok(mark),
    }
}

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
    pub fn parts(&self) -> Vec<Part<'_>> {
        vec![
            Part::new("marks on ~/init_roi", self.marks(&self.init_roi)),
            Part::new("marks on ~/init_detection", self.marks(&self.init_detection)),
            Part::new("the service ~/stop", self.answer(&self.stop, Command::Stop)),
            Part::new("the service ~/restart", self.answer(&self.restart, Command::Restart)),
        ]
    }

    async fn marks<M: Topic + DeserializeOwned>(&self, topic: &Subscription<M>)
    where
        Mark: for<'a> From<&'a M>,
    {
        let mut marks = Box::pin(topic.async_stream());
        let mut throttle = Throttle::default();
        while let Some(mark) = marks.next().await {
            let mark = mark.map_err(Refusal::from).and_then(|(mark, _)| with_short_id(Mark::from(&mark)));
            match mark {
                Ok(mark) => self.inbox.send(Command::Mark(mark)),
                Err(why) => {
                    if let Some(held) = throttle.pass(discriminant(&why), Instant::now()) {
                        error!("mark refused: {why}{}", held_back(held));
                    }
                }
            }
        }
    }

    /// Each request waits for the worker's answer, which comes between two frames, together with all others for the
    /// same.
    async fn answer(&self, service: &Trigger, command: impl Fn(Replies) -> Command) {
        let answer = |_| {
            let (reply, answer) = bounded(1);
            self.inbox.send(command(vec![reply]));
            async move {
                let message = "the node is shutting down".to_owned();
                answer.recv().await.unwrap_or(TriggerResponse { success: false, message })
            }
        };
        service.serve(answer).await;
    }
}
