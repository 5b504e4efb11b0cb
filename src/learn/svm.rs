//! Incremental support vector machine: the exact solution after each added or removed example.
//!
//! Source: Diehl and Cauwenberghs, "SVM incremental learning, adaptation and optimization", 2003; equations 11 to 16 of
//! the LCMHT paper. Hinge loss, Gaussian kernel `K(x, x') = exp(-gamma |x - x'|^2)`, bias; the dual problem is
//!
//! ```text
//! minimise  1/2 sum_ij a_i Q_ij a_j - sum_i a_i   subject to  0 <= a_i <= C,  sum_i y_i a_i = 0
//! Q_ij = y_i y_j K(x_i, x_j),   f(x) = sum_i y_i a_i K(x_i, x) + b,   m_i = y_i f(x_i) - 1
//! ```

mod border;
mod gram;
mod path;
mod score;
mod smo;
mod state;

pub use score::BLOCK;
pub use state::Set;

use gram::Gram;
use score::Scorer;
use state::SolverState;

/// The settings of an [`Svm`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SvmParams {
    /// Upper bound `C` of a coefficient: the price of a unit of hinge loss. Positive.
    pub c: f64,
    /// `gamma` of the Gaussian kernel, in units of 1 / squared feature. Positive.
    pub gamma: f64,
    /// Most examples that are kept, at least 2. [`Svm::add`] says which go.
    pub max_support: usize,
}

impl Default for SvmParams {
    /// `C = 2` as in the LCMHT paper (section 5); `gamma = 1` suits features of unit length.
    fn default() -> Self {
        Self { c: 2.0, gamma: 1.0, max_support: 200 }
    }
}

/// A kept example.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Example<'a> {
    /// The feature vector.
    pub features: &'a [f32],
    /// The label.
    pub positive: bool,
    /// The coefficient `a`, in `[0, C]`.
    pub alpha: f64,
    /// The margin `m = y f(x) - 1`.
    pub margin: f64,
    /// The set that the example is in.
    pub set: Set,
}

/// A two-class classifier that learns and unlearns single examples exactly.
#[derive(Clone, Debug)]
pub struct Svm {
    params: SvmParams,
    state: SolverState,
    /// Running number of each kept example: the smaller, the older.
    births: Vec<u64>,
    next_birth: u64,
    scorer: Scorer,
    /// Whether the scorer has what is learned by now.
    packed: bool,
}

impl Svm {
    /// A classifier without examples for feature vectors of `dim` numbers.
    pub fn new(dim: usize, params: SvmParams) -> Self {
        let state = SolverState::new(Gram::new(dim, params.gamma), params.c);
        Self { params, state, births: Vec::new(), next_birth: 0, scorer: Scorer::default(), packed: false }
    }

    /// Numbers of a feature vector.
    pub fn dim(&self) -> usize {
        self.state.gram.dim()
    }

    /// Number of kept examples.
    pub fn len(&self) -> usize {
        self.state.len()
    }

    /// Whether no example is kept.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Whether both classes have an example; before that, `f` is constant.
    pub fn is_trained(&self) -> bool {
        self.state.labels.contains(&1.0) && self.state.labels.contains(&-1.0)
    }

    /// The bias `b`.
    pub fn bias(&self) -> f64 {
        self.state.bias
    }

    /// How often a solution from scratch had to stand in for the increments since the start.
    pub fn resolves(&self) -> usize {
        self.state.resolves
    }

    /// The kept example at `index < len()`. Adding and removing change the order.
    pub fn example(&self, index: usize) -> Example<'_> {
        let state = &self.state;
        Example {
            features: state.gram.features(index),
            positive: state.labels[index] > 0.0,
            alpha: state.alphas[index],
            margin: state.margins[index],
            set: state.sets[index],
        }
    }

    /// Learns an example of `dim()` finite numbers.
    ///
    /// Where more than `max_support` examples are then kept, the one with the greatest margin is removed, exactly:
    /// first the reserve vector farthest from the margin; where there is no reserve vector, the margin vector of the
    /// smallest coefficient; last, the error vector closest to the margin. Of equals the oldest goes, and the last
    /// example of a class never does.
    ///
    /// # Panics
    /// If `x` has another length.
    pub fn add(&mut self, x: &[f32], positive: bool) {
        assert_eq!(x.len(), self.dim(), "feature vector of another length");
        self.packed = false;
        self.state.learn(x, if positive { 1.0 } else { -1.0 });
        self.births.push(self.next_birth);
        self.next_birth += 1;
        self.trim();
    }

    /// Unlearns the example at `index < len()`, as if it had never been added. The last example takes its index.
    pub fn remove(&mut self, index: usize) {
        self.packed = false;
        self.state.unlearn(index);
        self.births.swap_remove(index);
    }

    /// Forgets all examples.
    pub fn clear(&mut self) {
        *self = Self::new(self.dim(), self.params);
    }

    /// Solves the problem of the kept examples anew for other settings, and drops what they do not allow to keep.
    pub fn retune(&mut self, params: SvmParams) {
        self.packed = false;
        if params.gamma != self.params.gamma {
            self.state.gram.set_gamma(params.gamma);
        }
        if (params.gamma, params.c) != (self.params.gamma, self.params.c) {
            self.state.c = params.c;
            self.state.resolve();
        }
        self.params = params;
        self.trim();
    }

    /// The decision value `f(x)`: positive for the positive class, 1 on its margin. 0 before the first example.
    pub fn margin(&self, x: &[f32]) -> f64 {
        let state = &self.state;
        let support = (0..self.len()).filter(|&i| state.alphas[i] > 0.0);
        let sum: f64 = support.map(|i| state.labels[i] * state.alphas[i] * state.gram.kernel(i, x)).sum();
        sum + state.bias
    }

    /// Writes the decision values of the rows of `xs`, row-major `out.len() x dim()`, to `out`.
    ///
    /// Many at once are far faster than one by one; more than [`BLOCK`] gain nothing. Dot products are single
    /// precision: relative to [`margin`](Self::margin), squared distances are off by about 1e-7 of the squared lengths.
    ///
    /// # Panics
    /// If the lengths do not match.
    pub fn margins(&mut self, xs: &[f32], out: &mut [f64]) {
        assert_eq!(xs.len(), out.len() * self.dim(), "candidates of another length");
        if !std::mem::replace(&mut self.packed, true) {
            let state = &self.state;
            let weights = state.labels.iter().zip(&state.alphas).map(|(y, a)| y * a);
            self.scorer.pack(&state.gram, weights, state.bias);
        }
        self.scorer.decide(xs, out);
    }

    fn trim(&mut self) {
        while self.len() > self.params.max_support {
            let index = self.dispensable();
            self.remove(index);
        }
    }

    /// The example that [`add`](Self::add) says goes first.
    fn dispensable(&self) -> usize {
        let state = &self.state;
        let positives = state.labels.iter().filter(|&&y| y > 0.0).count();
        let negatives = self.len() - positives;
        let others = |i: usize| if state.labels[i] > 0.0 { positives } else { negatives } > 1;
        let greatest_margin_first = |&i: &usize, &j: &usize| {
            let margin = |i: usize| if state.sets[i] == Set::Margin { 0.0 } else { state.margins[i] };
            f64::total_cmp(&margin(j), &margin(i))
                .then(f64::total_cmp(&state.alphas[i], &state.alphas[j]))
                .then(self.births[i].cmp(&self.births[j]))
        };
        (0..self.len())
            .filter(|&i| others(i))
            .min_by(greatest_margin_first)
            .expect("three or more examples of two classes")
    }
}

#[cfg(test)]
mod tests;
