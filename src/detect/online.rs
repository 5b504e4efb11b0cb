//! The online detector of LCMHT (section 4.2, eqs 10 to 16): a support vector machine on HOG, LUV colour and
//! normalised gradient magnitude, trained on frames in which the target is certain, that scans the surroundings of a
//! lost target for places that look like it.
//!
//! The target is seen as a template of a fixed number of cells. A feature vector is the template's HOG, scaled to
//! length `1 / sqrt 2`, followed by its LUV colours and gradient magnitudes, scaled likewise: unit vectors, for which a
//! Gaussian kernel of `gamma` near 1 is neither flat nor a lookup table.

use std::ops::Range;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::crop::{Cropper, Patch};
use crate::features::hog::{self, Hog};
use crate::features::luv::{self, Luv};
use crate::features::{CELL, FeatureMap};
use crate::frame::Frame;
use crate::geometry::Rect;
use crate::learn::svm::{BLOCK, Svm, SvmParams};
use crate::trace::Proposal;

/// Cells around the template that are computed and dropped, so that block normalisation and gradients see the same
/// surround wherever the template lies in a crop.
const MARGIN: usize = 1;
/// Longest side of a template, in units of the shorter one: thinner targets are seen in wider cells.
const MAX_TEMPLATE_ASPECT: f64 = 4.0;
/// Proposals that overlap a better one by more than this are the same place.
const SAME_PLACE_IOU: f64 = 0.5;
/// Sides of the area in which [`Detector::search`] puts centres of targets, in target sizes.
pub const SEARCHED: f64 = 5.0;
/// Channels of the second block: LUV and gradient magnitude.
const COLOUR_CHANNELS: usize = luv::CHANNELS;

/// The settings of a [`Detector`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DetectorSettings {
    /// The classifier's own settings.
    pub svm: SvmParams,
    /// Cells of the template, about.
    pub template_cells: usize,
    /// Examples with at least this overlap are positive (delta_p of eq 10).
    pub positive_iou: f64,
    /// Examples with less than this overlap are negative (delta_n of eq 10).
    pub negative_iou: f64,
    /// Positive examples a frame.
    pub positives: usize,
    /// Negative examples for each positive one.
    pub negatives_per_positive: usize,
    /// Side of the area that negative examples come from, in target sizes.
    pub learn_extent: f64,
    /// Side of the area that is scanned, in target sizes.
    pub scan_extent: f64,
    /// Most proposals of a scan.
    pub proposals: usize,
}

impl DetectorSettings {
    /// What LCMHT gives in its section 4.2, and what it leaves open as it is here by default.
    pub const PAPER: Self = Self {
        svm: SvmParams { c: 2.0, gamma: 1.0, max_support: 100 },
        template_cells: 20,
        positive_iou: 0.9,
        negative_iou: 0.3,
        positives: 2,
        negatives_per_positive: 3,
        learn_extent: 4.0,
        scan_extent: 6.0,
        proposals: 5,
    };
}

/// The classifier, the template's shape, and scratch.
pub struct Detector {
    settings: DetectorSettings,
    svm: Svm,
    rng: ChaCha8Rng,
    /// Rows and columns of the template, in cells.
    rows: usize,
    cols: usize,
    grid: Grid,
    /// Feature vectors of a block of windows of a scan, `windows x dim`.
    candidates: Vec<f32>,
    places: Vec<Rect>,
    scores: Vec<f64>,
    order: Vec<usize>,
    example: Example,
    negatives: Vec<usize>,
}

/// The feature vector of a place: gradients (HOG), then colours (LUV and gradient magnitude), each of length
/// `1 / sqrt 2`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Example(Vec<f32>);

impl Example {
    /// Becomes the mean of itself, counting for `count` examples, and another one.
    pub fn take_in(&mut self, other: &Self, count: u32) {
        self.0.resize(other.0.len(), 0.0);
        let share = 1.0 / (count + 1) as f32;
        self.0.iter_mut().zip(&other.0).for_each(|(mean, new)| *mean += share * (new - *mean));
    }

