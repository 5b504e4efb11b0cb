//! Names that parameters had once, for those who still set them.

/// Each with the value that is a constant now.
const CONSTANTS: [(&str, &str); 76] = [
    ("lcmht.layers.hog_components", "16"),
    ("lcmht.filter.label_sigma", "0.1 target sizes"),
    ("lcmht.filter.mask", "1.2 target sizes"),
    ("lcmht.filter.memory", "20"),
    ("lcmht.filter.first_weight", "0.1"),
    ("lcmht.filter.steps", "3"),
    ("lcmht.augment.blur", "0.07 target sizes"),
    ("lcmht.augment.scale", "1.1"),
    ("lcmht.augment.mirror", "true"),
    ("lcmht.augment.turn", "20 degrees"),
    ("lcmht.turn.step", "20 degrees"),
    ("lcmht.turn.below", "0.8"),
    ("lcmht.turn.gain", "1.25"),
    ("lcmht.turn.aspect", "1.5"),
    ("lcmht.scale.step", "1.02"),
    ("lcmht.scale.learning_rate", "0.025"),
    ("lcmht.confidence.adapt", "0.05"),
    ("lcmht.neighbours.response", "0.3"),
    ("lcmht.neighbours.width", "0.25 target sizes"),
    ("lcmht.motion.prior", "0.5"),
    ("lcmht.motion.process_x", "0.0004"),
    ("lcmht.motion.process_y", "0.0004"),
    ("lcmht.motion.process_size_1", "0.0001"),
    ("lcmht.motion.process_size_2", "0.0001"),
    ("lcmht.motion.measured_x", "0.01"),
    ("lcmht.motion.measured_y", "0.01"),
    ("lcmht.motion.measured_size_1", "0.01"),
    ("lcmht.motion.measured_size_2", "0.01"),
    ("lcmht.phd.survival", "0.99"),
    ("lcmht.phd.detection", "0.95"),
    ("lcmht.phd.clutter_rate", "4"),
    ("lcmht.phd.birth_weight", "0.01"),
    ("lcmht.phd.birth_velocity", "0.01"),
    ("lcmht.phd.prune", "0.00001"),
    ("lcmht.phd.merge", "4"),
    ("lcmht.phd.max_components", "50"),
    ("lcmht.svm.c", "2"),
    ("lcmht.svm.gamma", "1"),
    ("lcmht.svm.max_support", "100"),
    ("lcmht.svm.template_cells", "20"),
    ("lcmht.svm.positive_iou", "0.9"),
    ("lcmht.svm.negative_iou", "0.3"),
    ("lcmht.svm.positives", "2"),
    ("lcmht.svm.negatives_per_positive", "3"),
    ("lcmht.svm.learn_extent", "4 target sizes"),
    ("lcmht.svm.proposals", "5"),
    ("etepf.features.radius", "2 px"),
    ("etepf.ensemble.surround", "2 target sizes"),
    ("etepf.ensemble.examples", "1000"),
    ("etepf.particles.history", "5 frames"),
    ("etepf.particles.spread", "1"),
    ("etepf.particles.climb", "10"),
    ("etepf.particles.lambda", "20"),
    ("etepf.modes.widen", "1.2"),
    ("etepf.update.memory", "5"),
    ("etepf.update.first", "0.5"),
    ("etepf.update.colours", "0.2"),
    ("etepf.update.contrast", "0.7"),
    ("etepf.update.similar", "0.8"),
    ("maptrack.background.gaussians", "4"),
    ("maptrack.find.gain", "0.5"),
    ("maptrack.find.drop", "0"),
    ("maptrack.model.margin", "1.5 target sizes"),
    ("maptrack.model.colours", "30 frames"),
    ("maptrack.model.shape", "10 frames"),
    ("maptrack.model.edge", "0"),
    ("maptrack.model.motion_weight", "1"),
    ("maptrack.model.colour_weight", "0.3"),
    ("maptrack.model.position_weight", "0.02"),
    ("maptrack.model.steps", "3"),
    ("maptrack.model.history", "150 frames"),
    ("maptrack.occlusion.end", "0.3"),
    ("maptrack.occlusion.widths", "3 regions"),
    ("maptrack.occlusion.drift", "0.5 regions"),
    ("maptrack.pattern.window", "4 target sizes"),
    ("maptrack.pattern.certain", "0.5"),
];

/// The constant that has taken the place of a parameter.
pub(super) fn constant(name: &str) -> Option<&'static str> {
    CONSTANTS.iter().find(|(gone, _)| *gone == name).map(|(_, value)| *value)
}

#[cfg(test)]
mod tests {
    use super::super::{Params, Phase, Value, descriptor};
    use super::*;

    #[test]
    fn what_became_of_a_name_is_told_where_it_is_set() {
        for (name, value) in CONSTANTS {
            assert!(descriptor(name).is_none(), "{name}");
            for phase in [Phase::StartUp, Phase::Running] {
                let why = Params::default().with([(name, &Value::Integer(1))], phase).unwrap_err().to_string();
                assert_eq!(why, format!("unknown parameter '{name}'; it is now a constant: {value}"));
            }
        }
    }
}
