//! The list of the targets that a tracker follows, each under its id, in the order of their starts; and the threads
//! that follow them.

use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, Builder};

use super::{Output, Target};
use crate::trace::{Event, Thresholds, Trace};

/// A target and all that is known of it.
pub(super) trait Followed {
    /// Its name.
    fn id(&self) -> &Arc<str>;

    /// What is said of it.
    fn report(&self) -> Target;

    /// What its response was held against in the last step, if it has one.
    fn thresholds(&self) -> Option<Thresholds> {
        None
    }
}

/// Room to work in, one for each thread that follows targets: as many as there are processors.
pub(super) struct Rooms<R>(Vec<R>);

impl<R: Default> Default for Rooms<R> {
    fn default() -> Self {
        Self::of(thread::available_parallelism().map_or(1, usize::from))
    }
}

impl<R: Default> Rooms<R> {
    fn of(threads: usize) -> Self {
        Self((0..threads).map(|_| R::default()).collect())
    }

    /// The room of the thread that asks.
    pub(super) fn own(&mut self) -> &mut R {
        &mut self.0[0]
    }
}

/// The targets, in the order of their starts.
pub(super) struct Targets<T>(Vec<T>);

impl<T> Default for Targets<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T: Followed> Targets<T> {
    /// Adds a target; one of the same id is forgotten.
    pub(super) fn add(&mut self, target: T) {
        self.stop(&target.id().clone());
        self.0.push(target);
    }

    /// Forgets the target of this id.
    pub(super) fn stop(&mut self, id: &str) {
        self.0.retain(|target| &**target.id() != id);
    }

    /// Forgets all but those.
    pub(super) fn retain(&mut self, is_kept: impl FnMut(&T) -> bool) {
        self.0.retain(is_kept);
    }

    /// The target of this id.
    pub(super) fn get_mut(&mut self, id: &str) -> Option<&mut T> {
        self.0.iter_mut().find(|target| &**target.id() == id)
    }

    /// All of them.
    pub(super) fn as_slice(&self) -> &[T] {
        &self.0
    }

    /// All of them.
    pub(super) fn iter_mut(&mut self) -> std::slice::IterMut<'_, T> {
        self.0.iter_mut()
    }

    /// Lets `step` follow each into a frame, in a room that no other uses meanwhile. They know nothing of each other,
    /// so all processors take part, unless `trace` is to see what happens in order.
    pub(super) fn step<R: Send>(
        &mut self,
        rooms: &mut Rooms<R>,
        trace: &mut dyn Trace,
        step: impl Fn(&mut T, &mut R, &mut dyn Trace) + Sync,
    ) where
        T: Send,
    {
        let (own, others) = rooms.0.split_first_mut().expect("a room");
        let helpers = if trace.looks_inside() { 0 } else { others.len().min(self.0.len().saturating_sub(1)) };
        if helpers == 0 {
            self.0.iter_mut().for_each(|target| step(target, own, trace));
        } else {
            let waiting = Mutex::new(self.0.iter_mut());
            let next = || waiting.lock().unwrap_or_else(PoisonError::into_inner).next();
            let work = |room: &mut R| {
                while let Some(target) = next() {
                    step(target, room, &mut ());
                }
            };
            thread::scope(|scope| {
                for room in &mut others[..helpers] {
                    // Where there is no thread to be had, those that there are do its work.
                    let _ = Builder::new().name("targets".to_owned()).spawn_scoped(scope, || work(room));
                }
                work(own);
            });
        }
        self.0.iter().for_each(|target| show_thresholds(target, trace));
    }

    /// Lets `step` follow the target of this id, if there is one.
    pub(super) fn catch_up(&mut self, id: &str, trace: &mut dyn Trace, step: impl FnOnce(&mut T, &mut dyn Trace)) {
        if let Some(target) = self.get_mut(id) {
            step(target, trace);
            show_thresholds(target, trace);
        }
    }

    /// Writes what is said of each.
    pub(super) fn report(&self, output: &mut Output) {
        output.targets.clear();
        output.targets.extend(self.0.iter().map(T::report));
    }
}

