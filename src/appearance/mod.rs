//! What a target looks like: correlation filters on layers of features, a scale filter, and what a response says of it.
//!
//! [`Appearance`] learns a target in one frame and knows it in the next ones. Its settings are its own, and it knows of
//! no tracker: one that has no more to say of a target than its looks calls [`Appearance::recognise`]; others take its
//! stages and put theirs between.
//!
//! | file | what it holds |
//! |---|---|
//! | `settings.rs` | the settings |
//! | `layers.rs` | layers of features, from a frame to the spectra that filters work on |
//! | `filters.rs` | the correlation filters that answer together |
//! | `augment.rs` | altered looks at the first frame's target, which the filters learn as well |
//! | `correlator.rs` | the filters and the window that they look through (LCMHT eqs 1 to 9) |
//! | `scale.rs` | the one-dimensional scale filter |
//! | `matching.rs` | where a pair of networks finds the target as it was marked |
//! | `confidence.rs` | the states, from the response |

mod augment;
mod confidence;
mod correlator;
mod filters;
pub mod layers;
pub mod matching;
pub mod scale;
mod settings;

use crate::crop::Cropper;
use crate::frame::Frame;
use crate::geometry::Rect;
use crate::network::SharedCnn;
use crate::output::State;
pub use confidence::Confidence;
pub use correlator::{Answer, Correlator};
use scale::ScaleFilter;
pub use settings::{
    AppearanceSettings, COLOUR_COMPONENTS, ConfidenceSettings, FilterForm, FilterSettings, LookSettings,
    NetworkFilterSettings, ScaleSettings, SearchShape,
};

/// The looks of one target. All boxes are in pixels of the frame.
pub struct Appearance {
    /// Where it is.
    pub correlator: Correlator,
    /// How sure that is.
    pub confidence: Confidence,
    scale: Option<ScaleFilter>,
    settings: AppearanceSettings,
    /// Frames in which it was recognised for certain.
    certain: u32,
}

/// Where a target was recognised.
#[derive(Clone, Copy, Debug)]
pub struct Recognised {
    /// The box: where the filter answers best or, of a lost target, where it was.
    pub rect: Rect,
    /// How sure that is, as the response of this frame and those before tell it.
    pub state: State,
    /// How probable it is that the box overlaps the target by more than half.
    pub confidence: f64,
    /// Whether nothing at all was to be seen.
    pub blind: bool,
}

impl Appearance {
    /// Learns the target in `rect`, and gives the response to the very sample that the filter was trained on as well.
    /// Layers of a network are left out where none is given. Altered looks wait for [`Correlator::learn_look`].
    pub fn new(
        settings: &AppearanceSettings,
        network: Option<SharedCnn>,
        frame: &Frame,
        cropper: &mut Cropper,
        rect: &Rect,
    ) -> (Self, f64) {
        let (correlator, response) = Correlator::new(settings, network, frame, cropper, rect);
        let confidence = Confidence::new(&settings.confidence, response);
        let scale = settings.scale.as_ref().map(|settings| scale_filter(settings, frame, cropper, rect));
        (Self { correlator, confidence, scale, settings: settings.clone(), certain: 0 }, response)
    }

    /// What it is made of.
    pub fn settings(&self) -> &AppearanceSettings {
        &self.settings
    }

    /// How sure it is after the last frame.
    pub fn state(&self) -> State {
        self.confidence.state()
    }

    /// Takes over settings that need nothing made anew (the rates and steps of learning, the interval, `recrop`,
    /// `subcell`, the share of the network's filter, what is made of a response) and, if one is given, what runs the
    /// same network by now. What else differs waits for [`remake`](Self::remake): `settings` are those in force then.
    pub fn retune(&mut self, settings: &AppearanceSettings, network: Option<&SharedCnn>) {
        self.correlator.retune(settings, network);
        self.confidence.retune(&settings.confidence);
        self.settings = settings.clone();
    }

    /// Learns the target in `rect` anew, by which it is measured from now on. Gives what a response before is worth in
    /// responses from now on.
    pub fn remake(
        &mut self,
        settings: &AppearanceSettings,
        network: Option<SharedCnn>,
        frame: &Frame,
        cropper: &mut Cropper,
        rect: &Rect,
    ) -> f64 {
        let (correlator, response) = Correlator::new(settings, network, frame, cropper, rect);
        self.correlator = correlator;
        self.settings = AppearanceSettings { scale: self.settings.scale.clone(), ..settings.clone() };
        self.confidence.remake(response)
    }

    /// Learns anew what size the target in `rect` has.
    pub fn remake_scale(
        &mut self,
        settings: Option<&ScaleSettings>,
        frame: &Frame,
        cropper: &mut Cropper,
        rect: &Rect,
    ) {
        self.scale = settings.map(|settings| scale_filter(settings, frame, cropper, rect));
        self.settings.scale = settings.cloned();
    }

    /// The box `rect` in the size that the target has by now.
    pub fn resized(&mut self, frame: &Frame, cropper: &mut Cropper, rect: &Rect) -> Rect {
        self.scale.as_mut().map_or(*rect, |scale| scale.resized(frame, cropper, rect))
    }

    /// Whether the filters are updated in the `count`th frame.
    pub fn is_due(&self, count: u32) -> bool {
        count.is_multiple_of(self.settings.filter.interval)
    }

    /// Updates the filters with the target in `rect`, where it was looked for.
    pub fn learn(&mut self, frame: &Frame, cropper: &mut Cropper, rect: &Rect) {
        self.correlator.learn(frame, cropper, rect.centre(), rect.size());
        if let (Some(scale), Some(settings)) = (&mut self.scale, &self.settings.scale) {
            scale.learn(frame, cropper, rect, settings.learning_rate as f32);
        }
    }

    /// Looks for the target around `rect`, judges what answers there, tells its size and, in some of the frames in
    /// which it is certain, learns it.
    pub fn recognise(&mut self, frame: &Frame, cropper: &mut Cropper, rect: &Rect) -> Recognised {
        self.correlator.look(frame, cropper, rect.centre(), rect.size(), 0.0);
        let blind = self.correlator.is_blank();
        let Answer { centre, response, .. } = self.correlator.best(|_| 1.0);
        let state = self.confidence.judge(response);
        // Targets may jump: half of the way there would be neither here nor there.
        let place = if state == State::Lost { rect.centre() } else { centre };
        let mut found = Rect::around(frame.nearest(place), rect.size());
        if state == State::Tracking {
            found = self.resized(frame, cropper, &found);
            self.certain = self.certain.wrapping_add(1);
            if self.is_due(self.certain) {
                self.learn(frame, cropper, &found);
            }
        }
        self.correlator.learn_look(cropper);
        Recognised { rect: found, state, confidence: self.confidence.reported(response), blind }
    }
}

/// A scale filter that has learned the target in `rect`.
fn scale_filter(settings: &ScaleSettings, frame: &Frame, cropper: &mut Cropper, rect: &Rect) -> ScaleFilter {
    let mut filter = ScaleFilter::new(rect, settings.step, settings.area);
    filter.learn(frame, cropper, rect, 1.0);
    filter
}
