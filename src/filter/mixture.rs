//! Gaussian mixtures, and how they are kept small: prune, merge, cap.
//!
//! Source: LCMHT, end of section 4.3; Vo and Ma, *The Gaussian mixture probability hypothesis density filter*, 2006,
//! table II.

use super::kalman::{Factor, Gaussian, squared_mahalanobis};
use super::{Matrix, Vector};

#[cfg(test)]
mod tests;

/// A weighted Gaussian.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Component<const N: usize> {
    /// The expected number of targets that it stands for. Not negative.
    pub weight: f64,
    /// Where they are.
    pub state: Gaussian<N>,
}

/// How far a mixture is reduced.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReductionSettings {
    /// Components that weigh less, or nothing, are dropped; their weight is not given to others.
    pub prune_below: f64,
    /// `U`: a component nearer than this to a heavier one is merged into it. The distance is the squared Mahalanobis
    /// distance of the means under the lighter one's covariance. 0 merges nothing.
    pub merge_within: f64,
    /// Most components that are kept, the heaviest ones. At least 1.
    pub max_components: usize,
}

impl Default for ReductionSettings {
    /// Pruning and merging as in the LCMHT paper, the cap as in Vo and Ma's example.
    fn default() -> Self {
        Self { prune_below: 1e-5, merge_within: 4.0, max_components: 100 }
    }
}

/// Reduces mixtures. Its buffers are reused, so that it allocates nothing once they have grown.
#[derive(Clone, Debug)]
pub struct Reducer<const N: usize> {
    /// Components that are not merged yet, heaviest last, each with the factor of its covariance.
    open: Vec<(Component<N>, Option<Factor<N>>)>,
    /// A component and those that are merged into it.
    group: Vec<Component<N>>,
}

impl<const N: usize> Default for Reducer<N> {
    fn default() -> Self {
        Self { open: Vec::new(), group: Vec::new() }
    }
}

impl<const N: usize> Reducer<N> {
    /// Prunes, merges and caps `mixture`, and leaves it with the heaviest component first.
    pub fn reduce(&mut self, mixture: &mut Vec<Component<N>>, settings: &ReductionSettings) {
        mixture.retain(|c| c.weight > 0.0 && c.weight >= settings.prune_below);
        if settings.merge_within > 0.0 {
            self.merge(mixture, settings.merge_within);
        }
        heaviest_first(mixture);
        mixture.truncate(settings.max_components);
    }

    /// The heaviest component takes in all that are near it, then the heaviest of the rest, and so on.
    fn merge(&mut self, mixture: &mut Vec<Component<N>>, within: f64) {
        heaviest_first(mixture);
        self.open.clear();
        self.open.extend(mixture.drain(..).rev().map(|c| (c, Factor::new(c.state.covariance))));
        while let Some((seed, _)) = self.open.pop() {
            let group = &mut self.group;
            group.clear();
            group.push(seed);
            self.open.retain(|(component, factor)| {
                let difference = component.state.mean - seed.state.mean;
                let near = factor.as_ref().is_some_and(|f| squared_mahalanobis(f, &difference) < within);
                if near {
                    group.push(*component);
                }
                !near
            });
            mixture.push(moments(group));
        }
    }
}

/// Sorts by weight, falling.
pub fn heaviest_first<const N: usize>(mixture: &mut [Component<N>]) {
    mixture.sort_unstable_by(|a, b| b.weight.total_cmp(&a.weight));
}

/// The one component with the weight, mean and covariance of all of `group`, whose weight is positive.
fn moments<const N: usize>(group: &[Component<N>]) -> Component<N> {
    if let [single] = group {
        return *single;
    }
    let weight: f64 = group.iter().map(|c| c.weight).sum();
    let mean: Vector<N> = group.iter().map(|c| c.state.mean * (c.weight / weight)).sum();
    let mut covariance = Matrix::zeros();
    for c in group {
        let spread = c.state.mean - mean;
        covariance += (c.state.covariance + spread * spread.transpose()) * (c.weight / weight);
    }
    Component { weight, state: Gaussian { mean, covariance } }
}
