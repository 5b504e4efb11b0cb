//! The tracker beside Algorithm 1, line by line as the paper prints it, with the paper's own parameters on hand-crafted
//! features. Cropping, features, filter, detector and GM-PHD filter are the crate's, which have naive twins of their
//! own.

use std::path::Path;

use super::*;
use crate::appearance::layers::{Extractor, Feature, LayerSource, LayerSpec};
use crate::dcf::fft::Fft2;
use crate::dcf::kernelised::{KernelisedFilter, KernelisedSettings};
use crate::dcf::sample::Sample;
use crate::dcf::window::label;
use crate::detect::online::Detector;
use crate::filter::Vector;
use crate::filter::gm_phd::{GmPhd, GmPhdSettings};
use crate::filter::kalman::Gaussian;
use crate::filter::mixture::{Component, ReductionSettings};
use crate::filter::motion::{MotionModel, Noise};
use crate::frame::Encoding;
use crate::geometry::distance;
use crate::loader::Loaded;
use crate::network::locked;
use crate::params::{NodeName, Phase, Value, file};
use crate::session::Session;
use crate::trace::Thresholds;

const WIDTH: usize = 320;
const HEIGHT: usize = 200;
const TARGET: Rect = Rect::new(60.0, 70.0, 32.0, 40.0);
const FRAMES: usize = 40;
/// Frames in which the target is hidden; then it is seen elsewhere.
const HIDDEN: std::ops::Range<usize> = 12..20;

/// Values of no order.
fn noise(x: usize, y: usize, seed: usize) -> u8 {
    let mut v = (x as u32).wrapping_mul(374_761_393) ^ (y as u32).wrapping_mul(668_265_263) ^ (seed as u32 * 97);
    v = (v ^ (v >> 13)).wrapping_mul(1_274_126_177);
    (v >> 24) as u8
}

/// Where the target is, if it is seen.
fn place(frame: usize) -> Option<[f64; 2]> {
    let [x, y] = TARGET.centre();
    let jump = if frame < HIDDEN.end { 0.0 } else { 48.0 };
    (!HIDDEN.contains(&frame)).then_some([x + 2.0 * frame as f64 + jump, y + 0.5 * jump])
}

/// Blocks of noise in front of a background of other, fainter noise.
fn scene(frame: usize) -> Vec<u8> {
    let pixel = |i: usize| {
        let (x, y) = (i % WIDTH, i / WIDTH);
        let inside = place(frame).and_then(|[cx, cy]| {
            let (u, v) = (x as f64 + 0.5 - cx + TARGET.w / 2.0, y as f64 + 0.5 - cy + TARGET.h / 2.0);
            ((0.0..TARGET.w).contains(&u) && (0.0..TARGET.h).contains(&v)).then_some((u as usize, v as usize))
        });
        match inside {
            Some((u, v)) => noise(u / 4, v / 4, 1),
            None => 100 + noise(x / 3, y / 3, 2 + frame) / 6,
        }
    };
    (0..WIDTH * HEIGHT).map(pixel).collect()
}

fn frame(data: &[u8]) -> Frame<'_> {
    Frame::new(data, WIDTH as u32, HEIGHT as u32, WIDTH, Encoding::Mono8, None).unwrap()
}

/// `params/paper.yaml` without its network.
fn paper() -> Params {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/paper.yaml");
    let mut rows = file(&path, &NodeName::default()).unwrap();
    rows.push(("lcmht.cnn.enabled".to_owned(), Value::Bool(false)));
    rows.push(("lcmht.layers.hog_weight".to_owned(), Value::Double(1.0)));
    let rows = rows.iter().map(|(name, value)| (name.as_str(), value));
    Params::default().with(rows, Phase::StartUp).unwrap()
}

/// All that Algorithm 1 takes from frame to frame.
struct Naive {
    params: LcmhtParams,
    cropper: Cropper,
    fft: Fft2,
    extractor: Extractor,
    sample: Sample,
    filter: KernelisedFilter,
    detector: Detector,
    phd: GmPhd<6, 4>,
    /// x_(k-1).
    x: [f64; 2],
}

/// What a frame made of it, to see that all branches were taken.
#[derive(Default)]
struct Branches {
    taken_up: usize,
    refused: usize,
    taught: usize,
    steps: usize,
}

