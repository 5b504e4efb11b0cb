//! Long-term correlation tracking with multi-layer hybrid features (Baisa, Bhowmik and Wallace).

use super::{Output, State, Tracker};
use crate::crop::Cropper;
use crate::dcf::fft::Fft2;
use crate::dcf::masked::{MaskedFilter, Settings};
use crate::dcf::response::{Peak, centred, highest, local_maxima};
use crate::dcf::sample::Sample;
use crate::dcf::scale::ScaleFilter;
use crate::dcf::window::{label, mask};
use crate::features::layers::{Extractor, Feature, LayerSpec};
use crate::frame::Frame;
use crate::geometry::{Rect, distance};
use crate::params::{LcmhtFilter as P, Params};
use crate::trace::{ResponseMap, Stage, Trace};

/// The tracker.
pub struct Lcmht {
    params: P,
    target: Option<Followed>,
    cropper: Cropper,
}

struct Followed {
    p: P,
    n: usize,
    fft: Fft2,
    extractor: Extractor,
    filter: MaskedFilter,
    long: MaskedFilter,
    scale: ScaleFilter,
    sample: Sample,
    response: Vec<f32>,
    shown: Vec<f32>,
    peaks: Vec<Peak>,
    centre: [f64; 2],
    size: [f64; 2],
    velocity: [f64; 2],
    innovation: f64,
    reference: f64,
    bad: u32,
    good_frames: u32,
    lost: bool,
    learned: u32,
    age: u32,
    lost_for: u32,
    erratic: f64,
    conf: f64,
}

impl Lcmht {
    /// A tracker that waits for a mark.
    pub fn new(params: &Params) -> Self {
        Self { params: params.lcmht.filter.clone(), target: None, cropper: Cropper::default() }
    }
}

impl Tracker for Lcmht {
    fn start(&mut self, frame: &Frame, rect: Rect, _trace: &mut dyn Trace) {
        let p = self.params.clone();
        let n = p.cells as usize;
        let mut fft = Fft2::new(n, n);
        let side = p.window * rect.scale();
        let window = Rect::around(rect.centre(), [side, side]);
        let specs = [
            LayerSpec {
                features: vec![Feature::Hog],
                components: Some(p.hog_components as usize),
                energy: Some((p.hog_weight) as f32),
            },
            LayerSpec {
                features: vec![Feature::ColourNames],
                components: Some(10),
                energy: Some((p.cn_weight) as f32),
            },
        ];
        let mut extractor = Extractor::fit(&specs, n, n, frame, &window, &mut self.cropper);
        let cell = side / n as f64;
        let (w, h) = (rect.w / cell, rect.h / cell);
        let y = label(n, n, p.label_sigma * (w * h).sqrt());
        let m = mask(n, n, p.mask * w, p.mask * h);
        let settings = Settings {
            memory: p.memory as usize,
            learning_rate: p.learning_rate as f32,
            first_weight: 0.1,
            regularisation: p.regularisation as f32,
        };
        let channels = extractor.channels();
        let mut filter = MaskedFilter::new(settings, &mut fft, channels, &y, &m);
        let mut long = MaskedFilter::new(settings, &mut fft, channels, &y, &m);
        let mut sample = Sample::default();
        extractor.extract(frame, &window, &mut self.cropper, &mut fft, &mut sample);
        filter.learn(&mut fft, &sample, 1.0, 30);
        long.learn(&mut fft, &sample, 1.0, 30);
        let mut response = vec![0.0; n * n];
        filter.respond(&mut fft, &sample, &mut response);
        let peak = f64::from(highest(&response, n, n, false).value);
        let mut scale = ScaleFilter::new(&rect, p.scale_step, 512.0);
        scale.learn(frame, &mut self.cropper, &rect, 1.0);
        self.target = Some(Followed {
            n,
            fft,
            extractor,
            filter,
            long,
            scale,
            sample,
            response,
            shown: Vec::new(),
            peaks: Vec::new(),
            centre: rect.centre(),
            size: rect.size(),
            velocity: [0.0; 2],
            innovation: 0.04,
            reference: e("REF0", 0.6) * peak,
            bad: 0,
            good_frames: 0,
            lost: false,
            learned: 0,
            age: 0,
            lost_for: 0,
            erratic: 0.0,
            conf: 0.0,
            p,
        });
    }

