//! From a frame and a search window to the spectra of the layers that correlation filters work on:
//! crop, features, projection, window, FFT.

use std::ops::Range;

use rustfft::num_complex::Complex32;

use crate::crop::{Alteration, Cropper, Patch};
use crate::dcf::fft::Fft2;
use crate::dcf::sample::Sample;
use crate::dcf::window::hann;
use crate::features::hog::Hog;
use crate::features::pca::Projection;
use crate::features::resize::Resize;
use crate::features::{CELL, FeatureMap, colour_names, contrast};
use crate::frame::Frame;
use crate::geometry::Rect;
use crate::network::{SharedCnn, locked};

/// Share of a map's energy that its layer must have in the first frame to be scaled up: less, and what the layer would
/// show are errors of rounding. Where a window is of one colour, nothing is left of colour names without their mean.
const LEAST_ENERGY: f32 = 1e-6;

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
pub enum LayerSource {
    /// Features on the grid of cells, whose channels stand beside each other.
    Cells(Vec<Feature>),
    /// An output of the network, counted as in its settings.
    Network(usize),
}

/// What one layer is made of.
#[derive(Clone, Debug, PartialEq)]
pub struct LayerSpec {
    /// Where its channels come from.
    pub source: LayerSource,
    /// Principal components to keep, fixed in the first frame; `None` keeps the channels as they are.
    pub components: Option<usize>,
    /// The mean energy of a cell that the layer is scaled to in the first frame; `None` leaves it as it is. A layer
    /// that shows nothing there stays silent.
    pub energy: Option<f32>,
    /// Weight of its response where each layer has a filter of its own (gamma of LCMHT eq 6).
    pub weight: f32,
}

impl LayerSpec {
    /// A layer of this energy, which weighs as much.
    pub fn scaled(source: LayerSource, components: Option<usize>, energy: f32) -> Self {
        Self { source, components, energy: Some(energy), weight: energy }
    }
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

/// What a search window shows, cut out of a frame: all that a sample is made of.
#[derive(Clone, Debug, Default)]
pub struct Cut {
    window: Rect,
    /// For the features of cells.
    cells: Patch,
    /// For the network, if that is to see it in another size.
    network: Option<Patch>,
}

impl Cut {
    /// Whether it shows anything that could be followed, where `tile` is the share of the window's sides that a target
    /// and its surroundings take.
    pub fn shows_anything(&self, tile: f64) -> bool {
        let side = |length: usize| (length as f64 * tile).round() as usize;
        contrast::shows_anything(&self.cells, [side(self.cells.width), side(self.cells.height)])
    }

    /// Mirrors and turns what it shows; blur comes with cutting alone.
    pub fn alter(&mut self, alteration: &Alteration, cropper: &mut Cropper) {
        for patch in std::iter::once(&mut self.cells).chain(&mut self.network) {
            cropper.alter(alteration, &self.window, patch);
        }
    }
}

/// What the network that layers are of saw in a look.
#[derive(Clone, Copy)]
pub struct SeenByNetwork<'a> {
    /// The network.
    pub cnn: &'a SharedCnn,
    /// Where it looked, in pixels of the frame.
    pub window: Rect,
    /// What it made of that, a map of each output.
    pub maps: &'a [FeatureMap],
}

/// Extracts samples on a grid of fixed size.
pub struct Extractor {
    rows: usize,
    cols: usize,
    layers: Vec<Layer>,
    hann: Vec<f32>,
    cut: Cut,
    hog: Hog,
    hog_map: FeatureMap,
    names_map: FeatureMap,
    network_maps: Vec<FeatureMap>,
    /// Whether the network's last run did not fail.
    has_run: bool,
    cnn: Option<SharedCnn>,
    /// The side of the network's input, if a layer is of it.
    side: Option<usize>,
    /// The channels of one layer of cells before its projection.
    joined: FeatureMap,
    /// The channels of one layer of the network after its projection, on the network's grid.
    projected: FeatureMap,
    /// The channels of one layer, windowed.
    planes: Vec<f32>,
}

