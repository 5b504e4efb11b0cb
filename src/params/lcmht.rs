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
        joint: bool = false, needs Filters, is Ablation; "HOG and colour names make one layer of 42 channels as in the paper, instead of a layer each."
        hog_weight: f64 = 1.0, in 0.0..=10.0, needs Filters, is Ablation; "Energy of the HOG layer, 0 leaves it out; of the joint layer, the weight of its response (gamma of eq 6)."
        colour_weight: f64 = 0.5, in 0.0..=10.0, needs Filters, is Ablation; "Energy of the colour-name layer, 0 leaves it out; separate layers only."
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
        enabled: bool = true, needs Network, is Basic; "Adds the outputs of a convolutional network to the layers."
        side: i64 = 192, in 32..=1024, unit "px", needs Network, is Basic; "Side of the network's input, to which the search window is resampled."
        file: String = "", needs Restart; "ONNX file of the network; empty takes the embedded one, EfficientNet-Lite0 up to block 10."
        mean: Vec<f64> = vec![127.0; 3], needs Network; "What is taken from the intensities (0 to 255) of each input channel."
        scale: Vec<f64> = vec![128.0; 3], needs Network; "What the intensities of each input channel are then divided by."
        order: ChannelOrder = ChannelOrder::Rgb, needs Network; "Order of the input channels."
        outputs: Vec<String> = ["block4", "block10"].map(String::from), needs Network; "Outputs of the network that become a layer each."
        weights: Vec<f64> = [0.1, 0.2], needs Filters; "Energy of each of these layers, 0 leaves one out; with a joint hand-crafted layer, the weight of its response (gamma of eq 6)."
        components: Vec<i64> = [8, 32], needs Filters; "Principal components of each of these layers that are kept; 0 keeps all channels as they are."
        inference: Inference = Inference::Auto, needs Runtime; "What runs the network."
        library: String = "", needs Restart; "ONNX Runtime's shared library; empty takes what ORT_DYLIB_PATH names, otherwise the system's."
        threads: i64 = 1, in 1..=64, needs Runtime; "Threads that run the network."
        separate: bool = true, needs Filters, is Ablation; "Trains a masked filter on these layers alone, whose response is added to that of the hand-crafted ones; otherwise one filter is trained on all layers."
        share: f64 = 0.2, in 0.0..=1.0, is Ablation; "Share of that filter's response."
        regularisation: f64 = 0.2, in 1e-8..=10.0, needs Filters, is Ablation; "Weight of that filter's norm."
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
            return wrong(format!("lcmht.cnn.weights must lie in 0 to 10, got {weight}"));
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
        enabled: bool = false, needs Network, is Basic; "Adds a pair of matching networks, which find the target as it was marked: their score map becomes a layer, their boxes tell width and height. Needs backbone and head."
        backbone: String = "", needs Restart, is Basic; "ONNX file of the network that makes features of template and search window."
        head: String = "", needs Restart, is Basic; "ONNX file of the network that finds the template in the search window."
        share: f64 = 0.35, in 0.0..=1.0; "Share of the score map in the response that the target's place is chosen by."
        size_rate: f64 = 0.35, in 0.0..=1.0; "Share of the networks' width and height that one frame takes over where they are sure."
        centre_rate: f64 = 0.5, in 0.0..=1.0; "Share of the networks' centre that is taken over where they are sure."
    }
}

group! {
    /// The correlation filter.
    pub struct LcmhtFilter at "lcmht.filter." {
        window: f64 = 4.0, in 1.5..=8.0, unit "target sizes", needs Filters, is Basic; "Side of the search window."
        cells: i64 = 48, in 16..=96, needs Filters; "Cells along the longer side of the search window; windows that need fewer at 4 px a cell get fewer where the shape is that of the target."
        learning_rate: f64 = 0.03, in 0.0..=1.0; "Weight of a new sample (eta of eq 8)."
        interval: i64 = 2, in 1..=100, unit "frames"; "Frames from one update to the next."
        kind: FilterKind = FilterKind::Masked, needs Filters, is Ablation; "The correlation filter."
        window_shape: WindowShape = WindowShape::Square, needs Filters, is Ablation; "Shape of the search window."
        regularisation: f64 = 0.05, in 1e-8..=10.0, needs Filters, is Ablation; "Weight of the filter's norm (lambda of eq 2); a separate filter of the network's layers has its own."
        recrop: bool = false, is Ablation; "Cuts the sample to learn anew around the position found, as the paper does, instead of shifting the one that was searched."
        subcell: bool = true, is Ablation; "Refines the peak below a cell of the response map."
    }
}

