//! What the target looks like: layers of features, and the correlation filter that is trained on them.

use std::collections::VecDeque;
use std::sync::Arc;

use super::augment::Look;
use super::filters::Filters;
use crate::crop::{Alteration, Cropper, turn_about};
use crate::dcf::fft::Fft2;
use crate::dcf::response::{Peak, centred, highest, local_maxima};
use crate::dcf::sample::Sample;
use crate::error::NetworkError;
use crate::features::CELL;
use crate::features::cnn::{self, Networks, SharedCnn};
use crate::features::contrast::AROUND;
use crate::features::layers::{Cut, Extractor, Feature, LayerSpec, Source};
use crate::frame::Frame;
use crate::geometry::{Rect, turned};
use crate::params::{LcmhtCnn, LcmhtFilter, LcmhtLayers, LcmhtParams, Params, WindowShape};
use crate::trace::{ResponseMap, Trace};

/// Local maxima of a response map that are weighed against the motion model.
const PEAKS: usize = 8;
/// Cells along a side of the search window, at least: fewer have no room for a label.
const MIN_CELLS: usize = 8;
/// Eleven probabilities sum to one: ten components hold them all.
const COLOUR_COMPONENTS: usize = 10;

/// The filter and the window that it looks through.
pub(in crate::tracker) struct Appearance {
    settings: LcmhtFilter,
    rows: usize,
    cols: usize,
    fft: Fft2,
    extractor: Extractor,
    filters: Filters,
    view: View,
    /// The look that another one is compared with.
    aside: View,
    peaks: Vec<Peak>,
    answers: Vec<Answer>,
    /// Altered looks at the first frame's target that have not been learned yet.
    looks: VecDeque<(Look, Arc<Cut>)>,
    /// What is looked at.
    cut: Cut,
    shown: Vec<f32>,
    /// Room to turn what is shown.
    spare: Vec<f32>,
}

/// A look through the search window.
#[derive(Default)]
struct View {
    window: Rect,
    /// How far the picture is turned about the window's centre, in degrees clockwise.
    turn: f64,
    /// Whether the window showed nothing that could be followed: then nothing answers.
    blank: bool,
    /// What the window showed, and the response to it (wrapped).
    sample: Sample,
    response: Vec<f32>,
}

/// A place that the filter answers to.
#[derive(Clone, Copy, Debug)]
pub(in crate::tracker) struct Answer {
    /// Centre of a target there, in pixels.
    pub(in crate::tracker) centre: [f64; 2],
    /// The response.
    pub(in crate::tracker) response: f64,
}

impl Appearance {
    /// Learns the target in `rect`. Gives the response to the very sample it was trained on as well. The network is
    /// there if the parameters want its layers. Altered looks are cut out, and wait for [`learn_look`](Self::learn_look).
    pub(in crate::tracker) fn new(
        params: &LcmhtParams,
        cnn: Option<SharedCnn>,
        frame: &Frame,
        cropper: &mut Cropper,
        rect: &Rect,
    ) -> (Self, f64) {
        let settings = &params.filter;
        let window = search_window(settings, rect.centre(), rect.size());
        let (rows, cols) = grid(settings, &window);
        let mut fft = Fft2::new(rows, cols);
        let (specs, weights) = specs(&params.layers, &params.cnn);
        let extractor = Extractor::fit(&specs, cnn, rows, cols, frame, &window, cropper);
        let cells = [rect.w * cols as f64 / window.w, rect.h * rows as f64 / window.h];
        let filters = Filters::new(params, &extractor, weights, &mut fft, rect, cells);
        let mut appearance = Self {
            settings: settings.clone(),
            rows,
            cols,
            fft,
            extractor,
            filters,
            view: View { response: vec![0.0; rows * cols], ..View::default() },
            aside: View { response: vec![0.0; rows * cols], ..View::default() },
            peaks: Vec::with_capacity(PEAKS),
            answers: Vec::with_capacity(PEAKS),
            looks: VecDeque::new(),
            cut: Cut::default(),
            shown: Vec::with_capacity(rows * cols),
            spare: Vec::with_capacity(rows * cols),
        };
        appearance.view.window = window;
        appearance.extractor.transform(&mut appearance.fft, &mut appearance.view.sample);
        appearance.filters.learn_first(&mut appearance.fft, &appearance.view.sample);
        appearance.cut_looks(frame, cropper, rect);
        appearance.respond();
        let response = f64::from(highest(&appearance.view.response, rows, cols, false).value);
        (appearance, response)
    }

