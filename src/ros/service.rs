//! One service: each request is answered once the client can hear it.

use std::cell::RefCell;
use std::collections::HashSet;
use std::future::Future;
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
/// Requests that are worked on at the same time, that wait in the library, and answers that it keeps until they are
/// received: a burst of so many gets all its answers.
pub(super) const MOST_REQUESTS: usize = 64;

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
    /// Answers requests for ever. They are given to `answer` one after another, in the order of their arrival; what it
    /// waits for, and a client that is not known yet, hold up no other request.
    pub async fn serve<F: Future<Output = A>>(&self, mut answer: impl FnMut(Q) -> F) {
        let known = RefCell::default();
        let respond = |request| {
            let request = match request {
                Ok((id, request)) => Some((id, answer(request))),
                Err(why) => {
                    warn!("a request could not be read: {why}");
                    None
                }
            };
            let known = &known;
            async move {
                let Some((id, response)) = request else { return };
                let response = response.await;
                self.wait_for(&id, known).await;
                if let Err(why) = self.server.async_send_response(id, response).await {
                    warn!("a response could not be sent: {why}");
                }
            }
        };
        self.server.receive_request_stream().for_each_concurrent(MOST_REQUESTS, respond).await;
    }

    /// Waits for a client that is new. Its request may come before it is known where it listens, and an answer sent
    /// then would be lost.
    async fn wait_for(&self, id: &RmwRequestId, known: &RefCell<HashSet<Gid>>) {
        if known.borrow().contains(&id.writer_gid) {
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
                known.borrow_mut().retain(here);
                Timer::after(SETTLING).await;
                known.borrow_mut().insert(id.writer_gid);
                return;
            }
            Timer::after(INTERVAL).await;
        }
    }
}
