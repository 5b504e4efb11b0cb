//! The correlation filters on layers of features, and the window that they look through.

use std::collections::VecDeque;
use std::sync::Arc;

use super::augment::Look;
use super::filters::Filters;
use super::layers::{Cut, Extractor, LayerSource, LayerSpec, SeenByNetwork};
use super::settings::{AppearanceSettings, FilterSettings, SearchShape};
use crate::crop::{Alteration, Cropper, turn_about};
use crate::dcf::fft::Fft2;
use crate::dcf::response::{Peak, centred, highest, local_maxima};
use crate::dcf::sample::Sample;
use crate::features::CELL;
use crate::features::contrast::AROUND;
use crate::frame::Frame;
use crate::geometry::{Rect, turned};
use crate::network::SharedCnn;
use crate::trace::{Event, ResponseMap, Trace};

/// Local maxima of a response map that are weighed against the motion model.
const PEAKS: usize = 8;
/// A place of an added layer answers as far as this, in widths of its Gaussian.
const REACH: f64 = 3.0;
/// Cells along a side of the search window, at least: fewer have no room for a label.
const MIN_CELLS: usize = 8;

/// The filters and the window that they look through.
pub struct Correlator {
    settings: FilterSettings,
    rows: usize,
    cols: usize,
    fft: Fft2,
    extractor: Extractor,
    filters: Filters,
    view: SearchView,
    /// The look that another one is compared with.
    aside: SearchView,
    peaks: Vec<Peak>,
    answers: Vec<Answer>,
    /// Altered looks at the first frame's target that have not been learned yet.
    looks: VecDeque<(Look, Arc<Cut>)>,
    /// What is looked at.
    cut: Cut,
    shown: Vec<f32>,
    /// Room to turn what is shown.
    spare: Vec<f32>,
    /// The layer that was added to the response, and the response without it; the latter is empty if none was.
    layer: Vec<f32>,
    unlayered: Vec<f32>,
    /// Whether nothing else was looked at since the last look.
    is_newest: bool,
}

/// A look through the search window.
#[derive(Default)]
struct SearchView {
    window: Rect,
    /// How far the picture is turned about the window's centre, in degrees clockwise.
    turn: f64,
    /// Whether the window showed nothing that could be followed: then nothing answers.
    blank: bool,
    /// What the window showed, and the response to it (wrapped).
    sample: Sample,
    response: Vec<f32>,
}

impl SearchView {
    /// Width and height of a cell, in pixels.
    fn cell(&self, rows: usize, cols: usize) -> [f64; 2] {
        [self.window.w / cols as f64, self.window.h / rows as f64]
    }

    /// How far a place lies from the middle of the window, in cells of the turned picture.
    fn displacement(&self, rows: usize, cols: usize, place: [f64; 2]) -> [f64; 2] {
        let ([x, y], [w, h]) = (self.window.centre(), self.cell(rows, cols));
        let [dx, dy] = turned([place[0] - x, place[1] - y], self.turn.to_radians());
        [dx / w, dy / h]
    }
}

/// A place that the filter answers to.
#[derive(Clone, Copy, Debug)]
pub struct Answer {
    /// Centre of a target there, in pixels.
    pub centre: [f64; 2],
    /// The response of the filters.
    pub response: f64,
    /// The response that places are chosen by: with the layer that was added, if one was.
    pub fused: f64,
}

impl Correlator {
    /// Learns the target in `rect`. Gives the response to the very sample it was trained on as well. Layers of a
    /// network are left out where none is given. Altered looks are cut out, and wait for
    /// [`learn_look`](Self::learn_look).
    pub(super) fn new(
        all: &AppearanceSettings,
        cnn: Option<SharedCnn>,
        frame: &Frame,
        cropper: &mut Cropper,
        rect: &Rect,
    ) -> (Self, f64) {
        let settings = &all.filter;
        let window = search_window(settings, rect.centre(), rect.size());
        let (rows, cols) = grid(settings, &window);
        let mut fft = Fft2::new(rows, cols);
        let is_there = |spec: &&LayerSpec| cnn.is_some() || !matches!(spec.source, LayerSource::Network(_));
        let specs: Vec<LayerSpec> = all.layers.iter().filter(is_there).cloned().collect();
        let extractor = Extractor::fit(&specs, cnn, rows, cols, frame, &window, cropper);
        let cells = [rect.w * cols as f64 / window.w, rect.h * rows as f64 / window.h];
        let filters = Filters::new(all, &extractor, &mut fft, rect, cells);
        let mut correlator = Self {
            settings: settings.clone(),
            rows,
            cols,
            fft,
            extractor,
            filters,
            view: SearchView { response: vec![0.0; rows * cols], ..SearchView::default() },
            aside: SearchView { response: vec![0.0; rows * cols], ..SearchView::default() },
            peaks: Vec::with_capacity(PEAKS),
            answers: Vec::with_capacity(PEAKS),
            looks: VecDeque::new(),
            cut: Cut::default(),
            shown: Vec::with_capacity(rows * cols),
            spare: Vec::with_capacity(rows * cols),
            layer: Vec::new(),
            unlayered: Vec::new(),
            is_newest: true,
        };
        correlator.view.window = window;
        correlator.extractor.transform(&mut correlator.fft, &mut correlator.view.sample);
        correlator.filters.learn_first(&mut correlator.fft, &correlator.view.sample);
        correlator.cut_looks(frame, cropper, rect);
        correlator.respond();
        let response = f64::from(highest(&correlator.view.response, rows, cols, false).value);
        (correlator, response)
    }

