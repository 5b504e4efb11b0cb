//! What targets are called that were renamed: the tracker goes on under the name that it knows.

use std::sync::Arc;

/// Pairs of the tracker's name and the one that is shown, of those targets alone where the two differ.
#[derive(Debug, Default)]
pub(super) struct Names(Vec<(Arc<str>, Arc<str>)>);

impl Names {
    /// What the tracker calls the target that is shown under this name.
    pub(super) fn known<'a>(&'a self, shown: &'a str) -> &'a str {
        self.0.iter().find(|(_, other)| **other == *shown).map_or(shown, |(known, _)| known)
    }

    /// What the target is shown as.
    pub(super) fn shown<'a>(&'a self, known: &'a Arc<str>) -> &'a Arc<str> {
        self.0.iter().find(|(other, _)| other == known).map_or(known, |(_, shown)| shown)
    }

    /// Shows the target under another name.
    pub(super) fn set(&mut self, known: &Arc<str>, shown: &str) {
        self.0.retain(|(other, _)| other != known);
        if **known != *shown {
            self.0.push((known.clone(), shown.into()));
        }
    }

    /// Whether a target has this name or had it, so that a new one cannot be called so by the tracker.
    pub(super) fn is_taken(&self, name: &str) -> bool {
        self.0.iter().any(|(known, shown)| **known == *name || **shown == *name)
    }

    /// Whether a target was called so and is not any more.
    pub(super) fn is_left(&self, name: &str) -> bool {
        self.0.iter().any(|(known, _)| **known == *name)
    }

    /// Forgets targets that are not there any more.
    pub(super) fn retain(&mut self, is_there: impl Fn(&Arc<str>) -> bool) {
        self.0.retain(|(known, _)| is_there(known));
    }
}
