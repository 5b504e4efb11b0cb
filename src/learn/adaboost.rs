//! AdaBoost over linear classifiers (Freund and Schapire, *Experiments with a new boosting algorithm*, 1996), as
//! ensemble tracking uses it (Avidan, *Ensemble tracking*, PAMI 2007, section 2.1; ETEPF, eq 5).
//!
//! A weak classifier is the sign of `a . x + b`: `a` is that of weighted least squares on labels of +1 and -1, and `b`
//! makes the least weighted error with it. (With the `b` of least squares, as in Avidan, later classifiers are no
//! better than chance, and there are but two or three.) Each is trained on weights that stress what those before it got
//! wrong; its vote `alpha` follows from its weighted error. `D` is the number of features.

use multiversion::multiversion;
use nalgebra::{DMatrix, DVector};

/// The most weak classifiers of an ensemble: the outcomes of all their votes are kept in a table.
pub const MAX_CLASSIFIERS: usize = 12;
/// Weight of the squared norm of `a` against the mean squared error: a feature that never varies, as in images without
/// colour, leaves no direction open.
const RIDGE: f64 = 1e-4;
/// A weighted error is kept this far from 0 and 1, so that a faultless classifier has a finite vote.
const LEAST_ERROR: f64 = 0.01;
/// A classifier whose weighted error is this close to one half tells nothing new.
const LEAST_EDGE: f64 = 1e-3;

/// Labelled examples of `D` features, each with a weight.
#[derive(Clone, Debug)]
pub struct Examples<const D: usize> {
    features: Vec<[f32; D]>,
    positive: Vec<bool>,
    weights: Vec<f64>,
}

impl<const D: usize> Default for Examples<D> {
    fn default() -> Self {
        Self { features: Vec::new(), positive: Vec::new(), weights: Vec::new() }
    }
}

impl<const D: usize> Examples<D> {
    /// Forgets all.
    pub fn clear(&mut self) {
        self.features.clear();
        self.positive.clear();
        self.weights.clear();
    }

    /// Adds one; only the ratios of weights count.
    pub fn push(&mut self, features: [f32; D], positive: bool, weight: f64) {
        self.features.push(features);
        self.positive.push(positive);
        self.weights.push(weight);
    }

    /// Adds all of another set, their weights multiplied by `share`.
    pub fn extend(&mut self, other: &Self, share: f64) {
        self.features.extend_from_slice(&other.features);
        self.positive.extend_from_slice(&other.positive);
        self.weights.extend(other.weights.iter().map(|w| w * share));
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.features.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.features.is_empty()
    }

    /// Makes the weights of each class sum to one half.
    pub fn balance(&mut self) {
        for class in [false, true] {
            let of_class = |&i: &usize| self.positive[i] == class;
            let sum: f64 = (0..self.len()).filter(of_class).map(|i| self.weights[i]).sum();
            if sum > 0.0 {
                for i in (0..self.len()).filter(|&i| self.positive[i] == class) {
                    self.weights[i] *= 0.5 / sum;
                }
            }
        }
    }
}

/// The sign of `a . x + b`, and the weight of its vote.
#[derive(Clone, Debug, PartialEq)]
pub struct Weak<const D: usize> {
    /// Coefficients.
    pub a: [f32; D],
    /// Constant.
    pub b: f32,
    /// Weight of the vote.
    pub alpha: f64,
}

impl<const D: usize> Weak<D> {
    /// Whether the example is taken for a positive one.
    pub fn is_positive(&self, x: &[f32; D]) -> bool {
        // In the order of `bits`, so that both give the same to the last bit.
        self.sum(x) > 0.0
    }

    fn sum(&self, x: &[f32; D]) -> f32 {
        self.a.iter().zip(x).fold(self.b, |sum, (a, x)| sum + a * x)
    }
}

/// Weak classifiers that vote.
#[derive(Clone, Debug, PartialEq)]
pub struct Ensemble<const D: usize> {
    weak: Vec<Weak<D>>,
    /// The likelihood (ETEPF eq 5) of each outcome of the votes: bit `k` of the index is set if classifier `k` says
    /// yes.
    likelihoods: Vec<f32>,
}

