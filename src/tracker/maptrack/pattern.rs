//! The pattern of a marked target, beyond the paper: correlation filters on HOG and colour names, and a scale filter.
//! Histograms know neither where in a target a colour is nor anything of grey pictures; and where the camera moves,
//! motion says nothing.

use crate::appearance::{Appearance, AppearanceSettings, ConfidenceSettings, ScaleSettings};
use crate::crop::Cropper;
use crate::frame::Frame;
use crate::geometry::Rect;

/// Area of the crops that sizes are compared in, in square pixels: small, for there may be many targets.
const SCALE_AREA: f64 = 512.0;
/// Response above which the pattern is recognised, in units of what the target usually gets.
const CERTAIN: f64 = 0.5;

/// Learns the pattern in `rect`, in pixels of the frame.
pub(super) fn learn(frame: &Frame, cropper: &mut Cropper, rect: &Rect) -> Appearance {
    let settings = AppearanceSettings {
        scale: Some(ScaleSettings { area: SCALE_AREA, ..ScaleSettings::default() }),
        confidence: ConfidenceSettings { activate: CERTAIN, ..ConfidenceSettings::default() },
        ..AppearanceSettings::default()
    };
    Appearance::new(&settings, None, frame, cropper, rect).0
}
