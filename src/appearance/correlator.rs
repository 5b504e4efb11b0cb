//! The correlation filters on layers of features, and the window that they look through.

use std::collections::VecDeque;
use std::sync::Arc;

use super::augment::Look;
use super::filters::Filters;
use super::layers::{Cut, Extractor, LayerSource, LayerSpec};
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

/// A place that the filter answers to.
#[derive(Clone, Copy, Debug)]
pub struct Answer {
    /// Centre of a target there, in pixels.
    pub centre: [f64; 2],
    /// The response.
    pub response: f64,
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
        }
        better
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
        let ranked = self.answers.iter().map(|&answer| (answer.response * prior(answer.centre), answer));
        ranked
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .map_or(Answer { centre: self.view.window.centre(), response: 0.0 }, |(_, answer)| answer)
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
        let cell = [window.w / self.cols as f64, window.h / self.rows as f64];
        let [dx, dy] = turned([peak.displacement[0] * cell[0], peak.displacement[1] * cell[1]], -turn.to_radians());
        Answer { centre: [x + dx, y + dy], response: f64::from(peak.value) }
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
        let alteration = Alteration { turn, ..Alteration::default() };
        cropper.altered(alteration, |cropper| extractor.cut(frame, &window, cropper, cut));
        view.blank = !cut.shows_anything(AROUND / self.settings.window);
        if !view.blank {
            extractor.extract_cut(cut, fft, &mut view.sample);
        }
    }

    fn respond(&mut self) {
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
mod tests {
    use std::sync::Mutex;

    use super::super::filters::{FIRST_STEPS, LOOK_STEPS};
    use super::super::settings::{LookSettings, NetworkFilterSettings};
    use super::*;
    use crate::frame::Encoding;
    use crate::geometry::distance;
    use crate::loader::Request;
    use crate::network::locked;
    use crate::params::Params;

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
    fn answer(looks: Option<LookSettings>, blur: usize) -> f64 {
        let settings = AppearanceSettings { looks, ..AppearanceSettings::default() };
        let [first, then] = [scene(1), scene(blur)];
        let frame = |data| Frame::new(data, WIDTH as u32, HEIGHT as u32, WIDTH, Encoding::Mono8, None).unwrap();
        let mut cropper = Cropper::default();
        let [first, then] = [frame(&first), frame(&then)];
        let (mut correlator, trained) = Correlator::new(&settings, None, &first, &mut cropper, &TARGET);
        let highest = |correlator: &mut Correlator, frame: &Frame| {
            correlator.look(frame, &mut Cropper::default(), TARGET.centre(), TARGET.size(), 0.0);
            correlator.highest().response
        };
        assert!((highest(&mut correlator, &first) - trained).abs() < 1e-6);
        learn_looks(&mut correlator, &mut cropper);
        highest(&mut correlator, &then) / highest(&mut correlator, &first)
    }

    #[test]
    fn a_filter_that_learned_altered_looks_answers_better_to_a_blurred_target() {
        let [without, with] = [answer(None, 7), answer(Some(LookSettings::default()), 7)];
        assert!(with > 1.1 * without, "{with} {without}");
    }

    #[test]
    fn a_target_that_turned_is_found_and_learned_where_it_is_by_a_picture_turned_back() {
        const DEGREES: f64 = 20.0;
        let settings = AppearanceSettings::default();
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
        let (mut correlator, _) = Correlator::new(&settings, None, &frame(&first), &mut cropper, &TARGET);
        learn_looks(&mut correlator, &mut cropper);
        correlator.look(&frame(&then), &mut cropper, TARGET.centre(), TARGET.size(), 0.0);
        let upright = correlator.highest();
        // Turned farther the same way, it answers worse, and the look before stays.
        assert!(!correlator.look_turned(&frame(&then), &mut cropper, DEGREES, |r| r > upright.response));
        assert_eq!((correlator.turn(), correlator.highest().response), (0.0, upright.response));
        assert!(correlator.look_turned(&frame(&then), &mut cropper, -DEGREES, |r| r > 1.2 * upright.response));
        assert_eq!(correlator.turn(), -DEGREES);
        assert!(distance(correlator.highest().centre, place) < 1.5, "{:?}", correlator.highest());
        correlator.learn(&frame(&then), &mut cropper, place, TARGET.size());
        correlator.respond();
        // The sample learned has the target in its middle.
        assert!(distance(correlator.highest().centre, TARGET.centre()) < 1.5, "{:?}", correlator.highest());
    }

    /// What a mark costs, counted: a run of the network and a few steps for the true look, and then as much, or less,
    /// for each altered one, in a frame of its own.
    #[test]
    fn a_mark_costs_one_run_of_the_network_and_each_later_frame_one_look_more() {
        let (settings, cnn) = (with_network(), network());
        let runs = |cnn: &Option<SharedCnn>| locked(cnn.as_ref().unwrap()).runs;
        let data = scene(1);
        let frame = Frame::new(&data, WIDTH as u32, HEIGHT as u32, WIDTH, Encoding::Mono8, None).unwrap();
        let mut cropper = Cropper::default();
        let (mut correlator, _) = Correlator::new(&settings, cnn.clone(), &frame, &mut cropper, &TARGET);
        assert_eq!((runs(&cnn), correlator.filters.steps()), (1, vec![FIRST_STEPS; 2]));
        // Blurred, and larger and smaller, for both filters; then mirrored, and turned, for the network's alone.
        const WEAK: usize = 4;
        const ALL: usize = 9;
        for look in 1..=ALL {
            correlator.learn_look(&mut cropper);
            let steps = [look.min(WEAK), look].map(|looks| FIRST_STEPS + LOOK_STEPS * looks);
            assert_eq!((runs(&cnn), correlator.filters.steps()), (1 + look, steps.to_vec()));
        }
        correlator.learn_look(&mut cropper);
        assert_eq!(runs(&cnn), 1 + ALL, "nothing is left to learn");
    }

    fn learn_looks(correlator: &mut Correlator, cropper: &mut Cropper) {
        while !correlator.looks.is_empty() {
            correlator.learn_look(cropper);
        }
    }

    /// HOG, colour names, and two outputs of the embedded network.
    fn with_network() -> AppearanceSettings {
        let mut settings = AppearanceSettings::default();
        let output = |i, components, energy| LayerSpec::scaled(LayerSource::Network(i), Some(components), energy);
        settings.layers.extend([output(0, 8, 0.1), output(1, 32, 0.2)]);
        settings
    }

    fn network() -> Option<SharedCnn> {
        let loaded = Request::of(&Params::default()).unwrap().load().unwrap();
        Some(Arc::new(Mutex::new(loaded)))
    }

    /// The response map of a filter trained on the first frame, to a scene that is a little blurred.
    fn responses(change: impl Fn(&mut AppearanceSettings)) -> Vec<f32> {
        let mut settings = with_network();
        change(&mut settings);
        let [first, then] = [scene(1), scene(3)];
        let frame = |data| Frame::new(data, WIDTH as u32, HEIGHT as u32, WIDTH, Encoding::Mono8, None).unwrap();
        let mut cropper = Cropper::default();
        let (mut correlator, _) = Correlator::new(&settings, network(), &frame(&first), &mut cropper, &TARGET);
        learn_looks(&mut correlator, &mut cropper);
        correlator.look(&frame(&then), &mut cropper, TARGET.centre(), TARGET.size(), 0.0);
        correlator.view.response
    }

    #[test]
    fn a_separate_filter_of_the_network_has_its_share_of_the_response() {
        let separate = |share, regularisation| Some(NetworkFilterSettings { share, regularisation });
        let usual = NetworkFilterSettings::default().regularisation;
        let with_share = |share| responses(|settings| settings.network_filter = separate(share, usual));
        let [hand_crafted, network, both] = [0.0, 1.0, 0.3].map(with_share);
        assert_eq!(hand_crafted, responses(|settings| settings.layers.truncate(2)));
        let difference = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        let sum: Vec<f32> = hand_crafted.iter().zip(&network).map(|(h, n)| 0.7 * h + 0.3 * n).collect();
        assert!(difference(&both, &sum) < 1e-5);
        assert!(difference(&hand_crafted, &network) > 0.01);
        assert!(difference(&both, &responses(|settings| settings.network_filter = None)) > 0.01);
        // The weight of its norm, and mirrored and turned looks, are for the network alone.
        let smooth = |share| responses(|settings| settings.network_filter = separate(share, 10.0));
        assert_eq!(hand_crafted, smooth(0.0));
        let highest = |map: &[f32]| map.iter().copied().fold(0.0, f32::max);
        assert!(highest(&smooth(1.0)) < 0.9 * highest(&network));
        let upright = |share| {
            responses(|settings| {
                settings.network_filter = separate(share, usual);
                settings.looks = Some(LookSettings { mirror: false, turn: 0.0, ..LookSettings::default() });
            })
        };
        assert_eq!(hand_crafted, upright(0.0));
        assert!(difference(&network, &upright(1.0)) > 0.01);
    }

    #[test]
    fn layers_of_a_network_that_is_not_there_are_left_out() {
        let data = scene(1);
        let frame = Frame::new(&data, WIDTH as u32, HEIGHT as u32, WIDTH, Encoding::Mono8, None).unwrap();
        let trained = |settings| Correlator::new(&settings, None, &frame, &mut Cropper::default(), &TARGET).1;
        assert_eq!(trained(with_network()), trained(AppearanceSettings::default()));
    }
}
