//! The live page's server against browsers, and against those that are none.

#![cfg(feature = "viewer")]

use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use async_tungstenite::WebSocketStream;
use async_tungstenite::tungstenite::client::IntoClientRequest as _;
use async_tungstenite::tungstenite::{Error, Message};
use futures::StreamExt as _;
use long_term_tracker::draw::Scene;
use long_term_tracker::params::ViewerParams;
use long_term_tracker::viewer::{Asked, Command, Host, Hub, View, listen};
use long_term_tracker::{Encoding, Frame, Output, Params};
use serde_json::{Value, json};
use smol::channel::{Sender, bounded};
use smol::{Async, block_on};

const TOKEN: &str = "0123456789abcdef";
/// It only ends what hangs.
const DEADLINE: Duration = Duration::from_secs(30);

/// Notes what is asked.
#[derive(Default)]
struct Notes(Mutex<Vec<Command>>);

impl Host for Notes {
    fn params(&self) -> Params {
        Params::default()
    }

    fn ask(&self, command: Command) -> Asked {
        if !matches!(command, Command::Release { .. }) {
            self.0.lock().unwrap().push(command);
        }
        Box::pin(std::future::ready(Ok(None)))
    }
}

/// A server, which ends with the value.
struct Served {
    address: String,
    hub: Hub,
    notes: Arc<Notes>,
    end: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Served {
    fn new(token: &str) -> Self {
        let (hub, notes) = (Hub::default(), Arc::new(Notes::default()));
        let params = ViewerParams { port: 0, token: token.to_owned(), ..ViewerParams::default() };
        let listening = listen(&params, "/tracker", hub.clone(), notes.clone()).unwrap();
        let address = listening.link.trim_start_matches("http://").trim_end_matches('/').to_owned();
        let (end, ended) = bounded::<()>(1);
        let thread = std::thread::spawn(move || {
            listening.run(async {
                let _ = ended.recv().await;
            });
        });
        Self { address, hub, notes, end: Some(end), thread: Some(thread) }
    }

    fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(&self.address).unwrap();
        stream.set_read_timeout(Some(DEADLINE)).unwrap();
        stream
    }

    /// What is answered to these bytes, until the server hangs up.
    fn answer(&self, request: &str) -> String {
        let mut stream = self.connect();
        // The server may hang up before it has read all.
        let _ = stream.write_all(request.as_bytes());
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        String::from_utf8_lossy(&answer).into_owned()
    }

    fn get(&self, path: &str, headers: &str) -> String {
        self.answer(&format!("GET {path} HTTP/1.1\r\n{headers}\r\n"))
    }

    /// The status of such a request.
    fn status(&self, path: &str, headers: &str) -> u16 {
        let answer = self.get(path, headers);
        answer.split(' ').nth(1).and_then(|code| code.parse().ok()).unwrap_or_else(|| panic!("{answer:?}"))
    }

    fn host(&self) -> String {
        format!("Host: {}\r\n", self.address)
    }

    /// A WebSocket of a page from `origin`, to which nothing was said.
    fn socket(&self, origin: &str) -> Result<Socket, Error> {
        let mut request = format!("ws://{}/live", self.address).into_client_request().unwrap();
        request.headers_mut().insert("Origin", origin.parse().unwrap());
        let stream = Async::new(self.connect()).unwrap();
        block_on(async_tungstenite::client_async(request, stream)).map(|(socket, _)| Socket(socket))
    }

    /// A page that has come in.
    fn page(&self, token: &str) -> Socket {
        let mut page = self.socket(&format!("http://{}", self.address)).unwrap();
        page.send(&json!({"enter": {"token": token}}));
        page
    }

    /// The server works, whatever was done to it.
    fn check(&self, token: &str) {
        let mut page = self.page(token);
        assert!(page.next("hello")["rows"].as_array().unwrap().len() > 50);
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.end.take();
        self.thread.take().unwrap().join().unwrap();
    }
}

struct Socket(WebSocketStream<Async<TcpStream>>);

