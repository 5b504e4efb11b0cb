//! What targets are called that were renamed: the tracker goes on under the name that it knows.

use std::sync::Arc;

use crate::trace::{Cues, Event, Trace};

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

    /// The same by the name alone.
    fn called<'a>(&'a self, known: &'a str) -> &'a str {
        self.0.iter().find(|(other, _)| **other == *known).map_or(known, |(_, shown)| shown)
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

    /// Shows `trace` everything under the names that are shown.
    pub(super) fn trace<'a>(&'a self, trace: &'a mut dyn Trace) -> Renamed<'a> {
        Renamed { names: self, trace }
    }
}

/// A trace that is shown targets by the names that are shown.
pub(super) struct Renamed<'a> {
    names: &'a Names,
    trace: &'a mut dyn Trace,
}

impl Trace for Renamed<'_> {
    fn event(&mut self, event: Event) {
        let Self { names, trace } = self;
        match event {
            Event::Cues(cues) => trace.event(Event::Cues(&Cues { id: names.called(cues.id), ..*cues })),
            Event::Thresholds { id, thresholds } => {
                trace.event(Event::Thresholds { id: names.called(id), thresholds });
            }
            other => trace.event(other),
        }
    }

    fn looks_inside(&self) -> bool {
        self.trace.looks_inside()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Rect;
    use crate::trace::Thresholds;

    struct Ids(Vec<String>);

    impl Trace for Ids {
        fn event(&mut self, event: Event) {
            match event {
                Event::Cues(cues) => self.0.push(cues.id.to_owned()),
                Event::Thresholds { id, .. } => self.0.push(id.to_owned()),
                _ => {}
            }
        }
    }

    #[test]
    fn what_a_step_shows_bears_the_names_that_are_shown() {
        let mut names = Names::default();
        names.set(&"0".into(), "the walker");
        let mut ids = Ids(Vec::new());
        for id in ["0", "1"] {
            let thresholds = Thresholds { certain: 0.5, lost: 0.2, found: 0.7 };
            names.trace(&mut ids).event(Event::Thresholds { id, thresholds });
            let images = [("", [].as_slice()); 4];
            let cues = Cues { id, name: "", window: Rect::default(), rows: 0, cols: 0, images };
            names.trace(&mut ids).event(Event::Cues(&cues));
        }
        assert_eq!(ids.0, ["the walker", "the walker", "1", "1"]);
    }
}
