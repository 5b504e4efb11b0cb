//! A particle filter whose proposals may be guided by what is seen (ETEPF, steps 2 to 5 of its algorithm; the
//! importance weights are those of Isard and Blake, *ICONDENSATION*, ECCV 1998).
//!
//! `n` particles of equal weight stand for what is known. A frame goes through
//!
//! 1. [`propagate`](Particles::propagate): each is moved by Gaussian noise, `x^ ~ N(x, C^2)`, the motion model (eq 6),
//!    reflected at the bounds of what a state may be;
//! 2. [`guide`](Particles::guide): each of these is led to a better place, `x~`, and `x- ~ N(x~, S^2)` is drawn beside
//!    it: 2n particles. Its weight `p(x- | x) / q(x- | x~)` makes up for having been led (eq 2);
//! 3. [`weigh`](Particles::weigh): by the likelihood of what is seen;
//! 4. [`mean`](Particles::mean);
//! 5. [`resample`](Particles::resample), or [`gather`](Particles::gather) where what was seen tells nothing.
//!
//! Noise is independent in each of the `N` quantities of a state. `p` and `q` are the densities of reflected steps, so
//! that the guided half has the right weights on the average over `x-`, whatever led it, and the posterior stays
//! unbiased up to the bounds.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::Vector;
use super::bounds::Bounds;

/// A state and its share of the posterior.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Particle<const N: usize> {
    /// The state.
    pub state: Vector<N>,
    /// The weight; once weighed, all sum to 1.
    pub weight: f64,
}

/// The particles, their random choices, and scratch.
#[derive(Clone, Debug)]
pub struct Particles<const N: usize> {
    rng: ChaCha8Rng,
    /// Of equal weight: `x`, of the frame before.
    known: Vec<Vector<N>>,
    /// Of this frame: the propagated, `x^`, and then the guided, `x-`, both in the order of `known`.
    drawn: Vec<Particle<N>>,
}

impl<const N: usize> Particles<N> {
    /// `count` particles, all in one state. Random choices follow from `seed`.
    pub fn new(count: usize, state: Vector<N>, seed: u64) -> Self {
        let mut new = Self {
            rng: ChaCha8Rng::seed_from_u64(seed),
            known: Vec::with_capacity(count),
            drawn: Vec::with_capacity(2 * count),
        };
        new.gather(count, state);
        new
    }

    /// Puts `count` particles into one state.
    pub fn gather(&mut self, count: usize, state: Vector<N>) {
        self.known.clear();
        self.known.resize(count, state);
        self.drawn.clear();
    }

    /// The particles of this frame.
    pub fn drawn(&self) -> &[Particle<N>] {
        &self.drawn
    }

    /// Moves each particle by Gaussian noise of these standard deviations, reflected at the bounds. One that is outside
    /// of them starts at the nearest state within.
    pub fn propagate(&mut self, noise: &Vector<N>, bounds: &Bounds<N>) {
        self.drawn.clear();
        for known in &mut self.known {
            *known = bounds.nearest(known);
            let state = bounds.reflected(&sample(&mut self.rng, known, noise));
            self.drawn.push(Particle { state, weight: 1.0 });
        }
    }

    /// Draws another particle beside each propagated one: by Gaussian noise of the standard deviations `spread` around
    /// where `lead` takes it, reflected likewise. `noise` and `bounds` are those of [`propagate`](Self::propagate).
    /// None of the deviations is 0.
    pub fn guide(
        &mut self,
        noise: &Vector<N>,
        spread: &Vector<N>,
        bounds: &Bounds<N>,
        mut lead: impl FnMut(&Vector<N>) -> Vector<N>,
    ) {
        for (i, known) in self.known.iter().enumerate() {
            let led = bounds.nearest(&lead(&self.drawn[i].state));
            let state = bounds.reflected(&sample(&mut self.rng, &led, spread));
            let ratio = bounds.log_density(&state, known, noise) - bounds.log_density(&state, &led, spread);
            self.drawn.push(Particle { state, weight: ratio.exp() });
        }
    }

    /// Multiplies the weights by the likelihood of each state and makes them sum to 1. Where nothing is likely, all
    /// weigh the same. Gives the sum before: the mean likelihood times the number of particles.
    pub fn weigh(&mut self, mut likelihood: impl FnMut(&Vector<N>) -> f64) -> f64 {
        self.drawn.iter_mut().for_each(|particle| particle.weight *= likelihood(&particle.state));
        let sum: f64 = self.drawn.iter().map(|p| p.weight).sum();
        let even = 1.0 / self.drawn.len() as f64;
        for particle in &mut self.drawn {
            particle.weight = if sum > 0.0 && sum.is_finite() { particle.weight / sum } else { even };
        }
        sum
    }