group! {
    /// The scale filter.
    pub struct LcmhtScale at "lcmht.scale." {
        enabled: bool = true, needs Scale, is Basic; "Estimates the target's size by a scale filter; otherwise it stays as marked."
        max_step: f64 = 0.1, in 0.0..=100.0, unit "target sizes a frame"; "Way of the target from one frame to the next beyond which it is blurred too much for its size to be told, and keeps that it had."
        area: f64 = 2048.0, in 64.0..=16384.0, unit "square px", needs Scale, is Ablation; "Area of the crops that sizes are compared in: larger ones tell sizes apart more finely, and take longer."
    }
}

group! {
    /// What is made of a response.
    pub struct LcmhtConfidence at "lcmht.confidence." {
        activate: f64 = 0.5, in 0.0..=10.0, is Basic; "Response below which the target is uncertain and nothing is learned (T_ad)."
        lost: f64 = 0.35, in 0.0..=10.0, is Basic; "Mean response of uncertain frames below which the target is lost and re-detection begins."
        patience: i64 = 5, in 0..=1000, unit "frames", is Basic; "Uncertain frames before the target can be lost."
        reacquire: f64 = 0.6, in 0.0..=10.0; "Response that a lost target must get where the detector proposes it; where it is expected, activate is enough."
        train: f64 = 0.6, in 0.0..=10.0; "Response above which the detector learns (T_td)."
        relative: bool = true, is Ablation; "Measures responses in units of what the target usually gets; otherwise the thresholds are responses, as in the paper."
        gate: bool = true, is Ablation; "Learns only while the target is certain; otherwise in every frame, as the paper's Algorithm 1."
        calibrated: bool = true, is Ablation; "Reports as confidence how probable it is that the box overlaps the target by more than half; otherwise the response in units of what the target usually gets."
    }
}

group! {
    /// The constant-velocity model.
    pub struct LcmhtMotion at "lcmht.motion." {
        enabled: bool = true, is Ablation; "Looks for the target where the motion model expects it; otherwise where it was, as in the paper."
        form: MotionForm = MotionForm::Size, needs Motion, is Ablation; "What the model holds of a box. Lengths count in target sizes."
        prior_min: f64 = 0.4, in 0.01..=10.0, unit "target sizes", is Ablation; "Least width of the Gaussian by which a peak counts less the farther it is from where the target is expected."
        prior_max: f64 = 2.0, in 0.01..=10.0, unit "target sizes", is Ablation; "Greatest width of that Gaussian."
    }
}

group! {
    /// The online support vector machine that re-detects.
    pub struct LcmhtSvm at "lcmht.svm." {
        scan_extent: f64 = 6.0, in 1.5..=16.0, unit "target sizes", is Basic; "Side of the area that is scanned for a lost target."
        opinion: f64 = 0.3, in 0.0..=10.0; "Share of the response that each unit of a negative margin takes away in every frame; 0 asks the detector only for a lost target, as the paper."
        least_margin: f64 = 0.0, in -100.0..=100.0, is Ablation; "Margin below which a lost target is not taken up again, whatever its response."
        interval: i64 = 1, in 1..=1000, is Ablation; "Updates of the filter from one training of the detector to the next."
    }
}

group! {
    /// Altered looks at the target in the first frame.
    pub struct LcmhtAugment at "lcmht.augment." {
        enabled: bool = true, needs Filters, is Ablation; "Trains a masked filter on altered looks at the target in the first frame as well, which weigh as much as the true one."
    }
}

group! {
    /// Search windows that turn with the target.
    pub struct LcmhtTurn at "lcmht.turn." {
        enabled: bool = true; "Looks for a target that answers poorly in pictures turned to either side as well, and goes on with that in which it answers better; otherwise the picture stays as it is."
    }
}

group! {
    /// What looks like the target and is not.
    pub struct LcmhtNeighbours at "lcmht.neighbours." {
        enabled: bool = true, is Ablation; "Follows what looks like the target as well, so that a peak which it explains is not taken for the target."
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
