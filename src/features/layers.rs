//! From a frame and a search window to the spectra of the layers that correlation filters work on:
//! crop, features, projection, window, FFT.

use rustfft::num_complex::Complex32;

use super::hog::{self, Hog};
use super::pca::Projection;
use super::{CELL, FeatureMap, colour_names};
use crate::crop::{Cropper, Patch};
use crate::dcf::fft::Fft2;
use crate::dcf::sample::Sample;
use crate::dcf::window::hann;
use crate::frame::Frame;
use crate::geometry::Rect;

/// A feature that a layer may be made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feature {
    /// Felzenszwalb's HOG, 31 channels.
    Hog,
    /// Colour names, 11 channels.
    ColourNames,
}

/// What one layer is made of.
#[derive(Clone, Debug, PartialEq)]
pub struct LayerSpec {
    /// Features whose channels stand beside each other.
    pub features: Vec<Feature>,
    /// Principal components to keep, fixed in the first frame; `None` keeps the channels as they are.
    pub components: Option<usize>,
    /// The mean energy of a cell that the layer is scaled to in the first frame; `None` leaves it as it is.
    pub energy: Option<f32>,
}

/// One layer, fitted to the first frame.
struct Layer {
    spec: LayerSpec,
    projection: Option<Projection>,
    gain: f32,
}

/// Extracts samples on a grid of fixed size.
pub struct Extractor {
    rows: usize,
    cols: usize,
    layers: Vec<Layer>,
    hann: Vec<f32>,
    patch: Patch,
    hog: Hog,
    hog_map: FeatureMap,
    names_map: FeatureMap,
    /// The channels of one layer before its projection.
    joined: FeatureMap,
    /// The channels of one layer, windowed.
    planes: Vec<f32>,
}

impl Extractor {
    /// An extractor for search windows of `rows x cols` cells whose layers are fitted to what `window` shows.
    pub fn fit(
        specs: &[LayerSpec],
        rows: usize,
        cols: usize,
        frame: &Frame,
        window: &Rect,
        cropper: &mut Cropper,
    ) -> Self {
        let mut extractor = Self {
            rows,
            cols,
            layers: Vec::new(),
            hann: hann(rows, cols),
            patch: Patch::default(),
            hog: Hog::default(),
            hog_map: FeatureMap::default(),
            names_map: FeatureMap::default(),
            joined: FeatureMap::default(),
            planes: Vec::new(),
        };
        extractor.compute(frame, window, cropper, specs);
        for spec in specs {
            extractor.join(&spec.features);
            let projection = spec.components.map(|n| Projection::fit(&extractor.joined, n));
            let mut layer = Layer { spec: spec.clone(), projection, gain: 1.0 };
            extractor.project(&layer);
            if let Some(energy) = spec.energy {
                let mean = extractor.planes.iter().map(|v| v * v).sum::<f32>() / (rows * cols) as f32;
                layer.gain = (energy / mean.max(f32::MIN_POSITIVE)).sqrt();
            }
            extractor.layers.push(layer);
        }
        extractor
    }

    /// Channels of all layers together.
    pub fn channels(&self) -> usize {
        self.layers.iter().map(channels).sum()
    }

    /// Fills `sample` with the spectra of what `window` shows.
    pub fn extract(
        &mut self,
        frame: &Frame,
        window: &Rect,
        cropper: &mut Cropper,
        fft: &mut Fft2,
        sample: &mut Sample,
    ) {
        let layers = std::mem::take(&mut self.layers);
        self.crop(frame, window, cropper);
        self.maps(layers.iter().flat_map(|l| &l.spec.features));
        sample.layers.clear();
        sample.spectra.resize(layers.iter().map(channels).sum::<usize>() * fft.bins(), Complex32::default());
        let mut first = 0;
        for layer in &layers {
            self.join(&layer.spec.features);
            self.project(layer);
            let end = first + channels(layer);
            let spectra = sample.spectra[first * fft.bins()..end * fft.bins()].chunks_exact_mut(fft.bins());
            for (plane, spectrum) in self.planes.chunks_exact_mut(self.hann.len()).zip(spectra) {
                plane.iter_mut().zip(&self.hann).for_each(|(v, w)| *v *= w);
                fft.forward(plane, spectrum);
            }
            sample.layers.push(first..end);
            first = end;
        }
        self.layers = layers;
    }

    fn compute(&mut self, frame: &Frame, window: &Rect, cropper: &mut Cropper, specs: &[LayerSpec]) {
        self.crop(frame, window, cropper);
        self.maps(specs.iter().flat_map(|s| &s.features));
    }

    fn crop(&mut self, frame: &Frame, window: &Rect, cropper: &mut Cropper) {
        cropper.crop(frame, window, self.cols * CELL, self.rows * CELL, &mut self.patch);
    }

    /// Computes each feature that is asked for.
    fn maps<'a>(&mut self, features: impl Iterator<Item = &'a Feature>) {
        for feature in features {
            match feature {
                Feature::Hog => self.hog.compute(&self.patch, &mut self.hog_map),
                Feature::ColourNames => colour_names::compute(&self.patch, &mut self.names_map),
            }
        }
    }

    /// Puts the channels of some features beside each other.
    fn join(&mut self, features: &[Feature]) {
        let joined = &mut self.joined;
        joined.data.clear();
        for feature in features {
            joined.data.extend_from_slice(match feature {
                Feature::Hog => &self.hog_map.data,
                Feature::ColourNames => &self.names_map.data,
            });
        }
        (joined.rows, joined.cols) = (self.rows, self.cols);
        joined.channels = joined.data.len() / (self.rows * self.cols);
    }

    fn project(&mut self, layer: &Layer) {
        match &layer.projection {
            Some(projection) => {
                self.planes.resize(projection.outputs() * self.joined.cells(), 0.0);
                projection.apply(&self.joined, &mut self.planes);
            }
            None => self.planes.clone_from(&self.joined.data),
        }
        self.planes.iter_mut().for_each(|v| *v *= layer.gain);
    }
}

fn channels(layer: &Layer) -> usize {
    layer.projection.as_ref().map_or_else(
        || {
            let of = |f: &Feature| match f {
                Feature::Hog => hog::CHANNELS,
                Feature::ColourNames => colour_names::CHANNELS,
            };
            layer.spec.features.iter().map(of).sum()
        },
        Projection::outputs,
    )
}
