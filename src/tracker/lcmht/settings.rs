//! What the parameters make of the parts of the tracker.

use crate::appearance::layers::{Feature, LayerSource, LayerSpec};
use crate::appearance::{
    AppearanceSettings, COLOUR_COMPONENTS, ConfidenceSettings, FilterForm, FilterSettings, LookSettings,
    NetworkFilterSettings, ScaleSettings, SearchShape,
};
use crate::detect::online::DetectorSettings;
use crate::params::{
    FilterKind, HOG_COMPONENTS, LcmhtAugment, LcmhtCnn, LcmhtConfidence, LcmhtFilter, LcmhtLayers, LcmhtParams,
    LcmhtScale, LcmhtSvm, MEMORY, WindowShape,
};

/// What the target's appearance is made of.
pub(super) fn appearance(params: &LcmhtParams) -> AppearanceSettings {
    let LcmhtCnn { separate, share, regularisation, .. } = params.cnn;
    AppearanceSettings {
        layers: layers(&params.layers, &params.cnn),
        filter: filter(&params.filter),
        network_filter: separate.then_some(NetworkFilterSettings { share, regularisation }),
        looks: looks(&params.augment),
        scale: scale(&params.scale),
        confidence: confidence(&params.confidence),
    }
}

/// The layers. Those that the weights leave out are not computed.
fn layers(layers: &LcmhtLayers, cnn: &LcmhtCnn) -> Vec<LayerSpec> {
    let cells = |features: &[Feature], components| (LayerSource::Cells(features.to_vec()), components);
    let mut all: Vec<((LayerSource, Option<usize>), f64)> = Vec::new();
    if layers.joint {
        all.push((cells(&[Feature::Hog, Feature::ColourNames], None), layers.hog_weight));
    } else {
        all.push((cells(&[Feature::Hog], Some(HOG_COMPONENTS as usize)), layers.hog_weight));
        all.push((cells(&[Feature::ColourNames], Some(COLOUR_COMPONENTS)), layers.colour_weight));
    }
    if cnn.enabled {
        let outputs = cnn.components.iter().zip(&cnn.weights).enumerate();
        all.extend(
            outputs
                .map(|(output, (&n, &weight))| ((LayerSource::Network(output), (n > 0).then_some(n as usize)), weight)),
        );
    }
    let spec = |((source, components), weight): ((LayerSource, Option<usize>), f64)| {
        let energy = (!layers.joint).then_some(weight as f32);
        LayerSpec { source, components, energy, weight: weight as f32 }
    };
    all.into_iter().filter(|(_, weight)| *weight > 0.0).map(spec).collect()
}

fn filter(filter: &LcmhtFilter) -> FilterSettings {
    FilterSettings {
        form: match filter.kind {
            FilterKind::Masked => FilterForm::Masked,
            FilterKind::Kernelised => FilterForm::Kernelised,
        },
        window: filter.window,
        shape: match filter.window_shape {
            WindowShape::Square => SearchShape::Square,
            WindowShape::Target => SearchShape::Target,
        },
        cells: filter.cells as usize,
        regularisation: filter.regularisation,
        learning_rate: filter.learning_rate,
        interval: filter.interval as u32,
        memory: MEMORY as usize,
        recrop: filter.recrop,
        subcell: filter.subcell,
        ..FilterSettings::default()
    }
}

fn looks(augment: &LcmhtAugment) -> Option<LookSettings> {
    augment.enabled.then(LookSettings::default)
}

/// What the scale filter is made of, if one is wanted.
pub(super) fn scale(scale: &LcmhtScale) -> Option<ScaleSettings> {
    scale.enabled.then(|| ScaleSettings { area: scale.area, ..ScaleSettings::default() })
}

fn confidence(confidence: &LcmhtConfidence) -> ConfidenceSettings {
    ConfidenceSettings {
        relative: confidence.relative,
        activate: confidence.activate,
        reacquire: confidence.reacquire,
        train: confidence.train,
        lost: confidence.lost,
        patience: confidence.patience as u32,
        calibrated: confidence.calibrated,
        ..ConfidenceSettings::default()
    }
}

/// What the detector is made of.
pub(super) fn detector(svm: &LcmhtSvm) -> DetectorSettings {
    DetectorSettings { scan_extent: svm.scan_extent, ..DetectorSettings::PAPER }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::Params;

    #[test]
    fn without_a_network_the_defaults_are_those_of_an_appearance() {
        let mut params = Params::default().lcmht;
        params.cnn.enabled = false;
        assert_eq!(appearance(&params), AppearanceSettings::default());
    }
}
