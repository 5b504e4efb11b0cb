//! Ensemble tracking embedded in a particle filter: ETEPF (Gu, Li and Han, *Embedding ensemble tracking in a stochastic
//! framework for robust object tracking*, 2009).
//!
//! Weak classifiers that tell pixels of the target from those around it make a likelihood image. Particles follow the
//! target: one half as it may have moved, the other led to the peaks of that image by mean shift; they are weighed by
//! what the image and their colours say. `EtepfTarget::step` is the paper's algorithm.
//!
//! The mode TRACK is `Tracking` where the likelihood mean of the target is above T1 and `Uncertain` below; FIND is
//! `Lost`. By default, some things differ from the paper, each of which a parameter takes back: the target must stand
//! out from its surroundings (eq 4) where the paper weighs its likelihood mean alone, and is lost where it does not; it
//! has a colour histogram for its upper and one for its lower half; its place settles on a peak of the likelihood
//! image; and ensemble and colours are updated while the target is certain. What FIND does is ours for good: the paper
//! says only that nothing is resampled. Each frame draws the particles anew around where the target was last, the
//! farther the longer it is lost; the heaviest of them is the one place that may be it, and it is if the likelihood
//! mean there is above T1, where the paper has T2.
//!
//! | file | what it holds |
//! |---|---|
//! | `etepf/likelihood.rs` | the likelihood image of a part of the frame (eq 5), and its means (eq 3) |
//! | `etepf/appearance.rs` | the ensemble and the colours, and what they say of a place (eqs 4 and 7 to 9) |
//! | `etepf/learning.rs` | what the ensemble is trained on |
//! | `etepf/motion.rs` | the adaptive motion model (eq 6) |
//! | `features/pixelwise.rs`, `features/colour_histogram.rs` | the features |
//! | `learn/adaboost.rs` | AdaBoost |
//! | `detect/mean_shift.rs` | mean shift |
//! | `filter/particles.rs`, `filter/bounds.rs` | the particle filter (eqs 1 and 2), within what a state may be |

mod appearance;
mod learning;
mod likelihood;
mod motion;

use std::sync::Arc;

use super::made::Made;
use super::targets::{self, Rooms, Targets};
use super::{NewId, Output, State, Target, Tracker};
use crate::crop::Cropper;
use crate::filter::bounds::Bounds;
use crate::filter::particles::Particles;
use crate::frame::Frame;
use crate::geometry::Rect;
use crate::network::Networks;
use crate::params::{CLIMB, EtepfMethod, EtepfModes, EtepfParams, Group as _, Need, Params, SURROUND};
use crate::trace::{Event, Stage, Thresholds, Trace};
use appearance::{Appearance, Evidence};
use likelihood::LikelihoodView;
use motion::{ParticleMotion, Place};

/// What the paper calls its modes.
const TRACK: &str = "track";
const FIND: &str = "find";
/// Standard deviations of what is drawn around a peak within which the likelihood image is made.
const REACH: f64 = 2.0;
/// Standard deviation of what is drawn around a local peak (Sigma), in units of the motion model's.
const SPREAD: f64 = 1.0;
/// What a frame must show to be learned from: how much the target stands out (eq 4) in units of the first frame's, and
/// how similar its colours are.
const LEAST_LEARNED_CONTRAST: f64 = 0.7;
const LEAST_LEARNED_LIKENESS: f64 = 0.8;
/// Keeps the contrast of the first frame above zero.
const LEAST_CONTRAST: f64 = 0.05;

/// The tracker.
pub struct Etepf {
    params: EtepfParams,
    seed: u64,
    scratch: Rooms<Scratch>,
    targets: Targets<EtepfTarget>,
    /// What changed parameters had made anew since the last frame.
    made: Made,
}

/// Room to work in: of one target at a time.
#[derive(Default)]
struct Scratch {
    cropper: Cropper,
    view: LikelihoodView,
}

/// A target and all that is known of it.
struct EtepfTarget {
    id: Arc<str>,
    params: EtepfParams,
    /// Its width and height at scale 1.
    size: [f64; 2],
    /// Where it is taken to be.
    place: Place,
    appearance: Appearance,
    particles: Particles<3>,
    motion: ParticleMotion,
    state: State,
    /// What is seen there.
    seen: Evidence,
    /// How much it stood out in the frame that it was learned in, the first (diff, eq 4).
    contrast: f64,
    age: u32,
    lost_for: u32,
    reacquired: bool,
}

