//! Decision values of many candidates at once: one matrix product of support vectors and candidates.

use nalgebra::{DMatrixView, DMatrixViewMut};

use super::gram::Gram;

/// Candidates in a product; with a few hundred support vectors, the dot products stay in the second-level cache.
pub const BLOCK: usize = 256;

/// The support vectors, packed for products.
#[derive(Clone, Debug, Default)]
pub(super) struct Scorer {
    gamma: f64,
    bias: f64,
    dim: usize,
    /// `weights.len() x dim`, column-major.
    vectors: Vec<f32>,
    /// Squared lengths of the support vectors.
    norms: Vec<f64>,
    /// `y_i a_i`.
    weights: Vec<f64>,
    /// Dot products of a block, a column a candidate.
    products: Vec<f32>,
}

impl Scorer {
    /// Packs the examples with their weights `y_i a_i`, leaving out weights of 0.
    pub(super) fn pack(&mut self, gram: &Gram, weights: impl Iterator<Item = f64> + Clone, bias: f64) {
        (self.gamma, self.bias, self.dim) = (gram.gamma(), bias, gram.dim());
        let support = weights.enumerate().filter(|&(_, w)| w != 0.0);
        self.weights.clear();
        self.weights.extend(support.clone().map(|(_, w)| w));
        self.norms.clear();
        self.norms.extend(support.clone().map(|(i, _)| squared_length(gram.features(i))));
        let count = self.weights.len();
        self.vectors.resize(count * self.dim, 0.0);
        for (row, (i, _)) in support.enumerate() {
            let column = self.vectors[row..].iter_mut().step_by(count);
            column.zip(gram.features(i)).for_each(|(packed, &v)| *packed = v);
        }
    }

    /// Decision values of the rows of `xs`, row-major `out.len() x dim`.
    pub(super) fn decide(&mut self, xs: &[f32], out: &mut [f64]) {
        let (count, dim) = (self.weights.len(), self.dim);
        if count == 0 {
            return out.fill(self.bias);
        }
        let mut products = std::mem::take(&mut self.products);
        for (xs, out) in xs.chunks(BLOCK * dim).zip(out.chunks_mut(BLOCK)) {
            products.resize(count * out.len(), 0.0);
            let vectors = DMatrixView::from_slice(&self.vectors, count, dim);
            let candidates = DMatrixView::from_slice(xs, dim, out.len());
            DMatrixViewMut::from_slice(&mut products, count, out.len()).gemm(1.0, &vectors, &candidates, 0.0);
            for ((x, products), f) in xs.chunks_exact(dim).zip(products.chunks_exact(count)).zip(out) {
                *f = self.bias + self.expansion(squared_length(x), products);
            }
        }
        self.products = products;
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
