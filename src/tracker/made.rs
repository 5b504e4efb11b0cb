//! What changed parameters had made anew, until a frame comes in which it can be shown.

use crate::params::Need;
use crate::trace::{Event, Trace};

/// Each of it once, however often parameters change before a frame comes.
#[derive(Default)]
pub(super) struct Made(Vec<Need>);

impl Made {
    /// That was made anew.
    pub(super) fn note(&mut self, what: Need) {
        if !self.0.contains(&what) {
            self.0.push(what);
        }
    }

    /// Shows what was made anew since the last frame.
    pub(super) fn show(&mut self, trace: &mut dyn Trace) {
        self.0.drain(..).for_each(|what| trace.event(Event::MadeAnew(what)));
    }
}
