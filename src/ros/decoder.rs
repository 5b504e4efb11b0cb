//! The decode thread: decodes the newest compressed image, so that one which takes long keeps none from being received.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use super::convert::Received;
use super::intake::{Intake, Refusal};
use super::messages::CompressedImage;

/// A compressed image, and when it came: nanoseconds since the epoch.
pub type Packed = (CompressedImage, i64);

/// All that the thread needs.
pub struct Decoder {
    /// Where images come from.
    pub slot: Arc<Slot<Packed>>,
    /// Where they go.
    pub intake: Intake,
    /// Bytes that the pixels of an image may take.
    pub most: u64,
}

impl Decoder {
    /// Runs until the slot is closed.
    pub fn run(mut self) {
        while let Some((image, arrival)) = self.slot.take() {
            let format = image.format.clone();
            let decoded = Received::decoded(image, arrival, self.most);
            self.intake.take(decoded.map_err(|why| Refusal::Decode { why, format }));
        }
    }
}

/// A place for one thing, the newest.
pub struct Slot<T> {
    state: Mutex<SlotState<T>>,
    changed: Condvar,
}

struct SlotState<T> {
    newest: Option<T>,
    closed: bool,
}

impl<T> Default for Slot<T> {
    fn default() -> Self {
        Self { state: Mutex::new(SlotState { newest: None, closed: false }), changed: Condvar::new() }
    }
}

impl<T> Slot<T> {
    /// Puts the newest in; says whether another was there, which is dropped.
    pub fn put(&self, newest: T) -> bool {
        let old = self.lock().newest.replace(newest);
        self.changed.notify_one();
        old.is_some()
    }

    /// Ends the waiting for good.
    pub fn close(&self) {
        self.lock().closed = true;
        self.changed.notify_all();
    }

    /// Waits for the newest and takes it; `None` once the slot is closed.
    pub fn take(&self) -> Option<T> {
        let idle = |state: &mut SlotState<T>| !state.closed && state.newest.is_none();
        let mut state = self.changed.wait_while(self.lock(), idle).unwrap_or_else(PoisonError::into_inner);
        if state.closed { None } else { state.newest.take() }
    }

    fn lock(&self) -> MutexGuard<'_, SlotState<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_stands_and_closing_ends_the_waiting() {
        let slot = Arc::new(Slot::default());
        assert_eq!([slot.put(1), slot.put(2), slot.put(3)], [false, true, true]);
        assert_eq!(slot.take(), Some(3));
        let waiting = std::thread::spawn({
            let slot = slot.clone();
            move || [slot.take(), slot.take()]
        });
        slot.put(4);
        while slot.lock().newest.is_some() {
            std::thread::yield_now();
        }
        slot.close();
        assert_eq!(waiting.join().unwrap(), [Some(4), None]);
        slot.put(5);
        assert_eq!(slot.take(), None, "closed for good");
    }
}
