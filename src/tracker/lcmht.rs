//! Long-term correlation tracking with multi-layer hybrid features (Baisa, Bhowmik and Wallace).

use super::{Output, Tracker};
use crate::frame::Frame;
use crate::geometry::Rect;
use crate::params::Params;
use crate::trace::Trace;

/// The tracker.
pub struct Lcmht;

impl Lcmht {
    /// A tracker that waits for a mark.
    pub fn new(_params: &Params) -> Self {
        Self
    }
}

impl Tracker for Lcmht {
    fn start(&mut self, _frame: &Frame, _rect: Rect, _trace: &mut dyn Trace) {}
    fn step(&mut self, _frame: &Frame, _dt: f64, _trace: &mut dyn Trace, output: &mut Output) {
        for target in &mut output.targets {
            target.age += 1;
            target.reacquired = false;
        }
    }
    fn retune(&mut self, _params: &Params) {}
}
