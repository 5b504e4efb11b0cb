//! The node: everything between ROS 2 and a [`Session`](crate::Session).
//!
//! The way in: [`args`] and [`env`](mod@env) say what is wanted, [`names`] resolves what things are called,
//! [`parameters`] holds the values in force, [`endpoints`] makes topics and services, [`node`] starts the threads and
//! ends them.
//!
//! While it runs, an image goes `receive (-> decode) -> inbox -> worker -> debug`:
//!
//! | thread | file | blocks on |
//! |---|---|---|
//! | receive | [`receive`] | the next image; overwrites the one slot of the inbox, or of the decode thread |
//! | decode | [`decoder`] | the newest image, where they are compressed; overwrites the one slot of the inbox |
//! | worker | [`worker`] | the inbox: the newest image and commands; steps the session, publishes tracks |
//! | debug | [`debug`] | a frame to draw, which the worker hands over only while somebody looks |
//! | spin | [`graph`], [`commands`], [`parameter_services`], [`service`], [`diagnostics`], [`clock`] | other nodes, marks, service calls, a clock |
//! | viewer | [`page`] | browsers that show the live page, where there is one |
//! | supervisor | [`supervisor`] | signals, the end of any thread, a clock; looks after memory, ends a process that hangs |
//!
//! [`queue`] and [`budget`] say which marks the worker obeys and when, so that images win. [`history`] keeps the frames
//! that a mark may name. [`messages`] are the types on the wire, [`convert`] goes from them to the core's types and
//! back, [`logging`] sends log lines to the terminal, to the file that [`log_file`] makes and to `/rosout`, [`stats`]
//! counts, and [`diagnostics`] tells of it.

pub mod args;
pub mod budget;
pub mod clock;
pub mod commands;
pub mod debug;
pub mod decoder;
pub mod diagnostics;
pub mod endpoints;
pub mod env;
pub mod fault;
pub mod graph;
pub mod history;
pub mod image_qos;
pub mod inbox;
pub mod intake;
pub mod log_file;
pub mod logging;
pub mod names;
pub mod node;
pub mod page;
pub mod parameter_services;
pub mod parameters;
pub mod part;
pub mod process;
pub mod queue;
pub mod receive;
pub mod service;
pub mod stats;
pub mod supervisor;
pub mod type_hash;
pub mod waiting;
pub mod worker;

use std::ffi::OsString;
use std::io::{self, Write as _};
use std::process::ExitCode;

pub use crate::messages::{self, convert};
use crate::params::preset_list;

/// Runs the node with the arguments of a process, the first being the program's name, until a signal ends it.
///
/// The exit code is 0 after SIGINT or SIGTERM, 1 where it failed while running or hung at the end, 2 where the
/// arguments, a parameter file or the environment cannot be used; then one line on standard error says why.
pub fn run(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    let args = match args::parse(args) {
        Ok(args) => args,
        Err(args::Stop::Clap(error)) => {
            // Help and version go to standard output with code 0, all else to standard error with code 2.
            let _ = error.print();
            return ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(2));
        }
        Err(args::Stop::Presets) => {
            let _ = io::stdout().write_all(preset_list().as_bytes());
            return ExitCode::SUCCESS;
        }
        Err(args::Stop::Fault(fault)) => return fault.report(),
    };
    match node::run(args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(fault) => {
            logging::to_file(&fault.to_string());
            fault.report()
        }
    }
}