fn show_thresholds(target: &impl Followed, trace: &mut dyn Trace) {
    if let Some(thresholds) = target.thresholds() {
        trace.event(Event::Thresholds { id: target.id(), thresholds });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Rect;
    use crate::tracker::State;

    /// A name and a width.
    struct Named(Arc<str>, f64);

    impl Followed for Named {
        fn id(&self) -> &Arc<str> {
            &self.0
        }

        fn report(&self) -> Target {
            Target {
                id: self.0.clone(),
                rect: Rect::new(0.0, 0.0, self.1, 1.0),
                velocity: [0.0; 2],
                confidence: 1.0,
                response: 0.0,
                state: State::Tracking,
                reacquired: false,
                age: 0,
                lost_for: 0,
            }
        }

        fn thresholds(&self) -> Option<Thresholds> {
            Some(Thresholds { certain: self.1, lost: 0.0, found: 0.0 })
        }
    }

    /// What it is shown, and whether it looks inside.
    struct Shown(Vec<String>, bool);

    impl Trace for Shown {
        fn event(&mut self, event: Event) {
            self.0.push(match event {
                Event::Thresholds { id, thresholds } => format!("{id} {}", thresholds.certain),
                Event::Mode { name, .. } => name.to_owned(),
                other => panic!("{other:?}"),
            });
        }

        fn looks_inside(&self) -> bool {
            self.1
        }
    }

    #[test]
    fn each_target_is_followed_once_on_any_number_of_threads() {
        for threads in [1, 2, 3, 9] {
            let mut targets = Targets::default();
            ["a", "b", "c", "d", "e"].into_iter().for_each(|id| targets.add(Named(id.into(), 1.0)));
            let mut rooms = Rooms::<usize>::of(threads);
            let step = |target: &mut Named, room: &mut usize, trace: &mut dyn Trace| {
                target.1 += 1.0;
                *room += 1;
                trace.event(Event::Mode { name: "inside", window: Rect::default() });
            };
            for (inside, width) in [(true, 2), (false, 3)] {
                let mut shown = Shown(Vec::new(), inside);
                targets.step(&mut rooms, &mut shown, step);
                let mut expected = vec!["inside".to_owned(); if inside || threads == 1 { 5 } else { 0 }];
                expected.extend(["a", "b", "c", "d", "e"].map(|id| format!("{id} {width}")));
                assert_eq!(shown.0, expected, "{threads} threads");
            }
            assert_eq!(rooms.0.iter().sum::<usize>(), 10, "{:?}", rooms.0);
        }
    }

    /// Two steps that wait for each other end only if they run at the same time.
    #[test]
    fn targets_are_followed_at_the_same_time() {
        let mut targets = Targets::default();
        ["a", "b"].into_iter().for_each(|id| targets.add(Named(id.into(), 1.0)));
        let both = std::sync::Barrier::new(2);
        targets.step(&mut Rooms::<()>::of(2), &mut (), |_, (), _| _ = both.wait());
    }

    fn said(targets: &Targets<Named>) -> Vec<(String, f64)> {
        let mut output = Output::default();
        targets.report(&mut output);
        output.targets.iter().map(|t| (t.id.to_string(), t.rect.w)).collect()
    }

    #[test]
    fn targets_stand_in_the_order_of_their_starts_and_a_known_id_begins_anew() {
        let mut targets = Targets::default();
        for (id, width) in [("a", 1.0), ("b", 2.0), ("c", 3.0), ("a", 4.0)] {
            targets.add(Named(id.into(), width));
        }
        assert_eq!(said(&targets), [("b".into(), 2.0), ("c".into(), 3.0), ("a".into(), 4.0)]);
        targets.stop("c");
        targets.stop("nobody");
        assert!(targets.get_mut("c").is_none() && targets.as_slice().len() == 2);
        targets.get_mut("b").unwrap().1 = 5.0;
        targets.iter_mut().for_each(|target| target.1 += 1.0);
        assert_eq!(said(&targets), [("b".into(), 6.0), ("a".into(), 5.0)]);
        targets.retain(|target| target.1 < 6.0);
        assert_eq!(said(&targets), [("a".into(), 5.0)]);
    }
}
