//! The parameters of MAPTrack. What the paper gives a value for has it as its default, unless its description says
//! more.

use super::table::{group, groups};

group! {
    /// The picture that all is computed on.
    pub struct MaptrackImage at "maptrack.image." {
        pixels: i64 = 200000, in 1024..=16777216, is Basic; "Maximum number of pixels used to detect motion; larger frames are scaled down. Other `maptrack` lengths in px refer to the scaled image."
    }
}

group! {
    /// The model of the background, by which motion is found (M).
    pub struct MaptrackBackground at "maptrack.background." {
        window: i64 = 500, in 2..=100000, unit "frames", needs Background; "Length of the background's history. What stands still for about `window` x (1 - `share`) frames becomes background."
        share: f64 = 0.7, in 0.1..=0.999, needs Background; "Fraction of the time a pixel is assumed to show background."
        deviations: f64 = 3.5, in 0.5..=10.0, needs Background; "Distance within which a colour matches a Gaussian, in standard deviations."
        initial_deviation: f64 = 15.0, in 0.5..=64.0, needs Background; "Standard deviation of a new Gaussian, in grey levels. A larger one adapts to noise sooner; a smaller one separates similar colours."
        least_deviation: f64 = 4.0, in 0.5..=64.0, needs Background; "Minimum standard deviation of a Gaussian, in grey levels: the camera's noise."
        shadow: f64 = 0.6, in 0.0..=1.0, needs Background; "Darkest shadow, as a fraction of the background's brightness. 1 switches shadow detection off."
        believed: f64 = 0.5, in 0.0..=1.0; "Fraction of moving pixels above which motion is ignored, because the camera has moved or the light has changed. Tracking continues on colour and position, and no new target is found."
    }
}

group! {
    /// Targets that are found without a mark (section 3.2).
    pub struct MaptrackFind at "maptrack.find." {
        most: i64 = 64, in 0..=128, is Basic; "Maximum number of targets found without a mark. 0 finds none."
        lambda: i64 = 3, in 1..=99, unit "px", is Basic; "Diameter of the disc used to open and close the motion image (lambda)."
        least_area: f64 = 0.0007, in 0.0..=1.0, unit "of the image", is Basic; "Minimum area of a blob."
        start: f64 = 60.0, in 0.0..=1e9, is Basic; "Confidence above which a blob becomes a target (sigma). 60 is reached in the fifth consecutive frame."
        most_area: f64 = 0.25, in 0.0..=1.0, unit "of the image"; "Maximum area of a blob."
        orientation: f64 = 90.0, in 0.0..=90.0, unit "degrees"; "Maximum angle between an elongated blob and the vertical. 90 accepts all; less accepts only upright ones, such as people."
        moved: f64 = 0.2, in 0.0..=10.0, unit "target sizes", is Ablation; "Distance a blob must have moved from where it was first seen. The paper has 0."
        recall: f64 = 0.6, in 0.0..=1.0, is Ablation; "Colour similarity above which a blob near the predicted position is taken for a hidden target. 1 never does so, as in the paper."
    }
}

group! {
    /// What hides a target, and the end of a track (eqs 11 to 14).
    pub struct MaptrackOcclusion at "maptrack.occlusion." {
        frames: i64 = 150, in 1..=100000, unit "frames", is Basic; "Maximum number of frames a target may be occluded. After that its track ends; a marked target stays where it was last seen."
        begin: f64 = 0.3, in 0.0..=1.0; "Fraction of the recent best visibility below which a target is occluded (t_occ of eq 12)."
        believed: i64 = 3, in 0..=100000, unit "frames"; "Number of frames an occluded target is UNCERTAIN before it is LOST."
    }
}

group! {
    /// The pattern of marked targets; the paper has none of it.
    pub struct MaptrackPattern at "maptrack.pattern." {
        enabled: bool = true, needs Start; "Also follows marked targets with a correlation filter on HOG and colour names. Where the filter recognises the target, its position is used; otherwise the paper's images decide."
    }
}

group! {
    /// What keeps targets apart and boxes tight; the paper has none of it.
    pub struct MaptrackGroups at "maptrack.groups." {
        share: bool = true, is Ablation; "Assigns each moving pixel to the one target whose colours and shape it fits best, so that targets do not merge."
        settle: f64 = 0.7, in 0.0..=1.0, is Ablation; "Rate at which a box moves towards a blob that belongs to its target alone. 0 keeps the position from mean shift."
        size: f64 = 0.1, in 0.0..=1.0, is Ablation; "Rate at which the box takes the size of such a blob. 0 keeps the initial size."
    }
}

group! {
    /// Stabilisation (section 3.1).
    pub struct MaptrackStabilisation at "maptrack.stabilisation." {
        enabled: bool = false, is Basic; "Compensates for camera motion. For cameras that shake, pan or rotate."
    }
}

groups! {
    /// MAPTrack.
    pub struct MaptrackParams {
        /// The picture that all is computed on.
        image: MaptrackImage,
        /// Stabilisation.
        stabilisation: MaptrackStabilisation,
        /// The model of the background.
        background: MaptrackBackground,
        /// Targets that are found without a mark.
        find: MaptrackFind,
        /// What hides a target.
        occlusion: MaptrackOcclusion,
        /// The pattern of marked targets.
        pattern: MaptrackPattern,
        /// What keeps targets apart.
        groups: MaptrackGroups,
    }
}