impl<const D: usize> Ensemble<D> {
    /// Trains at most `count` classifiers, fewer where one more would tell nothing. The weights of the examples are
    /// used up.
    pub fn train(examples: &mut Examples<D>, count: usize) -> Self {
        let mut weak = Vec::with_capacity(count);
        while weak.len() < count.min(MAX_CLASSIFIERS) && !examples.is_empty() {
            normalise(&mut examples.weights);
            let Some(next) = boost(examples) else { break };
            weak.push(next);
        }
        Self::new(weak)
    }

    /// An ensemble of these classifiers, at most [`MAX_CLASSIFIERS`].
    pub fn new(weak: Vec<Weak<D>>) -> Self {
        let outcome = |bits: usize| {
            let vote = |(k, w): (usize, &Weak<D>)| if bits >> k & 1 == 1 { w.alpha } else { -w.alpha };
            likelihood(weak.iter().enumerate().map(vote).sum())
        };
        Self { likelihoods: (0..1usize << weak.len()).map(outcome).collect(), weak }
    }

    /// The classifiers, in the order of their training.
    pub fn classifiers(&self) -> &[Weak<D>] {
        &self.weak
    }

    /// The weighted sum of the votes: `G` of eq 5.
    pub fn margin(&self, x: &[f32; D]) -> f64 {
        self.weak.iter().map(|w| if w.is_positive(x) { w.alpha } else { -w.alpha }).sum()
    }

    /// The likelihoods of many examples, whose features are planes: feature after feature, each as long as `out`.
    /// `scratch` is reused from call to call.
    pub fn likelihoods(&self, planes: &[f32], scratch: &mut Votes, out: &mut [f32]) {
        let count = out.len();
        scratch.sums.resize(count, 0.0);
        scratch.bits.clear();
        scratch.bits.resize(count, 0);
        for (k, weak) in self.weak.iter().enumerate() {
            vote(&weak.a, weak.b, planes, 1 << k, &mut scratch.sums, &mut scratch.bits);
        }
        out.iter_mut().zip(&scratch.bits).for_each(|(l, bits)| *l = self.likelihoods[usize::from(*bits)]);
    }
}

/// Scratch of [`Ensemble::likelihoods`].
#[derive(Clone, Debug, Default)]
pub struct Votes {
    sums: Vec<f32>,
    bits: Vec<u16>,
}

/// The likelihood that something of this margin is the object (eq 5): `1 / (1 + exp(-2 G))`.
pub fn likelihood(margin: f64) -> f32 {
    (1.0 / (1.0 + (-2.0 * margin).exp())) as f32
}

/// Sets `bit` where the classifier says yes.
#[multiversion(targets("x86_64+avx2+fma"))]
fn vote(a: &[f32], b: f32, planes: &[f32], bit: u16, sums: &mut [f32], bits: &mut [u16]) {
    sums.fill(b);
    for (a, plane) in a.iter().zip(planes.chunks_exact(sums.len())) {
        sums.iter_mut().zip(plane).for_each(|(s, x)| *s += a * x);
    }
    bits.iter_mut().zip(&*sums).for_each(|(bits, sum)| *bits |= if *sum > 0.0 { bit } else { 0 });
}

/// One round: a weak classifier, and the weights for the next. `None` where none is better than chance.
fn boost<const D: usize>(examples: &mut Examples<D>) -> Option<Weak<D>> {
    let (a, _) = least_squares(examples)?;
    let mut weak = Weak { a, b: 0.0, alpha: 0.0 };
    let (b, error) = threshold(&weak, examples);
    if error > 0.5 - LEAST_EDGE {
        return None;
    }
    let error = error.max(LEAST_ERROR);
    weak.b = b;
    weak.alpha = 0.5 * ((1.0 - error) / error).ln();
    for ((x, &positive), weight) in examples.features.iter().zip(&examples.positive).zip(&mut examples.weights) {
        let right = weak.is_positive(x) == positive;
        *weight *= (if right { -weak.alpha } else { weak.alpha }).exp();
    }
    Some(weak)
}