impl Naive {
    /// "In frame 1, we only train the correlation filter and SVM classifier using the initialized target."
    fn new(params: &Params, frame: &Frame) -> Self {
        let lcmht = params.lcmht.clone();
        let mut cropper = Cropper::default();
        let window = Self::window(&lcmht, TARGET.centre());
        let [cols, rows] = window.size().map(|side| (side / 4.0).round() as usize);
        let (mut fft, mut sample) = (Fft2::new(rows, cols), Sample::default());
        let joint = LayerSource::Cells(vec![Feature::Hog, Feature::ColourNames]);
        let specs = [LayerSpec { source: joint, components: None, energy: None, weight: 1.0 }];
        let mut extractor = Extractor::fit(&specs, None, rows, cols, frame, &window, &mut cropper);
        extractor.transform(&mut fft, &mut sample);
        let cells = TARGET.w * cols as f64 / window.w * (TARGET.h * rows as f64 / window.h);
        let y = label(rows, cols, 0.1 * cells.sqrt());
        let settings = KernelisedSettings { regularisation: 1e-4, layer_weights: vec![1.0] };
        let mut filter = KernelisedFilter::new(settings, &mut fft, &y);
        filter.learn(&fft, &sample, 1.0);
        let mut detector = Detector::new(settings::detector(&lcmht.svm), &TARGET, 0);
        detector.learn(frame, &mut cropper, &TARGET);
        let mut phd = phd(frame.bounds().area());
        let state =
            Gaussian { mean: phd.model().at_rest(&measured(&TARGET)), covariance: phd.settings().birth_covariance };
        phd.reset(&[Component { weight: 1.0, state }]);
        Self { params: lcmht, cropper, fft, extractor, sample, filter, detector, phd, x: TARGET.centre() }
    }

    fn window(params: &LcmhtParams, x: [f64; 2]) -> Rect {
        Rect::around(x, TARGET.size().map(|side| params.filter.window * side))
    }

    /// "Crop out the searching window ... and extract multi-layer hybrid features".
    fn crop(&mut self, frame: &Frame, x: [f64; 2]) -> Rect {
        let window = Self::window(&self.params, x);
        self.extractor.extract(frame, &window, &mut self.cropper, &mut self.fft, &mut self.sample);
        window
    }

    /// The maximum of the response map, and where it is (eqs 5 to 7).
    fn respond(&mut self, window: &Rect) -> ([f64; 2], f64) {
        let (rows, cols) = (self.fft.rows(), self.fft.cols());
        let mut r = vec![0.0; rows * cols];
        self.filter.respond(&mut self.fft, &self.sample, &mut r);
        let best = (0..r.len()).fold(0, |best, i| if r[i] > r[best] { i } else { best });
        let from_middle = |i: usize, n: usize| if i > n / 2 { i as f64 - n as f64 } else { i as f64 };
        let (dx, dy) = (from_middle(best % cols, cols), from_middle(best / cols, rows));
        let [x, y] = window.centre();
        ([x + dx * window.w / cols as f64, y + dy * window.h / rows as f64], f64::from(r[best]))
    }

    fn step(&mut self, frame: &Frame, seen: &mut Branches) {
        const ACTIVATE: f64 = 0.15;
        const TRAIN: f64 = 0.4;
        let at = |x| Rect::around(x, TARGET.size());
        // Crop out the searching window in frame k according to (x_(k-1), y_(k-1)) ...
        let window = self.crop(frame, self.x);
        // ... estimate the new target position (x_k, y_k) by finding the maximum response.
        let (x, max_r) = self.respond(&window);
        self.x = frame.nearest(x);
        // Update GM-PHD filter using the estimated target position as measurement.
        self.phd.predict(1.0);
        self.phd.update(&[measured(&at(self.x))]);
        if max_r < ACTIVATE {
            // Use the detector to generate detection proposals Z_k.
            let mut proposals = Vec::new();
            self.detector.scan(frame, &mut self.cropper, &at(self.x), &mut proposals);
            // Filter the candidates and select the detection with maximum weight ...
            let z: Vec<_> = proposals.iter().map(|p| measured(&p.rect)).collect();
            self.phd.update(&z);
            let values = self.phd.model().values(&self.phd.heaviest().expect("a component").state.mean);
            let x_r = frame.nearest([values[0] * TARGET.scale(), values[1] * TARGET.scale()]);
            // ... crop out the searching window at this re-detected position and compute its response map.
            let window = self.crop(frame, x_r);
            let (_, max_rd) = self.respond(&window);
            if max_rd >= ACTIVATE {
                self.x = x_r;
                seen.taken_up += 1;
            } else {
                seen.refused += 1;
            }
        }
        // Crop out new patch centered at (x_k, y_k) and update the translation correlation filter using (8).
        self.crop(frame, self.x);
        self.filter.learn(&self.fft, &self.sample, 0.01);
        // Update the detector.
        if max_r >= TRAIN {
            self.detector.learn(frame, &mut self.cropper, &at(self.x));
            seen.taught += 1;
        }
        seen.steps += 1;
    }
}

/// A box as it is measured, in target sizes.
fn measured(rect: &Rect) -> Vector<4> {
    let [x, y] = rect.centre();
    Vector::from([x, y, rect.w, rect.h]) / TARGET.scale()
}