impl Extractor {
    /// An extractor for search windows of `rows x cols` cells whose layers are fitted to what `window` shows.
    ///
    /// # Panics
    /// If a layer is of a network and none is given, or one that lacks the output.
    pub fn fit(
        specs: &[LayerSpec],
        cnn: Option<SharedCnn>,
        rows: usize,
        cols: usize,
        frame: &Frame,
        window: &Rect,
        cropper: &mut Cropper,
    ) -> Self {
        let network = specs.iter().any(|spec| matches!(spec.source, LayerSource::Network(_)));
        let mut extractor = Self {
            rows,
            cols,
            layers: Vec::new(),
            hann: hann(rows, cols),
            cut: Cut::default(),
            hog: Hog::default(),
            hog_map: FeatureMap::default(),
            names_map: FeatureMap::default(),
            network_maps: Vec::new(),
            has_run: false,
            side: cnn.as_ref().filter(|_| network).map(|cnn| locked(cnn).settings().side),
            cnn,
            joined: FeatureMap::default(),
            projected: FeatureMap::default(),
            planes: Vec::new(),
        };
        let mut cut = Cut::default();
        extractor.cut(frame, window, cropper, &mut cut);
        extractor.maps(specs.iter(), &cut);
        extractor.cut = cut;
        extractor.layers = specs.iter().map(|spec| extractor.fit_layer(spec)).collect();
        extractor
    }

    fn fit_layer(&mut self, spec: &LayerSpec) -> Layer {
        let grid = [self.rows, self.cols];
        let (projection, channels, from, whole) = self.with_map(&spec.source, |map, _| {
            let projection = spec.components.map(|n| Projection::fit(map, n));
            let channels = projection.as_ref().map_or(map.channels, Projection::outputs);
            (projection, channels, [map.rows, map.cols], mean_energy(&map.data, map.cells()))
        });
        let resize = (from != grid).then(|| Resize::new(from, grid));
        let mut layer = Layer { spec: spec.clone(), projection, resize, channels, gain: 1.0 };
        self.project(&mut layer);
        if let Some(energy) = spec.energy {
            let mean = mean_energy(&self.planes, self.hann.len());
            layer.gain = if mean > LEAST_ENERGY * whole { (energy / mean).sqrt() } else { 0.0 };
        }
        layer
    }

    /// Goes on with another network, which gives the same maps as the one before.
    pub fn use_network(&mut self, cnn: &SharedCnn) {
        self.cnn = Some(cnn.clone());
    }

    /// The network, if a layer is of it, and the maps that it made last; `None` if that run failed.
    pub fn network(&self) -> Option<(&SharedCnn, &[FeatureMap])> {
        let cnn = self.cnn.as_ref().filter(|_| self.side.is_some() && self.has_run)?;
        Some((cnn, &self.network_maps))
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
        let mut cut = std::mem::take(&mut self.cut);
        self.cut(frame, window, cropper, &mut cut);
        self.extract_cut(&cut, fft, sample);
        self.cut = cut;
    }

    /// Cuts out what `window` shows, for [`extract_cut`](Self::extract_cut).
    pub fn cut(&self, frame: &Frame, window: &Rect, cropper: &mut Cropper, cut: &mut Cut) {
        let [width, height] = [self.cols, self.rows].map(|cells| cells * CELL);
        cut.window = *window;
        cropper.crop(frame, window, width, height, &mut cut.cells);
        if let Some(side) = self.side.filter(|&side| [side; 2] != [width, height]) {
            cropper.crop(frame, window, side, side, cut.network.get_or_insert_default());
        }
    }

    /// Fills `sample` with the spectra of what a cut shows.
    pub fn extract_cut(&mut self, cut: &Cut, fft: &mut Fft2, sample: &mut Sample) {
        let layers = std::mem::take(&mut self.layers);
        self.maps(layers.iter().map(|layer| &layer.spec), cut);
        self.layers = layers;
        self.transform(fft, sample);
    }

