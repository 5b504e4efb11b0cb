//! Decision values of many candidates at once: one matrix product of support vectors and candidates.

use nalgebra::{DMatrix, DMatrixView};

use super::gram::Gram;

/// Candidates in a product; with a few hundred support vectors, the dot products stay in the second-level cache.
const BLOCK: usize = 256;

/// The support vectors, packed for products.
pub(super) struct Scorer {
    gamma: f64,
    bias: f64,
    /// `weights.len() x dim`.
    vectors: DMatrix<f32>,
    /// Squared lengths of the support vectors.
    norms: Vec<f64>,
    /// `y_i a_i`.
    weights: Vec<f64>,
}

impl Scorer {
    /// Packs the examples with their weights `y_i a_i`, leaving out weights of 0.
    pub(super) fn new(gram: &Gram, weights: impl Iterator<Item = f64>, bias: f64) -> Self {
        let (indices, weights): (Vec<usize>, Vec<f64>) = weights.enumerate().filter(|&(_, w)| w != 0.0).unzip();
        let rows = indices.iter().flat_map(|&i| gram.features(i)).copied();
        Self {
            gamma: gram.gamma(),
            bias,
            vectors: DMatrix::from_row_iterator(indices.len(), gram.dim(), rows),
            norms: indices.iter().map(|&i| squared_length(gram.features(i))).collect(),
            weights,
        }
    }

    /// Decision values of the rows of `xs`, row-major `out.len() x dim`.
    pub(super) fn decide(&self, xs: &[f32], out: &mut [f64]) {
        if self.weights.is_empty() {
            return out.fill(self.bias);
        }
        let (count, dim) = self.vectors.shape();
        let mut products = DMatrix::zeros(count, BLOCK.min(out.len()));
        for (xs, out) in xs.chunks(BLOCK * dim).zip(out.chunks_mut(BLOCK)) {
            let candidates = DMatrixView::from_slice(xs, dim, out.len());
            let mut products = products.columns_mut(0, out.len());
            products.gemm(1.0, &self.vectors, &candidates, 0.0);
            for ((x, products), f) in xs.chunks_exact(dim).zip(products.column_iter()).zip(out) {
                *f = self.bias + self.expansion(squared_length(x), products.as_slice());
            }
        }
    }

    /// `sum_i y_i a_i K(x_i, x)` from `|x|^2` and the dot products with `x`.
    fn expansion(&self, norm: f64, products: &[f32]) -> f64 {
        let terms = products.iter().zip(&self.norms).zip(&self.weights);
        terms
            .map(|((&product, own), weight)| {
                let squared_distance = (own + norm - 2.0 * f64::from(product)).max(0.0);
                weight * f64::from(((-self.gamma * squared_distance) as f32).exp())
            })
            .sum()
    }
}

/// Squared length, summed in `f64`.
fn squared_length(x: &[f32]) -> f64 {
    x.iter().map(|&v| f64::from(v) * f64::from(v)).sum()
}
