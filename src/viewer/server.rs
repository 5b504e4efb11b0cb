//! HTTP: the page's files, and the way to its WebSocket.

use std::cell::Cell;
use std::convert::Infallible;
use std::net::{IpAddr, TcpListener, TcpStream};
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use async_tungstenite::tungstenite::handshake::derive_accept_key;
use hyper::body::Incoming;
use hyper::header::{
    ALLOW, CACHE_CONTROL, CONNECTION, CONTENT_SECURITY_POLICY, CONTENT_TYPE, HeaderMap, HeaderName, HeaderValue,
    REFERRER_POLICY, SEC_WEBSOCKET_ACCEPT, SEC_WEBSOCKET_KEY, SEC_WEBSOCKET_VERSION, UPGRADE, X_CONTENT_TYPE_OPTIONS,
    X_FRAME_OPTIONS,
};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::upgrade::{self, OnUpgrade};
use hyper::{Method, Request, Response, StatusCode};
use log::{debug, warn};
use smol::{Async, LocalExecutor, Timer};
use smol_hyper::rt::FuturesIo;

use super::access::Names;
use super::context::Context;
use super::socket;
use super::{Host, Hub};

/// Connections at the same time, of which a page needs a few while it loads and then one.
const MOST_CONNECTIONS: usize = 32;
/// Until a request has been read and answered.
const PATIENCE: Duration = Duration::from_secs(10);
/// Bytes and number of headers.
const MOST_HEADER: usize = 16 * 1024;
const MOST_HEADERS: usize = 64;
/// Until connections are taken again after one could not be.
const PAUSE: Duration = Duration::from_millis(100);

/// Only what comes from this server may run, be shown or be asked.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src blob: data:; \
                      connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
const HTML: &str = "text/html; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";
const STYLE: &str = "text/css; charset=utf-8";
const TEXT: &str = "text/plain; charset=utf-8";
const SOCKET: &str = "/live";

/// The page's files: path, type and text.
const FILES: [(&str, &str, &str); 10] = [
    ("/", HTML, include_str!("page/index.html")),
    ("/style.css", STYLE, include_str!("page/style.css")),
    ("/app.js", SCRIPT, include_str!("page/app.js")),
    ("/link.js", SCRIPT, include_str!("page/link.js")),
    ("/picture.js", SCRIPT, include_str!("page/picture.js")),
    ("/replay.js", SCRIPT, include_str!("page/replay.js")),
    ("/marks.js", SCRIPT, include_str!("page/marks.js")),
    ("/targets.js", SCRIPT, include_str!("page/targets.js")),
    ("/story.js", SCRIPT, include_str!("page/story.js")),
    ("/tuning.js", SCRIPT, include_str!("page/tuning.js")),
];

/// Listens, and serves once it runs.
pub(super) struct Server {
    listener: TcpListener,
    title: String,
    token: String,
    hub: Hub,
    host: Arc<dyn Host>,
}

impl Server {
    pub(super) fn new(listener: TcpListener, title: String, token: String, hub: Hub, host: Arc<dyn Host>) -> Self {
        Self { listener, title, token, hub, host }
    }

    /// Serves on this thread until `end` gives something; then all connections are closed.
    pub(super) fn run(self, end: impl Future<Output = ()>) {
        let Self { listener, title, token, hub, host } = self;
        let address = listener.local_addr().map_or(IpAddr::from([127, 0, 0, 1]), |at| at.ip());
        let names = Names::of(address);
        let context = Rc::new(Context { title, token, hub, host, names, told: Cell::default() });
        let executor = LocalExecutor::new();
        let serve = async {
            match Async::new(listener) {
                Ok(listener) => accept(&executor, &listener, &context).await,
                Err(why) => warn!("the live page cannot be served: {why}"),
            }
            std::future::pending().await
        };
        smol::block_on(executor.run(smol::future::or(end, serve)));
    }
}

async fn accept(executor: &LocalExecutor<'_>, listener: &Async<TcpListener>, context: &Rc<Context>) {
    let open = Rc::new(());
    loop {
        match listener.accept().await {
            // Whoever is too many is hung up on.
            Ok(_) if Rc::strong_count(&open) > MOST_CONNECTIONS => {
                context.tell(format_args!("more than {MOST_CONNECTIONS} connections: the newest is closed"));
            }
            Ok((stream, _)) => {
                let (context, held) = (context.clone(), open.clone());
                executor
                    .spawn(async move {
                        connection(stream, context).await;
                        drop(held);
                    })
                    .detach();
            }
            Err(why) => {
                context.tell(format_args!("a connection cannot be taken: {why}"));
                Timer::after(PAUSE).await;
            }
        }
    }
}

