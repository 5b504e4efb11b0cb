//! What the node must know of the others: who subscribes to what is costly to make, and which other node bears its
//! name.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use futures::StreamExt;
use log::warn;
use ros2_client::builtin_topics::ros_discovery;
use ros2_client::{Gid, Subscription};
use rustdds::{DomainParticipant, RTPSEntity, Topic, TopicDescription, TopicKind};
use serde::Deserialize;

use super::endpoints::Endpoints;
use super::fault::Fault;
use super::logging::{Throttle, held_back};
use crate::params::NodeName;

/// How often subscribers are counted.
const PERIOD: Duration = Duration::from_millis(200);
/// How many other nodes of our name are told apart.
const MOST_NAMESAKES: usize = 64;

/// Whether somebody subscribes to a topic.
#[derive(Debug, Clone)]
pub struct Watched(Arc<Watch>);

#[derive(Debug)]
struct Watch {
    topic: String,
    kind: String,
    is_watched: AtomicBool,
}

impl Watched {
    /// A topic to which nobody subscribes yet.
    pub fn new(topic: &Topic) -> Self {
        let kind = topic.get_type().name().to_owned();
        Self(Arc::new(Watch { topic: topic.name(), kind, is_watched: AtomicBool::new(false) }))
    }

    /// Whether somebody subscribes.
    pub fn get(&self) -> bool {
        self.0.is_watched.load(Relaxed)
    }
}

/// `rmw_dds_common/msg/ParticipantEntitiesInfo`: the nodes of a participant.
#[derive(Debug, Deserialize)]
struct Participant {
    gid: Gid,
    nodes: Vec<NodeInfo>,
}

/// `rmw_dds_common/msg/NodeEntitiesInfo`
#[derive(Debug, Deserialize)]
struct NodeInfo {
    namespace: String,
    name: String,
    // To be read over.
    _readers: Vec<Gid>,
    _writers: Vec<Gid>,
}

/// Watches the others.
pub struct Graph {
    participant: DomainParticipant,
    participants: Subscription<Participant>,
    own: NodeName,
    watched: Vec<Watched>,
}

impl Graph {
    /// Watches for the topics of these endpoints.
    pub fn new(endpoints: &mut Endpoints) -> Result<Self, Fault> {
        let participant = endpoints.context.domain_participant();
        let failed = |why: String| Fault::system("see the nodes of others", why);
        let (name, kind) = (ros_discovery::TOPIC_NAME.to_owned(), ros_discovery::TYPE_NAME.to_owned());
        let topic = participant.create_topic(name, kind, &ros_discovery::QOS_PUB, TopicKind::NoKey);
        let topic = topic.map_err(|why| failed(why.to_string()))?;
        let participants = endpoints.node.create_subscription(&topic, None).map_err(|why| failed(why.to_string()))?;
        let own = endpoints.names.node().clone();
        Ok(Self { participant, participants, own, watched: endpoints.watched.clone() })
    }

    /// Watches until either half of it ends, which none should.
    pub async fn watch(&self) {
        smol::future::or(self.count(), self.compare_names()).await;
    }

    async fn count(&self) {
        let mut looks = smol::Timer::interval(PERIOD);
        while looks.next().await.is_some() {
            let readers = self.participant.discovered_readers();
            for Watched(watch) in &self.watched {
                let is_watched = readers
                    .iter()
                    .map(|reader| &reader.subscription_topic_data)
                    .any(|reader| *reader.topic_name() == watch.topic && *reader.type_name() == watch.kind);
                watch.is_watched.store(is_watched, Relaxed);
            }
        }
    }

    /// Tells of each other node that bears our name, when it appears.
    async fn compare_names(&self) {
        let own = Gid::from(self.participant.guid());
        let mut throttle = Throttle::default();
        let mut namesakes = Vec::new();
        let mut messages = Box::pin(self.participants.async_stream());
        while let Some(message) = messages.next().await {
            // What cannot be read names no node.
            let Ok((other, _)) = message else { continue };
            let is_namesake = other.gid != own && other.nodes.iter().any(|node| self.is_own(node));
            let known = namesakes.iter().position(|gid| *gid == other.gid);
            match known {
                Some(at) if !is_namesake => {
                    namesakes.swap_remove(at);
                }
                None if is_namesake => {
                    namesakes.truncate(MOST_NAMESAKES - 1);
                    namesakes.push(other.gid);
                    if let Some(held) = throttle.pass((), Instant::now()) {
                        let name = self.own.full();
                        warn!(
                            "another node is also named {name}: either may answer its services and parameters, and \
                             tools show only one; rename one with -r __node:=NAME or -r \
                             __ns:=/NAMESPACE{}",
                            held_back(held)
                        );
                    }
                }
                _ => {}
            }
        }
    }

    fn is_own(&self, node: &NodeInfo) -> bool {
        node.name == self.own.name && node.namespace == self.own.namespace
    }
}
