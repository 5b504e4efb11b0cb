//! The node as a whole: puts its parts together, starts their threads, and takes it all down at a signal.

use std::sync::Arc;
use std::thread::{Builder, JoinHandle};

use log::{error, info, warn};
use ros2_client::{Name, Node};
use smol::channel::{Receiver, Sender, bounded, unbounded};

use super::args::Args;
use super::commands::Commands;
use super::debug::{Feed, View};
use super::diagnostics::Diagnostics;
use super::endpoints::Endpoints;
use super::env::{self, Environment};
use super::fault::Fault;
use super::inbox::Inbox;
use super::logging;
use super::names::Names;
use super::parameter_services::ParameterServices;
use super::parameters::{Settings, Store};
use super::receive::{Receive, Source};
use super::stats::Stats;
use super::worker::Worker;
use crate::params::{ImageTransport, NodeName};
use crate::session::Session;

/// Why the node ends.
enum End {
    Signal,
    Thread(&'static str),
}

/// Runs the node until a signal comes.
pub fn run(args: Args) -> Result<(), Fault> {
    let names = Names::new(NodeName::default(), args.rules.clone())?;
    logging::start(&args, names.node());
    let environment = Environment::read()?;
    let image_topic = names.topic("image")?;
    let settings = Settings::new(&image_topic.to_string()).load(&args.parameters, names.node())?;
    if let Some(warning) = env::buffer_warning() {
        warn!("{warning}");
    }

    let source_topic = match settings.params.general.image_transport {
        ImageTransport::Raw => image_topic,
        ImageTransport::Compressed => names.transported("image", "compressed")?,
    };
    let session = Session::new(settings.params.clone())?;
    // The handler is there before the node is, so that a signal always ends in an orderly way.
    let (ended, end) = unbounded();
    let signalled = ended.clone();
    ctrlc::set_handler(move || drop(signalled.try_send(End::Signal)))
        .map_err(|e| Fault::system("handle signals", e))?;

    let name = names.node().full();
    let threads =
        Threads::start(Endpoints::new(environment.context()?, names)?, &source_topic, session, settings, ended)?;
    info!("{name} waits for images on {source_topic}");
    let reason = end.recv_blocking();
    threads.stop();
    match reason {
        Ok(End::Thread(name)) => Err(Fault::Thread(name)),
        Ok(End::Signal) | Err(_) => Ok(()),
    }
}

/// The running threads, and how to end them.
struct Threads {
    handles: Vec<JoinHandle<()>>,
    inbox: Arc<Inbox>,
    feed: Feed,
    stats: Arc<Stats>,
    node: Arc<Node>,
    /// Dropped to end what waits for the network.
    open: Sender<()>,
}

impl Threads {
    fn start(
        mut endpoints: Endpoints,
        topic: &Name,
        session: Session,
        settings: Settings,
        ended: Sender<End>,
    ) -> Result<Self, Fault> {
        let (inbox, stats) = (Arc::new(Inbox::default()), Arc::new(Stats::default()));
        let (open, closed) = bounded(1);
        inbox.limit_history(&settings.params.history);
        let qos = settings.image_qos();
        let receive = Receive {
            source: match settings.params.general.image_transport {
                ImageTransport::Raw => Source::Raw(endpoints.images(topic, qos)?),
                ImageTransport::Compressed => Source::Compressed(endpoints.images(topic, qos)?),
            },
            topic: topic.clone(),
            qos,
            context: endpoints.context.clone(),
            inbox: inbox.clone(),
            stats: stats.clone(),
            end: closed.clone(),
        };
        let store = Arc::new(Store::new(settings).with_networks(session.networks()));
        let tracks = endpoints.publisher("~/tracks")?;
        let detections = endpoints.publisher("~/detections")?;
        let views = (View::new(&mut endpoints, "~/debug/image")?, View::new(&mut endpoints, "~/debug/response")?);
        let commands = Commands::new(&mut endpoints, inbox.clone())?;
        let parameters = ParameterServices::new(&mut endpoints, store, inbox.clone())?;
        let diagnostics = Diagnostics::new(&mut endpoints, topic, stats.clone())?;
        let spinner = endpoints.node.spinner().map_err(|e| Fault::system("spin the node", e))?;
        let node = Arc::new(endpoints.node);
        logging::to_rosout(node.logging_handle());
        let feed = Feed::new(node.clone(), views.0, views.1);
        let worker =
            Worker { inbox: inbox.clone(), session, tracks, detections, debug: feed.clone(), stats: stats.clone() };
        let spin = move || {
            let work = async {
                let served = futures::join!(spinner.spin(), commands.serve(), parameters.serve(), diagnostics.serve());
                if let Err(why) = served.0 {
                    error!("discovery ended: {why}");
                }
            };
            smol::block_on(smol::future::or(work, until(&closed)));
        };
        let draw = feed.clone();
        let mut threads = Self { handles: Vec::new(), inbox, feed, stats, node, open };
        threads.spawn("spin", &ended, spin)?;
        threads.spawn("worker", &ended, move || worker.run())?;
        threads.spawn("debug", &ended, move || draw.run())?;
        threads.spawn("receive", &ended, move || receive.run())?;
        Ok(threads)
    }

    /// Starts a thread whose end, by panic or not, ends the node.
    fn spawn(
        &mut self,
        name: &'static str,
        ended: &Sender<End>,
        body: impl FnOnce() + Send + 'static,
    ) -> Result<(), Fault> {
        let guard = Guard(name, ended.clone());
        let thread = Builder::new().name(name.to_owned()).spawn(move || {
            let _guard = guard;
            body();
        });
        self.handles.push(thread.map_err(|e| Fault::system(format!("start the {name} thread"), e))?);
        Ok(())
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

/// Tells when a thread ends.
struct Guard(&'static str, Sender<End>);

impl Drop for Guard {
    fn drop(&mut self) {
        let _ = self.1.try_send(End::Thread(self.0));
    }
}

async fn until(closed: &Receiver<()>) {
    let _ = closed.recv().await;
}
