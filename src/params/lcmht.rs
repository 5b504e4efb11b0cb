//! The parameters of LCMHT. What the paper gives a value for is named as there; its own values make the preset
//! `params/paper.yaml`.

use super::table::{choice, group, groups};
use crate::error::ParamsError;

choice! {
    /// The correlation filter.
    pub enum FilterKind {
        /// Confined to the target, trained on a memory of samples.
        Masked = "masked",
        /// The paper's kernel ridge regression, one a layer, in closed form.
        Kernelised = "kernelised",
    }
}

choice! {
    /// The shape of the search window.
    pub enum WindowShape {
        /// A square of `window` times the root of the target's area.
        Square = "square",
        /// `window` times the target's sides.
        Target = "target",
    }
}

choice! {
    /// What the constant-velocity model holds of a box (cv-motion-model eqs 10 and 11, section III.2).
    pub enum MotionForm {
        /// `[x, y, vx, vy, w, h]`.
        Size = "size",
        /// `[x, y, vx, vy, w, h, vw, vh]`.
        MovingSize = "moving_size",
        /// Centre, area, aspect ratio; velocities of centre and area.
        AreaAspect = "area_aspect",
        /// Centre, aspect ratio, height; velocities of all.
        AspectHeight = "aspect_height",
    }
}

group! {
    /// Features and layers.
    pub struct LcmhtLayers at "lcmht.layers." {
        joint: bool = false, needs Filters, is Ablation; "Puts HOG and colour names into one layer of 42 channels, as in the paper, instead of a layer each."
        hog_weight: f64 = 1.0, in 0.0..=10.0, needs Filters, is Ablation; "Energy of the HOG layer; 0 leaves it out. With `lcmht.layers.joint`, the weight of the joint layer's response (gamma of eq 6)."
        colour_weight: f64 = 0.5, in 0.0..=10.0, needs Filters, is Ablation; "Energy of the colour-name layer; 0 leaves it out. Ignored with `lcmht.layers.joint`."
    }
}

choice! {
    /// The order of a network's input channels.
    pub enum ChannelOrder {
        /// Red, green, blue.
        Rgb = "rgb",
        /// Blue, green, red.
        Bgr = "bgr",
    }
}

choice! {
    /// What runs a network.
    pub enum Inference {
        /// ONNX Runtime where its library is named or installed, otherwise the built-in library.
        Auto = "auto",
        /// The built-in library.
        Builtin = "builtin",
        /// ONNX Runtime.
        OnnxRuntime = "onnxruntime",
    }
}

group! {
    /// Layers of a convolutional network.
    pub struct LcmhtCnn at "lcmht.cnn." {
        enabled: bool = true, needs Network, is Basic; "Adds layers of features from a convolutional network."
        side: i64 = 192, in 32..=1024, unit "px", needs Network, is Basic; "Side of the network's input. The search window is resampled to it."
        file: String = "", needs Restart; "ONNX file of the network. If empty, the embedded EfficientNet-Lite0 (up to block 10) is used."
        mean: Vec<f64> = vec![127.0; 3], needs Network; "Mean subtracted from each input channel (0 to 255)."
        scale: Vec<f64> = vec![128.0; 3], needs Network; "Scale each input channel is then divided by."
        order: ChannelOrder = ChannelOrder::Rgb, needs Network; "Order of the network's input channels."
        outputs: Vec<String> = ["block4", "block10"].map(String::from), needs Network; "Outputs of the network to use, one layer each."
        weights: Vec<f64> = [0.1, 0.2], needs Filters; "Energy of each of these layers; 0 leaves one out. With `lcmht.layers.joint`, the weight of its response (gamma of eq 6)."
        components: Vec<i64> = [8, 32], needs Filters; "Number of principal components kept of each of these layers. 0 keeps all channels unchanged."
        inference: Inference = Inference::Auto, needs Runtime; "Library that runs networks. `auto` uses ONNX Runtime if it is installed and the built-in RTen otherwise."
        library: String = "", needs Restart; "Path of ONNX Runtime's shared library. If empty, ORT_DYLIB_PATH is used, then the system's library path."
        threads: i64 = 1, in 1..=64, needs Runtime; "Number of threads per network."
        separate: bool = true, needs Filters, is Ablation; "Trains a separate masked filter on the network's layers and adds its response to that of the hand-crafted layers; otherwise one filter is trained on all layers."
        share: f64 = 0.2, in 0.0..=1.0, is Ablation; "Share of the separate filter's response."
        regularisation: f64 = 0.2, in 1e-8..=10.0, needs Filters, is Ablation; "Regularisation of the separate filter."
    }
}

