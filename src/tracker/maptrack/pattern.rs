//! The pattern of a marked target, beyond the paper: correlation filters on HOG and colour names, and a scale filter.
//! Histograms know neither where in a target a colour is nor anything of grey pictures; and where the camera moves, motion
//! says nothing.

use crate::appearance::{Appearance, AppearanceSettings, ConfidenceSettings, FilterSettings, ScaleSettings};
use crate::crop::Cropper;
use crate::frame::Frame;
use crate::geometry::Rect;
use crate::params::MaptrackPattern;

/// Area of the crops that sizes are compared in, in square pixels: small, for there may be many targets.
const SCALE_AREA: f64 = 512.0;

/// Learns the pattern in `rect`, in pixels of the frame.
pub(super) fn learn(frame: &Frame, cropper: &mut Cropper, rect: &Rect, params: &MaptrackPattern) -> Appearance {
    let settings = AppearanceSettings {
        filter: FilterSettings { window: params.window, ..FilterSettings::default() },
        scale: Some(ScaleSettings { area: SCALE_AREA, ..ScaleSettings::default() }),
        confidence: ConfidenceSettings { activate: params.certain, ..ConfidenceSettings::default() },
        ..AppearanceSettings::default()
    };
    Appearance::new(&settings, None, frame, cropper, rect).0
}
