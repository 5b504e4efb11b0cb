//! The parameters of ETEPF. What the paper gives a value for has it as its default, unless its description says more.

use super::table::{choice, group, groups};

/// Side of the outer rectangle in target sizes; what is between it and the target is the background that is learned,
/// and measured in eq 4.
pub(crate) const SURROUND: f64 = 2.0;
/// Steps of mean shift, at most, to a local peak.
pub(crate) const CLIMB: i64 = 10;

choice! {
    /// What finds the target.
    pub enum EtepfMethod {
        /// Ensemble tracking embedded in a particle filter.
        Full = "full",
        /// Ensemble tracking alone (the paper's ET): mean shift from where the target was.
        MeanShift = "mean_shift",
        /// Colour-based particles alone (the paper's PF).
        Particles = "particles",
    }
}

choice! {
    /// What particles are weighed by beside their colours.
    pub enum Observation {
        /// The likelihood mean of the target against that of its surroundings (eq 4).
        Contrast = "contrast",
        /// The likelihood mean of the target alone, as in eq 9.
        Mean = "mean",
    }
}

group! {
    /// Features of pixels.
    pub struct EtepfFeatures at "etepf.features." {
        pixels: i64 = 2500, in 64..=1000000, needs Target; "Pixels of the target in the likelihood image, at most: a larger one is seen smaller."
    }
}

group! {
    /// The ensemble of weak classifiers.
    pub struct EtepfEnsemble at "etepf.ensemble." {
        classifiers: i64 = 5, in 1..=12, needs Classifiers; "Weak classifiers."
    }
}

group! {
    /// The adaptive motion model and the particles.
    pub struct EtepfParticles at "etepf.particles." {
        count: i64 = 10, in 1..=1000, is Basic; "Particles (N). Twice as many are weighed."
        least_noise: f64 = 5.0, in 0.1..=1000.0, unit "px"; "Least standard deviation of a step across and down."
        scale_noise: f64 = 0.01, in 0.0001..=0.5; "Standard deviation of a step of the scale."
        method: EtepfMethod = EtepfMethod::Full, is Ablation; "What finds the target: the whole tracker or, for comparison, one half of it alone."
        settle: i64 = 10, in 0..=100, is Ablation; "Steps of mean shift, at most, from the mean of the particles to where the target is taken to be; 0 takes the mean, as the paper does."
        observation: Observation = Observation::Contrast, is Ablation; "What particles are weighed by beside their colours: `mean` is eq 9."
        parts: i64 = 2, in 1..=8, needs Target, is Ablation; "Parts of the target, one below the other, that have a colour histogram each; 1 as in the paper."
    }
}

group! {
    /// The modes TRACK and FIND.
    pub struct EtepfModes at "etepf.modes." {
        certain: f64 = 0.5, in 0.0..=1.0, is Basic; "Likelihood mean above which the target is certain, and which a lost one must have to be taken up again (T1)."
        lost: f64 = 0.1, in 0.0..=1.0, is Basic; "Likelihood mean below which it is lost (T2): the mode is FIND."
        lost_contrast: f64 = 0.25, in -20.0..=20.0, unit "of the first frame's"; "Difference of the likelihood means (eq 4) below which it is lost; -20 leaves that to T2, as in the paper."
        lost_similar: f64 = 0.4, in 0.0..=1.0; "Similarity of colour histograms below which it is lost; 0 in the paper."
        similar: f64 = 0.7, in 0.0..=1.0; "Similarity of colour histograms above which a lost target is taken up again (T3); 0.5 in the paper."
        found_contrast: f64 = 0.4, in -20.0..=20.0, unit "of the first frame's"; "Difference of the likelihood means above which it is taken up again."
        extent: f64 = 8.0, in 1.0..=32.0, unit "target sizes"; "Side of the area around its last place in which a target is searched."
    }
}

group! {
    /// The update of the ensemble and the colours.
    pub struct EtepfUpdate at "etepf.update." {
        interval: i64 = 5, in 1..=1000, unit "frames"; "Frames from one training to the next."
        enabled: bool = true, is Ablation; "Trains the ensemble anew and renews the colours from time to time, while the target is certain; the paper does neither."
    }
}

groups! {
    /// ETEPF.
    pub struct EtepfParams {
        /// Features of pixels.
        features: EtepfFeatures,
        /// The ensemble of weak classifiers.
        ensemble: EtepfEnsemble,
        /// The adaptive motion model and the particles.
        particles: EtepfParticles,
        /// The modes TRACK and FIND.
        modes: EtepfModes,
        /// The update of the ensemble and the colours.
        update: EtepfUpdate,
    }
}