impl Etepf {
    /// A tracker that waits for a mark.
    pub fn new(params: &Params) -> Self {
        Self {
            params: params.etepf.clone(),
            seed: params.general.seed.unsigned_abs(),
            scratch: Rooms::default(),
            targets: Targets::default(),
            made: Made::default(),
        }
    }
}

impl Tracker for Etepf {
    fn start(&mut self, id: &Arc<str>, frame: &Frame, rect: Rect, trace: &mut dyn Trace) {
        trace.event(Event::Stage(Stage::Learn));
        let followed = EtepfTarget::new(id.clone(), &self.params, self.seed, frame, self.scratch.own(), &rect);
        self.targets.add(followed);
    }

    fn stop(&mut self, id: &str) {
        self.targets.stop(id);
    }

    fn clear(&mut self) {
        self.targets = Targets::default();
    }

    fn catch_up(&mut self, id: &str, frame: &Frame, dt: f64, trace: &mut dyn Trace) {
        let Self { targets, scratch, .. } = self;
        targets.catch_up(id, trace, |target, trace| target.step(frame, scratch.own(), dt, trace));
    }

    fn step(&mut self, frame: &Frame, dt: f64, _: &mut NewId, trace: &mut dyn Trace) {
        let Self { params, scratch, targets, made, .. } = self;
        made.show(trace);
        targets.step(scratch, trace, |target, scratch, trace| target.step(frame, scratch, dt, trace));
        for target in targets.iter_mut().filter(|target| target.is_outdated(params)) {
            if target.state == State::Tracking {
                target.relearn(params, frame, scratch.own());
                trace.event(Event::MadeAnew(Need::Target));
            }
        }
    }

    fn report(&self, output: &mut Output) {
        self.targets.report(output);
    }

    fn retune(&mut self, params: &Params, _: Networks) {
        self.params = params.etepf.clone();
        for target in self.targets.iter_mut() {
            if target.retune(&self.params) {
                self.made.note(Need::Classifiers);
            }
        }
    }
}

impl targets::Followed for EtepfTarget {
    fn id(&self) -> &Arc<str> {
        &self.id
    }

    fn report(&self) -> Target {
        Target {
            id: self.id.clone(),
            rect: self.rect(&self.place),
            velocity: if self.state == State::Lost { [0.0; 2] } else { self.motion.velocity() },
            confidence: self.confidence() as f32,
            response: self.seen.target as f32,
            state: self.state,
            reacquired: self.reacquired,
            age: self.age,
            lost_for: self.lost_for,
        }
    }

    fn thresholds(&self) -> Option<Thresholds> {
        let EtepfModes { certain, lost, .. } = self.params.modes;
        Some(Thresholds { certain, lost, found: certain })
    }
}

impl EtepfTarget {
    fn new(id: Arc<str>, params: &EtepfParams, seed: u64, frame: &Frame, scratch: &mut Scratch, rect: &Rect) -> Self {
        let appearance = scratch.learn(frame, rect, params);
        let [u, v] = rect.centre();
        let place = Place::from([u, v, 1.0]);
        let seen = appearance.evidence(&scratch.view, rect);
        Self {
            id,
            size: rect.size(),
            place,
            seen,
            contrast: seen.contrast(),
            appearance,
            particles: Particles::new(params.particles.count as usize, place, seed),
            motion: ParticleMotion::new(),
            state: State::Tracking,
            age: 0,
            lost_for: 0,
            reacquired: false,
            params: params.clone(),
        }
    }

    /// Follows the target into the next frame.
    fn step(&mut self, frame: &Frame, scratch: &mut Scratch, dt: f64, trace: &mut dyn Trace) {
        self.age = self.age.saturating_add(1);
        trace.event(Event::Prediction(self.rect(&self.place)));

        trace.event(Event::Stage(Stage::Features));
        let noise = self.motion.noise(self.size, dt, &self.params.particles, &self.params.modes);
        let bounds = motion::bounds(frame, self.size, &self.place, &self.params.modes);
        self.particles.propagate(&noise, &bounds);
        self.look(frame, scratch, &noise);
        let view = &scratch.view;
        if !view.shows_anything(self.rect(&self.place).size()) {
            return self.wait(view, trace);
        }

        trace.event(Event::Stage(if self.state == State::Lost { Stage::Redetect } else { Stage::Localise }));
        self.guide(view, &noise, &bounds);
        self.weigh(view);
        let found = self.estimate(view);
        let was_lost = self.state == State::Lost;
        self.state = self.mode(&self.evidence(view, &found));
        self.reacquired = was_lost && self.state != State::Lost;
        self.show(view, trace);
        self.go_on(found, dt);
        self.seen = self.evidence(view, &self.place);

        if self.is_exemplary() {
            trace.event(Event::Stage(Stage::Learn));
            self.update(frame, scratch);
        }
    }

