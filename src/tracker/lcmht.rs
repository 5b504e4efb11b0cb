//! Long-term correlation tracking with multi-layer hybrid features: LCMHT (Baisa, Bhowmik and Wallace).
//!
//! A correlation filter on layers of features finds the target from frame to frame; a GM-PHD filter knows its motion;
//! when the response says that the target is gone, an online support vector machine proposes places, the GM-PHD filter
//! weighs them, and the correlation filter has the last word. `LcmhtTarget::step` is the paper's Algorithm 1.
//!
//! The paper learns in every frame, and so learns what hides the target. Here, by default, nothing is learned from a
//! frame whose response is low for this target, and a target that keeps answering badly is lost: its box goes on as the
//! motion model expects until the filter sees it again, near there or where the detector proposes. The preset
//! `params/paper.yaml` sets everything to the paper's own.
//!
//! | file | what it holds |
//! |---|---|
//! | `lcmht/target.rs` | one target, and Algorithm 1 |
//! | `lcmht/target/redetect.rs` | how a lost target is found again |
//! | `lcmht/judge.rs` | whether what is followed is still the target that was marked |
//! | `lcmht/settings.rs` | what the parameters make of the parts |
//! | `lcmht/matching.rs` | what matching networks say of the target, and how far they are believed |
//! | `lcmht/motion.rs` | the motion model and the GM-PHD filter (eqs 17 to 24) |
//! | `lcmht/neighbours.rs` | what looks like the target, so that it is not taken for it |
//! | `lcmht/sweep.rs` | which part of the image a lost target is searched for in next |
//! | `lcmht/turn.rs` | how far the picture is turned that the target is looked for in |
//! | `appearance/` | the layers, the response of the filters to them (eqs 1 to 9), and the states that follow from it |
//! | `detect/online.rs` | the support vector machine (eqs 10 to 16) |

mod judge;
mod matching;
mod motion;
mod neighbours;
mod settings;
mod sweep;
mod target;
#[cfg(test)]
mod tests;
mod turn;

use std::sync::Arc;

use super::made::Made;
use super::targets::{Rooms, Targets};
use super::{NewId, Output, State, Tracker};
use crate::crop::Cropper;
use crate::frame::Frame;
use crate::geometry::Rect;
use crate::network::Networks;
use crate::params::{LcmhtParams, Need, Params};
use crate::trace::{Event, Stage, Trace};
use target::LcmhtTarget;

/// The tracker.
pub struct Lcmht {
    params: LcmhtParams,
    seed: u64,
    croppers: Rooms<Cropper>,
    /// The networks that are wanted.
    networks: Networks,
    targets: Targets<LcmhtTarget>,
    /// What changed parameters had made anew since the last frame.
    made: Made,
}

impl Lcmht {
    /// A tracker that waits for a mark. Without a network, what it gives is left out.
    pub fn new(params: &Params, networks: Networks) -> Self {
        Self {
            params: params.lcmht.clone(),
            seed: params.general.seed.unsigned_abs(),
            croppers: Rooms::default(),
            networks,
            targets: Targets::default(),
            made: Made::default(),
        }
    }
}

impl Tracker for Lcmht {
    fn start(&mut self, id: &Arc<str>, frame: &Frame, rect: Rect, trace: &mut dyn Trace) {
        trace.event(Event::Stage(Stage::Learn));
        let Self { params, seed, croppers, networks, .. } = self;
        let followed = LcmhtTarget::new(id.clone(), params, networks.clone(), *seed, frame, croppers.own(), rect);
        self.targets.add(followed);
    }

    fn stop(&mut self, id: &str) {
        self.targets.stop(id);
    }

    fn clear(&mut self) {
        self.targets = Targets::default();
    }

    fn catch_up(&mut self, id: &str, frame: &Frame, dt: f64, trace: &mut dyn Trace) {
        let Self { targets, croppers, .. } = self;
        targets.catch_up(id, trace, |target, trace| target.step(frame, croppers.own(), dt, trace));
    }

    fn step(&mut self, frame: &Frame, dt: f64, _: &mut NewId, trace: &mut dyn Trace) {
        let Self { params, croppers, networks, targets, made, .. } = self;
        made.show(trace);
        targets.step(croppers, trace, |target, cropper, trace| target.step(frame, cropper, dt, trace));
        // One at most is made anew in a frame, which takes as long as a mark.
        let mut outdated = targets.iter_mut().filter(|target| target.params != *params);
        if let Some(target) = outdated.find(|target| target.appearance.state() == State::Tracking) {
            target.remake(params, networks.clone(), frame, croppers.own(), trace);
        }
    }

    fn report(&self, output: &mut Output) {
        self.targets.report(output);
    }

    fn retune(&mut self, params: &Params, networks: Networks) {
        if !self.networks.are(&networks) {
            self.made.note(Need::Runtime);
        }
        self.networks = networks;
        self.params = params.lcmht.clone();
        for target in self.targets.iter_mut() {
            if target.retune(&self.params, &self.networks) {
                self.made.note(Need::Motion);
            }
        }
    }
}
