//! What the parameters make of the parts of the tracker.

use crate::appearance::layers::{Feature, LayerSpec, Source};
use crate::appearance::{
    AppearanceSettings, COLOUR_COMPONENTS, ConfidenceSettings, FilterForm, FilterSettings, LookSettings,
    NetworkFilterSettings, ScaleSettings, SearchShape,
};
use crate::detect::online;
use crate::learn::svm::SvmParams;
use crate::params::{
    FilterKind, LcmhtAugment, LcmhtCnn, LcmhtConfidence, LcmhtFilter, LcmhtLayers, LcmhtParams, LcmhtScale, LcmhtSvm,
    WindowShape,
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
    let cells = |features: &[Feature], components| (Source::Cells(features.to_vec()), components);
    let mut all: Vec<((Source, Option<usize>), f64)> = Vec::new();
    if layers.joint {
        all.push((cells(&[Feature::Hog, Feature::ColourNames], None), layers.hog_weight));
    } else {
        all.push((cells(&[Feature::Hog], Some(layers.hog_components as usize)), layers.hog_weight));
        all.push((cells(&[Feature::ColourNames], Some(COLOUR_COMPONENTS)), layers.colour_weight));
    }
    if cnn.enabled {
        let outputs = cnn.components.iter().zip(&cnn.weights).enumerate();
        all.extend(
            outputs.map(|(output, (&n, &weight))| ((Source::Network(output), (n > 0).then_some(n as usize)), weight)),
        );
    }
    let spec = |((source, components), weight): ((Source, Option<usize>), f64)| {
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
        label_sigma: filter.label_sigma,
        regularisation: filter.regularisation,
        learning_rate: filter.learning_rate,
        interval: filter.interval as u32,
        mask: filter.mask,
        memory: filter.memory as usize,
        first_weight: filter.first_weight,
        steps: filter.steps as usize,
        recrop: filter.recrop,
        subcell: filter.subcell,
    }
}

fn looks(augment: &LcmhtAugment) -> Option<LookSettings> {
    let LcmhtAugment { enabled, blur, scale, mirror, turn } = *augment;
    enabled.then_some(LookSettings { blur, scale, mirror, turn })
}

/// What the scale filter is made of, if one is wanted.
pub(super) fn scale(scale: &LcmhtScale) -> Option<ScaleSettings> {
    let LcmhtScale { enabled, step, area, learning_rate, .. } = *scale;
    enabled.then_some(ScaleSettings { step, area, learning_rate })
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
        adapt: confidence.adapt,
    }
}

/// What the detector is made of.
pub(super) fn detector(svm: &LcmhtSvm) -> online::Settings {
    online::Settings {
        svm: SvmParams { c: svm.c, gamma: svm.gamma, max_support: svm.max_support as usize },
        template_cells: svm.template_cells as usize,
        positive_iou: svm.positive_iou,
        negative_iou: svm.negative_iou,
        positives: svm.positives as usize,
        negatives_per_positive: svm.negatives_per_positive as usize,
        learn_extent: svm.learn_extent,
        scan_extent: svm.scan_extent,
        proposals: svm.proposals as usize,
    }
}

/// `params`, but what filters and detector are made of as it is in `made`.
pub(super) fn with_made(made: &LcmhtParams, params: &LcmhtParams) -> LcmhtParams {
    LcmhtParams {
        scale: LcmhtScale {
            learning_rate: params.scale.learning_rate,
            max_step: params.scale.max_step,
            ..made.scale.clone()
        },
        svm: LcmhtSvm { template_cells: made.svm.template_cells, ..params.svm.clone() },
        ..with_made_filters(made, params)
    }
}

/// `params`, but what the correlation filters are made of as it is in `made`. What may change under them is how they learn
/// and refine, the share of the network's filter, and what runs the network.
pub(super) fn with_made_filters(made: &LcmhtParams, params: &LcmhtParams) -> LcmhtParams {
    let LcmhtFilter { learning_rate, interval, steps, subcell, recrop, .. } = params.filter;
    let LcmhtCnn { share, inference, threads, .. } = params.cnn;
    LcmhtParams {
        filter: LcmhtFilter { learning_rate, interval, steps, subcell, recrop, ..made.filter.clone() },
        cnn: LcmhtCnn { share, inference, library: params.cnn.library.clone(), threads, ..made.cnn.clone() },
        layers: made.layers.clone(),
        augment: made.augment.clone(),
        ..params.clone()
    }
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