    /// Stays where it is while nothing at all is to be seen: a plain picture tells no place from another. It is not
    /// looked for farther away then, either.
    fn wait(&mut self, view: &LikelihoodView, trace: &mut dyn Trace) {
        // One half of the tracker alone has no FIND.
        let finds = self.params.particles.method == EtepfMethod::Full;
        (self.state, self.reacquired) = (if finds { State::Lost } else { State::Uncertain }, false);
        self.lost_for = if finds { self.lost_for.saturating_add(1) } else { 0 };
        self.show(view, trace);
        self.particles.gather(self.params.particles.count as usize, self.place);
        self.seen = self.evidence(view, &self.place);
    }

    /// Makes the likelihood image of wherever a particle may come to be (step 1).
    fn look(&self, frame: &Frame, scratch: &mut Scratch, noise: &Place) {
        let (mut low, mut high) = (self.place, self.place);
        for particle in self.particles.drawn() {
            low = low.inf(&particle.state);
            high = high.sup(&particle.state);
        }
        let outer = SURROUND * high[2];
        let reach = |axis: usize| 0.5 * outer * self.size[axis] + REACH * SPREAD * noise[axis];
        let (x, y) = (low[0] - reach(0), low[1] - reach(1));
        let area = Rect::new(x, y, high[0] + reach(0) - x, high[1] + reach(1) - y);
        let size = self.rect(&self.place).size();
        scratch.view.look(frame, &mut scratch.cropper, &area, size, &self.params.features);
        scratch.view.judge(self.appearance.ensemble());
    }

    /// Draws as many particles again, beside where mean shift leads those there are (step 2).
    fn guide(&mut self, view: &LikelihoodView, noise: &Place, bounds: &Bounds<3>) {
        if self.params.particles.method != EtepfMethod::Full {
            return;
        }
        let spread = noise * SPREAD;
        let size = self.size;
        self.particles.guide(noise, &spread, bounds, |place| climb(view, place, size, CLIMB));
    }

    /// Weighs the particles by what is seen (step 3).
    fn weigh(&mut self, view: &LikelihoodView) {
        let Self { particles, appearance, params, size, .. } = self;
        particles.weigh(|place| appearance.evidence(view, &rect(place, *size)).likelihood(&params.particles));
    }

    /// Where the target is taken to be (step 4): at the mean of the particles, or the peak that it is next to, for the
    /// mean of so few is off by pixels. Those that look for a lost target are far apart, and the mean of two places is
    /// neither; so of these it is the heaviest.
    fn estimate(&self, view: &LikelihoodView) -> Place {
        let settings = &self.params.particles;
        match settings.method {
            EtepfMethod::MeanShift => climb(view, &self.place, self.size, CLIMB),
            EtepfMethod::Particles => self.particles.mean(),
            EtepfMethod::Full if self.state == State::Lost => self.particles.heaviest().unwrap_or(self.place),
            EtepfMethod::Full => climb(view, &self.particles.mean(), self.size, settings.settle),
        }
    }

    /// TRACK or FIND, by what is seen where the target is taken to be. One half of the tracker alone has no FIND.
    fn mode(&self, seen: &Evidence) -> State {
        let modes = &self.params.modes;
        let certain = seen.target >= modes.certain;
        let contrast = self.relative_contrast(seen);
        let gone = seen.target < modes.lost || contrast < modes.lost_contrast || seen.likeness < modes.lost_similar;
        let back = certain && seen.likeness >= modes.similar && contrast >= modes.found_contrast;
        match (self.params.particles.method, self.state) {
            (EtepfMethod::Full, State::Lost) if !back => State::Lost,
            (EtepfMethod::Full, State::Tracking | State::Uncertain) if gone => State::Lost,
            _ if certain => State::Tracking,
            _ => State::Uncertain,
        }
    }

    /// How much a place stands out, in units of what the target did in the first frame.
    fn relative_contrast(&self, seen: &Evidence) -> f64 {
        seen.contrast() / self.contrast.max(LEAST_CONTRAST)
    }

