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
}

impl Cnn {
    /// Loads the network and tries it out on a grey image.
    pub fn load(settings: Settings) -> Result<Self, NetworkError> {
        let grey = |(mean, scale): (&f32, &f32)| vec![(GREY - mean) / scale; settings.side * settings.side];
        let image = settings.mean.iter().zip(&settings.scale).flat_map(grey).collect::<Vec<f32>>();
        let mut maps = vec![FeatureMap::default(); settings.outputs.len()];
        let network = load(&settings, &image, &mut maps)?;
        Ok(Self { settings, network, patch: Patch::default(), image, maps, failed: false })
    }

    /// What it was loaded by.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Computes the maps of what `window` shows. A run that fails leaves maps of zeros, to which nothing answers; the first of
    /// several in a row is logged.
    pub fn compute(&mut self, frame: &Frame, window: &Rect, cropper: &mut Cropper) {
        cropper.crop(frame, window, self.settings.side, self.settings.side, &mut self.patch);
        self.prepare();
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
    fn prepare(&mut self) {
        let Settings { side, mean, scale, bgr, .. } = self.settings;
        let planes = self.patch.planes();
        for (channel, out) in self.image.chunks_exact_mut(side * side).enumerate() {
            let colour = if bgr { 2 - channel } else { channel };
            let plane = planes.get(colour).unwrap_or(&planes[0]);
            let (mean, factor) = (mean[channel], 1.0 / scale[channel]);
            out.iter_mut().zip(plane).for_each(|(o, &v)| *o = (f32::from(v) - mean) * factor);
        }
    }
}