    /// Takes over parameters that [`with_made`] lets through, and what runs the network by now.
    pub(in crate::tracker) fn retune(&mut self, params: &LcmhtParams, cnn: Option<&SharedCnn>) {
        self.settings = params.filter.clone();
        self.filters.retune(&params.cnn);
        if let Some(cnn) = cnn {
            self.extractor.use_network(cnn);
        }
    }

    /// Looks for a target of size `size` around `centre`, in a picture turned by `turn` degrees clockwise: fills the sample
    /// and the response map (eqs 5 and 6).
    pub(in crate::tracker) fn look(
        &mut self,
        frame: &Frame,
        cropper: &mut Cropper,
        centre: [f64; 2],
        size: [f64; 2],
        turn: f64,
    ) {
        self.see(frame, cropper, search_window(&self.settings, centre, size), turn);
        self.respond();
    }

    /// Looks through the same window again in a picture turned by `turn` degrees clockwise, and stays with that if the
    /// highest response is then `wanted`. Says whether it is.
    pub(in crate::tracker) fn look_turned(
        &mut self,
        frame: &Frame,
        cropper: &mut Cropper,
        turn: f64,
        wanted: impl Fn(f64) -> bool,
    ) -> bool {
        self.look_again(frame, cropper, self.view.window, turn, wanted)
    }