    /// Takes over what may change under it, and what runs the same network by now.
    pub(super) fn retune(&mut self, all: &AppearanceSettings, cnn: Option<&SharedCnn>) {
        self.settings = all.filter.clone();
        if let Some(settings) = &all.network_filter {
            self.filters.retune(settings);
        }
        if let Some(cnn) = cnn {
            self.extractor.use_network(cnn);
        }
    }

    /// Looks for a target of size `size` around `centre`, in a picture turned by `turn` degrees clockwise: fills the
    /// sample and the response map (eqs 5 and 6).
    pub fn look(&mut self, frame: &Frame, cropper: &mut Cropper, centre: [f64; 2], size: [f64; 2], turn: f64) {
        self.see(frame, cropper, search_window(&self.settings, centre, size), turn);
        self.respond();
    }

    /// Looks through the same window again in a picture turned by `turn` degrees clockwise, and stays with that if the
    /// highest response is then `wanted`. Says whether it is.
    pub fn look_turned(
        &mut self,
        frame: &Frame,
        cropper: &mut Cropper,
        turn: f64,
        wanted: impl Fn(f64) -> bool,
    ) -> bool {
        self.look_again(frame, cropper, self.view.window, turn, wanted)
    }

    /// Looks through the same window around `centre`, and stays there if the highest response is then `wanted`. Says
    /// whether it is.
    pub fn look_around(
        &mut self,
        frame: &Frame,
        cropper: &mut Cropper,
        centre: [f64; 2],
        wanted: impl Fn(f64) -> bool,
    ) -> bool {
        let SearchView { window, turn, .. } = self.view;
        self.look_again(frame, cropper, Rect::around(centre, window.size()), turn, wanted)
    }

    fn look_again(
        &mut self,
        frame: &Frame,
        cropper: &mut Cropper,
        window: Rect,
        turn: f64,
        wanted: impl Fn(f64) -> bool,
    ) -> bool {
        std::mem::swap(&mut self.view, &mut self.aside);
        self.see(frame, cropper, window, turn);
        self.respond();
        let better = wanted(self.highest().response);
        if !better {
            std::mem::swap(&mut self.view, &mut self.aside);
            self.is_newest = false;
        }
        better
    }