    /// Goes on from where the target was found: the motion model learns, and the particles are resampled (step 5). A
    /// lost one stays where it was seen last; the particles spread from there, the farther the longer.
    fn go_on(&mut self, found: Place, dt: f64) {
        if self.state == State::Lost {
            self.lost_for = self.lost_for.saturating_add(1);
            self.motion.missed();
            self.particles.gather(self.params.particles.count as usize, self.place);
        } else {
            let step = [found[0] - self.place[0], found[1] - self.place[1]];
            if self.reacquired {
                self.motion.restart();
            } else {
                self.motion.moved(step, dt);
            }
            self.lost_for = 0;
            self.place = found;
            self.particles.resample(self.params.particles.count as usize);
        }
    }

    /// What the view shows of a place.
    fn evidence(&self, view: &LikelihoodView, place: &Place) -> Evidence {
        self.appearance.evidence(view, &self.rect(place))
    }

    /// Whether the ensemble is to learn from this frame.
    fn is_exemplary(&self) -> bool {
        let update = &self.params.update;
        update.enabled
            && self.state == State::Tracking
            && !self.reacquired
            && self.age.is_multiple_of(update.interval as u32)
            && self.relative_contrast(&self.seen) >= LEAST_LEARNED_CONTRAST
            && self.seen.likeness >= LEAST_LEARNED_LIKENESS
    }

    /// Updates the ensemble with the target as it is in this frame.
    fn update(&mut self, frame: &Frame, scratch: &mut Scratch) {
        let place = self.rect(&self.place);
        scratch.look_around(frame, &place, &self.params);
        self.appearance.update(&mut scratch.view, &place, &self.params);
    }

    /// Shows the likelihood image, the particles and the mode.
    fn show(&self, view: &LikelihoodView, trace: &mut dyn Trace) {
        view.show(trace);
        self.particles
            .drawn()
            .iter()
            .for_each(|p| trace.event(Event::Particle { rect: self.rect(&p.state), weight: p.weight }));
        trace.event(Event::Mode { name: if self.state == State::Lost { FIND } else { TRACK }, window: view.window() });
    }

    /// How sure the box is right. The share of boxes that overlap the target by more than one half is near this number:
    /// off by 0.07 on the average over 26 sequences, as `evaluate` has it.
    fn confidence(&self) -> f64 {
        self.relative_contrast(&self.seen).clamp(0.0, 1.0) * self.seen.likeness
    }

    /// Takes over parameters, and says whether the classifiers were trained anew; those that what is learned depends on
    /// wait until it can be learned again.
    fn retune(&mut self, params: &EtepfParams) -> bool {
        let old = std::mem::replace(&mut self.params, params.clone());
        self.params.keep(&old);
        let anew = params.differs(&old, Need::Classifiers);
        if anew {
            self.appearance.retrain(&self.params);
        }
        anew
    }

    /// Whether these parameters need another ensemble and other colours than there are.
    fn is_outdated(&self, params: &EtepfParams) -> bool {
        params.differs(&self.params, Need::Target)
    }

    /// Learns the target anew, as it is in this frame, by which it is measured from now on.
    fn relearn(&mut self, params: &EtepfParams, frame: &Frame, scratch: &mut Scratch) {
        self.params = params.clone();
        self.appearance = scratch.learn(frame, &self.rect(&self.place), params);
        self.seen = self.evidence(&scratch.view, &self.place);
        self.contrast = self.seen.contrast();
    }

    fn rect(&self, place: &Place) -> Rect {
        rect(place, self.size)
    }
}

impl Scratch {
    /// Looks at a target and its surroundings.
    fn look_around(&mut self, frame: &Frame, rect: &Rect, params: &EtepfParams) {
        let outer = rect.scaled(SURROUND);
        self.view.look(frame, &mut self.cropper, &outer, rect.size(), &params.features);
    }

    /// Learns the target in `rect`.
    fn learn(&mut self, frame: &Frame, rect: &Rect, params: &EtepfParams) -> Appearance {
        self.look_around(frame, rect, params);
        Appearance::new(&mut self.view, rect, params)
    }
}

/// The box of a state, of a target that has this size at scale 1.
fn rect(place: &Place, size: [f64; 2]) -> Rect {
    Rect::around([place[0], place[1]], size.map(|side| side * place[2]))
}

/// Where mean shift leads.
fn climb(view: &LikelihoodView, place: &Place, size: [f64; 2], steps: i64) -> Place {
    let [u, v] = view.climb(&rect(place, size), steps);
    Place::from([u, v, place[2]])
}