/// What intensities may be reduced and divided by at most, and divided by at least: single precision holds what comes
/// of it.
const GREATEST_INPUT: f64 = 1e6;
const LEAST_SCALE: f64 = 1e-6;
/// Outputs of a network that may become layers.
const MOST_OUTPUTS: usize = 16;
/// Channels that an output of a network has at most, as far as is known before it is loaded.
const WIDEST: i64 = 512;
/// Channels of HOG and colour names.
const HAND_CRAFTED: [i64; 2] = [31, 11];
/// Principal components of HOG that are kept: half of its channels hold nearly all of its variance.
pub(crate) const HOG_COMPONENTS: i64 = 16;
/// Samples that a masked filter remembers, those of the first frame among them. With many altered looks it has room for
/// more.
pub(crate) const MEMORY: i64 = 20;
/// Conjugate-gradient steps of an update with a later sample.
pub(crate) const STEPS: usize = 3;
/// Altered looks at the target in the first frame, with the true one: they are remembered beside the other samples.
const LOOKS: i64 = 12;

impl LcmhtCnn {
    /// Checks that the lists are as long as they must be and hold what they may.
    fn check(&self) -> Result<(), ParamsError> {
        let wrong = |text: String| Err(ParamsError::Conflict(text));
        for (name, values) in [("mean", &self.mean), ("scale", &self.scale)] {
            if values.len() != 3 || values.iter().any(|v| v.is_nan() || v.abs() > GREATEST_INPUT) {
                return wrong(format!(
                    "lcmht.cnn.{name} must hold 3 numbers of at most {GREATEST_INPUT}, got {values:?}"
                ));
            }
        }
        if self.scale.iter().any(|&v| v < LEAST_SCALE) {
            return wrong(format!("lcmht.cnn.scale must hold numbers of at least {LEAST_SCALE}, got {:?}", self.scale));
        }
        let count = self.outputs.len();
        if count == 0 {
            return wrong(
                "lcmht.cnn.outputs must name an output; lcmht.cnn.enabled switches the network off".to_owned(),
            );
        }
        if count > MOST_OUTPUTS {
            return wrong(format!("lcmht.cnn.outputs may name {MOST_OUTPUTS} outputs, got {count}"));
        }
        if self.weights.len() != count || self.components.len() != count {
            return wrong(format!(
                "lcmht.cnn.outputs, .weights and .components must be equally long, got {count}, {} and {}",
                self.weights.len(),
                self.components.len()
            ));
        }
        if let Some(weight) = self.weights.iter().find(|w| !(0.0..=10.0).contains(*w)) {
            return wrong(format!("lcmht.cnn.weights must be from 0 to 10, got {weight}"));
        }
        if let Some(components) = self.components.iter().find(|&&n| n < 0) {
            return wrong(format!("lcmht.cnn.components must not be negative, got {components}"));
        }
        Ok(())
    }
}

group! {
    /// A pair of networks that finds the target as it was marked.
    pub struct LcmhtMatching at "lcmht.matching." {
        enabled: bool = false, needs Network, is Basic; "Adds matching networks, which compare the search window with the marked target. Their score map becomes a layer; their boxes give width and height. They are the files that `lcmht.matching.backbone` and `.head` name; without names, the embedded head on the embedded network."
        backbone: String = "", needs Restart, is Basic; "ONNX file of the backbone, which computes features of the template and the search window."
        head: String = "", needs Restart, is Basic; "ONNX file of the head, which locates the template in the search window."
        share: f64 = 0.35, in 0.0..=1.0; "Share of the score map in the response that selects the target's position."
        size_rate: f64 = 0.35, in 0.0..=1.0; "Rate at which width and height follow the networks' box where its score is high."
        centre_rate: f64 = 0.5, in 0.0..=1.0; "Rate at which the centre follows the networks' box where its score is high."
    }
}

group! {
    /// The correlation filter.
    pub struct LcmhtFilter at "lcmht.filter." {
        window: f64 = 4.0, in 1.5..=8.0, unit "target sizes", needs Filters, is Basic; "Side of the search window."
        cells: i64 = 48, in 16..=96, needs Filters; "Number of cells along the longer side of the search window. With `lcmht.filter.window_shape` = `target`, small windows use fewer, at 4 px per cell."
        learning_rate: f64 = 0.03, in 0.0..=1.0; "Learning rate: the weight of a new sample (eta of eq 8)."
        interval: i64 = 2, in 1..=100, unit "frames"; "Number of frames between updates of the filter."
        kind: FilterKind = FilterKind::Masked, needs Filters, is Ablation; "Correlation filter: `masked` is confined to the target and trained on a memory of samples; `kernelised` is the paper's."
        window_shape: WindowShape = WindowShape::Square, needs Filters, is Ablation; "Shape of the search window: a `square`, or that of the `target`."
        regularisation: f64 = 0.05, in 1e-8..=10.0, needs Filters, is Ablation; "Regularisation of the filter (lambda of eq 2). The network's separate filter has its own."
        recrop: bool = false, is Ablation; "Crops a new training sample at the position found, as in the paper, instead of shifting the one that was searched."
        subcell: bool = true, is Ablation; "Refines the peak of the response map to sub-cell precision."
    }
}

