//! One service: its requests one after another, each answered once the client can hear it.

use std::collections::HashSet;
use std::time::Duration;

use futures::StreamExt;
use log::warn;
use ros2_client::{Gid, Message, RmwRequestId, Server};
use rustdds::{DomainParticipant, GUID};
use smol::Timer;

/// How long an answer waits for its client to be discovered.
const PATIENCE: Duration = Duration::from_millis(500);
/// How often it looks.
const INTERVAL: Duration = Duration::from_millis(5);
/// From the discovery of a client to the moment when answers reach it.
const SETTLING: Duration = Duration::from_millis(20);

/// A service offered by the node.
pub struct Service<Q: Message, A: Message> {
    pub(super) server: Server<Q, A>,
    pub(super) participant: DomainParticipant,
    /// The DDS name of the topic with the answers.
    pub(super) replies: String,
}

impl<Q, A> Service<Q, A>
where
    Q: Message + Clone + 'static,
    A: Message + Clone + 'static,
{
    /// Answers requests for ever.
    pub async fn serve(&self, mut answer: impl AsyncFnMut(Q) -> A) {
        let mut requests = self.server.receive_request_stream();
        let mut known = HashSet::new();
        while let Some(request) = requests.next().await {
            match request {
                Ok((id, request)) => {
                    let response = answer(request).await;
                    self.wait_for(&id, &mut known).await;
                    if let Err(why) = self.server.async_send_response(id, response).await {
                        warn!("a response could not be sent: {why}");
                    }
                }
                Err(why) => warn!("a request could not be read: {why}"),
            }
        }
    }

    /// Waits for a client that is new. Its request may come before it is known where it listens, and an answer sent
    /// then would be lost.
    async fn wait_for(&self, id: &RmwRequestId, known: &mut HashSet<Gid>) {
        if known.contains(&id.writer_gid) {
            return;
        }
        let client = GUID::from(id.writer_gid).prefix;
        for _ in 0..PATIENCE.as_millis() / INTERVAL.as_millis() {
            let readers = self.participant.discovered_readers();
            let mut topics = readers.iter().map(|r| &r.subscription_topic_data);
            if topics.any(|t| t.key().prefix == client && *t.topic_name() == self.replies) {
                // Clients that are gone are forgotten.
                let here = |gid: &Gid| {
                    readers.iter().any(|r| r.subscription_topic_data.key().prefix == GUID::from(*gid).prefix)
                };
                known.retain(here);
                Timer::after(SETTLING).await;
                known.insert(id.writer_gid);
                return;
            }
            Timer::after(INTERVAL).await;
        }
    }
}