/// The constant `b` that makes the least weighted error with the classifier's `a`, and that error.
fn threshold<const D: usize>(weak: &Weak<D>, examples: &Examples<D>) -> (f32, f64) {
    let mut order: Vec<(f32, usize)> = examples.features.iter().enumerate().map(|(i, x)| (weak.sum(x), i)).collect();
    order.sort_unstable_by(|p, q| p.0.total_cmp(&q.0).then(p.1.cmp(&q.1)));
    // All are taken for positive at first; then, from the lowest sum, one after the other for negative.
    let mut error: f64 = (0..examples.len()).filter(|&i| !examples.positive[i]).map(|i| examples.weights[i]).sum();
    let mut best = (f32::MAX, error);
    for (k, &(sum, i)) in order.iter().enumerate() {
        error += if examples.positive[i] { examples.weights[i] } else { -examples.weights[i] };
        let next = order.get(k + 1).map_or(f32::MAX, |n| n.0);
        if next > sum && error < best.1 {
            // Above the last one, nothing is positive.
            let between = if next == f32::MAX { f32::MAX } else { 0.5 * (sum + next) };
            best = (-between, error);
        }
    }
    best
}

/// `a` and `b` that minimise the weighted mean of `(a . x + b - y)^2` with a ridge on `a`; `None` where no numbers do,
/// as with features that are not finite.
fn least_squares<const D: usize>(examples: &Examples<D>) -> Option<([f32; D], f32)> {
    let n = D + 1;
    let mut normal = DMatrix::<f64>::zeros(n, n);
    let mut right = DVector::<f64>::zeros(n);
    let mut x = vec![1.0; n];
    for ((features, &positive), &weight) in examples.features.iter().zip(&examples.positive).zip(&examples.weights) {
        x.iter_mut().zip(features).for_each(|(x, f)| *x = f64::from(*f));
        let y = if positive { 1.0 } else { -1.0 };
        for (i, xi) in x.iter().enumerate() {
            let scaled = weight * xi;
            right[i] += scaled * y;
            // The lower triangle is all that is read.
            normal.as_mut_slice()[i * n + i..(i + 1) * n].iter_mut().zip(&x[i..]).for_each(|(m, xj)| *m += scaled * xj);
        }
    }
    (0..D).for_each(|i| normal[(i, i)] += RIDGE);
    let solution = normal.cholesky()?.solve(&right);
    let finite = solution.iter().all(|v| v.is_finite());
    finite.then(|| (std::array::from_fn(|i| solution[i] as f32), solution[D] as f32))
}