impl Socket {
    fn send(&mut self, message: &Value) {
        self.send_raw(Message::text(message.to_string()));
    }

    fn send_raw(&mut self, message: Message) {
        block_on(self.0.send(message)).unwrap();
    }

    /// The next message that is no sign of life; `None` after the last.
    fn message(&mut self) -> Option<Message> {
        loop {
            let late = async {
                smol::Timer::after(DEADLINE).await;
                panic!("no message within {DEADLINE:?}")
            };
            match block_on(smol::future::or(self.0.next(), late)) {
                Some(Ok(Message::Ping(_) | Message::Pong(_))) => {}
                Some(Ok(Message::Close(_)) | Err(_)) | None => return None,
                Some(Ok(message)) => return Some(message),
            }
        }
    }

    /// The next message of this kind.
    fn next(&mut self, kind: &str) -> Value {
        loop {
            let Some(Message::Text(text)) = self.message() else { panic!("no '{kind}' came") };
            let mut message: Value = serde_json::from_str(&text).unwrap();
            if let Some(value) = message.get_mut(kind) {
                return value.take();
            }
        }
    }

    fn ask(&mut self, command: &Value) -> Value {
        self.send(&json!({"ask": {"number": 3, "command": command}}));
        let answer = self.next("answer");
        assert_eq!(answer["number"], 3);
        answer["error"].clone()
    }
}

fn show(hub: &Hub) {
    let data = vec![90; 64 * 48];
    let frame = Frame::new(&data, 64, 48, 64, Encoding::Mono8, Some(5)).unwrap();
    hub.show(&View { frame, stamp: frame.stamp(), output: &Output::default(), scene: &Scene::default(), quality: 80 })
        .unwrap();
}

#[test]
fn the_page_is_whole_and_may_load_nothing_from_elsewhere() {
    let served = Served::new("");
    let page = served.get("/", &served.host());
    assert!(page.starts_with("HTTP/1.1 200 OK") && page.ends_with("</html>\n"), "{page}");
    let policy = page.lines().find_map(|line| line.strip_prefix("content-security-policy: ")).unwrap();
    assert!(
        policy.starts_with("default-src 'none'") && !policy.contains("unsafe") && !policy.contains('*'),
        "{policy}"
    );
    // All that it names is there, and none of it is elsewhere.
    let mut names: Vec<String> = Vec::new();
    for part in ["src=\"", "href=\""] {
        names.extend(page.split(part).skip(1).map(|rest| rest.split('"').next().unwrap().to_owned()));
    }
    names.retain(|name| name != "data:,");
    assert_eq!(names, ["/app.js", "/style.css"]);
    let script = served.get("/app.js", &served.host());
    let imports = script.split("from \"./").skip(1).map(|rest| format!("/{}", rest.split('"').next().unwrap()));
    let mut scripts: Vec<String> = imports.collect();
    assert_eq!(scripts.len(), 7, "{scripts:?}");
    scripts.push("/style.css".to_owned());
    for path in scripts {
        let text = served.get(&path, &served.host());
        assert!(text.starts_with("HTTP/1.1 200 OK"), "{path}");
        let text: String = text.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
        let elsewhere = text.matches("//").count();
        let known = text.matches("http://www.w3.org/2000/svg").count() + text.matches("}://${location.host}").count();
        assert_eq!(elsewhere, known, "{path} names something elsewhere");
    }
    assert_eq!(served.status("/secret", &served.host()), 404);
    let posted = served.answer(&format!("POST / HTTP/1.1\r\n{}Content-Length: 0\r\n\r\n", served.host()));
    assert!(posted.starts_with("HTTP/1.1 405"), "{posted}");
}

