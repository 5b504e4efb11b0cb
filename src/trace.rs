//! What a tracker shows of its inside while it works, for debug images and timing.
//!
//! The core never draws and knows no clock: it calls a [`Trace`], and `()` is the one that does nothing.

use crate::geometry::Rect;

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

/// Receives what happens inside a step. Every method does nothing unless it is overridden.
pub trait Trace {
    /// A stage begins, and the one before it ends.
    fn stage(&mut self, _stage: Stage) {}
    /// The search window of this frame, in pixels.
    fn search_window(&mut self, _window: Rect) {}
    /// The motion model's guess before the frame was looked at, in pixels.
    fn prediction(&mut self, _rect: Rect) {}
    /// The fused response map over the search window.
    fn response(&mut self, _map: &ResponseMap) {}
    /// The images that a response is made of, of one target.
    fn cues(&mut self, _cues: &Cues) {}
    /// What the re-detector proposes on this frame; of MAPTrack, the blobs of what moves.
    fn proposals(&mut self, _proposals: &[Proposal]) {}
    /// What looks like a target and is not: a box in pixels.
    fn neighbour(&mut self, _rect: Rect) {}
    /// A particle: a box in pixels, and its share of all weight.
    fn particle(&mut self, _rect: Rect, _weight: f64) {}
    /// The mode that the tracker is in, with the window that it searches in.
    fn mode(&mut self, _name: &'static str, _window: Rect) {}
}

impl Trace for () {}

/// Both are shown everything.
impl<A: Trace, B: Trace> Trace for (A, B) {
    fn stage(&mut self, stage: Stage) {
        self.0.stage(stage);
        self.1.stage(stage);
    }

    fn search_window(&mut self, window: Rect) {
        self.0.search_window(window);
        self.1.search_window(window);
    }

    fn prediction(&mut self, rect: Rect) {
        self.0.prediction(rect);
        self.1.prediction(rect);
    }

    fn response(&mut self, map: &ResponseMap) {
        self.0.response(map);
        self.1.response(map);
    }

    fn cues(&mut self, cues: &Cues) {
        self.0.cues(cues);
        self.1.cues(cues);
    }

    fn proposals(&mut self, proposals: &[Proposal]) {
        self.0.proposals(proposals);
        self.1.proposals(proposals);
    }

    fn neighbour(&mut self, rect: Rect) {
        self.0.neighbour(rect);
        self.1.neighbour(rect);
    }

    fn particle(&mut self, rect: Rect, weight: f64) {
        self.0.particle(rect, weight);
        self.1.particle(rect, weight);
    }

    fn mode(&mut self, name: &'static str, window: Rect) {
        self.0.mode(name, window);
        self.1.mode(name, window);
    }
}