fn normalise(weights: &mut [f64]) {
    let sum: f64 = weights.iter().sum();
    weights.iter_mut().for_each(|w| *w /= sum);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn examples<const D: usize>(all: &[([f32; D], bool)]) -> Examples<D> {
        let mut examples = Examples::default();
        all.iter().for_each(|&(x, positive)| examples.push(x, positive, 1.0));
        examples
    }

    /// Six points on a line, of which no threshold gets more than five right, worked out by hand.
    #[test]
    fn the_first_round_on_a_set_made_by_hand_is_as_computed_by_hand() {
        let set = [(-3.0, false), (-2.0, false), (-1.0, true), (1.0, false), (2.0, true), (3.0, true)];
        let mut all = examples(&set.map(|(x, y)| ([x], y)));
        normalise(&mut all.weights);
        let first = boost(&mut all).unwrap();
        // Both means are 0, so a = E[xy] / (E[x^2] + ridge) = (8 / 6) / (28 / 6).
        assert!((first.a[0] - 8.0 / 28.0).abs() < 1e-5, "{first:?}");
        // The lowest of the best thresholds is half way between -2 and -1; it is wrong at 1 only.
        assert!((first.b / first.a[0] - 1.5).abs() < 1e-6, "{first:?}");
        assert!((first.alpha - 0.5 * 5f64.ln()).abs() < 1e-12);
        // What was wrong now weighs half of all.
        normalise(&mut all.weights);
        assert!(all.weights.iter().zip([0.1, 0.1, 0.1, 0.5, 0.1, 0.1]).all(|(w, v)| (w - v).abs() < 1e-12));
    }

    /// Textbook AdaBoost, with dense matrices, all thresholds tried one by one, and a fresh pass over the examples for
    /// everything.
    #[test]
    fn training_agrees_with_the_textbook() {
        let set: Vec<([f32; 3], bool)> = (0..60)
            .map(|i| {
                let (u, v) = ((i * 37 % 60) as f32 / 60.0, (i * 23 % 53) as f32 / 53.0);
                ([u, v, u * v], (u - 0.5).hypot(v - 0.5) < 0.35)
            })
            .collect();
        let ensemble = Ensemble::train(&mut examples(&set), 5);
        assert_eq!(ensemble.classifiers().len(), 5);
        let mut weights = vec![1.0 / 60.0; 60];
        for weak in ensemble.classifiers() {
            let a = DMatrix::from_fn(60, 4, |i, j| if j < 3 { f64::from(set[i].0[j]) } else { 1.0 });
            let w = DMatrix::from_diagonal(&DVector::from_vec(weights.clone()));
            let y = DVector::from_fn(60, |i, _| if set[i].1 { 1.0 } else { -1.0 });
            let ridge = DMatrix::from_diagonal(&DVector::from_vec(vec![RIDGE, RIDGE, RIDGE, 0.0]));
            let solution = (a.transpose() * &w * &a + ridge).lu().solve(&(a.transpose() * &w * &y)).unwrap();
            (0..3).for_each(|i| assert!((f64::from(weak.a[i]) - solution[i]).abs() < 1e-4, "{weak:?} {solution}"));
            let sum = |i: usize| (0..3).map(|j| a[(i, j)] * f64::from(weak.a[j])).sum::<f64>();
            let says = |b: f64, i: usize| if sum(i) + b > 0.0 { 1.0 } else { -1.0 };
            let error = |b: f64| -> f64 { (0..60).filter(|&i| says(b, i) != y[i]).map(|i| weights[i]).sum() };
            let least = (-4000..4000).map(|k| error(f64::from(k) / 1000.0)).fold(1.0, f64::min);
            let b = f64::from(weak.b);
            assert!((error(b) - least).abs() < 1e-9, "{} with b = {b}, the least is {least}", error(b));
            assert!((weak.alpha - 0.5 * ((1.0 - least) / least).ln()).abs() < 1e-9);
            weights.iter_mut().enumerate().for_each(|(i, w)| *w *= (-weak.alpha * y[i] * says(b, i)).exp());
            normalise(&mut weights);
        }
        let right = |e: &Ensemble<3>| set.iter().filter(|(x, y)| (e.margin(x) > 0.0) == *y).count();
        let alone = Ensemble::new(ensemble.classifiers()[..1].to_vec());
        assert!(right(&ensemble) > right(&alone), "{} {}", right(&ensemble), right(&alone));
    }

    #[test]
    fn likelihoods_of_planes_are_those_of_the_margins() {
        let weak = |a, b, alpha| Weak { a, b, alpha };
        let ensemble = Ensemble::new(vec![weak([1.0, -2.0], 0.1, 0.7), weak([-0.3, 0.4], 0.0, 0.4)]);
        let points: Vec<[f32; 2]> = (0..40).map(|i| [(i * 7 % 11) as f32 - 5.0, (i * 5 % 13) as f32 - 6.0]).collect();
        let planes: Vec<f32> = (0..2).flat_map(|c| points.iter().map(move |p| p[c])).collect();
        let mut out = vec![0.0; points.len()];
        ensemble.likelihoods(&planes, &mut Votes::default(), &mut out);
        for (point, got) in points.iter().zip(&out) {
            let want = 1.0 / (1.0 + (-2.0 * ensemble.margin(point)).exp());
            assert!((f64::from(*got) - want).abs() < 1e-6, "{point:?}: {got} {want}");
        }
        assert!(out.iter().any(|l| *l > 0.5) && out.iter().any(|l| *l < 0.5));
    }

    #[test]
    fn what_cannot_be_told_apart_has_no_votes() {
        let same: Vec<([f32; 2], bool)> = (0..10).map(|i| ([0.5, 0.5], i % 2 == 0)).collect();
        let ensemble = Ensemble::train(&mut examples(&same), 5);
        assert_eq!((ensemble.classifiers().len(), ensemble.margin(&[0.5, 0.5])), (0, 0.0));
        assert_eq!(Ensemble::<2>::train(&mut Examples::default(), 5).likelihoods, [0.5]);
        let apart = examples(&[([0.0, 0.0], false), ([1.0, 1.0], true)]);
        let alpha = Ensemble::train(&mut apart.clone(), 1).classifiers()[0].alpha;
        assert!(alpha.is_finite() && alpha > 2.0);
    }

    #[test]
    fn balancing_gives_both_classes_half_of_the_weight() {
        let mut all = examples(&[([0.0], false), ([1.0], true), ([2.0], true), ([3.0], true)]);
        all.balance();
        assert!(all.weights.iter().zip([0.5, 1.0 / 6.0, 1.0 / 6.0, 1.0 / 6.0]).all(|(w, v)| (w - v).abs() < 1e-12));
    }
}