    /// The cosines between two examples of one detector, in gradients and in colours.
    pub fn cosines(&self, other: &Self) -> [f64; 2] {
        let gradients = self.0.len() / (hog::CHANNELS + COLOUR_CHANNELS) * hog::CHANNELS;
        let cosine = |range: Range<usize>| {
            let products = self.0[range.clone()].iter().zip(&other.0[range]);
            2.0 * f64::from(products.map(|(a, b)| a * b).sum::<f32>())
        };
        [cosine(0..gradients), cosine(gradients..self.0.len())]
    }
}

/// The feature maps of an area around a target, on cells of which `rows x cols` make up the target.
#[derive(Default)]
struct Grid {
    patch: Patch,
    hog: Hog,
    luv: Luv,
    hog_map: FeatureMap,
    luv_map: FeatureMap,
    /// Top-left corner of the first window, in pixels of the frame.
    origin: [f64; 2],
    /// Size of a cell, in pixels of the frame.
    cell: [f64; 2],
    /// Windows in a row and in a column.
    across: usize,
    down: usize,
}

impl Detector {
    /// An untrained detector for targets of the shape of `target`. Its random choices follow from `seed`.
    pub fn new(settings: DetectorSettings, target: &Rect, seed: u64) -> Self {
        let aspect = (target.h / target.w).clamp(1.0 / MAX_TEMPLATE_ASPECT, MAX_TEMPLATE_ASPECT);
        let side = |v: f64| (v.round() as usize).max(2);
        let rows = side((settings.template_cells as f64 * aspect).sqrt());
        let cols = side((settings.template_cells as f64 / aspect).sqrt());
        let dim = rows * cols * (hog::CHANNELS + COLOUR_CHANNELS);
        Self {
            settings,
            svm: Svm::new(dim, settings.svm),
            rng: ChaCha8Rng::seed_from_u64(seed),
            rows,
            cols,
            grid: Grid::default(),
            candidates: Vec::new(),
            places: Vec::new(),
            scores: Vec::new(),
            order: Vec::new(),
            example: Example(Vec::with_capacity(dim)),
            negatives: Vec::new(),
        }
    }

    /// Whether examples of both classes have been learned.
    pub fn is_trained(&self) -> bool {
        self.svm.is_trained()
    }

    /// Takes over changed settings; the template stays.
    pub fn retune(&mut self, settings: DetectorSettings) {
        self.svm.retune(settings.svm);
        self.settings = settings;
    }

    /// Learns the target as it is in `target`, against what surrounds it (eq 10).
    pub fn learn(&mut self, frame: &Frame, cropper: &mut Cropper, target: &Rect) {
        // A shift by d along both axes leaves an overlap of (1 - d)^2 / (2 - (1 - d)^2).
        let keep = (2.0 * self.settings.positive_iou / (1.0 + self.settings.positive_iou)).sqrt();
        let reach = 1.0 - keep;
        for i in 0..self.settings.positives {
            let shift = if i == 0 { [0.0; 2] } else { [(); 2].map(|()| self.rng.random_range(-reach..=reach)) };
            let place = target.shifted(shift[0] * target.w, shift[1] * target.h);
            self.example_at(frame, cropper, &place);
            self.svm.add(&self.example.0, true);
        }
        self.grid.compute(frame, cropper, target, [self.rows, self.cols], self.settings.learn_extent);
        self.negatives.clear();
        let windows = self.grid.across * self.grid.down;
        let far = |&i: &usize| self.grid.place(i, [self.rows, self.cols]).iou(target) < self.settings.negative_iou;
        self.negatives.extend((0..windows).filter(far));
        for _ in 0..self.settings.positives * self.settings.negatives_per_positive {
            if self.negatives.is_empty() {
                break;
            }
            let chosen = self.rng.random_range(0..self.negatives.len());
            let window = self.negatives.swap_remove(chosen);
            self.example.0.clear();
            self.grid.append(window, [self.rows, self.cols], &mut self.example.0);
            self.svm.add(&self.example.0, false);
        }
    }

