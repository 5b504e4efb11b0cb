//! The list of the targets that a tracker follows, each under its id, in the order of their starts.

use std::sync::Arc;

use super::{Output, Target};

/// A target and all that is known of it.
pub(super) trait Followed {
    /// Its name.
    fn id(&self) -> &Arc<str>;

    /// What is said of it.
    fn report(&self) -> Target;
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

    /// Writes what is said of each.
    pub(super) fn report(&self, output: &mut Output) {
        output.targets.clear();
        output.targets.extend(self.0.iter().map(T::report));
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