    /// What the network that layers are of saw in the last look, if that was upright.
    pub fn seen_by_network(&self) -> Option<SeenByNetwork<'_>> {
        let SearchView { window, turn, blank, .. } = self.view;
        let is_there = self.is_newest && !blank && turn == 0.0;
        let (cnn, maps) = self.extractor.network().filter(|_| is_there)?;
        Some(SeenByNetwork { cnn, window, maps })
    }

    /// The window of the last look.
    pub fn window(&self) -> Rect {
        self.view.window
    }

    /// Makes a map of places part of the response, `share` of it: each place answers by its value, less the farther
    /// away from it, like a Gaussian of width `sigma` pixels; the best answer counts. Nothing answers in a blank
    /// window.
    pub fn add_layer(&mut self, share: f64, sigma: f64, places: impl Iterator<Item = ([f64; 2], f64)>) {
        let Self { view, rows, cols, layer, unlayered, .. } = self;
        if view.blank {
            return;
        }
        let (rows, cols) = (*rows, *cols);
        layer.clear();
        layer.resize(rows * cols, 0.0);
        let half = [cols, rows].map(|cells| cells as i64 / 2);
        let cell = view.cell(rows, cols);
        let reach = cell.map(|side| (REACH * sigma / side).ceil() as i64);
        for (place, value) in places {
            let at = view.displacement(rows, cols, place);
            let range = |axis: usize| {
                let middle = at[axis].round() as i64;
                (middle - reach[axis]).max(-half[axis])..=(middle + reach[axis]).min(half[axis] - 1)
            };
            for r in range(1) {
                for c in range(0) {
                    let d = [(c as f64 - at[0]) * cell[0], (r as f64 - at[1]) * cell[1]];
                    let here = value * (-0.5 * (d[0] * d[0] + d[1] * d[1]) / (sigma * sigma)).exp();
                    let there = &mut layer[wrapped_index(rows, cols, r, c)];
                    *there = there.max(here as f32);
                }
            }
        }
        unlayered.clone_from(&view.response);
        let share = share as f32;
        view.response.iter_mut().zip(layer.iter()).for_each(|(r, layer)| *r += share * (layer - *r));
    }

    /// The highest response around a place without the layer that was added.
    fn unlayered_at(&self, place: [f64; 2]) -> f64 {
        let Self { view, rows, cols, unlayered, .. } = self;
        let [x, y] = view.displacement(*rows, *cols, place).map(|cells| cells.round() as i64);
        let around = (-1..=1).flat_map(|r| (-1..=1).map(move |c| (y + r, x + c)));
        let highest = around.map(|(r, c)| unlayered[wrapped_index(*rows, *cols, r, c)]).fold(0.0, f32::max);
        f64::from(highest)
    }

    /// Whether the last look showed nothing that could be followed. No response is above 0 then.
    pub fn is_blank(&self) -> bool {
        self.view.blank
    }

    /// How far the picture of the last look is turned, in degrees clockwise.
    pub fn turn(&self) -> f64 {
        self.view.turn
    }

    /// The best local maximum of the response map (eq 7), by its response times what `prior` makes of its place.
    pub fn best(&mut self, prior: impl Fn([f64; 2]) -> f64) -> Answer {
        self.peaks.clear();
        local_maxima(&self.view.response, self.rows, self.cols, 0.0, PEAKS, self.settings.subcell, &mut self.peaks);
        self.answers.clear();
        for i in 0..self.peaks.len() {
            self.answers.push(self.answer(&self.peaks[i]));
        }
        let ranked = self.answers.iter().map(|&answer| (answer.fused * prior(answer.centre), answer));
        ranked
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .map_or(Answer { centre: self.view.window.centre(), response: 0.0, fused: 0.0 }, |(_, answer)| answer)
    }

    /// The local maxima that [`best`](Self::best) last chose from, highest first.
    pub fn answers(&self) -> &[Answer] {
        &self.answers
    }

    /// The highest response of the map.
    pub fn highest(&self) -> Answer {
        self.answer(&highest(&self.view.response, self.rows, self.cols, self.settings.subcell))
    }

    fn answer(&self, peak: &Peak) -> Answer {
        let SearchView { window, turn, .. } = &self.view;
        let [x, y] = window.centre();
        let cell = self.view.cell(self.rows, self.cols);
        let [dx, dy] = turned([peak.displacement[0] * cell[0], peak.displacement[1] * cell[1]], -turn.to_radians());
        let centre = [x + dx, y + dy];
        let fused = f64::from(peak.value);
        let response = if self.unlayered.is_empty() { fused } else { self.unlayered_at(centre) };
        Answer { centre, response, fused }
    }

    /// Learns the target at `centre` (eqs 4 and 8). By default the sample of the last look is shifted there, if that
    /// showed it at all; the paper cuts it anew. Where nothing is to be seen, nothing is learned.
    pub fn learn(&mut self, frame: &Frame, cropper: &mut Cropper, centre: [f64; 2], size: [f64; 2]) {
        if self.settings.recrop || self.view.window.intersection(&Rect::around(centre, size)).area() == 0.0 {
            self.see(frame, cropper, search_window(&self.settings, centre, size), self.view.turn);
        } else {
            let SearchView { window, turn, sample, .. } = &mut self.view;
            let [x, y] = window.centre();
            let [dx, dy] = turned([x - centre[0], y - centre[1]], turn.to_radians());
            sample.shift(&self.fft, [dx * self.cols as f64 / window.w, dy * self.rows as f64 / window.h]);
        }
        if !self.view.blank {
            self.filters.learn(&mut self.fft, &self.view.sample, &self.settings);
        }
    }

    /// Shows the response map of the last look.
    pub fn show(&mut self, trace: &mut dyn Trace) {
        let Self { view: SearchView { window, turn, response, .. }, rows, cols, shown, spare, .. } = self;
        trace.event(Event::SearchWindow(*window));
        centred(response, *rows, *cols, shown);
        let cell = [window.w / *cols as f64, window.h / *rows as f64];
        let middle = [*cols / 2, *rows / 2];
        if *turn != 0.0 {
            turn_about(shown, *cols, middle.map(|cells| cells as f32), -*turn, cell[1] / cell[0], spare);
        }
        // The middle of the window is that of the cell of no displacement, not the border of two.
        let at = |i: usize| window.centre()[i] - (middle[i] as f64 + 0.5) * cell[i];
        let window = Rect::new(at(0), at(1), window.w, window.h);
        trace.event(Event::Response(&ResponseMap { values: shown, rows: *rows, cols: *cols, window }));
    }

    fn see(&mut self, frame: &Frame, cropper: &mut Cropper, window: Rect, turn: f64) {
        let Self { fft, extractor, view, cut, .. } = self;
        (view.window, view.turn) = (window, turn);
        self.is_newest = true;
        let alteration = Alteration { turn, ..Alteration::default() };
        cropper.altered(alteration, |cropper| extractor.cut(frame, &window, cropper, cut));
        view.blank = !cut.shows_anything(AROUND / self.settings.window);
        if !view.blank {
            extractor.extract_cut(cut, fft, &mut view.sample);
        }
    }

    fn respond(&mut self) {
        self.unlayered.clear();
        let SearchView { blank, sample, response, .. } = &mut self.view;
        if *blank {
            response.fill(0.0);
        } else {
            self.filters.respond(&mut self.fft, sample, response);
        }
    }

    /// Cuts the altered looks out of the first frame. Those that differ in how they are mirrored and turned share a
    /// cut.
    fn cut_looks(&mut self, frame: &Frame, cropper: &mut Cropper, rect: &Rect) {
        let Self { settings, extractor, filters, looks, .. } = self;
        for &look in filters.looks() {
            let alike = |other: &Look| (other.scale, other.alteration.blur) == (look.scale, look.alteration.blur);
            let known = looks.iter().find(|(other, _)| alike(other)).map(|(_, cut)| cut.clone());
            let cut = known.unwrap_or_else(|| {
                let window = search_window(settings, rect.centre(), rect.size().map(|side| side / look.scale));
                let blurred = Alteration { blur: look.alteration.blur, ..Alteration::default() };
                let mut cut = Cut::default();
                cropper.altered(blurred, |cropper| extractor.cut(frame, &window, cropper, &mut cut));
                cut.into()
            });
            looks.push_back((look, cut));
        }
    }

    /// Learns the next altered look at the first frame's target, if one is left. Overwrites the sample of the last
    /// look.
    pub fn learn_look(&mut self, cropper: &mut Cropper) {
        let Self { fft, extractor, filters, view, looks, cut, .. } = self;
        let Some((look, unaltered)) = looks.pop_front() else {
            return;
        };
        cut.clone_from(&unaltered);
        cut.alter(&look.alteration, cropper);
        extractor.extract_cut(cut, fft, &mut view.sample);
        filters.learn_look(fft, &view.sample);
    }
}

