//! From a frame and a search window to the spectra of the layers that correlation filters work on:
//! crop, features, projection, window, FFT.

use std::ops::Range;

use rustfft::num_complex::Complex32;

use super::cnn::{SharedCnn, locked};
use super::hog::Hog;
use super::pca::Projection;
use super::resize::Resize;
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

/// Where a layer's channels come from.
#[derive(Clone, Debug, PartialEq)]
pub enum Source {
    /// Features on the grid of cells, whose channels stand beside each other.
    Cells(Vec<Feature>),
    /// An output of the network, counted as in its settings.
    Network(usize),
}

/// What one layer is made of.
#[derive(Clone, Debug, PartialEq)]
pub struct LayerSpec {
    /// Where its channels come from.
    pub source: Source,
    /// Principal components to keep, fixed in the first frame; `None` keeps the channels as they are.
    pub components: Option<usize>,
    /// The mean energy of a cell that the layer is scaled to in the first frame; `None` leaves it as it is.
    pub energy: Option<f32>,
}

/// One layer, fitted to the first frame.
struct Layer {
    spec: LayerSpec,
    projection: Option<Projection>,
    /// From the network's grid to that of the cells.
    resize: Option<Resize>,
    channels: usize,
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
    cnn: Option<SharedCnn>,
    /// The channels of one layer of cells before its projection.
    joined: FeatureMap,
    /// The channels of one layer of the network after its projection, on the network's grid.
    projected: FeatureMap,
    /// The channels of one layer, windowed.
    planes: Vec<f32>,
}

impl Extractor {
    /// An extractor for search windows of `rows x cols` cells whose layers are fitted to what `window` shows. Layers of
    /// the network need one.
    pub fn fit(
        specs: &[LayerSpec],
        cnn: Option<SharedCnn>,
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
            cnn,
            joined: FeatureMap::default(),
            projected: FeatureMap::default(),
            planes: Vec::new(),
        };
        extractor.maps(specs.iter(), frame, window, cropper);
        extractor.layers = specs.iter().map(|spec| extractor.fit_layer(spec)).collect();
        extractor
    }

    fn fit_layer(&mut self, spec: &LayerSpec) -> Layer {
        let grid = [self.rows, self.cols];
        let (projection, channels, from) = self.with_map(&spec.source, |map, _| {
            let projection = spec.components.map(|n| Projection::fit(map, n));
            let channels = projection.as_ref().map_or(map.channels, Projection::outputs);
            (projection, channels, [map.rows, map.cols])
        });
        let resize = (from != grid).then(|| Resize::new(from, grid));
        let mut layer = Layer { spec: spec.clone(), projection, resize, channels, gain: 1.0 };
        self.project(&mut layer);
        if let Some(energy) = spec.energy {
            let mean = self.planes.iter().map(|v| v * v).sum::<f32>() / self.hann.len() as f32;
            layer.gain = (energy / mean.max(f32::MIN_POSITIVE)).sqrt();
        }
        layer
    }

    /// Channels of all layers together.
    pub fn channels(&self) -> usize {
        self.layers.iter().map(|layer| layer.channels).sum()
    }

    /// The layers, and the channels that each takes.
    pub fn layers(&self) -> impl Iterator<Item = (&LayerSpec, Range<usize>)> {
        self.layers.iter().scan(0, |first, layer| {
            let channels = *first..*first + layer.channels;
            *first = channels.end;
            Some((&layer.spec, channels))
        })
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
        let mut layers = std::mem::take(&mut self.layers);
        self.maps(layers.iter().map(|layer| &layer.spec), frame, window, cropper);
        let channels: usize = layers.iter().map(|layer| layer.channels).sum();
        sample.layers.clear();
        sample.spectra.resize(channels * fft.bins(), Complex32::default());
        let mut first = 0;
        for layer in &mut layers {
            self.project(layer);
            let end = first + layer.channels;
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

    /// Computes each feature that the layers ask for, and runs the network once if any layer is of it.
    fn maps<'a>(
        &mut self,
        specs: impl Iterator<Item = &'a LayerSpec>,
        frame: &Frame,
        window: &Rect,
        cropper: &mut Cropper,
    ) {
        cropper.crop(frame, window, self.cols * CELL, self.rows * CELL, &mut self.patch);
        let mut network = false;
        for spec in specs {
            match &spec.source {
                Source::Cells(features) => features.iter().for_each(|feature| match feature {
                    Feature::Hog => self.hog.compute(&self.patch, &mut self.hog_map),
                    Feature::ColourNames => colour_names::compute(&self.patch, &mut self.names_map),
                }),
                Source::Network(_) => network = true,
            }
        }
        if network && let Some(cnn) = &self.cnn {
            locked(cnn).compute(frame, window, cropper);
        }
    }

    /// Gives `work` the map of a source, and room for its projection.
    fn with_map<T>(&mut self, source: &Source, work: impl FnOnce(&FeatureMap, &mut FeatureMap) -> T) -> T {
        match source {
            Source::Cells(features) => {
                self.join(features);
                work(&self.joined, &mut self.projected)
            }
            Source::Network(output) => {
                let cnn = self.cnn.as_ref().expect("layers of the network come with one");
                work(&locked(cnn).maps()[*output], &mut self.projected)
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

    /// Fills the planes with the channels of a layer: projected first, for that is cheaper on the coarser grid.
    fn project(&mut self, layer: &mut Layer) {
        let mut planes = std::mem::take(&mut self.planes);
        planes.resize(layer.channels * self.hann.len(), 0.0);
        let Layer { spec, projection, resize, channels, gain } = layer;
        self.with_map(&spec.source, |map, projected| match (projection, resize) {
            (Some(projection), Some(resize)) => {
                projected.resize(map.rows, map.cols, *channels);
                projection.apply(map, &mut projected.data);
                resize.apply(projected, &mut planes);
            }
            (Some(projection), None) => projection.apply(map, &mut planes),
            (None, Some(resize)) => resize.apply(map, &mut planes),
            (None, None) => planes.copy_from_slice(&map.data),
        });
        planes.iter_mut().for_each(|v| *v *= *gain);
        self.planes = planes;
    }
}
