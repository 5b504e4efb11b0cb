//! Topics and services, with absolute names and their quality of service.

use ros2_client::qos::{History, WhenFull};
use ros2_client::{
    Context, Message, Name, Node, NodeName, NodeOptions, Publisher, QosProfile, ServiceMapping, ServiceTypeName,
    Subscription,
};
use rustdds::{QosPolicies, TopicKind, policy};

use super::fault::Fault;
use super::graph::Watched;
use super::image_qos::ImageQos;
use super::messages::Topic;
use super::names::Names;
use super::service::{MOST_REQUESTS, Service};

/// How many small messages are kept for a peer that lags.
const DEPTH: usize = 10;

/// How many pictures are kept for a peer that lags.
const PICTURES: i32 = 4;

/// A node on the network, and what its things are called.
pub struct Endpoints {
    /// The participant.
    pub context: Context,
    /// The node of the ROS 2 library.
    pub node: Node,
    /// The rules for names.
    pub names: Names,
    /// The topics that are made only while somebody subscribes.
    pub watched: Vec<Watched>,
    dds_name: NodeName,
}

impl Endpoints {
    /// Puts the node on the network, without parameter services: [`parameter_services`](super::parameter_services)
    /// has better ones.
    pub fn new(context: Context, names: Names) -> Result<Self, Fault> {
        let own = names.node();
        let failed = |why: String| Fault::system(format!("create node {}", own.full()), why);
        let dds_name = NodeName::new(&own.namespace, &own.name).map_err(|e| failed(e.to_string()))?;
        let options = NodeOptions::new().start_parameter_services(false);
        let node = context.new_node(dds_name.clone(), options).map_err(|e| failed(e.to_string()))?;
        Ok(Self { context, node, names, watched: Vec::new(), dds_name })
    }

    /// Reads images.
    pub fn images<M: Topic>(&mut self, name: &Name, qos: ImageQos) -> Result<Subscription<M>, Fault> {
        let topic = self.dds_topic::<M>(name, &qos.policies())?;
        self.node.create_subscription(&topic, None).map_err(|e| Fault::system(format!("subscribe to {name}"), e))
    }

    /// A topic with a quality of service that the ROS 2 library has no words for.
    fn dds_topic<M: Topic>(&self, name: &Name, qos: &QosPolicies) -> Result<rustdds::Topic, Fault> {
        let dds_name = name.to_dds_name("rt", &self.dds_name, "");
        self.context
            .domain_participant()
            .create_topic(dds_name, M::type_name().dds_msg_type(), qos, TopicKind::NoKey)
            .map_err(|e| Fault::system(format!("make topic {name}"), e))
    }

    /// Reads small messages, none of which may be lost.
    pub fn subscription<M: Topic>(&mut self, name: &str) -> Result<Subscription<M>, Fault> {
        let name = self.names.topic(name)?;
        let failed = |e: ros2_client::CreateError| Fault::system(format!("subscribe to {name}"), e);
        let topic = self.node.create_topic(&name, M::type_name(), &reliable(DEPTH)).map_err(failed)?;
        self.node.create_subscription(&topic, None).map_err(failed)
    }

    /// Writes small messages. A reader that is stuck never blocks the writer.
    pub fn publisher<M: Topic>(&mut self, name: &str) -> Result<Publisher<M>, Fault> {
        self.writer(name, reliable(DEPTH))
    }

    /// Writes pictures to whoever looks, reliably to those who ask for it. As few are kept for them as can be, so that
    /// one that is stuck neither blocks the writer nor lets memory grow.
    pub fn image_publisher<M: Topic>(&mut self, name: &str) -> Result<(Publisher<M>, Watched), Fault> {
        let limits =
            policy::ResourceLimits { max_samples: PICTURES, max_instances: 1, max_samples_per_instance: PICTURES };
        let qos = QosPolicies::builder()
            .reliability(policy::Reliability::Reliable { max_blocking_time: rustdds::Duration::ZERO })
            .durability(policy::Durability::Volatile)
            .history(policy::History::KeepLast { depth: 1 })
            .resource_limits(limits)
            .build();
        let name = self.names.topic(name)?;
        let topic = self.dds_topic::<M>(&name, &qos)?;
        let watched = Watched::new(&topic);
        self.watched.push(watched.clone());
        let publisher = self.node.create_publisher(&topic, None);
        Ok((publisher.map_err(|e| Fault::system(format!("publish on {name}"), e))?, watched))
    }

    fn writer<M: Topic>(&mut self, name: &str, qos: QosProfile) -> Result<Publisher<M>, Fault> {
        let name = self.names.topic(name)?;
        let failed = |e: ros2_client::CreateError| Fault::system(format!("publish on {name}"), e);
        let topic = self.node.create_topic(&name, M::type_name(), &qos).map_err(failed)?;
        self.node.create_publisher(&topic, None).map_err(failed)
    }

    /// Offers a service.
    pub fn server<Q, A>(&mut self, name: &str, kind: &ServiceTypeName) -> Result<Service<Q, A>, Fault>
    where
        Q: Message + Clone + 'static,
        A: Message + Clone + 'static,
    {
        let name = self.names.service(name)?;
        let server = self
            .node
            .create_server(ServiceMapping::Enhanced, &name, kind, reliable(MOST_REQUESTS), reliable(MOST_REQUESTS))
            .map_err(|e| Fault::system(format!("offer service {name}"), e))?;
        let replies = name.to_dds_name("rr", &self.dds_name, "Reply");
        Ok(Service { server, participant: self.context.domain_participant(), replies })
    }
}

fn reliable(depth: usize) -> QosProfile {
    QosProfile::publisher_default().reliability_reliable(WhenFull::Fail).history(History::KeepLast { depth })
}
