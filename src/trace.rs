//! What a tracker shows of its inside while it works, for debug images and timing.
//!
//! The core never draws and knows no clock: it calls a [`Trace`], and `()` is the one that does nothing.

use crate::geometry::Rect;
use crate::params::Need;

/// The parts of a step whose share of the time is told apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Cropping search windows and computing features and likelihoods; finding what moves.
    Features,
    /// Responses of the correlation filter and their peak; mean shift and weighing of particles; composite images.
    Localise,
    /// The scale filter.
    Scale,
    /// Scanning for a lost target; finding new ones.
    Redetect,
    /// Updating filters and classifier.
    Learn,
}

impl Stage {
    /// All stages, in the order of the declaration.
    pub const ALL: [Self; 5] = [Self::Features, Self::Localise, Self::Scale, Self::Redetect, Self::Learn];

    /// The name in the timing line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Features => "features",
            Self::Localise => "localise",
            Self::Scale => "scale",
            Self::Redetect => "re-detect",
            Self::Learn => "learn",
        }
    }
}

/// A fused response map with its place in the frame.
#[derive(Clone, Copy, Debug)]
pub struct ResponseMap<'a> {
    /// Row-major values, `rows x cols`; row 0 is the top.
    pub values: &'a [f32],
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub cols: usize,
    /// The part of the frame that the map covers, in pixels. The value of a cell is the response to a target
    /// centred in that cell; of ETEPF, how likely the cell itself is part of the target.
    pub window: Rect,
}

/// The images that a target's region is made of, one over the other.
#[derive(Clone, Copy, Debug)]
pub struct Cues<'a> {
    /// The target's id.
    pub id: &'a str,
    /// What they say of the target.
    pub name: &'static str,
    /// The part of the frame that they cover, in pixels.
    pub window: Rect,
    /// Number of rows of each.
    pub rows: usize,
    /// Number of columns.
    pub cols: usize,
    /// The name of each and its values, 0 to 1, row-major `rows x cols`; row 0 is the top.
    pub images: [(&'static str, &'a [f32]); 4],
}

/// A place where a lost target, or a new one, may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Proposal {
    /// Where, in pixels.
    pub rect: Rect,
    /// The classifier's margin.
    pub score: f64,
}

/// What the response of a target is held against in a frame, in the response's own unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thresholds {
    /// From here on the target is tracked.
    pub certain: f64,
    /// Below it the target is gone, of LCMHT if that lasts.
    pub lost: f64,
    /// From here on a lost target is taken up again, of LCMHT where the detector proposes it.
    pub found: f64,
}

/// What happens inside a step.
#[derive(Clone, Copy, Debug)]
pub enum Event<'a> {
    /// A stage begins, and the one before it ends.
    Stage(Stage),
    /// The search window of this frame, in pixels.
    SearchWindow(Rect),
    /// The motion model's guess before the frame was looked at, in pixels.
    Prediction(Rect),
    /// The fused response map over the search window.
    Response(&'a ResponseMap<'a>),
    /// The images that a response is made of, of one target.
    Cues(&'a Cues<'a>),
    /// What the re-detector proposes on this frame; of MAPTrack, the blobs of what moves.
    Proposals(&'a [Proposal]),
    /// What looks like a target and is not: a box in pixels.
    Neighbour(Rect),
    /// One of ETEPF's particles.
    Particle {
        /// A box in pixels.
        rect: Rect,
        /// Its share of all weight.
        weight: f64,
    },
    /// The mode that the tracker is in.
    Mode {
        /// The mode's name.
        name: &'static str,
        /// The window that it searches in, in pixels.
        window: Rect,
    },
    /// What the response of a target is held against.
    Thresholds {
        /// The target's id.
        id: &'a str,
        /// In force in this frame.
        thresholds: Thresholds,
    },
    /// Changed parameters had this made anew.
    MadeAnew(Need),
}

/// Receives what happens inside a step.
pub trait Trace {
    /// This happens now.
    fn event(&mut self, event: Event);

    /// Whether it is to see the inside of each target's step. Then targets are followed one after the other; otherwise
    /// all at once, and it is told the rest: thresholds, and what was made anew.
    fn looks_inside(&self) -> bool {
        true
    }
}

/// Is shown everything, and does nothing.
impl Trace for () {
    fn event(&mut self, _: Event) {}

    fn looks_inside(&self) -> bool {
        false
    }
}

impl<T: Trace + ?Sized> Trace for &mut T {
    fn event(&mut self, event: Event) {
        (**self).event(event);
    }

    fn looks_inside(&self) -> bool {
        (**self).looks_inside()
    }
}

/// Is shown everything if it is there.
impl<T: Trace> Trace for Option<T> {
    fn event(&mut self, event: Event) {
        if let Some(trace) = self {
            trace.event(event);
        }
    }

    fn looks_inside(&self) -> bool {
        self.as_ref().is_some_and(T::looks_inside)
    }
}

/// Both are shown everything.
impl<A: Trace, B: Trace> Trace for (A, B) {
    fn event(&mut self, event: Event) {
        self.0.event(event);
        self.1.event(event);
    }

    fn looks_inside(&self) -> bool {
        self.0.looks_inside() || self.1.looks_inside()
    }
}