    /// The decision value for what `target` shows: positive where it looks like the target.
    pub fn margin(&mut self, frame: &Frame, cropper: &mut Cropper, target: &Rect) -> f64 {
        self.example_at(frame, cropper, target);
        self.margin_of_seen()
    }

    /// What `target` shows, as a feature vector, which is kept as [`seen`](Self::seen).
    pub fn see(&mut self, frame: &Frame, cropper: &mut Cropper, target: &Rect) -> &Example {
        self.example_at(frame, cropper, target);
        &self.example
    }

    /// What was [seen](Self::see), unless something else has been asked since.
    pub fn seen(&self) -> &Example {
        &self.example
    }

    /// The decision value for it.
    pub fn margin_of_seen(&self) -> f64 {
        self.svm.margin(&self.example.0)
    }

    /// The place of the size of `target` that `rank` puts highest, and its rank, among those around it: their centres
    /// lie in an area of [`SEARCHED`] times the target's size. `None` where no centre is in view.
    pub fn search(
        &mut self,
        frame: &Frame,
        cropper: &mut Cropper,
        target: &Rect,
        rank: impl Fn(&Example) -> f64,
    ) -> Option<(Rect, f64)> {
        let template = [self.rows, self.cols];
        self.grid.compute(frame, cropper, target, template, SEARCHED + 1.0);
        let mut best: Option<(Rect, f64)> = None;
        for window in 0..self.grid.across * self.grid.down {
            let place = self.grid.place(window, template);
            if frame.holds(place.centre()) {
                self.example.0.clear();
                self.grid.append(window, template, &mut self.example.0);
                let rank = rank(&self.example);
                if best.is_none_or(|(_, best)| rank > best) {
                    best = Some((place, rank));
                }
            }
        }
        best
    }

    /// Writes the best places for a target of the size of `target` around its centre to `proposals`, best first; no
    /// two of them are the same place, and the centre of each is in view.
    pub fn scan(&mut self, frame: &Frame, cropper: &mut Cropper, target: &Rect, proposals: &mut Vec<Proposal>) {
        proposals.clear();
        let template = [self.rows, self.cols];
        self.grid.compute(frame, cropper, target, template, self.settings.scan_extent);
        self.candidates.clear();
        self.places.clear();
        self.scores.clear();
        for window in 0..self.grid.across * self.grid.down {
            let place = self.grid.place(window, template);
            if frame.holds(place.centre()) {
                self.grid.append(window, template, &mut self.candidates);
                self.places.push(place);
                if self.places.len() - self.scores.len() == BLOCK {
                    self.score();
                }
            }
        }
        self.score();
        self.order.clear();
        self.order.extend(0..self.places.len());
        self.order.sort_unstable_by(|&a, &b| self.scores[b].total_cmp(&self.scores[a]).then(a.cmp(&b)));
        for &i in &self.order {
            if proposals.len() == self.settings.proposals {
                break;
            }
            if proposals.iter().all(|p| p.rect.iou(&self.places[i]) <= SAME_PLACE_IOU) {
                proposals.push(Proposal { rect: self.places[i], score: self.scores[i] });
            }
        }
    }

    /// Scores the candidates, those of the last places.
    fn score(&mut self) {
        let scored = self.scores.len();
        self.scores.resize(self.places.len(), 0.0);
        self.svm.margins(&self.candidates, &mut self.scores[scored..]);
        self.candidates.clear();
    }

    /// Fills `example` with the feature vector of what `place` shows.
    fn example_at(&mut self, frame: &Frame, cropper: &mut Cropper, place: &Rect) {
        self.grid.compute(frame, cropper, place, [self.rows, self.cols], 1.0);
        self.example.0.clear();
        self.grid.append(0, [self.rows, self.cols], &mut self.example.0);
    }
}

