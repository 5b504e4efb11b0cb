//! What moves: an adaptive mixture of Gaussians for each pixel's colour (KaewTraKulPong and Bowden, *An improved
//! adaptive background mixture model for real-time tracking with shadow detection*, 2002; after Stauffer and Grimson,
//! CVPR 1999).
//!
//! A pixel's colour is explained by K Gaussians, each with a weight, a mean colour and one variance for all planes. A
//! colour belongs to the first Gaussian that it fits, in the order of weight over deviation, and that one learns it; a
//! colour that fits none takes the place of the last. The first Gaussians whose weights together exceed a share T are
//! the background. What belongs to another one is foreground, unless it is a background darkened by a shadow.
//!
//! Learning is one rule. With `a = 1 / min(n, L)` in frame `n`, the weight of the Gaussian that the colour belongs to
//! goes up by `a (1 - w)`, the others' go down by `a w`, and the mean and the variance learn at the rate `a / w`. In
//! the first L frames that rate is one over the number of colours which the Gaussian has had: the expected sufficient
//! statistics. Afterwards it is the paper's L-recent window.
//!
//! Distances are root mean squares over the planes, so that grey is measured as a colour of three equal planes.
//!
//! Pixels are worked on sixteen at a time without branches, or else this would take most of a frame's time.

use multiversion::multiversion;

use crate::crop::Patch;

/// Pixels of a block.
const LANES: usize = 16;
/// The most Gaussians a pixel may have.
pub const MAX_GAUSSIANS: usize = 5;
const PLANES: usize = 3;

/// A number for each pixel of a block.
type Lanes = [f32; LANES];

/// How the background is learned and told from the rest.
#[derive(Clone, Debug, PartialEq)]
pub struct BackgroundSettings {
    /// Gaussians of a pixel, K: 2 to [`MAX_GAUSSIANS`].
    pub gaussians: usize,
    /// Frames that count, L: what stands still for about `L (1 - T)` frames becomes background.
    pub window: usize,
    /// The share of time that the background is seen, T: 0 to 1.
    pub share: f64,
    /// Within so many standard deviations a colour fits a Gaussian.
    pub deviations: f64,
    /// Standard deviation of a new Gaussian, in intensities.
    pub initial_deviation: f64,
    /// The least standard deviation, in intensities: the camera's noise.
    pub least_deviation: f64,
    /// A shadow leaves at least this share of the background's brightness, 0 to 1; 1 looks for none. Pictures without
    /// colour never have any: there, only its colour could tell a shadow from something dark.
    pub shadow: f64,
}

/// K, L, the share and the deviations are the paper's and its usual implementations'; those in intensities suit 8-bit
/// video.
impl Default for BackgroundSettings {
    fn default() -> Self {
        Self {
            gaussians: 4,
            window: 200,
            share: 0.7,
            deviations: 2.5,
            initial_deviation: 15.0,
            least_deviation: 4.0,
            shadow: 0.6,
        }
    }
}

/// One Gaussian of each pixel of a block.
#[derive(Clone, Copy, Debug)]
struct Gaussian {
    weight: Lanes,
    mean: [Lanes; PLANES],
    /// One over the variance.
    precision: Lanes,
}

impl Gaussian {
    /// One that has never been seen.
    const NONE: Self = Self { weight: [0.0; LANES], mean: [[0.0; LANES]; PLANES], precision: [1.0; LANES] };
}

/// The numbers of a frame that are the same for all pixels.
#[derive(Clone, Copy, Debug)]
struct Rule {
    /// `a` of the header.
    rate: f32,
    share: f32,
    /// Squared, as the next two.
    deviations: f32,
    initial: f32,
    least: f32,
    shadow: f32,
}

/// The model of a stream's background.
#[derive(Clone, Debug)]
pub struct Background {
    settings: BackgroundSettings,
    /// Width, height and planes of the patches learned from.
    shape: [usize; 3],
    frames: usize,
    /// `blocks x gaussians`; the pixels of a block follow each other, row-major.
    model: Vec<Gaussian>,
}

impl Background {
    /// A model that has seen nothing.
    ///
    /// # Panics
    /// If the number of Gaussians is none of 2 to [`MAX_GAUSSIANS`] or the window is empty.
    pub fn new(settings: BackgroundSettings) -> Self {
        assert!((2..=MAX_GAUSSIANS).contains(&settings.gaussians), "{} Gaussians", settings.gaussians);
        assert!(settings.window > 0, "an empty window");
        Self { settings, shape: [0; 3], frames: 0, model: Vec::new() }
    }

