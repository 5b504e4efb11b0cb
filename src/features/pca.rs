//! Projection of a feature map's channels on to their principal components, fixed from one map.

use nalgebra::{DMatrix, SymmetricEigen};

use super::FeatureMap;

/// A linear map from `inputs` channels to `outputs` uncorrelated ones; the mean is removed.
#[derive(Clone, Debug, PartialEq)]
pub struct Projection {
    inputs: usize,
    outputs: usize,
    /// `outputs x inputs`, row-major.
    weights: Vec<f32>,
    /// What to add to each output: minus the projected mean.
    offset: Vec<f32>,
}

impl Projection {
    /// The `outputs` directions (at most the channels there are) in which the map's cells vary most.
    pub fn fit(map: &FeatureMap, outputs: usize) -> Self {
        let inputs = map.channels;
        let outputs = outputs.min(inputs);
        let count = map.cells() as f64;
        let mean: Vec<f64> =
            (0..inputs).map(|c| map.plane(c).iter().map(|&v| f64::from(v)).sum::<f64>() / count).collect();
        // A column is a channel without its mean.
        let centred = DMatrix::from_iterator(
            map.cells(),
            inputs,
            (0..inputs).flat_map(|c| map.plane(c).iter().map(move |&v| (c, v))).map(|(c, v)| f64::from(v) - mean[c]),
        );
        let covariance = centred.transpose() * &centred / count;
        let eigen = SymmetricEigen::new(covariance);
        let mut order: Vec<usize> = (0..inputs).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let mut weights = Vec::with_capacity(outputs * inputs);
        let mut offset = Vec::with_capacity(outputs);
        for &component in &order[..outputs] {
            let direction = eigen.eigenvectors.column(component);
            weights.extend(direction.iter().map(|&v| v as f32));
            offset.push(-direction.iter().zip(&mean).map(|(d, m)| d * m).sum::<f64>() as f32);
        }
        Self { inputs, outputs, weights, offset }
    }

    /// Channels of the projected map.
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// Writes the projected planes, `outputs x cells`.
    pub fn apply(&self, map: &FeatureMap, out: &mut [f32]) {
        let cells = map.cells();
        let rows = self.weights.chunks_exact(self.inputs).zip(&self.offset);
        for (plane, (weights, offset)) in out.chunks_exact_mut(cells).zip(rows) {
            plane.fill(*offset);
            for (channel, weight) in weights.iter().enumerate() {
                plane.iter_mut().zip(map.plane(channel)).for_each(|(o, v)| *o += weight * v);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_are_uncorrelated_centred_and_ordered() {
        let (rows, cols, channels) = (8, 8, 5);
        let mut map = FeatureMap::default();
        map.resize(rows, cols, channels);
        for (i, v) in map.data.iter_mut().enumerate() {
            let (channel, cell) = (i / 64, i % 64);
            *v = 3.0
                + ((cell * (channel + 3) * 7 + channel) % 31) as f32 * (1 + channel) as f32 * 0.1
                + cell as f32 * 0.05;
        }
        let projection = Projection::fit(&map, 4);
        let mut out = vec![0.0; 4 * 64];
        projection.apply(&map, &mut out);
        let dot = |i: usize, j: usize| -> f32 { (0..64).map(|c| out[i * 64 + c] * out[j * 64 + c]).sum() };
        for i in 0..4 {
            assert!(out[i * 64..(i + 1) * 64].iter().sum::<f32>().abs() < 1e-2);
            for j in 0..i {
                assert!(dot(i, j).abs() < 1e-3 * dot(0, 0));
                assert!(dot(j, j) >= dot(i, i));
            }
        }
        // All components together keep every cell's distance from the mean.
        let full = Projection::fit(&map, 9);
        assert_eq!(full.outputs(), 5);
        let mut all = vec![0.0; 5 * 64];
        full.apply(&map, &mut all);
        let energy = |v: &[f32]| v.iter().map(|v| v * v).sum::<f32>();
        let centred: f32 = (0..channels)
            .map(|c| {
                let mean = map.plane(c).iter().sum::<f32>() / 64.0;
                map.plane(c).iter().map(|v| (v - mean).powi(2)).sum::<f32>()
            })
            .sum();
        assert!((energy(&all) / centred - 1.0).abs() < 1e-4);
    }
}
