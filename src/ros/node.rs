//! The node as a whole: puts its parts together, starts their threads, and takes it all down at a signal.

use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

use futures::FutureExt as _;
use log::{error, info, warn};
use ros2_client::{Name, Node};
use smol::channel::{Receiver, Sender, bounded};

use super::args::Args;
use super::clock::SimTime;
use super::commands::Commands;
use super::debug::{DebugView, Feed};
use super::decoder::{Decoder, Slot};
use super::diagnostics::Diagnostics;
use super::endpoints::Endpoints;
use super::env::{self, Environment};
use super::fault::Fault;
use super::graph::Graph;
use super::inbox::Inbox;
use super::intake::Intake;
use super::logging;
use super::names::Names;
use super::page::LivePage;
use super::parameter_services::ParameterServices;
use super::parameters::{NodeSettings, Store};
use super::part::{Part, first_to_end};
use super::receive::{ImageSource, Receive};
use super::stats::Stats;
use super::supervisor::Supervisor;
use super::worker::Worker;
use crate::loader::Loaded;
use crate::params::{ImageTransport, NodeName};
use crate::session::Session;

/// Runs the node until a signal comes.
pub fn run(args: Args) -> Result<(), Fault> {
    let names = Names::new(NodeName::default(), args.rules.clone())?;
    logging::start(&args, names.node());
    let environment = Environment::read(args.enclave.as_deref())?;
    for line in &environment.warnings {
        warn!("{line}");
    }
    let image_topic = names.topic("image")?;
    let settings = NodeSettings::new(&image_topic.to_string()).load(&args.parameters, names.node())?;
    // It is there before anything that may hang or grow, so that a signal always ends the node.
    let supervisor = Supervisor::start(settings.params.limits.memory_mb.unsigned_abs())?;
    if let Some(warning) = env::buffer_warning() {
        warn!("{warning}");
    }

    let source_topic = match settings.params.general.image_transport {
        ImageTransport::Raw => image_topic,
        ImageTransport::Compressed => names.transported("image", "compressed")?,
    };
    let loaded = Loaded::new(&settings.params)?;
    let name = names.node().full();
    let core = Core::new(settings, loaded, &name)?;
    let endpoints = Endpoints::new(environment.context()?, names)?;
    let threads = Threads::start(endpoints, &source_topic, core, &supervisor)?;
    info!("{name} waits for images on {source_topic}");
    let reason = supervisor.wait();
    if let Err(fault) = &reason {
        error!("{fault}");
    }
    threads.stop();
    reason
}

/// What there is of the node before it is seen by others.
struct Core {
    inbox: Arc<Inbox>,
    session: Session,
    store: Arc<Store>,
    page: Option<LivePage>,
}

impl Core {
    fn new(settings: NodeSettings, loaded: Loaded, name: &str) -> Result<Self, Fault> {
        let inbox = Arc::new(Inbox::new(&settings.params));
        let session = Session::with_networks(settings.params.clone(), loaded.networks());
        let store = Arc::new(Store::new(settings, loaded));
        let page = LivePage::open(name, &inbox, &store)?;
        Ok(Self { inbox, session, store, page })
    }
}

/// The running threads, and how to end them.
struct Threads {
    handles: Vec<JoinHandle<()>>,
    inbox: Arc<Inbox>,
    feed: Feed,
    stats: Arc<Stats>,
    node: Arc<Mutex<Node>>,
    /// Dropped to end what waits for the network.
    open: Sender<()>,
}

impl Threads {
    fn start(mut endpoints: Endpoints, topic: &Name, core: Core, supervisor: &Supervisor) -> Result<Self, Fault> {
        let (Core { inbox, session, store, page }, stats) = (core, Arc::new(Stats::default()));
        let settings = store.current();
        let (open, closed) = bounded(1);
        let qos = settings.image_qos();
        let transport = settings.params.general.image_transport;
        let most = settings.params.limits.image_bytes();
        let hub = page.as_ref().map(|page| page.hub.clone());
        let packed = Arc::new(Slot::default());
        let decoder = Decoder {
            slot: packed.clone(),
            intake: Intake::new(inbox.clone(), stats.clone(), topic.to_string()),
            most,
        };
        let receive = Receive {
            source: match transport {
                ImageTransport::Raw => ImageSource::Raw(endpoints.images(topic, qos)?),
                ImageTransport::Compressed => ImageSource::Compressed(endpoints.images(topic, qos)?, packed.clone()),
            },
            topic: topic.clone(),
            qos,
            context: endpoints.context.clone(),
            inbox: inbox.clone(),
            stats: stats.clone(),
            page: hub.clone(),
            end: closed.clone(),
        };
        let (listening, changes) = page.map(|page| (page.listening, (page.hub, page.changes))).unzip();
        let tracks = endpoints.publisher("~/tracks")?;
        let detections = endpoints.publisher("~/detections")?;
        let views =
            (DebugView::new(&mut endpoints, "~/debug/image")?, DebugView::new(&mut endpoints, "~/debug/response")?);
        let commands = Commands::new(&mut endpoints, inbox.clone())?;
        let parameters = ParameterServices::new(&mut endpoints, store.clone(), inbox.clone(), changes)?;
        let diagnostics = Diagnostics::new(&mut endpoints, topic, stats.clone(), hub.clone())?;
        let graph = Graph::new(&mut endpoints)?;
        logging::to_rosout(endpoints.node.logging_handle());
        let node = Arc::new(Mutex::new(endpoints.node));
        let sim_time = SimTime { node: node.clone(), store };
        let feed = Feed::new(views.0, views.1, hub.clone());
        let worker = Worker {
            inbox: inbox.clone(),
            session,
            tracks,
            detections,
            debug: feed.clone(),
            page: hub,
            stats: stats.clone(),
        };
        let ended = closed.clone();
        let spin = move || {
            let mut parts = vec![
                Part::new("discovery", graph.watch()),
                Part::new("the clock", sim_time.follow()),
                Part::new("diagnostics", diagnostics.serve()),
            ];
            parts.extend(commands.parts());
            parts.extend(parameters.parts());
            let ended = async { Some(format!("{} ended", first_to_end(parts).await)) };
            smol::block_on(smol::future::or(ended, until(&closed)))
        };
        let draw = feed.clone();
        supervisor.watch_library();
        let mut handles = vec![
            supervisor.spawn("spin", spin)?,
            supervisor.spawn("worker", move || {
                worker.run();
                None
            })?,
            supervisor.spawn("debug", move || {
                draw.run();
                None
            })?,
            supervisor.spawn("receive", move || {
                receive.run();
                None
            })?,
        ];
        if let Some(listening) = listening {
            handles.push(supervisor.spawn("viewer", move || {
                listening.run(until(&ended).map(drop));
                None
            })?);
        }
        if transport == ImageTransport::Compressed {
            handles.push(supervisor.spawn("decode", move || {
                decoder.run();
                None
            })?);
        }
        Ok(Self { handles, inbox, feed, stats, node, open })
    }

    /// Ends all threads, waits for them, and takes the node off the network.
    fn stop(self) {
        let Self { handles, inbox, feed, stats, node, open } = self;
        inbox.close();
        feed.close();
        drop(open);
        for handle in handles {
            // A thread that panicked has told so, and why the node ends is known.
            let _ = handle.join();
        }
        info!("{stats}");
        logging::end();
        // With its last owner the node says goodbye to the others.
        drop((feed, node));
    }
}

/// Nothing more than the end of the node.
async fn until(closed: &Receiver<()>) -> Option<String> {
    let _ = closed.recv().await;
    None
}