    /// The settings.
    pub fn settings(&self) -> &BackgroundSettings {
        &self.settings
    }

    /// Frames learned from so far.
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// Forgets all frames.
    pub fn clear(&mut self) {
        self.shape = [0; 3];
        self.frames = 0;
    }

    /// Learns from a patch and fills `mask`, row-major `height x width`: 1 where it shows moving foreground, 0
    /// elsewhere, shadows included. A patch of another shape than the last begins anew.
    pub fn apply(&mut self, patch: &Patch, mask: &mut Vec<u8>) {
        let planes = patch.planes();
        let shape = [patch.width, patch.height, planes.len()];
        let pixels = patch.width * patch.height;
        if shape != self.shape {
            self.shape = shape;
            self.frames = 0;
            self.model.clear();
            self.model.resize(pixels.div_ceil(LANES) * self.settings.gaussians, Gaussian::NONE);
        }
        self.frames += 1;
        mask.resize(pixels, 0);
        let rule = self.rule(planes.len());
        let planes: [&[u8]; PLANES] = std::array::from_fn(|i| planes[i.min(planes.len() - 1)].as_slice());
        match self.settings.gaussians {
            2 => learn::<2>(&mut self.model, planes, &rule, mask),
            3 => learn::<3>(&mut self.model, planes, &rule, mask),
            4 => learn::<4>(&mut self.model, planes, &rule, mask),
            _ => learn::<MAX_GAUSSIANS>(&mut self.model, planes, &rule, mask),
        }
    }

    /// Moves all that was learned by whole pixels, to the right and down: for a window that moves over the scene.
    /// Pixels that come in know nothing, and take what they show first for background.
    pub fn shift(&mut self, right: i64, down: i64) {
        let [width, height, _] = self.shape.map(|n| n as i64);
        let pixels = width * height;
        // Backwards where they move forwards, so that none is written before it is read.
        let forwards = down * width + right > 0;
        for i in 0..pixels {
            let to = if forwards { pixels - 1 - i } else { i };
            let (x, y) = (to % width - right, to / width - down);
            let from = ((0..width).contains(&x) && (0..height).contains(&y)).then(|| (y * width + x) as usize);
            self.copy(from, to as usize);
        }
    }

    /// Gives a pixel what another one, or none, knows.
    fn copy(&mut self, from: Option<usize>, to: usize) {
        let gaussians = self.settings.gaussians;
        let lane = to % LANES;
        for k in 0..gaussians {
            let (source, other) = match from {
                Some(from) => (self.model[from / LANES * gaussians + k], from % LANES),
                None => (Gaussian::NONE, 0),
            };
            let target = &mut self.model[to / LANES * gaussians + k];
            target.weight[lane] = source.weight[other];
            target.precision[lane] = source.precision[other];
            for (mean, from) in target.mean.iter_mut().zip(&source.mean) {
                mean[lane] = from[other];
            }
        }
    }

    fn rule(&self, planes: usize) -> Rule {
        let square = |value: f64| (value * value) as f32;
        let settings = &self.settings;
        Rule {
            rate: 1.0 / self.frames.min(settings.window) as f32,
            share: settings.share as f32,
            deviations: square(settings.deviations),
            initial: square(settings.initial_deviation),
            least: square(settings.least_deviation),
            shadow: if planes == PLANES { settings.shadow as f32 } else { 1.0 },
        }
    }
}

/// Learns from all pixels, block after block.
#[multiversion(targets("x86_64+avx2+fma"))]
fn learn<const K: usize>(model: &mut [Gaussian], planes: [&[u8]; PLANES], rule: &Rule, mask: &mut [u8]) {
    let (blocks, _) = model.as_chunks_mut::<K>();
    let (whole, rest) = mask.as_chunks_mut::<LANES>();
    let from = planes.map(|plane| plane.as_chunks::<LANES>());
    for (i, (gaussians, mask)) in blocks.iter_mut().zip(&mut *whole).enumerate() {
        *mask = block(gaussians, from.map(|(whole, _)| &whole[i]), rule);
    }
    if !rest.is_empty() {
        // What the last block lacks is black.
        let mut padded = [[0; LANES]; PLANES];
        padded.iter_mut().zip(from).for_each(|(block, (_, rest))| block[..rest.len()].copy_from_slice(rest));
        let moving = block(&mut blocks[whole.len()], padded.each_ref(), rule);
        rest.copy_from_slice(&moving[..rest.len()]);
    }
}

