//! The parameters of MAPTrack. What the paper gives a value for has it as its default, unless its description says
//! more.

use super::table::{group, groups};

group! {
    /// The picture that all is computed on.
    pub struct MaptrackImage at "maptrack.image." {
        pixels: i64 = 200000, in 1024..=16777216, is Basic; "Pixels of the picture that motion is found in, at most: a larger frame is seen smaller. Lengths below that are in px are in its pixels."
    }
}

group! {
    /// The model of the background, by which motion is found (M).
    pub struct MaptrackBackground at "maptrack.background." {
        window: i64 = 500, in 2..=100000, unit "frames", needs Background; "Frames that count; what stands still for about this long, times 1 less the share, becomes background."
        share: f64 = 0.7, in 0.1..=0.999, needs Background; "Share of the time that a pixel shows background."
        deviations: f64 = 3.5, in 0.5..=10.0, needs Background; "Standard deviations within which a colour fits a Gaussian."
        initial_deviation: f64 = 15.0, in 0.5..=64.0, needs Background; "Standard deviation of a new Gaussian, in intensities: a wide one learns noise soon, a narrow one keeps apart what looks alike."
        least_deviation: f64 = 4.0, in 0.5..=64.0, needs Background; "Least standard deviation of a Gaussian, in intensities: the noise of the camera."
        shadow: f64 = 0.6, in 0.0..=1.0, needs Background; "Share of the background's brightness that a shadow leaves at least; 1 looks for no shadows."
        believed: f64 = 0.5, in 0.0..=1.0; "Share of moving pixels above which motion tells nothing, for the camera has moved or the light has changed: colour and position go on alone, and nothing is found."
    }
}

group! {
    /// Targets that are found without a mark (section 3.2).
    pub struct MaptrackFind at "maptrack.find." {
        most: i64 = 64, in 0..=128, is Basic; "Targets that are found and followed at the same time, at most, beside those that are marked; 0 finds none."
        lambda: i64 = 3, in 1..=99, unit "px", is Basic; "Diameter of the disc by which the motion image is opened and closed."
        least_area: f64 = 0.0007, in 0.0..=1.0, unit "of the image", is Basic; "Least area of a blob."
        start: f64 = 60.0, in 0.0..=1e9, is Basic; "Confidence above which a target is taken up (sigma): 60 is reached in the 5th frame in a row."
        most_area: f64 = 0.25, in 0.0..=1.0, unit "of the image"; "Largest area of a blob."
        orientation: f64 = 90.0, in 0.0..=90.0, unit "degrees"; "Largest angle between a long blob and the upright: 90 takes all, less takes upright ones alone, as people are."
        moved: f64 = 0.2, in 0.0..=10.0, unit "target sizes", is Ablation; "How far a blob must have come from where it was seen first; the paper has 0."
        recall: f64 = 0.6, in 0.0..=1.0, is Ablation; "Likeness of colours above which a hidden target is taken for the one that is found near where it is expected; 1 takes none for it, as in the paper."
    }
}

group! {
    /// What hides a target, and the end of a track (eqs 11 to 14).
    pub struct MaptrackOcclusion at "maptrack.occlusion." {
        frames: i64 = 150, in 1..=100000, unit "frames", is Basic; "Frames that a target may be hidden; then the track ends, or a marked one stays where it was seen last."
        begin: f64 = 0.3, in 0.0..=1.0; "Share of the best visibility of late below which a target is hidden (t_occ of eq 12)."
        believed: i64 = 3, in 0..=100000, unit "frames"; "Frames for which a hidden target is uncertain; then it is lost."
    }
}

group! {
    /// The pattern of marked targets; the paper has none of it.
    pub struct MaptrackPattern at "maptrack.pattern." {
        enabled: bool = true, needs Start; "Knows a marked target by its pattern as well: where a correlation filter on HOG and colour names recognises it, it is taken to be there; where not, the paper's images decide."
    }
}

group! {
    /// What keeps targets apart and boxes tight; the paper has none of it.
    pub struct MaptrackGroups at "maptrack.groups." {
        share: bool = true, is Ablation; "Gives each moving pixel to one target, the one whose colours and shape it suits best, so that none swallows another."
        settle: f64 = 0.7, in 0.0..=1.0, is Ablation; "Share of the way that a box goes to that of the moving blob which is its target's alone; 0 leaves it where mean shift does."
        size: f64 = 0.1, in 0.0..=1.0, is Ablation; "Share by which its size goes there; 0 keeps the size of the start."
    }
}

group! {
    /// Stabilisation (section 3.1).
    pub struct MaptrackStabilisation at "maptrack.stabilisation." {
        enabled: bool = false, is Basic; "Takes out the motion of the camera before anything else is looked at; for cameras that shake, pan or turn."
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
