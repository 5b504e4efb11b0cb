//! One page's WebSocket.
//!
//! Nothing is queued for it. A picture is sent when the page has asked for one, and it asks when it has drawn the last
//! but one; figures and events are read from the hub when they are sent. So a page that stops reading holds one
//! message up, and is hung up on after a while.

use std::convert::Infallible;
use std::net::TcpStream;
use std::pin::Pin;
use std::rc::Rc;
use std::time::{Duration, Instant};

use async_tungstenite::WebSocketStream;
use async_tungstenite::tungstenite::protocol::{Role, WebSocketConfig};
use async_tungstenite::tungstenite::{Error, Message};
use futures::stream::FuturesUnordered;
use futures::{FutureExt as _, StreamExt as _};
use hyper::body::Bytes;
use log::debug;
use smol::channel::{Receiver, bounded};
use smol::future::or;
use smol::{Async, Timer};

use super::access::same;
use super::context::Context;
use super::hub::Known;
use super::protocol::{Asking, Incoming, Outgoing, Told};
use super::{Asked, Command, parameters};

/// Pages that are open at the same time.
const MOST_PAGES: usize = 8;
/// Bytes of a message from a page.
const MOST_MESSAGE: usize = 64 * 1024;
/// Messages from a page in each second; more wait.
const MOST_RATE: u32 = 200;
/// What a page may ask for before the first is done.
const MOST_ASKED: usize = 16;
/// Until the first message has come.
const GREETING: Duration = Duration::from_secs(5);
/// Until one who gave a wrong token is told so.
const PENANCE: Duration = Duration::from_secs(1);
/// Until a message has been taken.
const PATIENCE: Duration = Duration::from_secs(20);
/// From one sign of life to the next, and without one.
const PULSE: Duration = Duration::from_secs(15);
const SILENCE: Duration = Duration::from_secs(45);
/// From news to news, at least.
const PERIOD: Duration = Duration::from_millis(100);

type Socket = WebSocketStream<Async<TcpStream>>;
/// What is being done, and then its answer.
type Answering = Pin<Box<dyn Future<Output = Outgoing>>>;

/// Why a page is hung up on.
#[derive(Debug, thiserror::Error)]
enum End {
    #[error(transparent)]
    Socket(#[from] Error),
    #[error("it took no message for {} s", PATIENCE.as_secs())]
    Stuck,
    #[error("it gave no sign of life for {} s", SILENCE.as_secs())]
    Silent,
    #[error("it went away")]
    Gone,
    #[error("{0}")]
    Refused(String),
}

/// Serves a page until it goes away.
pub(super) async fn serve(stream: Async<TcpStream>, read: Vec<u8>, context: &Rc<Context>) {
    let config = WebSocketConfig::default()
        .max_message_size(Some(MOST_MESSAGE))
        .max_frame_size(Some(MOST_MESSAGE))
        .read_buffer_size(8 * 1024);
    let mut socket = WebSocketStream::from_partially_read(stream, read, Role::Server, Some(config)).await;
    let end = match greet(&mut socket, context).await {
        Ok(()) => converse(&mut socket, context).await,
        Err(end) => end,
    };
    debug!("live page: a page is closed: {end}");
    if let End::Refused(why) = end {
        context.tell(format_args!("a page was refused: {why}"));
        let asks_token = !context.token.is_empty();
        let _ = send(&mut socket, &Outgoing::Refused { why, asks_token }).await;
    }
    let _ = or(socket.close(None).map(drop), after(PENANCE)).await;
}

/// Lets in who knows the token.
async fn greet(socket: &mut Socket, context: &Context) -> Result<(), End> {
    let first = or(socket.next(), after(GREETING).map(|()| None)).await.ok_or(End::Gone)??;
    match incoming(&first)? {
        Some(Incoming::Enter { token }) if same(&token, &context.token) => Ok(()),
        Some(Incoming::Enter { .. }) => {
            Timer::after(PENANCE).await;
            Err(End::Refused("the token is wrong".to_owned()))
        }
        _ => Err(End::Refused("the first message must be {\"enter\": {\"token\": ...}}".to_owned())),
    }
}

/// What there is to do next.
enum Next {
    Message(Option<Result<Message, Error>>),
    Answer(Outgoing),
    News,
    Pulse,
}

/// A page that has been let in.
struct Page<'a> {
    context: &'a Context,
    number: u64,
    known: Known,
    /// What it asked for and is not done.
    asked: FuturesUnordered<Answering>,
    /// When it was told news last.
    told: Option<Instant>,
    /// When it was last heard, and what it has sent in the present second.
    heard: Instant,
    second: (Instant, u32),
}

/// Tells the others that it is gone, however that comes about.
struct Presence<'a>(&'a Context, u64);

impl Drop for Presence<'_> {
    fn drop(&mut self) {
        let Self(context, page) = *self;
        context.hub.leave(page);
        // It is done at once; nobody waits for it.
        let _ = context.host.ask(Command::Release { page }).now_or_never();
    }
}

async fn converse(socket: &mut Socket, context: &Context) -> End {
    let (wake, woken) = bounded(1);
    let entered = context.hub.enter(
        MOST_PAGES,
        Box::new(move || {
            // One that is full wakes the page as well.
            let _ = wake.try_send(());
        }),
    );
    let Some(number) = entered else {
        return End::Refused(format!("{MOST_PAGES} pages are open already"));
    };
    let _presence = Presence(context, number);
    let now = Instant::now();
    let mut page = Page {
        context,
        number,
        known: Known::default(),
        asked: FuturesUnordered::new(),
        told: None,
        heard: now,
        second: (now, 0),
    };
    match page.run(socket, &woken).await {
        Ok(never) => match never {},
        Err(end) => end,
    }
}

