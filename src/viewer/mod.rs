//! The live page: what a tracker sees and does, shown in a browser, where targets are marked and parameters are tuned.
//!
//! The node and `track --view` are its hosts, and neither knows of the other. A host tells the [`Hub`] what happens,
//! and obeys what pages ask for by the [`Host`] trait. Nothing is drawn or encoded while no page waits for a picture.
//!
//! | file | what it holds |
//! |---|---|
//! | `hub.rs` | the state that all pages share: newest pictures, latest figures, events |
//! | `host.rs` | what pages can ask of the tracker |
//! | `picture.rs` | a frame as the message that pages draw |
//! | `story.rs` | figures of each frame, and events |
//! | `parameters.rs` | the table of parameters as pages show it |
//! | `listen.rs` | the port, the address and the token |
//! | `access.rs` | who may connect |
//! | `context.rs` | what every connection needs |
//! | `server.rs` | HTTP: the page's files, and the way to its WebSocket |
//! | `socket.rs`, `protocol.rs` | one page's WebSocket, and its messages |
//! | `page/` | HTML, style sheet and scripts, served as they are |
//!
//! All from `access.rs` on are there with the cargo feature `viewer`.

#[cfg(feature = "viewer")]
mod access;
#[cfg(feature = "viewer")]
mod context;
mod host;
#[cfg_attr(not(feature = "viewer"), allow(dead_code, reason = "without pages nobody reads it"))]
mod hub;
#[cfg_attr(not(feature = "viewer"), allow(dead_code, reason = "without pages nobody reads it"))]
mod listen;
#[cfg_attr(not(feature = "viewer"), allow(dead_code, reason = "without pages nobody reads it"))]
mod parameters;
mod picture;
#[cfg(feature = "viewer")]
mod protocol;
#[cfg(feature = "viewer")]
mod server;
#[cfg(feature = "viewer")]
mod socket;
#[cfg_attr(not(feature = "viewer"), allow(dead_code, reason = "without pages nobody reads it"))]
mod story;

pub use host::{Asked, Command, Host, Playback, Replay};
pub use hub::Hub;
pub use listen::{ListenError, Listening, listen};
pub use picture::View;
pub use story::{Event, KeptThresholds, Part, Said};