    fn step(&mut self, frame: &Frame, dt: f64, trace: &mut dyn Trace, output: &mut Output) {
        if let (Some(f), Some(target)) = (&mut self.target, output.targets.first_mut()) {
            f.step(frame, &mut self.cropper, dt, trace);
            target.rect = Rect::around(f.centre, f.size);
            target.velocity = f.velocity; target.confidence = f.conf as f32;
            target.state = if f.lost {
                State::Lost
            } else if f.bad > 0 {
                State::Uncertain
            } else {
                State::Tracking
            };
            target.reacquired = target.lost_for > 0 && f.lost_for == 0;
            target.lost_for = f.lost_for;
            target.age = f.age;
        }
    }

    fn retune(&mut self, _params: &Params) {}
}

/// experiment
pub fn e(name: &'static str, default: f64) -> f64 {
    use std::sync::{Mutex, LazyLock}; use std::collections::HashMap;
    static M: LazyLock<Mutex<HashMap<&'static str, f64>>> = LazyLock::new(Default::default);
    *M.lock().unwrap().entry(name).or_insert_with(|| std::env::var(name).ok().map_or(default, |v| v.parse().unwrap()))
}

impl Followed {
    fn window(&self, centre: [f64; 2]) -> Rect {
        let side = self.p.window * (self.size[0] * self.size[1]).sqrt();
        Rect::around(centre, [side, side])
    }

    fn respond_at(&mut self, frame: &Frame, cropper: &mut Cropper, centre: [f64; 2], long: bool) -> f64 {
        let window = self.window(centre);
        self.extractor.extract(frame, &window, cropper, &mut self.fft, &mut self.sample);
        let filter = if long { &mut self.long } else { &mut self.filter };
        filter.respond(&mut self.fft, &self.sample, &mut self.response);
        window.w / self.n as f64
    }

