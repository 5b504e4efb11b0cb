//! What a tracker, this one or another, says of one frame: what all figures are computed from.

use crate::geometry::Rect;
use crate::tracker::{Output, State};

/// What a tracker says of one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    /// Where the target is, in pixels; where it is lost, the best guess.
    pub rect: Rect,
    /// How sure that is; `None` of trackers that do not say.
    pub confidence: Option<f64>,
    /// Whether the target is lost. Of trackers that only say yes or no, tracking or lost.
    pub state: State,
    /// Whether the tracker says that it was found again on this very frame.
    pub reacquired: bool,
}

impl Answer {
    /// What is said of the first target; one of which nothing is said is lost.
    pub fn of(output: &Output) -> Self {
        match output.targets.first() {
            Some(t) => Self {
                rect: t.rect,
                confidence: Some(f64::from(t.confidence)),
                state: t.state,
                reacquired: t.reacquired,
            },
            None => Self { rect: Rect::default(), confidence: Some(0.0), state: State::Lost, reacquired: false },
        }
    }

    /// Whether the tracker says that it has lost the target.
    pub fn is_lost(&self) -> bool {
        self.state == State::Lost
    }

    /// Overlap with the true box, 0 where there is none.
    pub fn overlap(&self, truth: Option<Rect>) -> f64 {
        truth.map_or(0.0, |t| self.rect.iou(&t))
    }
}
