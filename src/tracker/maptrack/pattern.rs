//! The pattern of a marked target, beyond the paper: LCMHT's correlation filter on HOG and colour names, and its scale
//! filter. Histograms know neither where in a target a colour is nor anything of grey pictures; and where the camera moves,
//! motion says nothing.

use crate::crop::Cropper;
use crate::dcf::scale::ScaleFilter;
use crate::frame::Frame;
use crate::geometry::Rect;
use crate::params::{LcmhtParams, MaptrackPattern};
use crate::tracker::State;
use crate::tracker::lcmht::appearance::{Answer, Appearance};
use crate::tracker::lcmht::confidence::Confidence;

/// Area of the crops that sizes are compared in, in square pixels: small, for there may be many targets.
const SCALE_AREA: f64 = 512.0;

/// The filters. All boxes are in pixels of the frame.
pub(super) struct Pattern {
    settings: LcmhtParams,
    appearance: Appearance,
    scale: ScaleFilter,
    confidence: Confidence,
    frames: u32,
}

/// Where a pattern is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Recognised {
    /// The box: where the filter answers best or, of a lost target, where it was.
    pub(super) rect: Rect,
    /// How sure that is, as LCMHT tells it from the response of this frame and those before.
    pub(super) state: State,
    /// How probable it is that the box overlaps the target by more than half.
    pub(super) confidence: f64,
    /// Whether nothing at all was to be seen.
    pub(super) blind: bool,
}

impl Pattern {
    /// Learns the pattern in `rect`.
    pub(super) fn new(frame: &Frame, cropper: &mut Cropper, rect: &Rect, params: &MaptrackPattern) -> Self {
        let mut settings = LcmhtParams::default();
        settings.cnn.enabled = false;
        settings.filter.window = params.window;
        settings.confidence.activate = params.certain;
        settings.scale.area = SCALE_AREA;
        let (appearance, response) = Appearance::new(&settings, None, frame, cropper, rect);
        let mut scale = ScaleFilter::new(rect, settings.scale.step, settings.scale.area);
        scale.learn(frame, cropper, rect, 1.0);
        let confidence = Confidence::new(&settings.confidence, response);
        Self { settings, appearance, scale, confidence, frames: 0 }
    }

    /// Looks for the pattern around `rect`. What is certain is learned.
    pub(super) fn recognise(&mut self, frame: &Frame, cropper: &mut Cropper, rect: &Rect) -> Recognised {
        self.appearance.look(frame, cropper, rect.centre(), rect.size(), 0.0);
        let blind = self.appearance.is_blank();
        let Answer { centre, response } = self.appearance.best(|_| 1.0);
        let was_lost = self.confidence.state() == State::Lost;
        self.confidence.assess(response);
        if was_lost && self.confidence.is_convincing(response) {
            self.confidence.found();
        }
        let state = self.confidence.state();
        let bounds = frame.bounds();
        // Targets may jump: half of the way there would be neither here nor there.
        let place = if state == State::Lost { rect.centre() } else { centre };
        let place = [place[0].clamp(0.0, bounds.w), place[1].clamp(0.0, bounds.h)];
        let mut found = Rect::around(place, rect.size());
        if state == State::Tracking {
            found = self.scale.resized(frame, cropper, &found);
            self.learn(frame, cropper, &found);
        }
        self.appearance.learn_look(cropper);
        Recognised { rect: found, state, confidence: self.confidence.reported(response), blind }
    }

    fn learn(&mut self, frame: &Frame, cropper: &mut Cropper, rect: &Rect) {
        self.frames = self.frames.wrapping_add(1);
        if self.frames.is_multiple_of(self.settings.filter.interval as u32) {
            self.appearance.learn(frame, cropper, rect.centre(), rect.size());
            self.scale.learn(frame, cropper, rect, self.settings.scale.learning_rate as f32);
        }
    }
}