impl Grid {
    /// Computes the maps of an area of `extent` times the size of `target` around it. The middle window is the target.
    fn compute(&mut self, frame: &Frame, cropper: &mut Cropper, target: &Rect, template: [usize; 2], extent: f64) {
        let [rows, cols] = template;
        self.cell = [target.w / cols as f64, target.h / rows as f64];
        let beyond = |n: usize| ((extent - 1.0) / 2.0 * n as f64).round() as usize;
        let (left, above) = (beyond(cols), beyond(rows));
        (self.across, self.down) = (2 * left + 1, 2 * above + 1);
        self.origin = [target.x - left as f64 * self.cell[0], target.y - above as f64 * self.cell[1]];
        let (all_cols, all_rows) = (cols + 2 * (left + MARGIN), rows + 2 * (above + MARGIN));
        let area = Rect::new(
            self.origin[0] - MARGIN as f64 * self.cell[0],
            self.origin[1] - MARGIN as f64 * self.cell[1],
            all_cols as f64 * self.cell[0],
            all_rows as f64 * self.cell[1],
        );
        cropper.crop(frame, &area, all_cols * CELL, all_rows * CELL, &mut self.patch);
        self.hog.compute(&self.patch, &mut self.hog_map);
        self.luv.compute(&self.patch, &mut self.luv_map);
    }

    /// Where a window lies, in pixels of the frame. Windows are numbered row by row.
    fn place(&self, window: usize, [rows, cols]: [usize; 2]) -> Rect {
        let (r, c) = (window / self.across, window % self.across);
        Rect::new(
            self.origin[0] + c as f64 * self.cell[0],
            self.origin[1] + r as f64 * self.cell[1],
            cols as f64 * self.cell[0],
            rows as f64 * self.cell[1],
        )
    }

    /// Appends the feature vector of a window.
    fn append(&self, window: usize, template: [usize; 2], out: &mut Vec<f32>) {
        let (top, left) = (window / self.across + MARGIN, window % self.across + MARGIN);
        for map in [&self.hog_map, &self.luv_map] {
            let start = out.len();
            for channel in 0..map.channels {
                let plane = map.plane(channel);
                for r in top..top + template[0] {
                    out.extend_from_slice(&plane[r * map.cols + left..r * map.cols + left + template[1]]);
                }
            }
            let norm = out[start..].iter().map(|v| v * v).sum::<f32>().sqrt();
            let scale = std::f32::consts::FRAC_1_SQRT_2 / norm.max(f32::MIN_POSITIVE);
            out[start..].iter_mut().for_each(|v| *v *= scale);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Encoding;

    const SETTINGS: DetectorSettings = DetectorSettings::PAPER;

    /// Noise, with a striped red object of 20 x 40 at the given corner.
    fn scene(at: [usize; 2], seed: u64) -> Vec<u8> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut data: Vec<u8> = (0..240 * 320 * 3).map(|_| rng.random_range(90..140)).collect();
        for y in 0..40 {
            for x in 0..20 {
                let at = ((at[1] + y) * 320 + at[0] + x) * 3;
                let stripe = if (y / 5 + x / 7) % 2 == 0 { 220 } else { 60 };
                data[at..at + 3].copy_from_slice(&[stripe, 30, 30]);
            }
        }
        data
    }

    fn frame(data: &[u8]) -> Frame<'_> {
        Frame::new(data, 320, 240, 960, Encoding::Rgb8, None).unwrap()
    }

    /// Where the object is first, and where it goes.
    const FIRST: Rect = Rect::new(150.0, 100.0, 20.0, 40.0);
    const THEN: Rect = Rect::new(185.0, 60.0, 20.0, 40.0);

    /// Both scenes.
    fn scenes() -> [Vec<u8>; 2] {
        [(FIRST, 1), (THEN, 2)].map(|(rect, seed)| scene([rect.x as usize, rect.y as usize], seed))
    }

