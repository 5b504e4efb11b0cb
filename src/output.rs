//! What a tracker says of its targets.

use std::sync::Arc;

use crate::geometry::Rect;

/// How sure the tracker is of where the target is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum State {
    /// The target is where the box is.
    #[default]
    Tracking,
    /// It probably is; nothing is learned from this frame.
    Uncertain,
    /// It is not in sight. The box is the best guess, and it is being searched for.
    Lost,
}

impl State {
    /// The name in CSV files and log lines.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Tracking => "tracking",
            Self::Uncertain => "uncertain",
            Self::Lost => "lost",
        }
    }
}

/// What is known of one target on one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// Name of the target; the same from start to end.
    pub id: Arc<str>,
    /// Where it is, in pixels.
    pub rect: Rect,
    /// Velocity of the centre: pixels a second, or pixels a frame where frames bear no stamps.
    pub velocity: [f64; 2],
    /// Share of such boxes that can be expected to be right, 0 to 1. Of a target that MAPTrack found by itself, only a
    /// figure of merit: how much of it is seen, and less the longer it is hidden.
    pub confidence: f32,
    /// Peak of the fused response map; of ETEPF, the mean likelihood within the box; of MAPTrack, how much of the
    /// target moves or looks as it is remembered.
    pub response: f32,
    /// How sure the tracker is.
    pub state: State,
    /// Whether it was found again on this very frame.
    pub reacquired: bool,
    /// Frames since the start, skipped ones not counted.
    pub age: u32,
    /// Frames since it was lost; 0 while it is not.
    pub lost_for: u32,
}

#[cfg(test)]
impl Target {
    /// A target that stands in `rect`, for tests.
    pub(crate) fn standing(id: &str, rect: Rect, state: State) -> Self {
        let (velocity, confidence, response) = ([0.0; 2], 0.5, 0.5);
        Self { id: id.into(), rect, velocity, confidence, response, state, reacquired: false, age: 1, lost_for: 0 }
    }
}

/// What a tracker says of one frame.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Output {
    /// In the order of their starts; none before the first mark, unless the tracker finds them.
    pub targets: Vec<Target>,
}