impl Page<'_> {
    async fn run(&mut self, socket: &mut Socket, woken: &Receiver<()>) -> Result<Infallible, End> {
        let hub = &self.context.hub;
        // What changes from now on is news.
        let before = self.context.host.params();
        let hello = Outgoing::Hello {
            title: self.context.title.clone(),
            version: env!("CARGO_PKG_VERSION"),
            now: hub.now(),
            rows: parameters::rows(),
            values: parameters::values(&before),
        };
        send(socket, &hello).await?;
        let mut pulse = Instant::now() + PULSE;
        loop {
            self.inform(socket).await?;
            match self.next(socket, woken, pulse).await {
                Next::Message(None) => return Err(End::Gone),
                Next::Message(Some(message)) => self.hear(&message?).await?,
                Next::Answer(answer) => send(socket, &answer).await?,
                Next::News => {}
                Next::Pulse if self.heard.elapsed() > SILENCE => return Err(End::Silent),
                Next::Pulse => {
                    pulse = Instant::now() + PULSE;
                    in_time(socket.send(Message::Ping(Default::default()))).await?;
                }
            }
        }
    }

    /// Sends the picture that the page waits for, and news.
    async fn inform(&mut self, socket: &mut Socket) -> Result<(), End> {
        let hub = &self.context.hub;
        if let Some(picture) = hub.picture(self.number, self.known.picture) {
            self.known.picture = picture.number;
            in_time(socket.send(Message::Binary(Bytes::from_owner(picture.message)))).await?;
        }
        if self.told.is_none_or(|at| at.elapsed() >= PERIOD) {
            let news = hub.news(&mut self.known);
            if let Some(told) = Told::new(news, hub.now(), &*self.context.host) {
                self.told = Some(Instant::now());
                send(socket, &Outgoing::News(told)).await?;
            }
        }
        Ok(())
    }

    async fn next(&mut self, socket: &mut Socket, woken: &Receiver<()>, pulse: Instant) -> Next {
        // An empty set would end at once.
        let is_asked = !self.asked.is_empty();
        let answer = async {
            match self.asked.next().await.filter(|_| is_asked) {
                Some(answer) => Next::Answer(answer),
                None => std::future::pending().await,
            }
        };
        let due = self.told.map(|at| at + PERIOD).filter(|at| *at > Instant::now());
        let news = async {
            let _ = woken.recv().await;
            Next::News
        };
        let timer = async {
            match due {
                Some(at) if at < pulse => drop(Timer::at(at).await),
                _ => {
                    Timer::at(pulse).await;
                    return Next::Pulse;
                }
            }
            Next::News
        };
        // In turns, so that none of them keeps the others waiting.
        let heard = socket.next().map(Next::Message);
        smol::future::race(smol::future::race(heard, answer), smol::future::race(news, timer)).await
    }

    async fn hear(&mut self, message: &Message) -> Result<(), End> {
        self.heard = Instant::now();
        self.slow_down().await;
        match incoming(message)? {
            None => {}
            Some(Incoming::Look { side }) => self.context.hub.wish(self.number, side),
            Some(Incoming::Ask { number, command }) => self.ask(number, command),
            Some(Incoming::Enter { .. }) => return Err(End::Refused("it has entered already".to_owned())),
        }
        Ok(())
    }

    /// Waits for the next second where the page has sent too much in this one.
    async fn slow_down(&mut self) {
        let (began, count) = self.second;
        let age = began.elapsed();
        if age >= Duration::from_secs(1) {
            self.second = (Instant::now(), 1);
        } else if count >= MOST_RATE {
            Timer::after(Duration::from_secs(1) - age).await;
            self.second = (Instant::now(), 1);
        } else {
            self.second.1 += 1;
        }
    }

    fn ask(&mut self, number: u64, asking: Asking) {
        let done = move |error: Option<String>, file| Outgoing::Answer { number, error, file };
        let host = &self.context.host;
        let answer: Answering = if let Asking::Save {} = asking {
            let file = parameters::file(&host.params());
            Box::pin(std::future::ready(done(None, Some(file))))
        } else if self.asked.len() >= MOST_ASKED {
            Box::pin(std::future::ready(done(Some(format!("{MOST_ASKED} requests wait already")), None)))
        } else {
            let asked: Asked = match asking.command(self.number) {
                Ok(command) => host.ask(command),
                Err(why) => Box::pin(std::future::ready(Err(why))),
            };
            Box::pin(asked.map(move |result| match result {
                Ok(file) => done(None, file),
                Err(why) => done(Some(why), None),
            }))
        };
        self.asked.push(answer);
    }
}

/// What the message says; `None` where it is only a sign of life.
fn incoming(message: &Message) -> Result<Option<Incoming>, End> {
    match message {
        Message::Text(text) => match serde_json::from_str(text) {
            Ok(incoming) => Ok(Some(incoming)),
            Err(why) => Err(End::Refused(format!("a message was not understood: {why}"))),
        },
        Message::Binary(data) => Err(End::Refused(format!("a message of {} bytes was not understood", data.len()))),
        Message::Close(_) => Err(End::Gone),
        Message::Ping(_) | Message::Pong(_) | Message::Frame(_) => Ok(None),
    }
}

async fn send(socket: &mut Socket, message: &Outgoing) -> Result<(), End> {
    // Nothing in these messages cannot be written as JSON.
    let text = serde_json::to_string(message).map_err(|why| End::Refused(why.to_string()))?;
    in_time(socket.send(Message::text(text))).await
}

async fn in_time(sent: impl Future<Output = Result<(), Error>>) -> Result<(), End> {
    or(sent.map(|sent| sent.map_err(End::from)), after(PATIENCE).map(|()| Err(End::Stuck))).await
}

async fn after(time: Duration) {
    Timer::after(time).await;
}