#[test]
fn requests_under_other_names_and_from_other_pages_are_refused() {
    let served = Served::new("");
    assert_eq!(served.status("/", "Host: evil.example\r\n"), 403);
    assert_eq!(served.status("/", ""), 403);
    assert_eq!(served.status("/", &format!("{}Origin: http://evil.example\r\n", served.host())), 403);
    assert_eq!(served.status("/live", &served.host()), 403, "a WebSocket must say where its page is from");
    let origin = format!("{}Origin: http://{}\r\n", served.host(), served.address);
    assert_eq!(served.status("/live", &origin), 426, "this is no WebSocket");
    for origin in ["http://evil.example", "null", "http://localhost:1"] {
        let refused = served.socket(origin).err().expect("refused");
        assert!(matches!(&refused, Error::Http(answer) if answer.status() == 403), "{refused}");
    }
    served.check("");
    assert!(served.notes.0.lock().unwrap().is_empty());
}

#[test]
fn who_does_not_know_the_token_comes_no_further() {
    let served = Served::new(TOKEN);
    for token in ["", "0123456789abcdeX", "0123456789abcdef0"] {
        let begun = Instant::now();
        let mut page = served.page(token);
        let refused = page.next("refused");
        assert_eq!((&refused["why"], &refused["asks_token"]), (&json!("the token is wrong"), &json!(true)));
        assert!(page.message().is_none() && begun.elapsed() >= Duration::from_secs(1), "guessing takes its time");
    }
    let mut hasty = served.socket(&format!("http://{}", served.address)).unwrap();
    hasty.send(&json!({"ask": {"number": 1, "command": {"stop": {"id": null}}}}));
    assert!(hasty.next("refused")["why"].as_str().unwrap().starts_with("the first message must be"));
    assert!(served.notes.0.lock().unwrap().is_empty());
    served.check(TOKEN);
}

#[test]
fn what_a_page_asks_for_is_done_and_what_makes_no_sense_is_not() {
    let served = Served::new("");
    let mut page = served.page("");
    page.next("hello");
    assert_eq!(
        page.ask(&json!({"mark": {"rect": [1, 2, 30, 40.5], "id": "a", "stamp": "1700000000123456789"}})),
        json!(null)
    );
    let why = page.ask(&json!({"set": {"name": "debug.max_side", "value": "x"}}));
    assert_eq!(why, "parameter 'debug.max_side' is of type integer, got \"x\"");
    let asked = served.notes.0.lock().unwrap().clone();
    let [Command::Mark { rect, id, stamp }] = &asked[..] else { panic!("{asked:?}") };
    assert_eq!((rect.x, rect.h, id.as_deref(), *stamp), (1.0, 40.5, Some("a"), Some(1_700_000_000_123_456_789)));
}