group! {
    /// The scale filter.
    pub struct LcmhtScale at "lcmht.scale." {
        enabled: bool = true, needs Scale, is Basic; "Estimates the target's size with a scale filter; otherwise the size stays as marked."
        max_step: f64 = 0.1, in 0.0..=100.0, unit "target sizes per frame"; "Motion per frame above which blur makes the size unreliable, so the last size is kept."
        area: f64 = 2048.0, in 64.0..=16384.0, unit "square px", needs Scale, is Ablation; "Area of the crops used to compare sizes. Larger crops resolve size more finely and take longer."
    }
}

group! {
    /// What is made of a response.
    pub struct LcmhtConfidence at "lcmht.confidence." {
        activate: f64 = 0.5, in 0.0..=10.0, is Basic; "Response below which the target is UNCERTAIN and nothing is learned (T_ad)."
        lost: f64 = 0.35, in 0.0..=10.0, is Basic; "Mean response over UNCERTAIN frames below which the target is LOST and re-detection begins."
        patience: i64 = 5, in 0..=1000, unit "frames", is Basic; "Minimum number of UNCERTAIN frames before the target can be LOST."
        reacquire: f64 = 0.6, in 0.0..=10.0; "Response needed to re-acquire a lost target at a position proposed by the detector. At the predicted position `lcmht.confidence.activate` is enough."
        looks: i64 = 10, in 0..=1000; "Number of first looks at the target that every frame is compared with. A target that is not recognised by them is UNCERTAIN, is not re-acquired, and has a low confidence. 0 turns this off: the response alone decides, as in the paper."
        train: f64 = 0.6, in 0.0..=10.0; "Response above which the detector is trained (T_td)."
        relative: bool = true, is Ablation; "Measures responses relative to the target's usual response; otherwise the thresholds are absolute, as in the paper."
        gate: bool = true, is Ablation; "Learns only while the target is TRACKING; otherwise in every frame, as in the paper's Algorithm 1."
        calibrated: bool = true, is Ablation; "Reports the confidence as the probability that the box overlaps the target by more than half; otherwise as the response relative to the usual one."
    }
}

group! {
    /// The constant-velocity model.
    pub struct LcmhtMotion at "lcmht.motion." {
        enabled: bool = true, is Ablation; "Centres the search window on the predicted position; otherwise on the last one, as in the paper."
        form: MotionForm = MotionForm::Size, needs Motion, is Ablation; "State vector of the motion model."
        prior_min: f64 = 0.4, in 0.01..=10.0, unit "target sizes", is Ablation; "Minimum standard deviation of the Gaussian prior that weights peaks by their distance from the predicted position."
        prior_max: f64 = 2.0, in 0.01..=10.0, unit "target sizes", is Ablation; "Maximum standard deviation of that prior."
    }
}

group! {
    /// The online support vector machine that re-detects.
    pub struct LcmhtSvm at "lcmht.svm." {
        scan_extent: f64 = 6.0, in 1.5..=16.0, unit "target sizes", is Basic; "Side of the area that is searched for a lost target."
        areas: i64 = 6, in 0..=100; "Maximum number of areas of the image, each of 5 x 5 target sizes, that are searched per frame for a lost target, beyond its surroundings. The whole image is searched within 20 frames, or more slowly if that takes more areas. 0 searches only the surroundings, as in the paper. Needs `lcmht.confidence.looks`."
        opinion: f64 = 0.3, in 0.0..=10.0; "How much a negative SVM margin lowers the response, per unit of margin, in every frame. 0 uses the detector only for lost targets, as in the paper."
        least_margin: f64 = 0.0, in -100.0..=100.0, is Ablation; "SVM margin below which a lost target is not re-acquired, whatever its response."
        interval: i64 = 1, in 1..=1000, is Ablation; "Number of filter updates per training of the detector."
    }
}