    #[test]
    fn the_learned_target_is_the_best_proposal_and_its_margin_is_positive() {
        let mut cropper = Cropper::default();
        let ([first, moved], [target, there]) = (scenes(), [FIRST, THEN]);
        let mut detector = Detector::new(SETTINGS, &target, 7);
        assert!(!detector.is_trained());
        detector.learn(&frame(&first), &mut cropper, &target);
        assert!(detector.is_trained());
        let mut proposals = Vec::new();
        detector.scan(&frame(&moved), &mut cropper, &target, &mut proposals);
        assert_eq!(proposals.len(), 5);
        assert!(proposals[0].rect.iou(&there) > 0.7, "{proposals:?}");
        assert!(proposals[0].score > 0.0 && proposals[1].score < proposals[0].score, "{proposals:?}");
        for (i, a) in proposals.iter().enumerate() {
            assert!(proposals[..i].iter().all(|b| b.rect.iou(&a.rect) <= SAME_PLACE_IOU));
        }
        assert!(detector.margin(&frame(&moved), &mut cropper, &there) > 0.5);
        assert!(detector.margin(&frame(&moved), &mut cropper, &target) < -0.5);
    }

    #[test]
    fn a_look_is_found_again_anywhere_in_the_area_and_nowhere_out_of_view() {
        let mut cropper = Cropper::default();
        let ([first, moved], target) = (scenes(), FIRST);
        let mut detector = Detector::new(SETTINGS, &target, 7);
        let look = detector.see(&frame(&first), &mut cropper, &target).clone();
        let likeness = |seen: &Example| look.cosines(seen).iter().sum();
        let (place, rank) = detector.search(&frame(&moved), &mut cropper, &target, likeness).unwrap();
        assert!(place.iou(&THEN) > 0.7, "{place}");
        // The same place by itself, but for the margins of its cells.
        let alone: f64 = likeness(detector.see(&frame(&moved), &mut cropper, &place));
        assert!((rank - alone).abs() < 0.05, "{rank} {alone}");
        let outside = Rect::new(2000.0, 100.0, 20.0, 40.0);
        assert_eq!(detector.search(&frame(&moved), &mut cropper, &outside, likeness), None);
    }

    #[test]
    fn a_mean_of_examples_is_that_of_each_value() {
        let mut mean = Example::default();
        for (i, values) in [[1.0, 4.0], [3.0, 0.0], [5.0, 2.0]].into_iter().enumerate() {
            mean.take_in(&Example(values.to_vec()), i as u32);
        }
        assert_eq!(mean, Example(vec![3.0, 2.0]));
    }

    /// A window cut from a large area and the same window computed on its own have the same features.
    #[test]
    fn windows_of_an_area_agree_with_single_windows() {
        let mut cropper = Cropper::default();
        let data = scene([150, 100], 3);
        // Cells of exactly 4 px, so that both crops sample the same pixels.
        let target = Rect::new(152.0, 100.0, 12.0, 28.0);
        let template = [7, 3];
        let (mut area, mut single) = (Grid::default(), Grid::default());
        area.compute(&frame(&data), &mut cropper, &target, template, 4.0);
        for window in [0, area.across / 2 + area.down / 2 * area.across, area.across * area.down - 1] {
            let place = area.place(window, template);
            let (mut got, mut want) = (Vec::new(), Vec::new());
            area.append(window, template, &mut got);
            single.compute(&frame(&data), &mut cropper, &place, template, 1.0);
            single.append(0, template, &mut want);
            // HOG sees one cell beyond the template; the gradient's surround sees two.
            for (a, b) in got[..hog::CHANNELS * 21].iter().zip(&want) {
                assert!((a - b).abs() < 0.02, "{a} {b}");
            }
            assert!((got.iter().map(|v| v * v).sum::<f32>() - 1.0).abs() < 1e-5);
        }
        assert_eq!(area.place(area.across / 2 + area.down / 2 * area.across, template), target);
    }

    #[test]
    fn the_same_seed_learns_the_same() {
        let mut cropper = Cropper::default();
        let data = scene([150, 100], 1);
        let target = Rect::new(150.0, 100.0, 20.0, 40.0);
        let margins: Vec<f64> = [5, 5, 6]
            .into_iter()
            .map(|seed| {
                let mut detector = Detector::new(SETTINGS, &target, seed);
                detector.learn(&frame(&data), &mut cropper, &target);
                detector.margin(&frame(&data), &mut cropper, &target.shifted(6.0, 0.0))
            })
            .collect();
        assert_eq!(margins[0], margins[1]);
        assert_ne!(margins[0], margins[2]);
    }
}