    fn step(&mut self, frame: &Frame, cropper: &mut Cropper, dt: f64, trace: &mut dyn Trace) {
        self.age += 1;
        let scale = (self.size[0] * self.size[1]).sqrt();
        let predicted = [self.centre[0] + dt * self.velocity[0], self.centre[1] + dt * self.velocity[1]];
        let width = (3.0 * self.innovation.sqrt() * (1.0 + 0.1 * f64::from(self.bad))).clamp(0.2, 1.0) * scale;
        let prior = |at: [f64; 2]| (-0.5 * (distance(at, predicted) / width).powi(2)).exp();
        trace.stage(Stage::Features);
        let cell = self.respond_at(frame, cropper, predicted, false);
        let window = self.window(predicted);
        trace.search_window(window);
        trace.stage(Stage::Localise);
        centred(&self.response, self.n, self.n, &mut self.shown);
        trace.response(&ResponseMap { values: &self.shown, rows: self.n, cols: self.n, window });
        self.peaks.clear();
        local_maxima(&self.response, self.n, self.n, 0.0, 8, &mut self.peaks);
        let place = |p: &Peak| [predicted[0] + p.displacement[0] * cell, predicted[1] + p.displacement[1] * cell];
        let best = self
            .peaks
            .iter()
            .map(|p| (f64::from(p.value) * ((1.0 - e("PW", 0.7)) + e("PW", 0.7) * prior(place(p))), *p))
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .map(|b| b.1)
            .unwrap_or(Peak { displacement: [0.0; 2], value: 0.0 });
        let mut at = place(&best);
        let q = f64::from(best.value) / self.reference;
        let h = ((q - e("H0", 0.55)) / 0.2).clamp(0.0, 1.0);
        let g = 1.0 - 0.7 * (1.0 - prior(at)) * (1.0 - self.erratic);
        self.conf = q; let mut conf = q * (g + (1.0 - g) * h);
        let mut good = conf > e("GOOD", 0.6);
        if self.lost || (!good && self.bad >= 4) {
            self.lost = true;
            trace.stage(Stage::Redetect);
            // scan
            let mut found = None;
            if conf <= 0.6 {
                let rings = (1 + self.lost_for / 10).min(3) as i32;
                let spacing = 0.4 * window.w;
                let mut top = 0.0;
                for gy in -rings..=rings {
                    for gx in -rings..=rings {
                        let c = [predicted[0] + f64::from(gx) * spacing, predicted[1] + f64::from(gy) * spacing];
                        if !(0.0..f64::from(frame.width())).contains(&c[0])
                            || !(0.0..f64::from(frame.height())).contains(&c[1])
                        {
                            continue;
                        }
                        self.respond_at(frame, cropper, c, true);
                        let peak = highest(&self.response, self.n, self.n, true);
                        let at = [c[0] + peak.displacement[0] * cell, c[1] + peak.displacement[1] * cell];
                        let spread = spacing * f64::from(rings);
                        let near = (-0.5 * (distance(at, predicted) / spread).powi(2)).exp();
                        let v = f64::from(peak.value) * (0.5 + 0.5 * near);
                        if v > top {
                            top = v;
                            found = Some((at, f64::from(peak.value)));
                        }
                    }
                }
            } else {
                found = Some((at, f64::from(best.value)));
            }
            if let Some((place, value)) = found
                && value > 0.6 * self.reference
            {
                self.respond_at(frame, cropper, place, false);
                let peak = highest(&self.response, self.n, self.n, true);
                if f64::from(peak.value) > 0.6 * self.reference {
                    at = [place[0] + peak.displacement[0] * cell, place[1] + peak.displacement[1] * cell];
                    conf = f64::from(peak.value) / self.reference;
                    good = true;
                    self.lost = false;
                    self.lost_for = 0;
                    self.velocity = [0.0; 2];
                }
            }
            if self.lost {
                self.lost_for += 1;
                self.bad += 1;
                self.velocity = self.velocity.map(|v| v * 0.97);
                self.centre = [
                    predicted[0].clamp(0.0, f64::from(frame.width())),
                    predicted[1].clamp(0.0, f64::from(frame.height())),
                ];
                return;
            }
        }
        let trust = ((conf - e("T0", 0.3)) / 0.4).clamp(0.0, 1.0);
        let before = self.centre;
        self.centre =
            [predicted[0] + trust * (at[0] - predicted[0]), predicted[1] + trust * (at[1] - predicted[1])];
        if good {
            self.bad = 0;
            self.good_frames += 1;
            let step = [(self.centre[0] - before[0]) / dt, (self.centre[1] - before[1]) / dt];
            let error = distance(at, predicted) / scale;
            self.innovation = 0.9 * self.innovation + 0.1 * error * error;
            self.velocity = [0.8 * self.velocity[0] + 0.2 * step[0], 0.8 * self.velocity[1] + 0.2 * step[1]];
        } else {
            self.bad += 1;
        }
        if good {
            trace.stage(Stage::Scale);
            let factor = self.scale.estimate(frame, cropper, &Rect::around(self.centre, self.size));
            self.size = self.size.map(|s| s * factor);
        }
        if conf > e("LEARN", 0.5) {
            trace.stage(Stage::Learn);
            self.learned += 1;
            self.reference = 0.95 * self.reference + 0.05 * f64::from(best.value);
            if self.learned % self.p.interval as u32 == 0 {
                let off = [(predicted[0] - self.centre[0]) / cell, (predicted[1] - self.centre[1]) / cell];
                self.sample.shift(&self.fft, off);
                self.filter.learn(&mut self.fft, &self.sample, self.p.learning_rate as f32, self.p.steps as usize);
                if conf > 0.9 {
                    self.long.learn(
                        &mut self.fft,
                        &self.sample,
                        0.3 * self.p.learning_rate as f32,
                        self.p.steps as usize,
                    );
                }
            }
            self.scale.learn(frame, cropper, &Rect::around(self.centre, self.size), self.p.scale_rate as f32);
        }
    }
}
