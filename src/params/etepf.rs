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
        pixels: i64 = 2500, in 64..=1000000, needs Target; "Maximum number of target pixels in the likelihood image; a larger target is scaled down."
    }
}

group! {
    /// The ensemble of weak classifiers.
    pub struct EtepfEnsemble at "etepf.ensemble." {
        classifiers: i64 = 5, in 1..=12, needs Classifiers; "Number of weak classifiers."
    }
}

group! {
    /// The adaptive motion model and the particles.
    pub struct EtepfParticles at "etepf.particles." {
        count: i64 = 10, in 1..=1000, is Basic; "Number of particles (N). Twice as many are weighted."
        least_noise: f64 = 5.0, in 0.1..=1000.0, unit "px"; "Minimum standard deviation of a particle's step in x and y."
        scale_noise: f64 = 0.01, in 0.0001..=0.5; "Standard deviation of a particle's step in scale."
        method: EtepfMethod = EtepfMethod::Full, is Ablation; "Which part runs: the `full` tracker or, for comparison, only `mean_shift` or `particles`."
        settle: i64 = 10, in 0..=100, is Ablation; "Maximum number of mean-shift steps from the particles' mean to the reported position. 0 reports the mean, as in the paper."
        observation: Observation = Observation::Contrast, is Ablation; "Likelihood used to weight particles, besides colour: `mean` is eq 9."
        parts: i64 = 2, in 1..=8, needs Target, is Ablation; "Number of parts, stacked vertically, with a colour histogram each. The paper has 1."
    }
}

group! {
    /// The modes TRACK and FIND.
    pub struct EtepfModes at "etepf.modes." {
        certain: f64 = 0.5, in 0.0..=1.0, is Basic; "Mean likelihood above which the target is TRACKING, and above which a lost one can be re-acquired (T1)."
        lost: f64 = 0.1, in 0.0..=1.0, is Basic; "Mean likelihood below which the target is LOST and the mode is FIND (T2)."
        lost_contrast: f64 = 0.25, in -20.0..=20.0, unit "of the first frame's"; "Difference of mean likelihoods (eq 4) below which the target is LOST. -20 leaves the decision to T2, as in the paper."
        lost_similar: f64 = 0.4, in 0.0..=1.0; "Colour similarity below which the target is LOST. The paper has 0."
        similar: f64 = 0.7, in 0.0..=1.0; "Colour similarity above which a lost target is re-acquired (T3). The paper has 0.5."
        found_contrast: f64 = 0.4, in -20.0..=20.0, unit "of the first frame's"; "Difference of mean likelihoods (eq 4) above which a lost target is re-acquired."
        extent: f64 = 8.0, in 1.0..=32.0, unit "target sizes"; "Side of the area, around the last position, that is searched for a lost target."
    }
}

group! {
    /// The update of the ensemble and the colours.
    pub struct EtepfUpdate at "etepf.update." {
        interval: i64 = 5, in 1..=1000, unit "frames"; "Number of frames between trainings."
        enabled: bool = true, is Ablation; "Retrains the ensemble and updates the colour histograms while the target is TRACKING. The paper does neither."
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