/// Learns the colours of a block. Returns 1 where they are foreground, 0 elsewhere.
#[inline(always)]
fn block<const K: usize>(gaussians: &mut [Gaussian; K], planes: [&[u8; LANES]; PLANES], rule: &Rule) -> [u8; LANES] {
    let mut colour = [[0.0; LANES]; PLANES];
    for (colour, plane) in colour.iter_mut().zip(planes) {
        for i in 0..LANES {
            colour[i] = f32::from(plane[i]);
        }
    }
    let colour = &colour;
    let owner = belongs(gaussians, colour, rule);
    update(gaussians, &owner, colour, rule);
    normalise(gaussians);
    let background = background(gaussians, rule.share);
    let mut moving = [1.0; LANES];
    for (owns, background) in owner.owns.iter().zip(&background) {
        for i in 0..LANES {
            moving[i] -= owns[i] * background[i];
        }
    }
    if rule.shadow < 1.0 && moving.iter().sum::<f32>() > 0.0 {
        for (gaussian, background) in gaussians.iter().zip(&background) {
            let shadowed = shadowed(gaussian, colour, rule);
            for i in 0..LANES {
                moving[i] *= 1.0 - background[i] * shadowed[i];
            }
        }
    }
    let mut mask = [0; LANES];
    for i in 0..LANES {
        mask[i] = u8::from(moving[i] != 0.0);
    }
    mask
}

/// The square of what Gaussians are ordered by, weight over deviation.
#[inline(always)]
fn scores(gaussian: &Gaussian) -> Lanes {
    let mut scores = gaussian.weight;
    for (score, (weight, precision)) in scores.iter_mut().zip(gaussian.weight.iter().zip(&gaussian.precision)) {
        *score *= weight * precision;
    }
    scores
}

/// The mean squares, over the planes, of the distances of colours from a mean.
#[inline(always)]
fn distances(mean: &[Lanes; PLANES], colour: &[Lanes; PLANES]) -> Lanes {
    let mut sum = [0.0; LANES];
    for (mean, colour) in mean.iter().zip(colour) {
        for i in 0..LANES {
            let difference = colour[i] - mean[i];
            sum[i] += difference * difference;
        }
    }
    for value in &mut sum {
        *value *= 1.0 / PLANES as f32;
    }
    sum
}

/// The Gaussian that each colour of a block belongs to.
struct Owner<const K: usize> {
    /// 1 for that Gaussian, 0 for the others.
    owns: [Lanes; K],
    /// 1 where the colour fits none and takes that Gaussian's place, 0 elsewhere.
    new: Lanes,
    /// Of all Gaussians.
    distances: [Lanes; K],
}

/// The first Gaussian, by score, that the colour fits; the last of all where it fits none.
#[inline(always)]
fn belongs<const K: usize>(gaussians: &[Gaussian; K], colour: &[Lanes; PLANES], rule: &Rule) -> Owner<K> {
    let mut owner = Owner { owns: [[0.0; LANES]; K], new: [0.0; LANES], distances: [[0.0; LANES]; K] };
    let (mut index, mut best, mut least) = ([0.0; LANES], [0.0; LANES], [f32::INFINITY; LANES]);
    for (k, gaussian) in gaussians.iter().enumerate() {
        let (scores, distances) = (scores(gaussian), distances(&gaussian.mean, colour));
        for i in 0..LANES {
            let fits = distances[i] * gaussian.precision[i] <= rule.deviations;
            let score = select(fits, scores[i], 0.0);
            let last = (best[i] <= 0.0) & (scores[i] < least[i]);
            index[i] = select((score > best[i]) | last, k as f32, index[i]);
            best[i] = select(score > best[i], score, best[i]);
            least[i] = select(scores[i] < least[i], scores[i], least[i]);
        }
        owner.distances[k] = distances;
    }
    for (k, owns) in owner.owns.iter_mut().enumerate() {
        for i in 0..LANES {
            owns[i] = select(index[i] == k as f32, 1.0, 0.0);
        }
    }
    for (new, best) in owner.new.iter_mut().zip(best) {
        *new = select(best > 0.0, 0.0, 1.0);
    }
    owner
}