/// One request, and the WebSocket that it may open.
async fn connection(stream: Async<TcpStream>, context: Rc<Context>) {
    // Small messages are to go at once; where that cannot be had, they go a little later.
    let _ = stream.get_ref().set_nodelay(true);
    let opened = Upgrade::default();
    let service = service_fn(|request: Request<Incoming>| {
        let answer = answer(request, &context, &opened);
        async move { Ok::<_, Infallible>(answer) }
    });
    let mut http = http1::Builder::new();
    http.max_buf_size(MOST_HEADER).max_headers(MOST_HEADERS);
    let served = http.serve_connection(FuturesIo::new(stream), service).with_upgrades();
    let in_time = async {
        Timer::after(PATIENCE).await;
        debug!("live page: a request took too long");
    };
    let served = async {
        if let Err(why) = served.await {
            debug!("live page: {why}");
        }
    };
    smol::future::or(served, in_time).await;
    let Some(upgrade) = opened.take() else { return };
    match upgraded(upgrade).await {
        Some((stream, read)) => socket::serve(stream, read, &context).await,
        None => debug!("live page: a WebSocket was not opened"),
    }
}

/// The stream behind an upgraded connection, and what was read of it already.
async fn upgraded(upgrade: OnUpgrade) -> Option<(Async<TcpStream>, Vec<u8>)> {
    let parts = upgrade.await.ok()?.downcast::<FuturesIo<Async<TcpStream>>>().ok()?;
    Some((parts.io.into_inner(), parts.read_buf.to_vec()))
}

type Upgrade = Rc<Cell<Option<OnUpgrade>>>;

fn answer(mut request: Request<Incoming>, context: &Context, opened: &Upgrade) -> Response<String> {
    let opens_socket = request.uri().path() == SOCKET;
    if let Err(why) = context.names.check(request.headers(), opens_socket) {
        context.tell(format_args!("a request was refused: {why}"));
        return response(StatusCode::FORBIDDEN, TEXT, format!("{why}\n"));
    }
    if request.method() != Method::GET {
        let mut response = response(StatusCode::METHOD_NOT_ALLOWED, TEXT, "only GET is answered\n".to_owned());
        response.headers_mut().insert(ALLOW, HeaderValue::from_static("GET"));
        return response;
    }
    if opens_socket {
        return match accept_key(request.headers()) {
            Some(accepted) => {
                opened.set(Some(upgrade::on(&mut request)));
                switching(accepted)
            }
            None => response(StatusCode::UPGRADE_REQUIRED, TEXT, "a WebSocket is opened here\n".to_owned()),
        };
    }
    match FILES.iter().find(|(path, ..)| *path == request.uri().path()) {
        Some((_, kind, text)) => response(StatusCode::OK, kind, (*text).to_owned()),
        None => response(StatusCode::NOT_FOUND, TEXT, "there is no such file\n".to_owned()),
    }
}

/// What a request to open a WebSocket is answered with, if it is one (RFC 6455, 4.2.1).
fn accept_key(headers: &HeaderMap) -> Option<HeaderValue> {
    let has = |name: HeaderName, word: &str| {
        let text = headers.get(name).and_then(|value| value.to_str().ok()).unwrap_or_default();
        text.split(',').any(|part| part.trim().eq_ignore_ascii_case(word))
    };
    let is_asked = has(UPGRADE, "websocket") && has(CONNECTION, "upgrade") && has(SEC_WEBSOCKET_VERSION, "13");
    let key = headers.get(SEC_WEBSOCKET_KEY).filter(|_| is_asked)?;
    HeaderValue::from_str(&derive_accept_key(key.as_bytes())).ok()
}

fn switching(accepted: HeaderValue) -> Response<String> {
    let mut response = Response::new(String::new());
    *response.status_mut() = StatusCode::SWITCHING_PROTOCOLS;
    let headers = response.headers_mut();
    headers.insert(UPGRADE, HeaderValue::from_static("websocket"));
    headers.insert(CONNECTION, HeaderValue::from_static("upgrade"));
    headers.insert(SEC_WEBSOCKET_ACCEPT, accepted);
    response
}

fn response(status: StatusCode, kind: &'static str, body: String) -> Response<String> {
    let mut response = Response::new(body);
    *response.status_mut() = status;
    let fixed = [
        (CONTENT_TYPE, kind),
        (CONTENT_SECURITY_POLICY, POLICY),
        (X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (X_FRAME_OPTIONS, "DENY"),
        (REFERRER_POLICY, "no-referrer"),
        (CACHE_CONTROL, "no-store"),
        (CONNECTION, "close"),
        (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
        (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    ];
    for (name, value) in fixed {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}
