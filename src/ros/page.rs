//! The node as the host of the live page: marks and stops go the way of those that come by topic, parameters that of
//! those that come by service.

use std::sync::Arc;

use log::info;
use smol::channel::{Receiver, Sender, bounded};

use super::convert::{Mark, Start};
use super::inbox::Inbox;
use super::parameters::Store;
use super::queue;
use crate::params::{Assignment, Params};
use crate::viewer::{self, Asked, Command, Host, Hub, ListenError, Listening};

/// Changes of parameters that wait at the same time.
const MOST_CHANGES: usize = 16;
const ENDS: &str = "the node is shutting down";

/// A change of a parameter, and who waits for what becomes of it.
pub struct Change {
    /// The parameter and its value.
    pub assignment: Assignment,
    /// Where the answer goes.
    pub answer: Sender<Result<(), String>>,
}

/// The live page, which is to be served.
pub struct LivePage {
    /// What it shows.
    pub hub: Hub,
    /// Its port.
    pub listening: Listening,
    /// Changes of parameters that are asked for there.
    pub changes: Receiver<Change>,
}

impl LivePage {
    /// Listens where the parameters say; `None` where they ask for no page.
    pub fn open(node: &str, inbox: &Arc<Inbox>, store: &Arc<Store>) -> Result<Option<Self>, ListenError> {
        let params = store.current().params.viewer.clone();
        if params.port == 0 {
            return Ok(None);
        }
        let (hub, (changes, asked)) = (Hub::default(), bounded(MOST_CHANGES));
        let host = PageHost { inbox: inbox.clone(), store: store.clone(), changes };
        let listening = viewer::listen(&params, node, hub.clone(), Arc::new(host))?;
        info!("live page: {}", listening.link);
        Ok(Some(Self { hub, listening, changes: asked }))
    }
}

/// What pages ask goes through this.
struct PageHost {
    inbox: Arc<Inbox>,
    store: Arc<Store>,
    changes: Sender<Change>,
}

impl Host for PageHost {
    fn params(&self) -> Params {
        self.store.current().params.clone()
    }

    fn ask(&self, command: Command) -> Asked {
        let done = |result: Result<(), String>| -> Asked { Box::pin(std::future::ready(result.map(|()| None))) };
        let send = |command| {
            self.inbox.send(command);
            done(Ok(()))
        };
        match command {
            Command::Mark { rect, id, stamp } => send(queue::Command::Mark(Mark::Start(Start { rect, id, stamp }))),
            Command::Stop(id) => send(queue::Command::Mark(Mark::Stop(id))),
            Command::Rename { id, to } => send(queue::Command::Rename { id, to }),
            Command::Hold { page, stamp } => done(self.inbox.hold(page, stamp)),
            Command::Release { page } => {
                self.inbox.release(page);
                done(Ok(()))
            }
            Command::Restart => {
                let (reply, answer) = bounded(1);
                self.inbox.send(queue::Command::Restart(vec![reply]));
                Box::pin(async move {
                    let answer = answer.recv().await.map_err(|_| ENDS.to_owned())?;
                    if answer.success { Ok(None) } else { Err(answer.message) }
                })
            }
            Command::Replay(_) => done(Err("there is no recording".to_owned())),
            Command::Set { name, value } => {
                let changes = self.changes.clone();
                Box::pin(async move {
                    let (answer, answered) = bounded(1);
                    let sent = changes.send(Change { assignment: (name, value), answer }).await;
                    sent.map_err(|_| ENDS.to_owned())?;
                    answered.recv().await.map_err(|_| ENDS.to_owned())?.map(|()| None)
                })
            }
        }
    }
}
