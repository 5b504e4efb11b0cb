//! What every connection of the live page needs.

use std::cell::Cell;
use std::fmt::Display;
use std::sync::Arc;
use std::time::{Duration, Instant};

use log::warn;

use super::access::Names;
use super::{Host, Hub};

/// From one line in the log about what was refused to the next.
const QUIET: Duration = Duration::from_secs(1);

/// The tracker behind the page, and who may come in.
pub(super) struct Context {
    pub(super) title: String,
    /// What a page must show; empty where nothing is asked for.
    pub(super) token: String,
    pub(super) hub: Hub,
    pub(super) host: Arc<dyn Host>,
    pub(super) names: Names,
    /// When the log was told of a refusal last.
    pub(super) told: Cell<Option<Instant>>,
}

impl Context {
    /// Tells the log of what was refused, unless it was told of something just before.
    pub(super) fn tell(&self, line: impl Display) {
        if self.told.get().is_none_or(|at| at.elapsed() >= QUIET) {
            self.told.set(Some(Instant::now()));
            warn!("live page: {line}");
        }
    }
}