/// The GM-PHD filter of the target's motion, in target sizes.
fn phd(area: f64) -> GmPhd<6, 4> {
    let noise = Noise { process: [4e-4, 4e-4, 1e-4, 1e-4], measurement: [0.01; 4] };
    let model = MotionModel::centre_size(noise);
    let settings = GmPhdSettings {
        survival: 0.99,
        detection: 0.95,
        clutter_rate: 4.0,
        // Widths and heights of twice the target's.
        clutter_volume: area / TARGET.area() * 4.0,
        birth_weight: 0.01,
        birth_covariance: model.diagonal(&Vector::from(noise.measurement), &Vector::from_element(0.01)),
        reduction: ReductionSettings { prune_below: 1e-5, merge_within: 4.0, max_components: 50 },
    };
    GmPhd::new(model, settings)
}

#[test]
fn with_the_papers_parameters_each_frame_goes_by_algorithm_1_line_by_line() {
    let params = paper();
    let first = scene(0);
    let mut tracker = Lcmht::new(&params, Networks::default());
    tracker.start(&"1".into(), &frame(&first), TARGET, &mut ());
    let (mut naive, mut seen) = (Naive::new(&params, &frame(&first)), Branches::default());
    let mut output = Output::default();
    for n in 1..FRAMES {
        let data = scene(n);
        tracker.step(&frame(&data), 1.0, &mut || "new".into(), &mut ());
        naive.step(&frame(&data), &mut seen);
        tracker.report(&mut output);
        let got = output.targets[0].rect.centre();
        assert!(distance(got, naive.x) < 1e-6, "frame {n}: {got:?}, by the paper {:?}", naive.x);
        assert_eq!(output.targets[0].rect.size(), TARGET.size());
    }
    let Branches { taken_up, refused, taught, steps } = seen;
    assert!(taken_up > 0 && refused > 0 && taught > 0 && taught < steps, "{taken_up} {refused} {taught} of {steps}");
    let there = Rect::around(place(FRAMES - 1).unwrap(), TARGET.size());
    assert!(output.targets[0].rect.iou(&there) > 0.5, "{} is not {there}", output.targets[0].rect);
}

/// One run of the embedded network serves the filter's layers and the matching head.
#[test]
fn the_network_runs_once_a_frame_for_layers_and_head() {
    let [on, off] = [true, false].map(Value::Bool);
    let changes = [
        ("lcmht.matching.enabled", &on),
        ("lcmht.augment.enabled", &off),
        ("lcmht.turn.enabled", &off),
        ("lcmht.cnn.inference", &Value::String("builtin".to_owned())),
    ];
    let params = Params::default().with(changes, Phase::StartUp).unwrap();
    let networks = Loaded::new(&params).unwrap().networks();
    let cnn = networks.cnn.clone().unwrap();
    let mut session = Session::with_networks(params, networks);
    session.start(&frame(&scene(0)), TARGET, &mut ()).unwrap();
    for k in 1..6 {
        let before = locked(&cnn).runs;
        session.step(&frame(&scene(k)), &mut ());
        assert_eq!(locked(&cnn).runs - before, 1, "frame {k}");
    }
}

/// Keeps what the last response was held against.
struct Held(Option<Thresholds>);

impl Trace for Held {
    fn event(&mut self, event: Event) {
        if let Event::Thresholds { thresholds, .. } = event {
            self.0 = Some(thresholds);
        }
    }
}

#[test]
fn the_thresholds_that_are_shown_are_those_that_decide() {
    // The detector's opinion would count as well.
    let params = [("lcmht.cnn.enabled", &Value::Bool(false)), ("lcmht.svm.opinion", &Value::Double(0.0))];
    let params = Params::default().with(params, Phase::StartUp).unwrap();
    let mut tracker = Lcmht::new(&params, Networks::default());
    tracker.start(&"0".into(), &frame(&scene(0)), TARGET, &mut ());
    let (mut output, mut before, mut seen) = (Output::default(), State::Tracking, [0; 3]);
    for n in 1..FRAMES {
        let mut held = Held(None);
        tracker.step(&frame(&scene(n)), 1.0, &mut || "1".into(), &mut held);
        tracker.report(&mut output);
        let (target, Some(held)) = (&output.targets[0], held.0) else { panic!("frame {n}: no thresholds") };
        let is_certain = f64::from(target.response) >= held.certain;
        assert!(held.lost <= held.certain && held.certain <= held.found, "{held:?}");
        match before {
            State::Lost => {}
            _ => assert_eq!(target.state == State::Tracking, is_certain, "frame {n}: {} {held:?}", target.response),
        }
        seen[before as usize] += 1;
        before = target.state;
    }
    assert!(seen.iter().all(|&frames| frames > 0), "{seen:?}");
}
