//! A picture of another size than the one the targets were marked in: the tracker goes on in the pixels of that one.
//!
//! A camera that changes its resolution shows the same scene in other pixels. The tracker is shown each frame as if it
//! had the first one's size, and what it says is told in the pixels of the frame.

use crate::frame::Frame;
use crate::geometry::Rect;
use crate::trace::{Cues, Proposal, ResponseMap, Stage, Trace};
use crate::tracker::Target;

/// From the pixels in which the tracker counts to those of the latest frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Zoom {
    /// The size that the tracker knows.
    known: [u32; 2],
    /// Pixels of the frame in a pixel of the tracker, across and down.
    factors: [f64; 2],
}

impl Zoom {
    /// Frames of another size than `known` are to be seen as ones of that size.
    pub(super) fn new(known: [u32; 2]) -> Self {
        Self { known, factors: [1.0; 2] }
    }

    /// The frame as the tracker is to see it.
    pub(super) fn see<'a>(&mut self, frame: &Frame<'a>) -> Frame<'a> {
        self.factors = factors(self.known, [frame.width(), frame.height()]);
        frame.seen_as(self.known)
    }

    /// A box of the frame in the tracker's pixels.
    pub(super) fn into_known(self, rect: Rect) -> Rect {
        stretched(rect, self.factors.map(|f| 1.0 / f))
    }

    /// What the tracker says of a target, in the frame's pixels.
    pub(super) fn apply(self, target: &mut Target) {
        target.rect = stretched(target.rect, self.factors);
        let [x, y] = self.factors;
        target.velocity = [target.velocity[0] * x, target.velocity[1] * y];
    }

    /// Shows `trace` everything in the frame's pixels.
    pub(super) fn trace(self, trace: &mut dyn Trace) -> Zoomed<'_> {
        Zoomed { trace, factors: self.factors }
    }
}

/// How much larger `to` is than `from`, across and down.
pub(super) fn factors(from: [u32; 2], to: [u32; 2]) -> [f64; 2] {
    [0, 1].map(|i| f64::from(to[i]) / f64::from(from[i]))
}

/// The box in a picture that was stretched by these factors.
pub(super) fn stretched(rect: Rect, [x, y]: [f64; 2]) -> Rect {
    Rect::new(rect.x * x, rect.y * y, rect.w * x, rect.h * y)
}

/// A trace that is shown what happens in the frame's pixels.
pub(super) struct Zoomed<'a> {
    trace: &'a mut dyn Trace,
    factors: [f64; 2],
}

impl Trace for Zoomed<'_> {
    fn stage(&mut self, stage: Stage) {
        self.trace.stage(stage);
    }

    fn search_window(&mut self, window: Rect) {
        self.trace.search_window(stretched(window, self.factors));
    }

    fn prediction(&mut self, rect: Rect) {
        self.trace.prediction(stretched(rect, self.factors));
    }

    fn response(&mut self, map: &ResponseMap) {
        self.trace.response(&ResponseMap { window: stretched(map.window, self.factors), ..*map });
    }

    fn cues(&mut self, cues: &Cues) {
        self.trace.cues(&Cues { window: stretched(cues.window, self.factors), ..*cues });
    }

    fn proposals(&mut self, proposals: &[Proposal]) {
        if self.factors == [1.0; 2] {
            return self.trace.proposals(proposals);
        }
        let stretch = |p: &Proposal| Proposal { rect: stretched(p.rect, self.factors), ..*p };
        self.trace.proposals(&proposals.iter().map(stretch).collect::<Vec<_>>());
    }

    fn neighbour(&mut self, rect: Rect) {
        self.trace.neighbour(stretched(rect, self.factors));
    }

    fn particle(&mut self, rect: Rect, weight: f64) {
        self.trace.particle(stretched(rect, self.factors), weight);
    }

    fn mode(&mut self, name: &'static str, window: Rect) {
        self.trace.mode(name, stretched(window, self.factors));
    }
}
