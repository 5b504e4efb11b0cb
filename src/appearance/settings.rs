//! What an [`Appearance`](super::Appearance) is made of. The defaults are those of hand-crafted features alone.

use super::layers::{Feature, LayerSource, LayerSpec};

/// Eleven probabilities sum to one: ten components hold them all.
pub const COLOUR_COMPONENTS: usize = 10;

/// All settings.
#[derive(Clone, Debug, PartialEq)]
pub struct AppearanceSettings {
    /// The layers of features; one at least.
    pub layers: Vec<LayerSpec>,
    /// The correlation filter.
    pub filter: FilterSettings,
    /// A filter of its own for the layers of a network; `None` trains one on all layers.
    pub network_filter: Option<NetworkFilterSettings>,
    /// Altered looks at the first frame's target; `None` trains on the true one alone.
    pub looks: Option<LookSettings>,
    /// The scale filter; `None` leaves the size as it is.
    pub scale: Option<ScaleSettings>,
    /// What is made of a response.
    pub confidence: ConfidenceSettings,
}

impl Default for AppearanceSettings {
    fn default() -> Self {
        Self {
            layers: vec![
                LayerSpec::scaled(LayerSource::Cells(vec![Feature::Hog]), Some(16), 1.0),
                LayerSpec::scaled(LayerSource::Cells(vec![Feature::ColourNames]), Some(COLOUR_COMPONENTS), 0.5),
            ],
            filter: FilterSettings::default(),
            network_filter: Some(NetworkFilterSettings::default()),
            looks: Some(LookSettings::default()),
            scale: Some(ScaleSettings::default()),
            confidence: ConfidenceSettings::default(),
        }
    }
}

/// The correlation filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilterForm {
    /// Confined to the target, trained on a memory of samples.
    Masked,
    /// Kernel ridge regression, one a layer, in closed form (LCMHT eqs 1 to 9).
    Kernelised,
}

/// The shape of the search window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SearchShape {
    /// A square of the root of the target's area.
    Square,
    /// That of the target.
    Target,
}

/// The correlation filter, and the window that it looks through. Lengths count in target sizes.
#[derive(Clone, Debug, PartialEq)]
pub struct FilterSettings {
    /// What it is.
    pub form: FilterForm,
    /// Side of the search window.
    pub window: f64,
    /// Shape of the search window.
    pub shape: SearchShape,
    /// Cells along its longer side.
    pub cells: usize,
    /// Width of the Gaussian label (sigma of LCMHT eq 1).
    pub label_sigma: f64,
    /// Weight of the filter's norm (lambda of eq 2).
    pub regularisation: f64,
    /// Weight of a new sample (eta of eq 8).
    pub learning_rate: f64,
    /// Frames from one update to the next; 1 at least.
    pub interval: u32,
    /// Side of the area that a masked filter is confined to.
    pub mask: f64,
    /// Samples that a masked filter remembers.
    pub memory: usize,
    /// Weight that the first sample of a masked filter never falls below.
    pub first_weight: f64,
    /// Conjugate-gradient steps of an update of a masked filter.
    pub steps: usize,
    /// Whether the sample to learn is cut anew, instead of shifting the one that was searched.
    pub recrop: bool,
    /// Whether the peak is refined below a cell.
    pub subcell: bool,
}

impl Default for FilterSettings {
    fn default() -> Self {
        Self {
            form: FilterForm::Masked,
            window: 4.0,
            shape: SearchShape::Square,
            cells: 48,
            label_sigma: 0.1,
            regularisation: 0.05,
            learning_rate: 0.03,
            interval: 2,
            mask: 1.2,
            memory: 20,
            first_weight: 0.1,
            steps: 3,
            recrop: false,
            subcell: true,
        }
    }
}

/// A masked filter for the layers of a network alone.
#[derive(Clone, Debug, PartialEq)]
pub struct NetworkFilterSettings {
    /// Share of its response in that of all.
    pub share: f64,
    /// Weight of its norm.
    pub regularisation: f64,
}

impl Default for NetworkFilterSettings {
    fn default() -> Self {
        Self { share: 0.2, regularisation: 0.2 }
    }
}

/// Altered looks at the target in the first frame.
#[derive(Clone, Debug, PartialEq)]
pub struct LookSettings {
    /// How far a look is blurred to either side, in target sizes; 0 leaves these looks out.
    pub blur: f64,
    /// How much larger, and smaller, the target looks; 1 leaves these looks out.
    pub scale: f64,
    /// Whether a filter of the network's layers learns the mirrored target as well.
    pub mirror: bool,
    /// How far it is turned in looks that such a filter learns as well, in degrees; 0 leaves these looks out.
    pub turn: f64,
}

impl Default for LookSettings {
    fn default() -> Self {
        Self { blur: 0.07, scale: 1.1, mirror: true, turn: 20.0 }
    }
}

/// The scale filter.
#[derive(Clone, Debug, PartialEq)]
pub struct ScaleSettings {
    /// Ratio of neighbouring scales, above 1.
    pub step: f64,
    /// Area of the crops that sizes are compared in, in square pixels.
    pub area: f64,
    /// Weight of a new sample.
    pub learning_rate: f64,
}

impl Default for ScaleSettings {
    fn default() -> Self {
        Self { step: 1.02, area: 2048.0, learning_rate: 0.025 }
    }
}

/// What is made of a response. Thresholds count in the unit that `relative` says.
#[derive(Clone, Debug, PartialEq)]
pub struct ConfidenceSettings {
    /// Whether responses are measured in units of what the target usually gets.
    pub relative: bool,
    /// Below, the target is uncertain (T_ad of LCMHT section 4.2).
    pub activate: f64,
    /// What a lost target must get at a place that was proposed.
    pub reacquire: f64,
    /// Above, the target is an example to learn from (T_td).
    pub train: f64,
    /// Mean of uncertain frames below which the target is lost.
    pub lost: f64,
    /// Uncertain frames before the target can be lost.
    pub patience: u32,
    /// Whether the probability of a good box is reported, instead of the response.
    pub calibrated: bool,
    /// Rate at which the usual response follows that of a frame.
    pub adapt: f64,
}

impl Default for ConfidenceSettings {
    fn default() -> Self {
        Self {
            relative: true,
            activate: 0.5,
            reacquire: 0.6,
            train: 0.6,
            lost: 0.35,
            patience: 5,
            calibrated: true,
            adapt: 0.05,
        }
    }
}