#[test]
fn garbage_ends_only_who_sends_it() {
    let served = Served::new("");
    let mark = |rect: &str| format!(r#"{{"ask": {{"number": 1, "command": {{"mark": {{"rect": {rect}}}}}}}}}"#);
    let mut garbage = vec![
        Message::text("{"),
        Message::text("[[[[[[".repeat(2000)),
        Message::text(r#"{"enter": {"token": ""}}"#),
        Message::text(r#"{"look": {"side": -1}}"#),
        Message::binary(vec![0xff; 1000]),
        // Longer than any message may be.
        Message::text("x".repeat(100_000)),
    ];
    garbage.extend(["[NaN, 1, 2, 3]", "[1e999, 1, 2, 3]", "[null, 1, 2, 3]"].map(|rect| Message::text(mark(rect))));
    for message in garbage {
        let mut page = served.page("");
        page.next("hello");
        let told = message.to_string().chars().take(60).collect::<String>();
        // It may be hung up on before all is sent.
        let _ = block_on(page.0.send(message));
        let until = Instant::now() + DEADLINE;
        while page.message().is_some() {
            assert!(Instant::now() < until, "'{told}' was taken");
        }
    }
    // Bytes that are no WebSocket's.
    let mut raw = served.connect();
    let origin = format!("{}Origin: http://{}\r\n", served.host(), served.address);
    let upgrade =
        "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAA\r\n";
    raw.write_all(format!("GET /live HTTP/1.1\r\n{origin}{upgrade}\r\n").as_bytes()).unwrap();
    let _ = raw.write_all(&[0xff; 4096]);
    let mut rest = Vec::new();
    let _ = raw.read_to_end(&mut rest);
    assert!(served.notes.0.lock().unwrap().is_empty());
    served.check("");
}

#[test]
fn headers_without_end_are_cut_off() {
    let served = Served::new("");
    let long = format!("{}X: {}\r\n", served.host(), "x".repeat(1_000_000));
    let answer = served.get("/", &long);
    assert!(answer.is_empty() || answer.starts_with("HTTP/1.1 431"), "{answer}");
    let many = format!("{}{}", served.host(), "X: y\r\n".repeat(1000));
    let answer = served.get("/", &many);
    assert!(answer.is_empty() || answer.starts_with("HTTP/1.1 431"), "{answer}");
    let path = format!("/{}", "x".repeat(1_000_000));
    let answer = served.get(&path, &served.host());
    assert!(answer.is_empty() || answer.starts_with("HTTP/1.1 4"), "{answer}");
    served.check("");
}

#[test]
fn two_hundred_connections_do_not_keep_others_out_for_long() {
    let served = Served::new("");
    let begun = Instant::now();
    let mut held: Vec<TcpStream> = (0..200).map(|_| served.connect()).collect();
    // Those that are too many are hung up on at once, and those that say nothing after a while.
    let closed =
        held.iter_mut().map(|stream| stream.read(&mut [0])).filter(|read| matches!(read, Ok(0) | Err(_))).count();
    assert_eq!(closed, 200);
    assert!(begun.elapsed() < DEADLINE);
    drop(held);
    served.check("");
}

#[test]
fn no_more_than_eight_pages_are_open() {
    let served = Served::new("");
    let mut pages: Vec<Socket> = (0..8).map(|_| served.page("")).collect();
    pages.iter_mut().for_each(|page| drop(page.next("hello")));
    assert_eq!(served.page("").next("refused")["why"], "8 pages are open already");
    drop(pages.pop());
    let until = Instant::now() + DEADLINE;
    loop {
        let mut next = served.page("");
        let Some(Message::Text(text)) = next.message() else { panic!("nothing was said") };
        if text.contains("hello") {
            break;
        }
        assert!(Instant::now() < until, "a page that is gone counts: {text}");
    }
}

#[test]
fn a_page_that_does_not_ask_is_sent_nothing_and_one_that_asks_the_newest() {
    let served = Served::new("");
    let mut page = served.page("");
    page.next("hello");
    assert!(!served.hub.wants());
    page.send(&json!({"look": {"side": 64}}));
    let until = Instant::now() + DEADLINE;
    while !served.hub.wants() {
        assert!(Instant::now() < until);
        std::thread::sleep(Duration::from_millis(1));
    }
    (0..5).for_each(|_| show(&served.hub));
    let picture = loop {
        if let Some(Message::Binary(data)) = page.message() {
            break data;
        }
    };
    let length = u32::from_le_bytes(picture[..4].try_into().unwrap()) as usize;
    let header: Value = serde_json::from_slice(&picture[4..4 + length]).unwrap();
    assert_eq!((&header["stamp"], &header["size"]), (&json!("5"), &json!([64, 48])));
    assert!(!served.hub.wants(), "it asked for one");
}

#[test]
fn for_a_page_that_stops_reading_nothing_is_kept() {
    let served = Served::new("");
    let mut page = served.page("");
    page.next("hello");
    // It asks for as many pictures as it likes; what it asked for is known once this is answered.
    (0..100).for_each(|_| page.send(&json!({"look": {"side": 64}})));
    assert_eq!(page.ask(&json!({"stop": {"id": null}})), json!(null));
    (0..1000).for_each(|_| show(&served.hub));
    page.send(&json!({"ask": {"number": 4, "command": {"stop": {"id": null}}}}));
    let (mut pictures, mut told) = (0, String::new());
    while !told.contains("answer") {
        match page.message() {
            Some(Message::Binary(_)) => pictures += 1,
            Some(Message::Text(text)) => told = text.to_string(),
            other => panic!("{other:?} came"),
        }
    }
    assert!((1..=2).contains(&pictures), "{pictures} pictures came");
}
