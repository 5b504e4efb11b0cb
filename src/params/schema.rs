//! The table of parameters, group by group. A row is name, type, default, range, unit, whether it is fixed once
//! the program runs, and one sentence.

use super::table::{choice, group, groups};
use crate::error::ParamsError;

choice! {
    /// The tracker behind the interface.
    pub enum Algorithm {
        /// Long-term correlation tracking with multi-layer hybrid features.
        Lcmht = "lcmht",
    }
}

choice! {
    /// How images arrive.
    pub enum ImageTransport {
        /// `sensor_msgs/msg/Image`.
        Raw = "raw",
    }
}

group! {
    /// What all trackers and ends share.
    pub struct General at "" {
        algorithm: Algorithm = Algorithm::Lcmht, @fixed; "The tracker that follows the target."
        image_transport: ImageTransport = ImageTransport::Raw, @fixed; "How images arrive."
        seed: i64 = 0, in 0..=i64::MAX, @fixed; "Seed of every random choice; the same seed gives the same boxes."
    }
}

group! {
    /// Debug images.
    pub struct Debug at "debug." {
        max_side: i64 = 240, in 16..=4096, unit "px"; "Largest side of raw debug images; larger frames are scaled down, for default DDS peers lose images of more than 130 KB."
        jpeg_quality: i64 = 80, in 1..=100; "JPEG quality of compressed debug images."
    }
}

group! {
    /// The correlation filter.
    pub struct LcmhtFilter at "lcmht.filter." {
        learning_rate: f64 = 0.015, in 0.0..=1.0; "Weight of a new sample."
        window: f64 = 4.0, in 1.5..=8.0; "Window."
        cells: i64 = 32, in 8..=128; "Cells."
        hog_components: i64 = 16, in 1..=31; "x"
        hog_weight: f64 = 1.0, in 0.0..=10.0; "x"
        cn_weight: f64 = 0.5, in 0.0..=10.0; "x"
        label_sigma: f64 = 0.1, in 0.01..=1.0; "x"
        mask: f64 = 1.2, in 0.5..=4.0; "x"
        memory: i64 = 20, in 2..=100; "x"
        regularisation: f64 = 0.05, in 0.0..=100.0; "x"
        interval: i64 = 2, in 1..=100; "x"
        steps: i64 = 3, in 1..=100; "x"
        scale_step: f64 = 1.02, in 1.0..=2.0; "x"
        scale_rate: f64 = 0.025, in 0.0..=1.0; "x"
    }
}

groups! {
    /// LCMHT.
    pub struct LcmhtParams {
        /// The correlation filter.
        filter: LcmhtFilter,
    }
}

groups! {
    /// Every parameter of the package.
    pub struct Params {
        /// What all trackers and ends share.
        general: General,
        /// Debug images.
        debug: Debug,
        /// LCMHT.
        lcmht: LcmhtParams,
    }
}

impl Params {
    /// Checks what a range cannot say: values that must fit each other.
    pub(super) fn check(&self) -> Result<(), ParamsError> {
        Ok(())
    }
}
