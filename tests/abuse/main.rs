//! What breaks such nodes in users' hands: stamps, marks, peers, files and inputs as they come, and what must be right
//! all the same. One file a kind. Runs in at most five minutes.

#[path = "../support/mod.rs"]
mod support;

mod inputs;
mod marks;
mod network;
mod nothing;
mod page;
mod parameter_files;
mod recordings;
mod time;
mod tools;