/// The rule of the header. What its owner learns is worked out once a pixel, as divisions take long.
#[inline(always)]
fn update<const K: usize>(gaussians: &mut [Gaussian; K], owner: &Owner<K>, colour: &[Lanes; PLANES], rule: &Rule) {
    let keep = 1.0 - rule.rate;
    let (mut weights, mut precisions, mut distances) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
    for ((gaussian, owns), of) in gaussians.iter().zip(&owner.owns).zip(&owner.distances) {
        for i in 0..LANES {
            weights[i] += owns[i] * gaussian.weight[i];
            precisions[i] += owns[i] * gaussian.precision[i];
            distances[i] += owns[i] * of[i];
        }
    }
    let mut speeds = [0.0; LANES];
    for i in 0..LANES {
        // A new one has no weight from before: its mean learns at rate 1.
        weights[i] = (1.0 - owner.new[i]) * keep * weights[i] + rule.rate;
        speeds[i] = rule.rate / weights[i];
        let variance = 1.0 / precisions[i];
        let learned = variance + speeds[i] * (distances[i] - variance);
        let learned = select(learned > rule.least, learned, rule.least);
        precisions[i] = 1.0 / select(owner.new[i] > 0.0, rule.initial, learned);
    }
    for (gaussian, owns) in gaussians.iter_mut().zip(&owner.owns) {
        for i in 0..LANES {
            let other = 1.0 - owns[i];
            gaussian.weight[i] = other * keep * gaussian.weight[i] + owns[i] * weights[i];
            gaussian.precision[i] = other * gaussian.precision[i] + owns[i] * precisions[i];
        }
        for (mean, colour) in gaussian.mean.iter_mut().zip(colour) {
            for i in 0..LANES {
                mean[i] += owns[i] * speeds[i] * (colour[i] - mean[i]);
            }
        }
    }
}

/// Makes the weights of each pixel add up to 1: those of a Gaussian whose place was taken are gone.
#[inline(always)]
fn normalise<const K: usize>(gaussians: &mut [Gaussian; K]) {
    let mut sum = [0.0; LANES];
    for gaussian in gaussians.iter() {
        for (sum, weight) in sum.iter_mut().zip(&gaussian.weight) {
            *sum += weight;
        }
    }
    for value in &mut sum {
        *value = 1.0 / *value;
    }
    for gaussian in gaussians {
        for (weight, scale) in gaussian.weight.iter_mut().zip(&sum) {
            *weight *= scale;
        }
    }
}

/// 1 for the Gaussians that are background: those before them, by score, have no more than the share of the weight.
#[inline(always)]
fn background<const K: usize>(gaussians: &[Gaussian; K], share: f32) -> [Lanes; K] {
    let (mut all, mut background) = ([[0.0; LANES]; K], [[0.0; LANES]; K]);
    for (scores_of, gaussian) in all.iter_mut().zip(gaussians) {
        *scores_of = scores(gaussian);
    }
    for (k, (scores, background)) in all.iter().zip(&mut background).enumerate() {
        for (j, gaussian) in gaussians.iter().enumerate() {
            for i in 0..LANES {
                let first = (all[j][i] > scores[i]) | ((all[j][i] == scores[i]) & (j < k));
                background[i] += select(first, gaussian.weight[i], 0.0);
            }
        }
        for before in background {
            *before = select(*before <= share, 1.0, 0.0);
        }
    }
    background
}

/// 1 where the colours are the mean's, only darker: `a` times the mean comes closest to the colour, `a` lies between
/// the least brightness of a shadow and 1, and what remains, the distortion of the colour, fits the Gaussian.
#[inline(always)]
fn shadowed(gaussian: &Gaussian, colour: &[Lanes; PLANES], rule: &Rule) -> Lanes {
    let (mut along, mut length) = ([0.0; LANES], [0.0; LANES]);
    for (mean, colour) in gaussian.mean.iter().zip(colour) {
        for i in 0..LANES {
            along[i] += mean[i] * colour[i];
            length[i] += mean[i] * mean[i];
        }
    }
    let (mut darker, mut shadowed) = (gaussian.mean, [0.0; LANES]);
    for i in 0..LANES {
        along[i] /= length[i].max(1.0);
    }
    for mean in &mut darker {
        for i in 0..LANES {
            mean[i] *= along[i];
        }
    }
    let distortion = distances(&darker, colour);
    for i in 0..LANES {
        let fits = distortion[i] * gaussian.precision[i] <= rule.deviations;
        shadowed[i] = select(fits & (along[i] > rule.shadow) & (along[i] < 1.0), 1.0, 0.0);
    }
    shadowed
}

/// One of two values. Both are there before it is known which, so that no lane takes a branch.
#[inline(always)]
fn select(condition: bool, yes: f32, no: f32) -> f32 {
    if condition { yes } else { no }
}

#[cfg(test)]
mod tests;
