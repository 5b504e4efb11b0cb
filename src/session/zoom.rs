//! A picture of another size than the one the targets were marked in: the tracker goes on in the pixels of that one.
//!
//! A camera that changes its resolution shows the same scene in other pixels. The tracker is shown each frame as if it
//! had the first one's size, and what it says is told in the pixels of the frame.

use crate::frame::Frame;
use crate::geometry::Rect;
use crate::trace::{Cues, Event, Proposal, ResponseMap, Trace};
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
    fn event(&mut self, event: Event) {
        let stretch = |rect| stretched(rect, self.factors);
        match event {
            Event::Stage(_) | Event::Thresholds { .. } | Event::MadeAnew(_) => self.trace.event(event),
            Event::SearchWindow(window) => self.trace.event(Event::SearchWindow(stretch(window))),
            Event::Prediction(rect) => self.trace.event(Event::Prediction(stretch(rect))),
            Event::Response(map) => {
                self.trace.event(Event::Response(&ResponseMap { window: stretch(map.window), ..*map }));
            }
            Event::Cues(cues) => self.trace.event(Event::Cues(&Cues { window: stretch(cues.window), ..*cues })),
            Event::Proposals(_) if self.factors == [1.0; 2] => self.trace.event(event),
            Event::Proposals(proposals) => {
                let stretched: Vec<_> = proposals.iter().map(|p| Proposal { rect: stretch(p.rect), ..*p }).collect();
                self.trace.event(Event::Proposals(&stretched));
            }
            Event::Neighbour(rect) => self.trace.event(Event::Neighbour(stretch(rect))),
            Event::Particle { rect, weight } => self.trace.event(Event::Particle { rect: stretch(rect), weight }),
            Event::Mode { name, window } => self.trace.event(Event::Mode { name, window: stretch(window) }),
        }
    }

    fn looks_inside(&self) -> bool {
        self.trace.looks_inside()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Default)]
    struct Places(Vec<Rect>);

    impl Trace for Places {
        fn event(&mut self, event: Event) {
            self.0.push(match event {
                Event::Stage(_) | Event::Thresholds { .. } | Event::MadeAnew(_) => Rect::default(),
                Event::SearchWindow(rect) | Event::Prediction(rect) | Event::Neighbour(rect) => rect,
                Event::Particle { rect, .. } | Event::Mode { window: rect, .. } => rect,
                Event::Response(map) => map.window,
                Event::Cues(cues) => cues.window,
                Event::Proposals(proposals) => proposals[0].rect,
            });
        }
    }

    #[test]
    fn every_place_is_shown_in_the_pixels_of_the_frame() {
        let [known, shown] = [Rect::new(1.0, 2.0, 3.0, 4.0), Rect::new(2.0, 6.0, 6.0, 12.0)];
        let images = [("", [].as_slice()); 4];
        let events = [
            Event::SearchWindow(known),
            Event::Prediction(known),
            Event::Response(&ResponseMap { values: &[], rows: 0, cols: 0, window: known }),
            Event::Cues(&Cues { id: "0", name: "", window: known, rows: 0, cols: 0, images }),
            Event::Proposals(&[Proposal { rect: known, score: 0.0 }]),
            Event::Neighbour(known),
            Event::Particle { rect: known, weight: 1.0 },
            Event::Mode { name: "", window: known },
        ];
        let mut places = Places::default();
        let mut zoomed = Zoom { known: [10, 10], factors: [2.0, 3.0] };
        events.iter().for_each(|event| zoomed.trace(&mut places).event(*event));
        assert_eq!(places.0, [shown; 8]);
        zoomed.factors = [1.0; 2];
        zoomed.trace(&mut places).event(events[4]);
        assert_eq!(places.0.last(), Some(&known));
    }
}