    /// Looks through the same window around `centre`, and stays there if the highest response is then `wanted`. Says whether
    /// it is.
    pub(in crate::tracker) fn look_around(
        &mut self,
        frame: &Frame,
        cropper: &mut Cropper,
        centre: [f64; 2],
        wanted: impl Fn(f64) -> bool,
    ) -> bool {
        let View { window, turn, .. } = self.view;
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
        }
        better
    }

    /// Whether the last look showed nothing that could be followed. No response is above 0 then.
    pub(in crate::tracker) fn is_blank(&self) -> bool {
        self.view.blank
    }

    /// How far the picture of the last look is turned, in degrees clockwise.
    pub(in crate::tracker) fn turn(&self) -> f64 {
        self.view.turn
    }

    /// The best local maximum of the response map (eq 7), by its response times what `prior` makes of its place.
    pub(in crate::tracker) fn best(&mut self, prior: impl Fn([f64; 2]) -> f64) -> Answer {
        self.peaks.clear();
        local_maxima(&self.view.response, self.rows, self.cols, 0.0, PEAKS, self.settings.subcell, &mut self.peaks);
        self.answers.clear();
        for i in 0..self.peaks.len() {
            self.answers.push(self.answer(&self.peaks[i]));
        }
        let ranked = self.answers.iter().map(|&answer| (answer.response * prior(answer.centre), answer));
        ranked
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .map_or(Answer { centre: self.view.window.centre(), response: 0.0 }, |(_, answer)| answer)
    }

    /// The local maxima that [`best`](Self::best) last chose from, highest first.
    pub(in crate::tracker) fn answers(&self) -> &[Answer] {
        &self.answers
    }

    /// The highest response of the map.
    pub(in crate::tracker) fn highest(&self) -> Answer {
        self.answer(&highest(&self.view.response, self.rows, self.cols, self.settings.subcell))
    }

    fn answer(&self, peak: &Peak) -> Answer {
        let View { window, turn, .. } = &self.view;
        let [x, y] = window.centre();
        let cell = [window.w / self.cols as f64, window.h / self.rows as f64];
        let [dx, dy] = turned([peak.displacement[0] * cell[0], peak.displacement[1] * cell[1]], -turn.to_radians());
        Answer { centre: [x + dx, y + dy], response: f64::from(peak.value) }
    }

    /// Learns the target at `centre` (eqs 4 and 8). By default the sample of the last look is shifted there, if that showed
    /// it at all; the paper cuts it anew. Where nothing is to be seen, nothing is learned.
    pub(in crate::tracker) fn learn(&mut self, frame: &Frame, cropper: &mut Cropper, centre: [f64; 2], size: [f64; 2]) {
        if self.settings.recrop || self.view.window.intersection(&Rect::around(centre, size)).area() == 0.0 {
            self.see(frame, cropper, search_window(&self.settings, centre, size), self.view.turn);
        } else {
            let View { window, turn, sample, .. } = &mut self.view;
            let [x, y] = window.centre();
            let [dx, dy] = turned([x - centre[0], y - centre[1]], turn.to_radians());
            sample.shift(&self.fft, [dx * self.cols as f64 / window.w, dy * self.rows as f64 / window.h]);
        }
        if !self.view.blank {
            self.filters.learn(&mut self.fft, &self.view.sample, &self.settings);
        }
    }

    /// Shows the response map of the last look.
    pub(in crate::tracker) fn show(&mut self, trace: &mut dyn Trace) {
        let Self { view: View { window, turn, response, .. }, rows, cols, shown, spare, .. } = self;
        trace.search_window(*window);
        centred(response, *rows, *cols, shown);
        let cell = [window.w / *cols as f64, window.h / *rows as f64];
        let middle = [*cols / 2, *rows / 2];
        if *turn != 0.0 {
            turn_about(shown, *cols, middle.map(|cells| cells as f32), -*turn, cell[1] / cell[0], spare);
        }
        // The middle of the window is that of the cell of no displacement, not the border of two.
        let at = |i: usize| window.centre()[i] - (middle[i] as f64 + 0.5) * cell[i];
        let window = Rect::new(at(0), at(1), window.w, window.h);
        trace.response(&ResponseMap { values: shown, rows: *rows, cols: *cols, window });
    }

    fn see(&mut self, frame: &Frame, cropper: &mut Cropper, window: Rect, turn: f64) {
        let Self { fft, extractor, view, cut, .. } = self;
        (view.window, view.turn) = (window, turn);
        let alteration = Alteration { turn, ..Alteration::default() };
        cropper.altered(alteration, |cropper| extractor.cut(frame, &window, cropper, cut));
        view.blank = !cut.shows_anything(AROUND / self.settings.window);
        if !view.blank {
            extractor.extract_cut(cut, fft, &mut view.sample);
        }
    }

    fn respond(&mut self) {
        let View { blank, sample, response, .. } = &mut self.view;
        if *blank {
            response.fill(0.0);
        } else {
            self.filters.respond(&mut self.fft, sample, response);
        }
    }

    /// Cuts the altered looks out of the first frame. Those that differ in how they are mirrored and turned share a cut.
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

    /// Learns the next altered look at the first frame's target, if one is left. Overwrites the sample of the last look.
    pub(in crate::tracker) fn learn_look(&mut self, cropper: &mut Cropper) {
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

/// The network that the parameters ask for.
pub(in crate::tracker) fn network(params: &Params, networks: &Networks) -> Result<Option<SharedCnn>, NetworkError> {
    network_settings(params).map(|settings| networks.get(settings)).transpose()
}

/// What the network that the parameters ask for is loaded by.
pub(in crate::tracker) fn network_settings(params: &Params) -> Option<cnn::Settings> {
    params.lcmht.cnn.enabled.then(|| cnn::Settings::new(&params.lcmht.cnn, params.limits.file_bytes()))
}

/// `params`, but what an [`Appearance`] is made of as it is in `made`. What may change under it is how it learns and refines, the
/// share of the network's filter, and what runs the network.
pub(in crate::tracker) fn with_made(made: &LcmhtParams, params: &LcmhtParams) -> LcmhtParams {
    let LcmhtFilter { learning_rate, interval, steps, subcell, recrop, .. } = params.filter;
    let LcmhtCnn { share, inference, threads, .. } = params.cnn;
    LcmhtParams {
        filter: LcmhtFilter { learning_rate, interval, steps, subcell, recrop, ..made.filter.clone() },
        cnn: LcmhtCnn { share, inference, library: params.cnn.library.clone(), threads, ..made.cnn.clone() },
        layers: made.layers.clone(),
        augment: made.augment.clone(),
        ..params.clone()
    }
}

fn search_window(settings: &LcmhtFilter, centre: [f64; 2], size: [f64; 2]) -> Rect {
    let sides = match settings.window_shape {
        WindowShape::Square => [(size[0] * size[1]).sqrt(); 2],
        WindowShape::Target => size,
    };
    Rect::around(centre, sides.map(|side| side * settings.window))
}

/// Rows and columns of the feature grid. The longer side has as many cells as the settings say. A window of the target's
/// shape has no more than the image resolves, a cell for 4 px: the paper's features of a quarter of the window's size.
fn grid(settings: &LcmhtFilter, window: &Rect) -> (usize, usize) {
    let longer = window.w.max(window.h);
    let resolved = (longer / CELL as f64).round();
    let cells = match settings.window_shape {
        WindowShape::Square => settings.cells as f64,
        WindowShape::Target => resolved.min(settings.cells as f64),
    };
    let side = |length: f64| ((cells * length / longer).round() as usize).max(MIN_CELLS);
    (side(window.h), side(window.w))
}

/// The layers, and the weight of each. Layers that the weights leave out are not computed.
fn specs(layers: &LcmhtLayers, cnn: &LcmhtCnn) -> (Vec<LayerSpec>, Vec<f32>) {
    let cells = |features: &[Feature], components| (Source::Cells(features.to_vec()), components);
    let mut all: Vec<((Source, Option<usize>), f64)> = Vec::new();
    if layers.joint {
        all.push((cells(&[Feature::Hog, Feature::ColourNames], None), layers.hog_weight));
    } else {
        all.push((cells(&[Feature::Hog], Some(layers.hog_components as usize)), layers.hog_weight));
        all.push((cells(&[Feature::ColourNames], Some(COLOUR_COMPONENTS)), layers.colour_weight));
    }
    if cnn.enabled {
        let outputs = cnn.components.iter().zip(&cnn.weights).enumerate();
        all.extend(
            outputs.map(|(output, (&n, &weight))| ((Source::Network(output), (n > 0).then_some(n as usize)), weight)),
        );
    }
    let spec = |((source, components), weight): ((Source, Option<usize>), f64)| {
        let energy = (!layers.joint).then_some(weight as f32);
        (LayerSpec { source, components, energy }, weight as f32)
    };
    all.into_iter().filter(|(_, weight)| *weight > 0.0).map(spec).unzip()
}

#[cfg(test)]
mod tests {
    use super::super::filters::{FIRST_STEPS, LOOK_STEPS};
    use super::*;
    use crate::frame::Encoding;
    use crate::geometry::distance;
    use crate::params::LcmhtAugment;

    const WIDTH: usize = 200;
    const HEIGHT: usize = 160;
    const TARGET: Rect = Rect::new(80.0, 50.0, 30.0, 50.0);

    /// Texture, each pixel of it a mean over so many across.
    fn scene(blur: usize) -> Vec<u8> {
        let texture = |x: usize, y: usize| (x / 5 * 7919 + y / 4 * 104_729 + x / 5 * (y / 4) * 31) % 251;
        let mean = |x: usize, y: usize| (0..blur).map(|i| texture(x + i, y)).sum::<usize>() / blur;
        (0..WIDTH * HEIGHT).map(|i| mean(i % WIDTH, i / WIDTH) as u8).collect()
    }

    /// The highest response to a scene that is blurred or not, relative to that of the first frame.
    fn answer(augment: LcmhtAugment, blur: usize) -> f64 {
        let mut params = Params::default().lcmht;
        params.cnn.enabled = false;
        params.augment = augment;
        let [first, then] = [scene(1), scene(blur)];
        let frame = |data| Frame::new(data, WIDTH as u32, HEIGHT as u32, WIDTH, Encoding::Mono8, None).unwrap();
        let mut cropper = Cropper::default();
        let [first, then] = [frame(&first), frame(&then)];
        let (mut appearance, trained) = Appearance::new(&params, None, &first, &mut cropper, &TARGET);
        let highest = |appearance: &mut Appearance, frame: &Frame| {
            appearance.look(frame, &mut Cropper::default(), TARGET.centre(), TARGET.size(), 0.0);
            appearance.highest().response
        };
        assert!((highest(&mut appearance, &first) - trained).abs() < 1e-6);
        learn_looks(&mut appearance, &mut cropper);
        highest(&mut appearance, &then) / highest(&mut appearance, &first)
    }

    #[test]
    fn a_filter_that_learned_altered_looks_answers_better_to_a_blurred_target() {
        let augment = Params::default().lcmht.augment;
        let plain = LcmhtAugment { enabled: false, ..augment.clone() };
        let [without, with] = [answer(plain, 7), answer(augment, 7)];
        assert!(with > 1.1 * without, "{with} {without}");
    }

    #[test]
    fn a_target_that_turned_is_found_and_learned_where_it_is_by_a_picture_turned_back() {
        const DEGREES: f64 = 20.0;
        let mut params = Params::default().lcmht;
        params.cnn.enabled = false;
        let first = scene(1);
        let [x, y] = TARGET.centre();
        let place = [x + 9.0, y - 6.0];
        let pixel = |i: usize| {
            let offset = [(i % WIDTH) as f64 + 0.5 - place[0], (i / WIDTH) as f64 + 0.5 - place[1]];
            let [dx, dy] = turned(offset, -DEGREES.to_radians());
            let [column, row] = [(x + dx, WIDTH), (y + dy, HEIGHT)].map(|(v, n)| v.clamp(0.0, n as f64 - 1.0) as usize);
            first[row * WIDTH + column]
        };
        let then: Vec<u8> = (0..first.len()).map(pixel).collect();
        let frame = |data| Frame::new(data, WIDTH as u32, HEIGHT as u32, WIDTH, Encoding::Mono8, None).unwrap();
        let mut cropper = Cropper::default();
        let (mut appearance, _) = Appearance::new(&params, None, &frame(&first), &mut cropper, &TARGET);
        learn_looks(&mut appearance, &mut cropper);
        appearance.look(&frame(&then), &mut cropper, TARGET.centre(), TARGET.size(), 0.0);
        let upright = appearance.highest();
        // Turned farther the same way, it answers worse, and the look before stays.
        assert!(!appearance.look_turned(&frame(&then), &mut cropper, DEGREES, |r| r > upright.response));
        assert_eq!((appearance.turn(), appearance.highest().response), (0.0, upright.response));
        assert!(appearance.look_turned(&frame(&then), &mut cropper, -DEGREES, |r| r > 1.2 * upright.response));
        assert_eq!(appearance.turn(), -DEGREES);
        assert!(distance(appearance.highest().centre, place) < 1.5, "{:?}", appearance.highest());
        appearance.learn(&frame(&then), &mut cropper, place, TARGET.size());
        appearance.respond();
        // The sample learned has the target in its middle.
        assert!(distance(appearance.highest().centre, TARGET.centre()) < 1.5, "{:?}", appearance.highest());
    }

    /// What a mark costs, counted: a run of the network and a few steps for the true look, and then as much, or less, for each
    /// altered one, in a frame of its own.
    #[test]
    fn a_mark_costs_one_run_of_the_network_and_each_later_frame_one_look_more() {
        let params = Params::default();
        let cnn = network(&params, &Networks::default()).unwrap();
        let params = params.lcmht;
        let runs = |cnn: &Option<SharedCnn>| cnn::locked(cnn.as_ref().unwrap()).runs;
        let data = scene(1);
        let frame = Frame::new(&data, WIDTH as u32, HEIGHT as u32, WIDTH, Encoding::Mono8, None).unwrap();
        let mut cropper = Cropper::default();
        let (mut appearance, _) = Appearance::new(&params, cnn.clone(), &frame, &mut cropper, &TARGET);
        assert_eq!((runs(&cnn), appearance.filters.steps()), (1, vec![FIRST_STEPS; 2]));
        // Blurred, and larger and smaller, for both filters; then mirrored, and turned, for the network's alone.
        const WEAK: usize = 4;
        const ALL: usize = 9;
        for look in 1..=ALL {
            appearance.learn_look(&mut cropper);
            let steps = [look.min(WEAK), look].map(|looks| FIRST_STEPS + LOOK_STEPS * looks);
            assert_eq!((runs(&cnn), appearance.filters.steps()), (1 + look, steps.to_vec()));
        }
        appearance.learn_look(&mut cropper);
        assert_eq!(runs(&cnn), 1 + ALL, "nothing is left to learn");
    }

    fn learn_looks(appearance: &mut Appearance, cropper: &mut Cropper) {
        while !appearance.looks.is_empty() {
            appearance.learn_look(cropper);
        }
    }

    /// The response map of a filter trained on the first frame, to a scene that is a little blurred.
    fn responses(change: impl Fn(&mut LcmhtParams)) -> Vec<f32> {
        let mut params = Params::default();
        change(&mut params.lcmht);
        let [first, then] = [scene(1), scene(3)];
        let frame = |data| Frame::new(data, WIDTH as u32, HEIGHT as u32, WIDTH, Encoding::Mono8, None).unwrap();
        let (mut cropper, cnn) = (Cropper::default(), network(&params, &Networks::default()).unwrap());
        let (mut appearance, _) = Appearance::new(&params.lcmht, cnn, &frame(&first), &mut cropper, &TARGET);
        learn_looks(&mut appearance, &mut cropper);
        appearance.look(&frame(&then), &mut cropper, TARGET.centre(), TARGET.size(), 0.0);
        appearance.view.response
    }

    #[test]
    fn a_separate_filter_of_the_network_has_its_share_of_the_response() {
        let with_share = |share| responses(|params| params.cnn.share = share);
        let [hand_crafted, network, both] = [0.0, 1.0, 0.3].map(with_share);
        assert_eq!(hand_crafted, responses(|params| params.cnn.enabled = false));
        let difference = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        let sum: Vec<f32> = hand_crafted.iter().zip(&network).map(|(h, n)| 0.7 * h + 0.3 * n).collect();
        assert!(difference(&both, &sum) < 1e-5);
        assert!(difference(&hand_crafted, &network) > 0.01);
        assert!(difference(&both, &responses(|params| params.cnn.separate = false)) > 0.01);
        // The weight of its norm, and mirrored and turned looks, are for the network alone.
        let smooth = |share| {
            responses(|params| {
                params.cnn.share = share;
                params.cnn.regularisation = 10.0;
            })
        };
        assert_eq!(hand_crafted, smooth(0.0));
        let highest = |map: &[f32]| map.iter().copied().fold(0.0, f32::max);
        assert!(highest(&smooth(1.0)) < 0.9 * highest(&network));
        let upright = |share| {
            responses(|params| {
                params.cnn.share = share;
                params.augment.mirror = false;
                params.augment.turn = 0.0;
            })
        };
        assert_eq!(hand_crafted, upright(0.0));
        assert!(difference(&network, &upright(1.0)) > 0.01);
    }
}