/// The index of a cell of a wrapped map.
fn wrapped_index(rows: usize, cols: usize, r: i64, c: i64) -> usize {
    r.rem_euclid(rows as i64) as usize * cols + c.rem_euclid(cols as i64) as usize
}

fn search_window(settings: &FilterSettings, centre: [f64; 2], size: [f64; 2]) -> Rect {
    let sides = match settings.shape {
        SearchShape::Square => [(size[0] * size[1]).sqrt(); 2],
        SearchShape::Target => size,
    };
    Rect::around(centre, sides.map(|side| side * settings.window))
}

/// Rows and columns of the feature grid. The longer side has as many cells as the settings say. A window of the
/// target's shape has no more than the image resolves, a cell for 4 px: the paper's features of a quarter of the
/// window's size.
fn grid(settings: &FilterSettings, window: &Rect) -> (usize, usize) {
    let longer = window.w.max(window.h);
    let resolved = (longer / CELL as f64).round();
    let cells = match settings.shape {
        SearchShape::Square => settings.cells as f64,
        SearchShape::Target => resolved.min(settings.cells as f64),
    };
    let side = |length: f64| ((cells * length / longer).round() as usize).max(MIN_CELLS);
    (side(window.h), side(window.w))
}

#[cfg(test)]
mod tests;