    /// The mean of the posterior.
    pub fn mean(&self) -> Vector<N> {
        self.drawn.iter().map(|p| p.state * p.weight).sum()
    }

    /// The heaviest, once they are weighed; `None` before any is drawn.
    pub fn heaviest(&self) -> Option<Vector<N>> {
        self.drawn.iter().max_by(|a, b| a.weight.total_cmp(&b.weight)).map(|p| p.state)
    }

    /// Goes on with `count` particles of equal weight, each drawn as often as it weighs: systematic resampling.
    pub fn resample(&mut self, count: usize) {
        let step = 1.0 / count as f64;
        let mut at = self.rng.random::<f64>() * step;
        let mut end = 0.0;
        self.known.clear();
        for (i, particle) in self.drawn.iter().enumerate() {
            end += particle.weight;
            let is_last = i + 1 == self.drawn.len();
            while self.known.len() < count && (at < end || is_last) {
                self.known.push(particle.state);
                at += step;
            }
        }
    }
}

/// A draw from `N(mean, deviations^2)`.
fn sample<const N: usize>(rng: &mut ChaCha8Rng, mean: &Vector<N>, deviations: &Vector<N>) -> Vector<N> {
    let noise = Vector::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
    mean + deviations.component_mul(&noise)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// No bounds that any draw here would meet.
    fn anywhere<const N: usize>() -> Bounds<N> {
        Bounds { low: Vector::from_element(-1e6), high: Vector::from_element(1e6) }
    }

    /// Mean, variance and sum of the weights.
    fn moments(particles: &[Particle<1>]) -> (f64, f64, f64) {
        let sum: f64 = particles.iter().map(|p| p.weight).sum();
        let mean = particles.iter().map(|p| p.weight * p.state[0]).sum::<f64>() / sum;
        let variance = particles.iter().map(|p| p.weight * (p.state[0] - mean).powi(2)).sum::<f64>() / sum;
        (mean, variance, sum)
    }

    /// Prior N(0, 2^2), seen at 3 with N(x, 1): the posterior is N(2.4, 0.8), whatever leads the particles.
    #[test]
    fn guided_particles_keep_the_posterior_unbiased() {
        const COUNT: usize = 200_000;
        let (noise, spread) = (Vector::from([2.0]), Vector::from([2.0]));
        type Lead = fn(f64) -> f64;
        let leads: [(&str, Lead); 4] = [
            ("nowhere", |x| x),
            ("to what is seen", |_| 3.0),
            ("away", |x| x - 2.0),
            ("half way", |x| (x + 3.0) / 2.0),
        ];
        for (name, lead) in leads {
            let mut particles = Particles::new(COUNT, Vector::from([0.0]), 7);
            particles.propagate(&noise, &anywhere());
            particles.guide(&noise, &spread, &anywhere(), |x| Vector::from([lead(x[0])]));
            particles.weigh(|x| (-0.5 * (x[0] - 3.0).powi(2)).exp());
            let (guided, all) = (moments(&particles.drawn()[COUNT..]), moments(particles.drawn()));
            for (mean, variance, _) in [guided, all] {
                assert!((mean - 2.4).abs() < 0.04, "{name}: mean {mean}");
                assert!((variance - 0.8).abs() < 0.05, "{name}: variance {variance}");
            }
            assert!((guided.2 - 0.5).abs() < 0.02, "{name}: both halves weigh the same, not {}", guided.2);
            assert!((particles.mean()[0] - all.0).abs() < 1e-9);
        }
    }

    /// At the edge: prior N(0, 2^2) folded at 0, which is half-normal, seen at -1 with N(x, 1). Of the posterior,
    /// N(-0.8, 0.8) above 0, mean and variance are those of a truncated normal in closed form.
    #[test]
    fn guided_particles_keep_the_posterior_unbiased_at_an_edge() {
        const COUNT: usize = 200_000;
        let bounds = Bounds { low: Vector::from([0.0]), high: Vector::from([1e6]) };
        let (noise, spread) = (Vector::from([2.0]), Vector::from([1.5]));
        // With a = 0.8 / sqrt(0.8): the inverse Mills ratio phi(a) / (1 - Phi(a)), where 1 - Phi(a) is by quadrature.
        let (mean, deviation) = (-0.8f64, 0.8f64.sqrt());
        let a = -mean / deviation;
        let phi = |z: f64| (-0.5 * z * z).exp() / std::f64::consts::TAU.sqrt();
        let above: f64 = (0..100_000).map(|i| phi(a + (f64::from(i) + 0.5) * 1e-4) * 1e-4).sum();
        let mills = phi(a) / above;
        let want = (mean + deviation * mills, deviation.powi(2) * (1.0 + a * mills - mills * mills));
        type Lead = fn(f64) -> f64;
        let leads: [(&str, Lead); 4] =
            [("nowhere", |x| x), ("to the edge", |_| 0.0), ("beyond it", |_| -1.0), ("away from it", |x| x + 1.0)];
        for (name, lead) in leads {
            let mut particles = Particles::new(COUNT, Vector::from([0.0]), 7);
            particles.propagate(&noise, &bounds);
            particles.guide(&noise, &spread, &bounds, |x| Vector::from([lead(x[0])]));
            particles.weigh(|x| (-0.5 * (x[0] + 1.0).powi(2)).exp());
            let (guided, all) = (moments(&particles.drawn()[COUNT..]), moments(particles.drawn()));
            for (mean, variance, _) in [guided, all] {
                assert!((mean - want.0).abs() < 0.01, "{name}: mean {mean}, not {}", want.0);
                assert!((variance - want.1).abs() < 0.01, "{name}: variance {variance}, not {}", want.1);
            }
            assert!((guided.2 - 0.5).abs() < 0.02, "{name}: both halves weigh the same, not {}", guided.2);
        }
    }

    /// The weights alone, by the definition of the Gaussian density.
    #[test]
    fn importance_weights_are_the_quotient_of_the_densities() {
        let (noise, spread) = (Vector::from([2.0, 0.5]), Vector::from([1.0, 0.7]));
        let start = Vector::from([1.0, -1.0]);
        let mut particles = Particles::new(5, start, 1);
        particles.propagate(&noise, &anywhere());
        let led = Vector::from([2.5, -0.5]);
        particles.guide(&noise, &spread, &anywhere(), |_| led);
        let density = |x: f64, mean: f64, deviation: f64| {
            (-0.5 * ((x - mean) / deviation).powi(2)).exp() / (deviation * std::f64::consts::TAU.sqrt())
        };
        for particle in &particles.drawn()[5..] {
            let of = |mean: &Vector<2>, d: &Vector<2>| -> f64 {
                (0..2).map(|i| density(particle.state[i], mean[i], d[i])).product()
            };
            let want = of(&start, &noise) / of(&led, &spread);
            assert!((particle.weight / want - 1.0).abs() < 1e-9);
        }
        assert!(particles.drawn()[..5].iter().all(|p| p.weight == 1.0));
    }

    #[test]
    fn resampling_draws_each_as_often_as_it_weighs() {
        let mut particles = Particles::new(1000, Vector::from([0.0]), 3);
        particles.propagate(&Vector::from([1.0]), &anywhere());
        particles.drawn.iter_mut().enumerate().for_each(|(i, particle)| particle.state[0] = i as f64);
        // The particles are 0, 1, ..., 999; those of 100 and 700 have weights of one and three quarters.
        particles.weigh(|x| if x[0] == 100.0 { 1.0 } else { f64::from(x[0] == 700.0) * 3.0 });
        assert!((particles.mean()[0] - (25.0 + 525.0)).abs() < 1e-9);
        particles.resample(1000);
        let count = |v: f64| particles.known.iter().filter(|x| x[0] == v).count();
        assert_eq!((count(100.0), count(700.0)), (250, 750));
    }

    #[test]
    fn where_nothing_is_likely_all_weigh_the_same() {
        let mut particles = Particles::new(4, Vector::from([5.0]), 3);
        assert_eq!(particles.heaviest(), None);
        particles.propagate(&Vector::from([1.0]), &anywhere());
        assert_eq!(particles.weigh(|_| 0.0), 0.0);
        assert!(particles.drawn().iter().all(|p| p.weight == 0.25));
        particles.resample(8);
        assert!(particles.drawn().iter().all(|p| particles.known.iter().filter(|x| **x == p.state).count() == 2));
        particles.gather(6, Vector::from([1.0]));
        assert_eq!((particles.known.len(), particles.drawn().len()), (6, 0));
    }

    #[test]
    fn the_same_seed_gives_the_same_particles() {
        let run = |seed| {
            let mut particles = Particles::new(10, Vector::from([0.0, 0.0, 1.0]), seed);
            let noise = Vector::from([5.0, 5.0, 0.02]);
            for _ in 0..5 {
                particles.propagate(&noise, &anywhere());
                particles.guide(&noise, &noise, &anywhere(), |x| x * 0.5);
                particles.weigh(|x| (-x.norm()).exp());
                particles.resample(10);
            }
            particles.known
        };
        assert_eq!(run(4), run(4));
        assert_ne!(run(4), run(5));
    }
}