    /// Fills `sample` with the spectra of what was looked at last: after [`fit`](Self::fit), of what that was fitted
    /// to.
    pub fn transform(&mut self, fft: &mut Fft2, sample: &mut Sample) {
        let mut layers = std::mem::take(&mut self.layers);
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
    fn maps<'a>(&mut self, specs: impl Iterator<Item = &'a LayerSpec>, cut: &Cut) {
        let mut network = false;
        for spec in specs {
            match &spec.source {
                LayerSource::Cells(features) => features.iter().for_each(|feature| match feature {
                    Feature::Hog => self.hog.compute(&cut.cells, &mut self.hog_map),
                    Feature::ColourNames => colour_names::compute(&cut.cells, &mut self.names_map),
                }),
                LayerSource::Network(_) => network = true,
            }
        }
        if network && let Some(cnn) = &self.cnn {
            let patch = cut.network.as_ref().unwrap_or(&cut.cells);
            self.has_run = locked(cnn).compute_patch(patch, &mut self.network_maps).is_ok();
        }
    }

    /// Gives `work` the map of a source, and room for its projection.
    fn with_map<T>(&mut self, source: &LayerSource, work: impl FnOnce(&FeatureMap, &mut FeatureMap) -> T) -> T {
        match source {
            LayerSource::Cells(features) => {
                self.join(features);
                work(&self.joined, &mut self.projected)
            }
            LayerSource::Network(output) => work(&self.network_maps[*output], &mut self.projected),
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

/// Mean energy of a cell, over all channels.
fn mean_energy(planes: &[f32], cells: usize) -> f32 {
    planes.iter().map(|v| v * v).sum::<f32>() / cells as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Encoding;

    const SIDE: usize = 64;

    /// The mean energy of a cell of each layer, HOG and colour names, in images of `SIDE` pixels, fitted to the first.
    fn energies(first: &[u8], then: &[u8]) -> [f32; 2] {
        let spec = |feature, n| LayerSpec::scaled(LayerSource::Cells(vec![feature]), Some(n), 1.0);
        let specs = [spec(Feature::Hog, 16), spec(Feature::ColourNames, 10)];
        let frame = |data| Frame::new(data, SIDE as u32, SIDE as u32, 3 * SIDE, Encoding::Rgb8, None).unwrap();
        let (window, cells) = (Rect::new(0.0, 0.0, SIDE as f64, SIDE as f64), SIDE / CELL);
        let mut cropper = Cropper::default();
        let mut extractor = Extractor::fit(&specs, None, cells, cells, &frame(first), &window, &mut cropper);
        let (mut fft, mut sample) = (Fft2::new(cells, cells), Sample::default());
        extractor.extract(&frame(then), &window, &mut cropper, &mut fft, &mut sample);
        let plane = |channels: &Range<usize>| {
            let spectra =
                sample.spectra[channels.start * fft.bins()..channels.end * fft.bins()].chunks_exact(fft.bins());
            let mut values = vec![0.0; cells * cells];
            spectra
                .map(|spectrum| {
                    fft.inverse(spectrum, &mut values);
                    mean_energy(&values, values.len())
                })
                .sum()
        };
        <[f32; 2]>::try_from(sample.layers.iter().map(plane).collect::<Vec<f32>>()).unwrap()
    }

    #[test]
    fn a_layer_that_shows_nothing_in_the_first_frame_stays_silent() {
        let colours = |i: usize| [(i % SIDE * 4) as u8, (i / SIDE * 4) as u8, (i * 37 % 251) as u8];
        let textured: Vec<u8> = (0..SIDE * SIDE).flat_map(colours).collect();
        for colour in [[0, 0, 0], [90, 90, 90], [200, 30, 40], [12, 200, 90], [250, 250, 10], [13, 12, 14]] {
            let plain = colour.repeat(SIDE * SIDE);
            assert_eq!(energies(&plain, &textured), [0.0; 2], "{colour:?}");
        }
        // Seen once, it has the energy that it is scaled to, less what the window takes.
        for energy in energies(&textured, &textured) {
            assert!((0.02..0.5).contains(&energy), "{energy}");
        }
    }
}
