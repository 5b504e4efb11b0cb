//! Maps of a convolutional network: any ONNX network that takes one image, and any of its outputs.
//!
//! The search window is resampled to the network's input size, whatever its shape, so that the maps cover just what
//! the other features cover.
//!
//! | file | what it holds |
//! |---|---|
//! | `network.rs` | what a network must be, its loading and its checks |
//! | `builtin.rs` | inference by tract, which is built in |
//! | `depthwise.rs` | its convolutions of single channels, which ours replace |
//! | `onnxruntime.rs` | inference by ONNX Runtime, where its library is there |

mod builtin;
mod depthwise;
mod network;
#[cfg(feature = "onnxruntime")]
mod onnxruntime;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

pub use network::Settings;
use network::{Loaded, load};

use super::FeatureMap;
use crate::crop::{Cropper, Patch};
use crate::error::NetworkError;
use crate::frame::Frame;
use crate::geometry::Rect;

/// The intensity of the image that a network is tried out on.
const GREY: f32 = 128.0;

/// A network that all targets of a tracker use, one at a time.
pub type SharedCnn = Arc<Mutex<Cnn>>;

/// The network behind the lock; nobody else uses it while a tracker does.
pub fn locked(cnn: &SharedCnn) -> MutexGuard<'_, Cnn> {
    cnn.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Networks by what they were loaded by. Whoever loads one before it is needed spares that to him who asks for it then: clones
/// hold the same. The one that was asked for last is kept.
#[derive(Clone, Default)]
pub struct Networks(Arc<Mutex<Option<SharedCnn>>>);

impl Networks {
    /// The network of these settings, loaded unless it is there.
    pub fn get(&self, settings: Settings) -> Result<SharedCnn, NetworkError> {
        // Not held while a network is loaded, so that others get theirs meanwhile.
        let kept = self.kept().clone().filter(|kept| locked(kept).settings == settings);
        if let Some(kept) = kept {
            return Ok(kept);
        }
        let loaded: SharedCnn = Arc::new(Mutex::new(Cnn::load(settings)?));
        *self.kept() = Some(loaded.clone());
        Ok(loaded)
    }

    fn kept(&self) -> MutexGuard<'_, Option<SharedCnn>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl std::fmt::Debug for Networks {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Networks")
    }
}

/// A network with the maps it made last.
pub struct Cnn {
    settings: Settings,
    network: Loaded,
    patch: Patch,
    /// The input, `3 x side x side`.
    image: Vec<f32>,
    maps: Vec<FeatureMap>,
    /// Whether the last run failed.
    failed: bool,
    /// How often it has run since it was loaded.
    #[cfg(test)]
    pub(crate) runs: usize,
}

impl Cnn {
    /// Loads the network and tries it out on a grey image.
    pub fn load(settings: Settings) -> Result<Self, NetworkError> {
        let grey = |(mean, scale): (&f32, &f32)| vec![(GREY - mean) / scale; settings.side * settings.side];
        let image = settings.mean.iter().zip(&settings.scale).flat_map(grey).collect::<Vec<f32>>();
        let mut maps = vec![FeatureMap::default(); settings.outputs.len()];
        let network = load(&settings, &image, &mut maps)?;
        Ok(Self {
            settings,
            network,
            patch: Patch::default(),
            image,
            maps,
            failed: false,
            #[cfg(test)]
            runs: 0,
        })
    }

    /// What it was loaded by.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Computes the maps of what `window` shows. A run that fails leaves maps of zeros, to which nothing answers; the first of
    /// several in a row is logged.
    pub fn compute(&mut self, frame: &Frame, window: &Rect, cropper: &mut Cropper) {
        let mut patch = std::mem::take(&mut self.patch);
        cropper.crop(frame, window, self.settings.side, self.settings.side, &mut patch);
        self.compute_patch(&patch);
        self.patch = patch;
    }

    /// Computes the maps of a patch of the input's size likewise.
    pub fn compute_patch(&mut self, patch: &Patch) {
        self.prepare(patch);
        #[cfg(test)]
        {
            self.runs += 1;
        }
        let ran = self.network.run(&self.image, self.settings.side, &mut self.maps);
        let failed_before = std::mem::replace(&mut self.failed, ran.is_err());
        if let Err(why) = ran {
            self.maps.iter_mut().for_each(|map| map.data.fill(0.0));
            if !failed_before {
                log::error!("network {}: {why}", self.settings.name());
            }
        }
    }

    /// The map of each output, in the order of [`Settings::outputs`].
    pub fn maps(&self) -> &[FeatureMap] {
        &self.maps
    }

    /// Fills the input from the patch: `(intensity - mean) / scale`, planes in the network's order. A patch without
    /// colour is grey.
    fn prepare(&mut self, patch: &Patch) {
        let Settings { side, mean, scale, bgr, .. } = self.settings;
        let planes = patch.planes();
        for (channel, out) in self.image.chunks_exact_mut(side * side).enumerate() {
            let colour = if bgr { 2 - channel } else { channel };
            let plane = planes.get(colour).unwrap_or(&planes[0]);
            let (mean, factor) = (mean[channel], 1.0 / scale[channel]);
            out.iter_mut().zip(plane).for_each(|(o, &v)| *o = (f32::from(v) - mean) * factor);
        }
    }
}
