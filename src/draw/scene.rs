//! What one step of a tracker shows of itself, kept to be drawn.

use std::ops::Range;

use crate::geometry::Rect;
use crate::trace::{Cues, Event, Proposal, ResponseMap, Trace};

/// What one step shows of itself, of all targets. Clear it before each step; its buffers are reused.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    pub(crate) search_windows: Vec<Rect>,
    pub(crate) predictions: Vec<Rect>,
    pub(crate) proposals: Vec<Proposal>,
    pub(crate) neighbours: Vec<Rect>,
    /// Boxes with their weights.
    pub(crate) particles: Vec<(Rect, f64)>,
    /// Names with the windows that they are of.
    pub(crate) modes: Vec<(&'static str, Rect)>,
    /// The images of the first target that showed them.
    pub(super) cues: Option<KeptCues>,
    maps: Vec<MapShape>,
    /// Of all maps, one after the other.
    values: Vec<f32>,
}

/// The images of a target's region.
#[derive(Clone, Debug)]
pub(super) struct KeptCues {
    /// The target's id, and what the images say of it.
    pub(super) caption: String,
    pub(super) window: Rect,
    pub(super) rows: usize,
    pub(super) cols: usize,
    pub(super) images: [(&'static str, Vec<f32>); 4],
}

/// The shape of a map whose values are kept with those of others.
#[derive(Clone, Debug)]
struct MapShape {
    rows: usize,
    cols: usize,
    window: Rect,
    /// Where its values are.
    values: Range<usize>,
}

impl Scene {
    /// Forgets the last step.
    pub fn clear(&mut self) {
        self.search_windows.clear();
        self.predictions.clear();
        self.proposals.clear();
        self.neighbours.clear();
        self.particles.clear();
        self.modes.clear();
        self.cues = None;
        self.maps.clear();
        self.values.clear();
    }
}

impl Scene {
    /// The response maps that cover anything.
    pub(crate) fn maps(&self) -> impl Iterator<Item = ResponseMap<'_>> {
        let shown = self.maps.iter().filter(|map| map.rows > 0 && map.cols > 0 && map.window.area() > 0.0);
        shown.map(|map| ResponseMap {
            values: &self.values[map.values.clone()],
            rows: map.rows,
            cols: map.cols,
            window: map.window,
        })
    }

    fn keep_map(&mut self, map: &ResponseMap) {
        let first = self.values.len();
        self.values.extend_from_slice(map.values);
        let values = first..self.values.len();
        self.maps.push(MapShape { rows: map.rows, cols: map.cols, window: map.window, values });
    }

    fn keep_cues(&mut self, cues: &Cues) {
        self.cues.get_or_insert_with(|| KeptCues {
            caption: format!("#{} {}", cues.id, cues.name),
            window: cues.window,
            rows: cues.rows,
            cols: cues.cols,
            images: cues.images.map(|(name, values)| (name, values.to_vec())),
        });
    }
}

impl Trace for Scene {
    fn event(&mut self, event: Event) {
        match event {
            Event::Stage(_) | Event::Thresholds { .. } | Event::MadeAnew(_) => {}
            Event::SearchWindow(window) => self.search_windows.push(window),
            Event::Prediction(rect) => self.predictions.push(rect),
            Event::Response(map) => self.keep_map(map),
            Event::Cues(cues) => self.keep_cues(cues),
            Event::Proposals(proposals) => self.proposals.extend_from_slice(proposals),
            Event::Neighbour(rect) => self.neighbours.push(rect),
            Event::Particle { rect, weight } => self.particles.push((rect, weight)),
            Event::Mode { name, window } => self.modes.push((name, window)),
        }
    }
}