group! {
    /// Altered looks at the target in the first frame.
    pub struct LcmhtAugment at "lcmht.augment." {
        enabled: bool = true, needs Filters, is Ablation; "Also trains masked filters on augmented views of the target in the first frame, which together weigh as much as the original."
    }
}

group! {
    /// Search windows that turn with the target.
    pub struct LcmhtTurn at "lcmht.turn." {
        enabled: bool = true; "When the response is low, also searches windows rotated to either side and keeps the better rotation; otherwise the search window stays upright."
    }
}

group! {
    /// What looks like the target and is not.
    pub struct LcmhtNeighbours at "lcmht.neighbours." {
        enabled: bool = true, is Ablation; "Also tracks objects that look like the target, so that their peaks are not taken for the target."
    }
}

groups! {
    /// LCMHT.
    pub struct LcmhtParams {
        /// Features and layers.
        layers: LcmhtLayers,
        /// Layers of a convolutional network.
        cnn: LcmhtCnn,
        /// A pair of networks that finds the target as it was marked.
        matching: LcmhtMatching,
        /// The correlation filter.
        filter: LcmhtFilter,
        /// Altered looks at the target in the first frame.
        augment: LcmhtAugment,
        /// Search windows that turn with the target.
        turn: LcmhtTurn,
        /// The scale filter.
        scale: LcmhtScale,
        /// What is made of a response.
        confidence: LcmhtConfidence,
        /// What looks like the target and is not.
        neighbours: LcmhtNeighbours,
        /// The constant-velocity model.
        motion: LcmhtMotion,
        /// The online support vector machine.
        svm: LcmhtSvm,
    }
}

impl LcmhtParams {
    /// About how many values the samples of a target have, all channels and bins together.
    pub(super) fn sample_values(&self) -> f64 {
        let [hog, colours] = HAND_CRAFTED;
        let hand_crafted = if self.layers.joint { hog } else { HOG_COMPONENTS } + colours;
        let kept = |&components: &i64| if components == 0 { WIDEST } else { components.min(WIDEST) };
        let network: i64 = if self.cnn.enabled { self.cnn.components.iter().map(kept).sum() } else { 0 };
        let samples = match self.filter.kind {
            FilterKind::Masked => MEMORY + LOOKS,
            FilterKind::Kernelised => 2,
        };
        // The transform of real values has half as many bins as there are cells, and a column.
        let bins = self.filter.cells * (self.filter.cells / 2 + 1);
        [samples, bins, hand_crafted + network].into_iter().map(|n| n as f64).product()
    }

    /// Checks what the parameters of a group, or of several, have to do with each other.
    pub(super) fn check(&self) -> Result<(), ParamsError> {
        self.cnn.check()?;
        let LcmhtLayers { joint, hog_weight, colour_weight, .. } = self.layers;
        let hand_crafted = hog_weight > 0.0 || (!joint && colour_weight > 0.0);
        if hand_crafted || (self.cnn.enabled && self.cnn.weights.iter().any(|&weight| weight > 0.0)) {
            return Ok(());
        }
        Err(ParamsError::Conflict(format!(
            "no layer is left: lcmht.layers.joint is {joint}, .hog_weight {hog_weight} and .colour_weight \
             {colour_weight}, \
             lcmht.cnn.enabled {} and .weights {:?}",
            self.cnn.enabled, self.cnn.weights
        )))
    }
}

#[cfg(test)]
mod tests {
    use crate::params::{Params, Phase, Value};

    #[test]
    fn a_set_that_leaves_no_layer_is_refused() {
        let with = |changes: &[(&str, Value)]| {
            Params::default().with(changes.iter().map(|(name, value)| (*name, value)), Phase::Running)
        };
        let off = |name| (name, Value::Double(0.0));
        let [hog, colour] = ["lcmht.layers.hog_weight", "lcmht.layers.colour_weight"].map(off);
        let joint = ("lcmht.layers.joint", Value::Bool(true));
        let without = ("lcmht.cnn.enabled", Value::Bool(false));
        let unweighted = ("lcmht.cnn.weights", Value::DoubleArray(vec![0.0; 2]));
        assert!(with(&[hog.clone(), colour.clone()]).is_ok());
        assert!(with(&[hog.clone(), without.clone()]).is_ok());
        assert!(with(&[colour.clone(), joint.clone(), without.clone()]).is_ok());
        for network in [without, unweighted] {
            for layers in [[hog.clone(), colour.clone()], [hog.clone(), joint.clone()]] {
                let why = with(&[layers.as_slice(), std::slice::from_ref(&network)].concat()).unwrap_err().to_string();
                assert!(why.contains("no layer is left") && why.contains(".hog_weight 0"), "{why}");
            }
        }
    }
}
